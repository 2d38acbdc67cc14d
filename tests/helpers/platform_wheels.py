"""Where the wheels of the named platforms are, and how fast a moving platform carries them.

Rigid bodies in the plane, as complex numbers. Nothing here knows G or A.
"""

from __future__ import annotations

import cmath
import math
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from nmm.model.platforms import Mecanum, Platform, SkidSteer, Tractor
from nmm.model.platforms.car import Car, FrontDriveCar
from nmm.model.platforms.unicycle import DifferentialDrive

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Contact:
    """A wheel's centre on a body and in its axes (m), its direction (rad), its rollers and its speed.

    heading : where the wheel rolls, from the body's x axis, rad
    spin : its speed, rad/s; None when it rolls as the motion of its centre has it
    rollers : angle of the rollers, rad; None without
    """

    body: int
    center: complex
    heading: float
    radius: float
    spin: float | None = None
    rollers: float | None = None


@dataclass(frozen=True)
class Moving:
    """A body's frame in the world and its velocity: m, unit complex number, m/s, rad/s."""

    origin: complex
    direction: complex
    velocity: complex
    omega: float

    def point_velocity(self, point: complex) -> complex:
        """Of a point given in the body's axes (m); in the world, m/s."""
        return self.velocity + 1j * self.omega * self.direction * point

    def carry(self, point: complex, angle: float, rate: float) -> Moving:
        """The body that hangs on this one's `point`, at `angle` (rad) from it, turning at `rate` (rad/s)."""
        return Moving(
            self.origin + self.direction * point,
            self.direction * cmath.exp(1j * angle),
            self.point_velocity(point),
            self.omega + rate,
        )


def bodies(platform: Platform, qp: Array, qp_dot: Array) -> list[Moving]:
    """The platform's body and, for a tractor, its trailers with their frames at the hitches."""
    found = [Moving(complex(qp[0], qp[1]), cmath.exp(1j * qp[2]), complex(qp_dot[0], qp_dot[1]), qp_dot[2])]
    if isinstance(platform, Tractor):
        axle = 0.0
        for i, trailer in enumerate(platform.trailers, 3):
            found.append(found[-1].carry(axle - trailer.hitch, qp[i], qp_dot[i]))
            axle = -trailer.length
    return found


def contacts(platform: Platform, qp: Array, up: Array | None) -> list[Contact]:
    """All wheels that touch the ground, steered as at qp (n_p,) and driven as by the inputs up (p,).

    Without inputs no wheel is driven, so that it rolls as the motion of its centre has it.
    """
    pair = partial(axle, spread=0.5, radius=0.1)
    if isinstance(platform, DifferentialDrive):
        spins = (None, None) if up is None else (up[0], up[1])
        return list(axle(0, 0.0, platform.track, platform.radius, spins))
    if isinstance(platform, Mecanum):
        speeds = dict(zip(platform.wheels, platform.wheel_speeds(up), strict=True))
        found = []
        for name, spin in speeds.items():
            x = platform.length / 2 if "front" in name else -platform.length / 2
            y = platform.width / 2 if "left" in name else -platform.width / 2
            found.append(Contact(0, complex(x, y), 0.0, platform.radius, spin, platform.roller(x, y)))
        return found
    if isinstance(platform, SkidSteer):
        spins = (None, None) if up is None else (up[0], up[1])
        ends = (platform.length / 2, -platform.length / 2)
        return [wheel for x in ends for wheel in axle(0, x, platform.width, platform.radius, spins)]
    if isinstance(platform, Tractor):
        behind = [wheel for i, t in enumerate(platform.trailers, 1) for wheel in pair(i, -t.length)]
        return [*pair(0, 0.0), *behind]
    if isinstance(platform, Car | FrontDriveCar):
        front_spin = up[0] / 0.1 if isinstance(platform, FrontDriveCar) and up is not None else None
        steered = Contact(0, complex(platform.wheelbase, 0.0), qp[3], 0.1, front_spin)
        return [*pair(0, 0.0), steered, *ackermann(platform.wheelbase, qp[3], 0.1)]
    if platform.name == "unicycle":
        return list(pair(0, 0.0))
    return []


def axle(
    body: int,
    x: float,
    spread: float,
    radius: float,
    spins: tuple[float | None, float | None] = (None, None),
) -> tuple[Contact, Contact]:
    """A wheel to the left and one to the right."""
    left, right = complex(x, spread / 2), complex(x, -spread / 2)
    return Contact(body, left, 0.0, radius, spins[0]), Contact(body, right, 0.0, radius, spins[1])


def ackermann(wheelbase: float, angle: float, radius: float) -> list[Contact]:
    """The front wheels of a car whose wheel midway between them is at `angle`: all turn about one point."""
    found = []
    for y in (0.2 * wheelbase, -0.2 * wheelbase):
        # Across the line to the point on the rear axle's line about which the car turns, (0, L / tan angle).
        heading = math.atan2(wheelbase * math.sin(angle), wheelbase * math.cos(angle) - y * math.sin(angle))
        found.append(Contact(0, complex(wheelbase, y), heading, radius))
    return found


def slips(platform: Platform, qp: Array, qp_dot: Array, up: Array | None) -> Array:
    """What the ground sees slide: two components of each wheel's contact point (forward, left), m/s.

    A wheel with rollers slides only in the direction in which they grip. Without inputs no wheel is driven.
    """
    carrying = bodies(platform, qp, qp_dot)
    found: list[float] = []
    for wheel in contacts(platform, qp, up):
        body = carrying[wheel.body]
        ahead = cmath.exp(1j * wheel.heading)
        center = body.point_velocity(wheel.center) / body.direction / ahead  # in the wheel's own axes
        spin = center.real / wheel.radius if wheel.spin is None else wheel.spin
        contact = center - wheel.radius * spin
        if wheel.rollers is None:
            found += [contact.real, contact.imag]
        else:
            found.append((contact * cmath.exp(-1j * wheel.rollers)).real)
    return np.array(found)
