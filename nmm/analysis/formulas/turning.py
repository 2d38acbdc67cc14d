"""Turns about x, y and z, of which all rotations are made."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from nmm.analysis.formulas.expansion import Expansion, Ring

Vector = list[Expansion]


class Turning(NamedTuple):
    """A turn by k·angles and some quarters of a turn.

    Attributes
    ----------
    axis : 0, 1 or 2 for x, y or z
    angle : ((variable, k), ...)
    quarters : 0 to 3
    """

    axis: int
    angle: tuple[tuple[int, int], ...] = ()
    quarters: int = 0

    def inverse(self) -> Turning:
        """The turn back."""
        return Turning(self.axis, tuple((i, -k) for i, k in self.angle), -self.quarters % 4)

    def of(self, vector: Vector, ring: Ring) -> Vector:
        """A vector, turned."""
        cosine, sine = ring.cos(dict(self.angle)), ring.sin(dict(self.angle))
        for _ in range(self.quarters):
            cosine, sine = -sine, cosine
        i, j = (self.axis + 1) % 3, (self.axis + 2) % 3
        turned = list(vector)
        turned[i] = cosine * vector[i] - sine * vector[j]
        turned[j] = sine * vector[i] + cosine * vector[j]
        return turned


def turned(turns: Sequence[Turning], vector: Vector, ring: Ring) -> Vector:
    """A vector by several turns, the last one first: as by the product of their matrices."""
    for turn in reversed(turns):
        vector = turn.of(vector, ring)
    return vector


def back(turns: Sequence[Turning]) -> list[Turning]:
    """The inverse of several."""
    return [turn.inverse() for turn in reversed(turns)]


def merged(turns: Sequence[Turning]) -> tuple[Turning, ...]:
    """Neighbours about one axis as one, and none that do nothing."""
    found: list[Turning] = []
    for turn in turns:
        if found and found[-1].axis == turn.axis:
            before = found.pop()
            angle = dict(before.angle)
            for i, k in turn.angle:
                angle[i] = angle.get(i, 0) + k
            kept = tuple((i, k) for i, k in angle.items() if k)
            turn = Turning(turn.axis, kept, (before.quarters + turn.quarters) % 4)
        if turn.angle or turn.quarters:
            found.append(turn)
    return tuple(found)


def unit_vectors(ring: Ring) -> list[Vector]:
    """x, y and z."""
    return [[ring.number(int(i == j)) for j in range(3)] for i in range(3)]


def dot(a: Vector, b: Vector) -> Expansion:
    """a · b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a: Vector, b: Vector) -> Vector:
    """a × b."""
    return [a[(i + 1) % 3] * b[(i + 2) % 3] - a[(i + 2) % 3] * b[(i + 1) % 3] for i in range(3)]
