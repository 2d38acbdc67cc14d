"""Platforms described by their wheels, paths through their configurations, a model of their rims."""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable

import numpy as np
from numpy import pi
from numpy.typing import NDArray

from nmm.model.platforms.wheeled.descriptions import (
    CasterWheel,
    FixedWheel,
    Hitch,
    OmniWheel,
    SteeredWheel,
    WheelDescription,
)
from nmm.model.platforms.wheeled.inputs import CommonSpeed, WeightedSpins, WheelSpeed, WheelSpin
from nmm.model.platforms.wheeled.platform import WheeledPlatform

Array = NDArray[np.float64]
Path = Callable[[float], Array]

AXLE = [FixedWheel("rear_left", 0, 0.3, 0.1), FixedWheel("rear_right", 0, -0.3, 0.1)]
FRONT = SteeredWheel("front", 0.8, 0, 0.12)
CASTER = CasterWheel("caster", -0.4, 0.05, 0.04, 0.3, trail=0.03)
TRAILER_CASTER = CasterWheel("c", 0.1, 0.2, 0.03, body="h2", trail=0.04)
RAKED = SteeredWheel("front", 0.8, 0.1, 0.12, 0.2, trail=0.06, offset=0.02)
CORNERS = {
    "front_left": (0.4, 0.3),
    "front_right": (0.4, -0.3),
    "rear_left": (-0.4, 0.3),
    "rear_right": (-0.4, -0.3),
}


def mecanum(radius: float, length: float, width: float) -> WheeledPlatform:
    wheels = []
    for name, (x, y) in CORNERS.items():
        x, y = math.copysign(length / 2, x), math.copysign(width / 2, y)
        wheels.append(OmniWheel(name, x, y, radius, roller=-pi / 4 if x * y > 0 else pi / 4))
    parts = {"drive": (1, 1, 1, 1), "strafe": (-1, 1, 1, -1), "turn": (-1, 1, -1, 1)}
    inputs = [
        WeightedSpins({name: sign / 4 for name, sign in zip(CORNERS, signs, strict=True)}, part)
        for part, signs in parts.items()
    ]
    return WheeledPlatform(wheels, inputs=inputs)


def trailer(name: str, joint: str, length: float, width: float = 0.25) -> list[WheelDescription]:
    return [
        FixedWheel(f"{name}_left", -length, width, 0.08, body=joint),
        FixedWheel(f"{name}_right", -length, -width, 0.08, body=joint),
    ]


def corners(**more: float) -> list[WheelDescription]:
    return [SteeredWheel(name, *at, 0.1, joint=f"steer_{name}", **more) for name, at in CORNERS.items()]


TRIANGLE = [
    OmniWheel(f"o{k}", *0.3 * np.array([math.cos(a), math.sin(a)]), 0.05, a + pi / 2)
    for k, a in enumerate((0.1, 0.1 + 2 * pi / 3, 0.1 - 2 * pi / 3))
]
TWO_STEERED = [
    SteeredWheel("a", 0.5, 0.1, 0.1, joint="steer_a"),
    SteeredWheel("b", -0.4, -0.2, 0.1, pi, joint="steer_b"),
]

EXAMPLES: dict[str, WheeledPlatform] = {
    "axle": WheeledPlatform([*AXLE, CASTER]),
    "oblique axle": WheeledPlatform([FixedWheel("wheel", -0.2, 0.3, 0.1, 0.7)]),
    "wheel speeds": WheeledPlatform(AXLE, inputs=[WheelSpin("rear_left"), WheelSpin("rear_right")]),
    "car": WheeledPlatform([*AXLE, FRONT]),
    "front drive": WheeledPlatform([*AXLE, FRONT], inputs=[WheelSpeed("front", "v")]),
    "twin front wheels": WheeledPlatform(
        [*AXLE, *(SteeredWheel(f"f{s}", 0.8, 0, 0.1, joint="steering", offset=s * 0.05) for s in (1, -1))]
    ),
    "raked front wheel": WheeledPlatform([*AXLE, RAKED]),
    "steered raked front wheel": WheeledPlatform([*AXLE, RAKED], inputs=["v"]),
    "trailers": WheeledPlatform(
        [*AXLE, *trailer("t1", "h1", 0.6), *trailer("t2", "h2", 0.5), TRAILER_CASTER],
        [Hitch("h1", 0.0), Hitch("h2", -0.8, 0.1, "h1")],
    ),
    "car with a steered trailer": WheeledPlatform(
        [*AXLE, FRONT, SteeredWheel("t", -0.7, 0.1, 0.1, joint="t_steering", body="h")], [Hitch("h", -0.3)]
    ),
    "two trailers side by side": WheeledPlatform(
        [*AXLE, *trailer("t1", "h1", 0.6), *trailer("t2", "h2", 0.5)],
        [Hitch("h1", -0.2, 0.4), Hitch("h2", -0.2, -0.4)],
    ),
    "hitch with nothing": WheeledPlatform(AXLE, [Hitch("h", 0.2)]),
    "omni": WheeledPlatform(TRIANGLE),
    "omni by wheel speeds": WheeledPlatform(TRIANGLE, inputs=[WheelSpin(f"o{k}") for k in range(3)]),
    "mecanum": mecanum(0.05, 0.5, 0.4),
    "one steered": WheeledPlatform([SteeredWheel("wheel", 0.3, 0.1, 0.1, 0.2), CASTER]),
    "two steered": WheeledPlatform([*TWO_STEERED, CASTER]),
    "two steered, one drives": WheeledPlatform(
        TWO_STEERED, inputs=["steer_a_rate", WheelSpin("b"), "steer_b_rate"]
    ),
    "four steered": WheeledPlatform(corners()),
    "two front wheels": WheeledPlatform([*AXLE, *corners()[:2]]),
    "driven casters": WheeledPlatform(corners(trail=0.04, offset=0.01)[:3]),
    "driven casters that steer": WheeledPlatform(
        corners(trail=0.2)[:3],
        inputs=[WheelSpeed("front_left"), "steer_front_left_rate", "steer_rear_left_rate"],
    ),
    "axles and a driven caster": WheeledPlatform(
        [*AXLE, *trailer("t", "h", 0.6), SteeredWheel("s", -0.9, 0, 0.1, joint="s", body="h", trail=-0.1)],
        [Hitch("h", -0.2)],
    ),
    "straight on": WheeledPlatform([*AXLE, FixedWheel("front_left", 0.5, 0.3, 0.1)]),
    "about a point": WheeledPlatform([*AXLE, FixedWheel("front_left", 0.5, 0.3, 0.1, 0.6)]),
    "stuck": WheeledPlatform([*AXLE, FixedWheel("a", 0.5, 0.3, 0.1), FixedWheel("b", 0.5, 0.2, 0.1, 1.0)]),
    "common speed by name": WheeledPlatform(TWO_STEERED, inputs=[CommonSpeed("b", "a", "speed")]),
}  # fmt: skip

#: Centres of rotation, in the main body's frame, that leave these platforms' wheels concurrent.
_CENTERS: dict[str, Callable[[Array], complex]] = {
    "four steered": lambda r: complex(0.5 * r[0], 1.5 + 0.5 * r[1]),
    "two front wheels": lambda r: complex(0.0, 1.5 + 0.5 * r[1]),
}


def random_path(name: str, rng: np.random.Generator, size: float = 1.0) -> Path:
    """s -> qp, smooth, with the wheels' axes concurrent all along; angles up to `size` rad at s = 0."""
    platform = EXAMPLES[name]
    start, direction = size * rng.uniform(-1, 1, platform.n_p), rng.uniform(-1, 1, platform.n_p)
    numbers, change = rng.uniform(-1, 1, 2), rng.uniform(-1, 1, 2)
    center = _CENTERS.get(name)

    def path(s: float) -> Array:
        qp = start + s * direction
        if center is not None:
            about = center(numbers + s * change)
            for wheel in platform.wheels:
                if isinstance(wheel, SteeredWheel):
                    angle = cmath.phase(1j * (complex(wheel.x, wheel.y) - about)) + pi
                    qp[platform.coordinates.index(wheel.joint)] = math.remainder(angle - wheel.heading, pi)
        return qp

    return path


def _turn(angle: complex, axis: int) -> NDArray[np.complex128]:
    """Homogeneous rotation about z (2) or y (1)."""
    T = np.eye(4, dtype=complex)
    i, j = ((0, 1), (2, 0))[2 - axis]
    T[i, i] = T[j, j] = np.cos(angle)
    T[i, j], T[j, i] = -np.sin(angle), np.sin(angle)
    return T


def _shift(x: complex, y: complex, z: complex = 0.0) -> NDArray[np.complex128]:
    T = np.eye(4, dtype=complex)
    T[:3, 3] = x, y, z
    return T


def _body(platform: WheeledPlatform, name: str, qp: NDArray[np.complex128]) -> NDArray[np.complex128]:
    if name == "theta":
        return _shift(qp[0], qp[1]) @ _turn(qp[2], 2)
    hitch = next(hitch for hitch in platform.hitches if hitch.joint == name)
    angle = qp[platform.coordinates.index(name)]
    return _body(platform, hitch.carrier, qp) @ _shift(hitch.x, hitch.y) @ _turn(angle, 2)


def rim(
    platform: WheeledPlatform,
    wheel: WheelDescription,
    qp: NDArray[np.complex128],
    swivel: complex,
    spin: complex,
) -> NDArray[np.complex128]:
    """Placement of the wheel: x along its heading, y along its axis when it has not turned."""
    carrier = _body(platform, wheel.body, qp) @ _shift(wheel.x, wheel.y)
    if isinstance(wheel, SteeredWheel):
        swivel = qp[platform.coordinates.index(wheel.joint)]
    trail, offset = getattr(wheel, "trail", 0.0), getattr(wheel, "offset", 0.0)
    return carrier @ _turn(swivel + wheel.heading, 2) @ _shift(-trail, offset, wheel.radius) @ _turn(spin, 1)


def touching_velocity(
    platform: WheeledPlatform,
    wheel: WheelDescription,
    qp: Array,
    qp_dot: Array,
    swivel: tuple[float, float],
    spin: float,
) -> Array:
    """Velocity (3,), in the wheel's axes (heading, left, up), of its rim's point that touches the ground.

    By a complex step through the placement: exact. swivel = (angle, rate) of a caster.
    """
    here = rim(platform, wheel, qp.astype(complex), swivel[0], 0.0).real
    bottom = np.linalg.inv(here) @ (here[:, 3] - [0, 0, wheel.radius, 0])
    h = 1e-30
    moved = rim(platform, wheel, qp + 1j * h * qp_dot, swivel[0] + 1j * h * swivel[1], 1j * h * spin)
    velocity: Array = here[:3, :3].T @ (moved @ bottom).imag[:3] / h
    return velocity
