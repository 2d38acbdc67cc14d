"""Names for a robot's lengths and fixed angles: the xacro arguments' where they are known, else `x_q2`."""

from __future__ import annotations

import math
from collections.abc import Mapping
from fractions import Fraction

import numpy as np

from nmm.analysis.symbolic_expansion import Expansion, Ring
from nmm.arrays import Array

#: Numbers (m, rad) below it are what files and rotation matrices leave of zero.
_NOTHING = 1e-9
#: How far from a multiple of π/2 an angle may be and still be one (files write 1.5708), rad.
_SQUARE = 1e-5


class Geometry:
    """The lengths and fixed angles met on the way, each a symbol (or an exact number), and their values.

    Parameters
    ----------
    ring : where the symbols live
    arguments : names for lengths by their label, as `x_q2`; a label without one is its own name
    as_numbers : keep lengths as decimal fractions instead
    """

    def __init__(self, ring: Ring, arguments: Mapping[str, str], as_numbers: bool) -> None:
        self.ring = ring
        self.values: dict[str, float] = {}
        self.notes: list[str] = []
        self._arguments = arguments
        self._as_numbers = as_numbers

    def length(self, value: float, label: str) -> Expansion:
        """A length (m) as a symbol; its sign is kept outside where it is an argument's."""
        if abs(value) < _NOTHING:
            return self.ring.number(0)
        if self._as_numbers:
            return self.ring.number(exact(value))
        name = self._arguments.get(label, label)
        sign = -1 if name.startswith("-") else 1
        name = name.removeprefix("-")
        self.values[name] = sign * value
        return self.ring.scalar(name).scaled(Fraction(sign))

    def vector(self, values: Array, label: str) -> list[Expansion]:
        """A translation, labelled `x_label`, `y_label`, `z_label`."""
        return [
            self.length(float(value), f"{axis}_{label}") for axis, value in zip("xyz", values, strict=True)
        ]

    def rotation(self, matrix: Array, label: str) -> list[list[Expansion]]:
        """A fixed rotation as Rz(yaw) Ry(pitch) Rx(roll): quarter turns exact, other angles symbols."""
        angles = _roll_pitch_yaw(matrix)
        result = identity(self.ring)
        for axis, name in ((2, "yaw"), (1, "pitch"), (0, "roll")):
            result = times(result, self.turn(angles[axis], axis, f"{name}_{label}"))
        return result

    def turn(self, value: float, axis: int, label: str) -> list[list[Expansion]]:
        """A turn by a fixed angle (rad) about x, y or z."""
        quarters = round(value / (math.pi / 2))
        excess = value - quarters * math.pi / 2
        ring = self.ring
        if abs(excess) < _SQUARE:
            if abs(excess) > _NOTHING:
                self.notes.append(
                    f"{label} = {value:.10g} rad taken as {quarters} pi/2 ({excess:.1e} rad away)"
                )
            cosine, sine = ((1, 0), (0, 1), (-1, 0), (0, -1))[quarters % 4]
            return _about(axis, ring.number(cosine), ring.number(sine), ring)
        self.values[label] = value
        angle = {ring.variable(label, True): 1}
        return _about(axis, ring.cos(angle), ring.sin(angle), ring)

    def towards(self, axis: Array, label: str) -> list[list[Expansion]]:
        """Rz(a) Ry(b), which turns z into a unit axis."""
        yaw = math.atan2(axis[1], axis[0]) if math.hypot(axis[0], axis[1]) > _NOTHING else 0.0
        pitch = math.atan2(math.hypot(axis[0], axis[1]), axis[2])
        return times(self.turn(yaw, 2, f"axis_yaw_{label}"), self.turn(pitch, 1, f"axis_pitch_{label}"))


def exact(value: float) -> Fraction:
    """The shortest decimal fraction that is this float, without the dust of its last digits."""
    near = Fraction(value).limit_denominator(1_000_000)
    return near if abs(float(near) - value) < 1e-12 * max(1.0, abs(value)) else Fraction(repr(value))


def identity(ring: Ring) -> list[list[Expansion]]:
    """The rotation that turns nothing."""
    return [[ring.number(int(i == j)) for j in range(3)] for i in range(3)]


def times(a: list[list[Expansion]], b: list[list[Expansion]]) -> list[list[Expansion]]:
    """a b."""
    return [
        [sum((a[i][k] * b[k][j] for k in range(1, len(b))), a[i][0] * b[0][j]) for j in range(len(b[0]))]
        for i in range(len(a))
    ]


def transposed(a: list[list[Expansion]]) -> list[list[Expansion]]:
    """aᵀ."""
    return [list(column) for column in zip(*a, strict=True)]


def moving_turn(ring: Ring, axis: int, variable: int, sign: int) -> list[list[Expansion]]:
    """A turn by a joint's angle about x, y or z (or its negative)."""
    return _about(axis, ring.cos({variable: sign}), ring.sin({variable: sign}), ring)


def _about(axis: int, cosine: Expansion, sine: Expansion, ring: Ring) -> list[list[Expansion]]:
    matrix = identity(ring)
    i, j = (axis + 1) % 3, (axis + 2) % 3
    matrix[i][i] = matrix[j][j] = cosine
    matrix[i][j], matrix[j][i] = -sine, sine
    return matrix


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
