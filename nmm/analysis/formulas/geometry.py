"""Names for a robot's lengths and fixed angles: the xacro arguments' where they are known, else `x_q2`."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from fractions import Fraction

import numpy as np

from nmm.analysis.formulas.expansion import Expansion, Ring, exact
from nmm.analysis.formulas.turning import Turning
from nmm.arrays import Array
from nmm.errors import InputError

#: Lengths (m) below it are what rounding leaves of zero.
_NO_LENGTH = 1e-12
#: The same for entries of rotation matrices and angles, rad, which files write with fewer digits.
_NOTHING = 1e-9
#: How far from a multiple of π/2 an angle may be and still be one (files write 1.5708), rad.
_SQUARE = 1e-5


class Geometry:
    """The lengths and fixed angles met on the way, each a symbol (or an exact number), and their values.

    Parameters
    ----------
    ring : where the symbols live
    arguments : names for lengths by their label, as `x_q2`; a label without one is its own name
    demanded : whether a name that cannot be had (a coordinate's, or that of another length) is an error
    as_numbers : keep lengths as decimal fractions instead
    taken : names that no length may have: the coordinates'

    Raises
    ------
    InputError : (of its methods) a name that cannot be had
    """

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
        self.notes: list[str] = []
        self._arguments = arguments
        self._demanded = demanded
        self._as_numbers = as_numbers
        self._taken = frozenset(taken)
        self._names: dict[str, str] = {}

    def length(self, value: float, label: str) -> Expansion:
        """A length (m) as a symbol; its sign is kept outside where it is an argument's."""
        if abs(value) < _NO_LENGTH:
            return self.ring.number(0)
        if self._as_numbers:
            return self.ring.number(exact(value))
        given = self._arguments.get(label, label)
        sign = -1 if given.startswith("-") else 1
        if label not in self._names:
            self._names[label] = self._name(given.removeprefix("-"), sign * value, label)
        self._valued(self._names[label], sign * value, False)
        return self.ring.scalar(self._names[label]).scaled(Fraction(sign))

    def fixed_angle(self, value: float) -> int:
        """The variable for an angle (rad) that has no name in the robot's file: angle1, angle2, ..."""
        label = f"angle of {value:.9f} rad"
        if label not in self._names:
            count = sum(label.startswith("angle of") for label in self._names)
            self._names[label] = self._name(f"angle{count + 1}", value, label)
        return self._valued(self._names[label], value, True)

    def _valued(self, name: str, value: float, angle: bool) -> int:
        """The variable of a name, with its value."""
        self.values[name] = value
        index = self.ring.variable(name, angle)
        self.ring.sample[index] = value
        return index

    def _name(self, name: str, value: float, label: str) -> str:
        """A name that stands for this value alone."""
        used = name in self.ring.names and name not in self.values  # by what is no length
        same = abs(self.values.get(name, value) - value) < _NOTHING
        if label in self._arguments:
            if same and not used and name not in self._taken:
                return name
            if self._demanded:
                of = (
                    "the coordinate"
                    if name in self._taken
                    else "another quantity"
                    if used
                    else (f"another length of {self.values[name]:g} m")
                )
                raise InputError(f"arguments: {name!r} for {label} = {value:g}: it is the name of {of}")
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
        roll, pitch, yaw = _roll_pitch_yaw(matrix)
        return [
            self.turn(yaw, 2, f"yaw_{label}"),
            self.turn(pitch, 1, f"pitch_{label}"),
            self.turn(roll, 0, f"roll_{label}"),
        ]

    def towards(self, axis: Array, label: str) -> list[Turning]:
        """Rz(a) Ry(b), which turns z into a unit axis."""
        yaw = math.atan2(axis[1], axis[0]) if math.hypot(axis[0], axis[1]) > _NOTHING else 0.0
        pitch = math.atan2(math.hypot(axis[0], axis[1]), axis[2])
        return [self.turn(yaw, 2, f"axis_yaw_{label}"), self.turn(pitch, 1, f"axis_pitch_{label}")]

    def turn(self, value: float, axis: int, label: str) -> Turning:
        """A turn by a fixed angle (rad) about x, y or z: quarter turns exact, other angles symbols."""
        quarters = round(value / (math.pi / 2))
        excess = value - quarters * math.pi / 2
        if abs(excess) < _SQUARE:
            if abs(excess) > _NOTHING:
                self.notes.append(
                    f"{label} = {value:.10g} rad taken as {quarters} pi/2 ({excess:.1e} rad away)"
                )
            return Turning(axis, (), quarters % 4)
        if label not in self._names:
            self._names[label] = self._name(label, value, label)
        return Turning(axis, ((self._valued(self._names[label], value, True), 1),))


def _roll_pitch_yaw(R: Array) -> tuple[float, float, float]:
    """Angles with R = Rz(yaw) Ry(pitch) Rx(roll); roll is 0 where only yaw -+ roll counts."""
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
