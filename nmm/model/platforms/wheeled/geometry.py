"""A wheeled platform's bodies, velocities of their points, and the rows of M(qp) qp_dot = [0; up].

Each row gives its value in world axes (`at`) and how the kernel computes it (`packed`). Points of the plane
are complex numbers. The kernel has formulas of its own: the tests compare the two."""

from __future__ import annotations

import cmath
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from nmm.base.arrays import Array
from nmm.base.errors import InputError, expect_known
from nmm.model.platforms.wheeled.descriptions import (
    MAIN,
    CasterWheel,
    Hitch,
    OmniWheel,
    SteeredWheel,
    WheelDescription,
)
from nmm.model.platforms.wheeled.kernel import CLOSURES, COMMON, RATES, TERMS


@dataclass(frozen=True)
class PlatformBody:
    """What coordinate 2 + number turns: the main body, or what hangs on a hitch or a steering pivot. `place`
    is the joint in the carrier's frame, m; the main body carries itself."""

    name: str
    carrier: int
    place: complex
    lower: float = -np.inf
    upper: float = np.inf
    steers: bool = False


@dataclass(frozen=True)
class Term:
    """Weight times the velocity of a body's point along a direction; both in the body's frame."""

    body: int
    point: complex
    direction: float
    weight: float = 1.0


class Bodies:
    """All bodies, the main one first, each before those it carries (Pinocchio's order of joints)."""

    def __init__(self, wheels: Sequence[WheelDescription], hitches: Sequence[Hitch]) -> None:
        names = [MAIN, *(hitch.joint for hitch in hitches)]
        for hitch in hitches:
            expect_known("carrier", hitch.carrier, names, f"hitch {hitch.joint}")
        for wheel in wheels:
            expect_known("body", wheel.body, names, f"wheel {wheel.name}")
        self.all: list[PlatformBody] = [PlatformBody(MAIN, 0, 0j)]

        def add_carried_by(carrier: int) -> None:
            name = self.all[carrier].name
            for wheel in wheels:
                if isinstance(wheel, SteeredWheel) and wheel.body == name:
                    at = complex(wheel.x, wheel.y)
                    pivot = PlatformBody(wheel.joint, carrier, at, wheel.lower, wheel.upper, steers=True)
                    if pivot not in self.all:
                        self._add(pivot)
            for hitch in hitches:
                if hitch.carrier == name:
                    self._add(
                        PlatformBody(
                            hitch.joint, carrier, complex(hitch.x, hitch.y), hitch.lower, hitch.upper
                        )
                    )
                    add_carried_by(len(self.all) - 1)

        add_carried_by(0)
        left = [hitch.joint for hitch in hitches if hitch.joint not in self.names]
        if left:
            what = "they carry each other, and the main body none of them"
            raise InputError(what, where=f"hitches {', '.join(left)}")

    def _add(self, body: PlatformBody) -> None:
        if body.name in (*self.names, "x", "y"):
            what = "pivots with another place or other limits" if body.steers else "joints or coordinates"
            raise InputError(f"the name is given twice, to {what}", where=f"joint {body.name}")
        self.all.append(body)

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(body.name for body in self.all)

    @property
    def steering(self) -> list[int]:
        return [2 + b for b, body in enumerate(self.all) if body.steers]

    def number(self, name: str) -> int:
        return self.names.index(name)

    def contact(self, wheel: WheelDescription, direction: float = 0.0, weight: float = 1.0) -> Term:
        """The velocity of the wheel's centre (a caster's pivot) along its heading, turned by `direction`."""
        if isinstance(wheel, SteeredWheel):
            place = cmath.rect(1.0, wheel.heading) * complex(-wheel.trail, wheel.offset)
            return Term(self.number(wheel.joint), place, wheel.heading + direction, weight)
        body = self.number(wheel.body)
        return Term(body, complex(wheel.x, wheel.y), wheel.heading + direction, weight)

    def frames(self, qp: Array) -> list[tuple[complex, float]]:
        """Origin (m) and angle (rad) of every body in the world."""
        poses = [(complex(qp[0], qp[1]), float(qp[2]))]
        for body, turn in zip(self.all[1:], qp[3:], strict=True):
            origin, angle = poses[body.carrier]
            poses.append((origin + cmath.rect(1.0, angle) * body.place, angle + float(turn)))
        return poses

    def row(self, terms: Iterable[Term], qp: Array) -> Array:
        """The row over qp_dot, (n_p,), of a sum of terms."""
        frames = self.frames(qp)
        row = np.zeros(2 + len(self.all))
        for term in terms:
            origin, angle = frames[term.body]
            point = origin + cmath.rect(1.0, angle) * term.point
            direction = cmath.rect(term.weight, angle + term.direction)
            row[0] += direction.real
            row[1] += direction.imag
            for body in self.chain(term.body):
                lever = 1j * (point - frames[body][0])
                row[2 + body] += (direction.conjugate() * lever).real
        return row

    def chain(self, body: int) -> list[int]:
        chain = [body]
        while chain[-1] != 0:
            chain.append(self.all[chain[-1]].carrier)
        return chain


def rolling_term(bodies: Bodies, wheel: WheelDescription) -> Term:
    """The wheel's spin rate, rad/s: r spin = v · heading; with rollers at γ, r spin cos γ = v · grip."""
    if isinstance(wheel, CasterWheel):
        what = "a caster's swivel is no coordinate, so neither its speed nor its spin can be an input"
        raise InputError(what, where=f"wheel {wheel.name}")
    roller = wheel.roller if isinstance(wheel, OmniWheel) else 0.0
    return bodies.contact(wheel, roller, 1.0 / (wheel.radius * float(np.cos(roller))))


#: The section of the kernel's parameters, and lines for it.
Packed = tuple[int, list[list[float]]]


class Axis(NamedTuple):
    """Axis of a wheel without trail on its carrier: pivot (m), its coordinate (-1 without), heading (rad)."""

    coordinate: int
    x: float
    y: float
    heading: float

    def line(self, qp: Array, derivative: int = 0, center: complex = 0j) -> Array:
        """Sideways speed of the wheel as a row over (v_x, v_y, omega) of its carrier at `center`, or its
        first derivative in the pivot's angle."""
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
    """See `inputs.CommonSpeed`: the twist's component along the motion that both wheels allow. With the twist
    at the pivots' middle and omega times half their distance, its norm is the rms of their speeds."""

    axes: tuple[Axis, Axis]

    @property
    def center(self) -> complex:
        return 0.5 * sum(complex(axis.x, axis.y) for axis in self.axes)

    @property
    def length(self) -> float:
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
