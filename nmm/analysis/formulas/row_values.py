"""What the rows of a task have as values, and what auxiliary symbols stand for."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple, TypeAlias

from nmm.analysis.formulas.expansion import Expansion
from nmm.analysis.formulas.quotient import Linear


@dataclass(frozen=True)
class Arc:
    """An angle atan2(sine, cosine), which no kernel can compute with."""

    sine: Expansion
    cosine: Expansion


class Turn(NamedTuple):
    """Component 0, 1 or 2 of a rotation matrix' rotation vector.

    Attributes
    ----------
    part : which
    name : the matrix'
    product : what it is the product of: turns about the axis (0, 1, 2) by the angles and some quarters
    """

    part: int
    name: str
    product: tuple[tuple[int, tuple[tuple[str, int], ...], int], ...]


class Share(NamedTuple):
    """An angle, by its name, times a factor."""

    angle: str
    factor: Expansion


Value: TypeAlias = Expansion | Arc | Linear | Turn | Share


class Auxiliary(NamedTuple):
    """A symbol for a quantity that would make the formulas long.

    Attributes
    ----------
    name : the symbol's
    kind : "length" of a vector (2 or 3 arguments), "bearing" atan2(b, a), "elevation" atan2(c, hypot(a, b)),
        "off axis" atan2(hypot(b, c), a), "over sine": the angle off axis over its sine, "root" of a
    arguments : a, b, c
    """

    name: str
    kind: str
    arguments: tuple[Expansion, ...]


def value_without(value: Value, variables: set[int]) -> Value:
    """A value with scalars set to 0."""
    if isinstance(value, Expansion):
        return value.without(variables)
    if isinstance(value, Arc):
        return Arc(value.sine.without(variables), value.cosine.without(variables))
    if isinstance(value, Share):
        return value._replace(factor=value.factor.without(variables))
    return value
