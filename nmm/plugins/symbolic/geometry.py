"""Names for a robot's lengths and fixed angles: the xacro arguments' where they are known, else `x_q2`."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from fractions import Fraction
from typing import NamedTuple

import numpy as np

from nmm.base.arrays import Array
from nmm.base.errors import InputError
from nmm.base.findings import Finding
from nmm.plugins.symbolic.expansion import Expansion, Ring, exact

Vector = list[Expansion]


class Turning(NamedTuple):
    """A turn about x, y or z (0, 1, 2) by k·angles, ((variable, k), ...), plus 0 to 3 quarter turns."""

    axis: int
    angle: tuple[tuple[int, int], ...] = ()
    quarters: int = 0

    def inverse(self) -> Turning:
        return Turning(self.axis, tuple((i, -k) for i, k in self.angle), -self.quarters % 4)

    def of(self, vector: Vector, ring: Ring) -> Vector:
        cosine, sine = ring.waves(dict(self.angle), self.quarters)
        i, j = (self.axis + 1) % 3, (self.axis + 2) % 3
        turned = list(vector)
        turned[i] = cosine * vector[i] - sine * vector[j]
        turned[j] = sine * vector[i] + cosine * vector[j]
        return turned


def turned(turns: Sequence[Turning], vector: Vector, ring: Ring) -> Vector:
    """A vector after several turns, the last one first: as by the product of their matrices."""
    for turn in reversed(turns):
        vector = turn.of(vector, ring)
    return vector


def back(turns: Sequence[Turning]) -> list[Turning]:
    return [turn.inverse() for turn in reversed(turns)]


def merged(turns: Sequence[Turning]) -> tuple[Turning, ...]:
    """Join neighbouring turns about one axis; drop those without effect."""
    joined: list[Turning] = []
    for turn in turns:
        if joined and joined[-1].axis == turn.axis:
            before = joined.pop()
            angle = dict(before.angle)
            for i, k in turn.angle:
                angle[i] = angle.get(i, 0) + k
            nonzero = tuple((i, k) for i, k in angle.items() if k)
            turn = Turning(turn.axis, nonzero, (before.quarters + turn.quarters) % 4)
        if turn.angle or turn.quarters:
            joined.append(turn)
    return tuple(joined)


def unit_vectors(ring: Ring) -> list[Vector]:
    return [[ring.number(int(i == j)) for j in range(3)] for i in range(3)]


def dot(a: Vector, b: Vector) -> Expansion:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a: Vector, b: Vector) -> Vector:
    return [a[(i + 1) % 3] * b[(i + 2) % 3] - a[(i + 2) % 3] * b[(i + 1) % 3] for i in range(3)]


#: Smaller lengths (m) are rounding and count as zero.
_NO_LENGTH = 1e-12
#: The same for entries of rotation matrices and angles, rad, which files write with fewer digits.
_NOTHING = 1e-9
#: How far from a multiple of π/2 an angle may be and still be one (files write 1.5708), rad.
_SQUARE = 1e-5


class Geometry:
    """The robot's lengths and fixed angles, each a symbol (or an exact number), and their values. A length
    has the name that `arguments` give its label, as `x_q2`, or the label itself; if names are `demanded`, one
    that is `taken` by a coordinate, or by another length, is an error."""

    def __init__(
        self,
        ring: Ring,
        arguments: Mapping[str, str],
        demanded: bool = False,
        as_numbers: bool = False,
        taken: Sequence[str] = (),
    ) -> None:
        self.ring = ring
        self.values: dict[str, float] = {}
        self.notes: list[Finding] = []
        self._arguments = arguments
        self._demanded = demanded
        self._as_numbers = as_numbers
        self._taken = frozenset(taken)
        self._names: dict[str, str] = {}

    def length(self, value: float, label: str) -> Expansion:
        """A length (m) as a symbol; the sign of an argument's name stays outside."""
        if abs(value) < _NO_LENGTH:
            return self.ring.number(0)
        if self._as_numbers:
            return self.ring.number(exact(value))
        argument = self._arguments.get(label, label)
        sign = -1 if argument.startswith("-") else 1
        index = self._variable(label, argument.removeprefix("-"), sign * value, False)
        return self.ring.scalar(self.ring.names[index]).scaled(Fraction(sign))

    def fixed_angle(self, value: float) -> int:
        """The variable for an angle (rad) without a name in the robot's file: angle1, angle2, ..."""
        count = sum(label.startswith("angle of") for label in self._names)
        return self._variable(f"angle of {value:.9f} rad", f"angle{count + 1}", value, True)

    def _variable(self, label: str, name: str, value: float, angle: bool) -> int:
        """The variable with this label, under the given name if it is free."""
        if label not in self._names:
            self._names[label] = self._name(name, value, label)
        index = self.ring.variable(self._names[label], angle)
        self.values[self._names[label]] = self.ring.sample[index] = value
        return index

    def _name(self, name: str, value: float, label: str) -> str:
        """A name that stands for this value alone."""
        used = name in self.ring.names and name not in self.values  # by what is no length
        same = abs(self.values.get(name, value) - value) < _NOTHING
        if label in self._arguments:
            if same and not used and name not in self._taken:
                return name
            if self._demanded:
                of = "the coordinate" if name in self._taken else "another quantity"
                if name not in self._taken and not used:
                    of = f"another length of {self.values[name]:g} m"
                what = f"{name!r} for {label} = {value:g}: it is the name of {of}"
                raise InputError(what, where="arguments")
            name = label
        while name in self._taken or name in self.ring.names:
            name += "_"
        return name

    def vector(self, values: Array, label: str) -> list[Expansion]:
        """A translation, labelled `x_label`, `y_label`, `z_label`."""
        return [
            self.length(float(value), f"{axis}_{label}") for axis, value in zip("xyz", values, strict=True)
        ]

    def rotation(self, matrix: Array, label: str) -> list[Turning]:
        """A fixed rotation as Rz(yaw) Ry(pitch) Rx(roll)."""
        angles = zip(("roll", "pitch", "yaw"), _roll_pitch_yaw(matrix), strict=True)
        return [self.turn(value, i, f"{name}_{label}") for i, (name, value) in reversed([*enumerate(angles)])]

    def towards(self, axis: Array, label: str) -> list[Turning]:
        """Rz(a) Ry(b), which turns z into a unit axis."""
        yaw = math.atan2(axis[1], axis[0]) if math.hypot(axis[0], axis[1]) > _NOTHING else 0.0
        pitch = math.atan2(math.hypot(axis[0], axis[1]), axis[2])
        return [self.turn(yaw, 2, f"axis_yaw_{label}"), self.turn(pitch, 1, f"axis_pitch_{label}")]

    def turn(self, value: float, axis: int, label: str) -> Turning:
        """A turn by a fixed angle (rad) about x, y or z: quarter turns are exact, other angles symbols."""
        quarters = round(value / (math.pi / 2))
        excess = value - quarters * math.pi / 2
        if abs(excess) < _SQUARE:
            if abs(excess) > _NOTHING:
                self.notes.append(
                    Finding("angle_rounded", {"name": label, "value": value, "quarters": quarters})
                )
            return Turning(axis, (), quarters % 4)
        return Turning(axis, ((self._variable(label, label, value, True), 1),))


def _roll_pitch_yaw(R: Array) -> tuple[float, float, float]:
    """Angles with R = Rz(yaw) Ry(pitch) Rx(roll); roll is 0 where only yaw -+ roll is determined."""
    flat = math.hypot(R[0, 0], R[1, 0])
    pitch = math.atan2(-R[2, 0], flat)
    if flat < _NOTHING:
        return 0.0, pitch, math.atan2(-R[0, 1], R[1, 1])
    return math.atan2(R[2, 1], R[2, 2]), pitch, math.atan2(R[1, 0], R[0, 0])


def signed_axis(axis: Array) -> tuple[int, int] | None:
    """Index and sign of an axis that is one of ±x, ±y, ±z; None for others."""
    largest = int(np.argmax(np.abs(axis)))
    rest = np.delete(axis, largest)
    return (largest, 1 if axis[largest] > 0 else -1) if np.all(np.abs(rest) < _NOTHING) else None
