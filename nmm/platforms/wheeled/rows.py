"""Rows of M(qp) qp_dot = [0; up]: what wheels forbid, what keeps their axes concurrent, what inputs mean.

Each row gives its value in world axes (`at`) and says how the kernel is to compute it (`packed`).
"""

from __future__ import annotations

import cmath
import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from nmm.arrays import Array
from nmm.platforms.wheeled.descriptions import SteeredWheel, WheelDescription
from nmm.platforms.wheeled.geometry import Bodies, Term
from nmm.platforms.wheeled.kernel import CLOSURES, COMMON, RATES, TERMS

#: The section of the kernel's parameters, and lines for it.
Packed = tuple[int, list[list[float]]]


class Axis(NamedTuple):
    """Axis of a wheel without trail on its carrier: pivot (m), its coordinate (-1 without), heading (rad)."""

    coordinate: int
    x: float
    y: float
    heading: float

    def line(self, qp: Array, derivative: int = 0, center: complex = 0j) -> Array:
        """Sideways speed of the wheel as a row over the carrier's twist (v_x, v_y, omega) at `center`.

        derivative : 0, or 1 for the row's derivative in the pivot's angle
        """
        angle = self.heading + (float(qp[self.coordinate]) if self.coordinate >= 0 else 0.0)
        normal = cmath.rect(1.0, angle + math.pi / 2)
        pivot = complex(self.x, self.y) - center
        if derivative == 1:
            normal *= 1j
        return np.array([normal.real, normal.imag, (pivot.conjugate() * normal).imag])


def axis_of(bodies: Bodies, wheel: WheelDescription) -> Axis:
    """The axis of a fixed wheel, or of a steered one without trail."""
    if isinstance(wheel, SteeredWheel):
        return Axis(2 + bodies.number(wheel.joint), wheel.x, wheel.y, wheel.heading)
    return Axis(-1, wheel.x, wheel.y, wheel.heading)


@dataclass(frozen=True)
class Velocity:
    """A sum of velocities of points: a wheel's sideways speed, a spin, a forward speed."""

    terms: tuple[Term, ...]

    def at(self, bodies: Bodies, qp: Array) -> Array:
        return bodies.row(self.terms, qp)

    def packed(self, row: int) -> Packed:
        return TERMS, [
            [row, term.body, term.point.real, term.point.imag, term.direction, term.weight]
            for term in self.terms
        ]


@dataclass(frozen=True)
class Rate:
    """The rate of one coordinate: of theta, a steering angle or a hitch."""

    coordinate: int

    def at(self, bodies: Bodies, qp: Array) -> Array:
        return np.eye(qp.size)[self.coordinate]

    def packed(self, row: int) -> Packed:
        return RATES, [[row, self.coordinate]]


@dataclass(frozen=True)
class Closure:
    """d/dt det(c₁, c₂, c₃) = 0: three wheels of one carrier steer so that their axes stay concurrent."""

    axes: tuple[Axis, Axis, Axis]
    length: float

    def at(self, bodies: Bodies, qp: Array) -> Array:
        row = np.zeros(qp.size)
        for turned, axis in enumerate(self.axes):
            if axis.coordinate >= 0:
                lines = [other.line(qp, int(k == turned)) for k, other in enumerate(self.axes)]
                row[axis.coordinate] += np.linalg.det(np.array(lines)) / self.length
        return row

    def share(self, qp: Array) -> float:
        """Sideways speed of the third wheel as a share of the platform's, where the other two roll."""
        lines = [axis.line(qp) / (1.0, 1.0, self.length) for axis in self.axes]
        motion = np.cross(lines[0], lines[1])
        size = float(np.linalg.norm(motion))
        return abs(float(motion @ lines[2])) / size if size > 0.0 else 0.0

    def packed(self, row: int) -> Packed:
        return CLOSURES, [[row, *self.axes[0], *self.axes[1], *self.axes[2]]]


@dataclass(frozen=True)
class Common:
    """See `inputs.CommonSpeed`: the twist's component along the motion that both wheels allow.

    With the twist taken at the middle of the two pivots and the angular speed times half their distance, its
    norm is the root mean square of the pivots' speeds.
    """

    axes: tuple[Axis, Axis]

    @property
    def center(self) -> complex:
        return 0.5 * sum(complex(axis.x, axis.y) for axis in self.axes)

    @property
    def length(self) -> float:
        """Half the distance of the pivots, m."""
        first, second = self.axes
        return 0.5 * math.hypot(first.x - second.x, first.y - second.y)

    def motion(self, qp: Array) -> Array:
        """The twist (v_x, v_y, length omega) at the middle, of any size, that both wheels allow."""
        scale = (1.0, 1.0, self.length)
        first, second = (axis.line(qp, 0, self.center) / scale for axis in self.axes)
        return np.cross(first, second)

    @property
    def sign(self) -> float:
        """What makes the motion with both steering angles at zero a forward one."""
        coordinates = max(axis.coordinate for axis in self.axes)
        forward = self.motion(np.zeros(coordinates + 3))[:2]
        heading = self.axes[0].heading
        return -1.0 if forward @ (math.cos(heading), math.sin(heading)) < 0.0 else 1.0

    def at(self, bodies: Bodies, qp: Array) -> Array:
        motion = self.motion(qp)
        norm = self.sign * float(np.linalg.norm(motion))
        vx, vy, turn = motion / norm if norm != 0.0 else motion
        row = np.zeros(qp.size)
        cosine, sine = math.cos(qp[2]), math.sin(qp[2])
        row[:2] = cosine * vx - sine * vy, sine * vx + cosine * vy
        row[2] = self.length * turn - self.center.imag * vx + self.center.real * vy
        return row

    def packed(self, row: int) -> Packed:
        center = self.center
        head = [row, self.sign, self.length, center.real, center.imag]
        return COMMON, [[*head, *self.axes[0], *self.axes[1]]]


Row = Velocity | Rate | Closure | Common
