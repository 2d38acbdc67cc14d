"""Families of singular configurations: what is free, what is pinned, and what is tied together."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from nmm.base.arrays import Array
from nmm.base.text_format import NEAR_PI, counted, listed, signed_sum, value_text

#: Values of the same kind that differ by less are the same, rad or m.
SAME_VALUE = 1e-4
#: More free coordinates than these are not named in a line.
MANY = 4


@dataclass(frozen=True)
class Relation:
    """Whole multiples of coordinates whose sum has a fixed value, as q1 + q2 = ±π/2.

    Attributes
    ----------
    coefficients : by coordinate; one of them alone is a pinned coordinate
    values : any of these, rad or m; an angle's from -π to π where whole turns do not matter
    unit : rad or m
    circular : whole turns do not matter

    Examples
    --------
    >>> robot = nmm.load("unicycle_2r")
    >>> search = nmm.analysis.find_singularities((robot, nmm.Position("ee", "xy")), part="arm", starts=40)
    >>> relation = search.families[0].constraints[0]
    >>> relation.coefficients, relation.unit
    ({'q2': 1}, 'rad')
    """

    coefficients: Mapping[str, int]
    values: tuple[float, ...]
    unit: str
    circular: bool

    @property
    def text(self) -> str:
        """ "q1 + q2 = ±π/2"."""
        terms = [(k, name if abs(k) == 1 else f"{abs(k)} {name}") for name, k in self.coefficients.items()]
        return f"{signed_sum(terms)} = {values_text(self.values, self.unit, self.circular)}"

    @property
    def kind(self) -> tuple[tuple[str, int], ...]:
        """What is tied, without the values."""
        return tuple(self.coefficients.items())

    def holds(self, values: Mapping[str, float]) -> bool:
        """Whether it does at these coordinates, within 1e-4."""
        total = sum(number * values[name] for name, number in self.coefficients.items())
        return any(self._apart(total - value) <= SAME_VALUE for value in self.values)

    def same_values(self, other: Relation) -> bool:
        """Whether both have the same values."""
        return len(self.values) == len(other.values) and all(
            any(self._apart(mine - its) <= SAME_VALUE for its in other.values) for mine in self.values
        )

    def _apart(self, difference: float) -> float:
        return abs(np.remainder(difference + np.pi, 2.0 * np.pi) - np.pi if self.circular else difference)


@dataclass(frozen=True, eq=False)
class SingularFamily:
    """Singular configurations that differ in what does not matter, or move along one equation.

    Pieces that tie the same coordinates by different equations count as one family. What lies in a family
    may lose more rank where it meets another one.

    Attributes
    ----------
    free : coordinates that may take any value
    constraints : what is pinned, and simple sums that are; all combinations of their values are singular,
        found by a start, or half a turn from one that was and proved by random members
    related : coordinates tied by the equations, those of `constraints` that are sums among them
    dimension, moving : of this part of the singular set, and of how many coordinates the search moved
    rank, full_rank : of J in the family, and elsewhere
    lost : the task's directions that are lost at the first example
    examples (E, n), names : configurations, and the names of their coordinates
    starts : how many starts ended here

    Examples
    --------
    >>> robot = nmm.load("unicycle_2r")
    >>> search = nmm.analysis.find_singularities((robot, nmm.Position("ee", "xy")), part="arm", starts=40)
    >>> family = search.families[0]
    >>> family.free, family.dimension, family.rank
    (('x', 'y', 'theta', 'q1'), 4, 1)
    """

    free: tuple[str, ...]
    constraints: tuple[Relation, ...]
    related: tuple[str, ...]
    dimension: int
    moving: int
    rank: int
    full_rank: int
    lost: tuple[str, ...]
    examples: Array
    starts: int
    names: tuple[str, ...]

    @property
    def pinned(self) -> dict[str, tuple[float, ...]]:
        """Isolated values, any of them, by coordinate, rad or m; every combination is singular."""
        return {
            next(iter(constraint.coefficients)): constraint.values
            for constraint in self.constraints
            if len(constraint.coefficients) == 1
        }

    @property
    def relations(self) -> tuple[Relation, ...]:
        """Sums of coordinates that are pinned."""
        return tuple(constraint for constraint in self.constraints if len(constraint.coefficients) > 1)

    @property
    def codimension(self) -> int:
        """How many independent conditions make it."""
        return self.moving - self.dimension

    @property
    def equations(self) -> int:
        """How many conditions tie `related`, beside the sums in `relations`."""
        return self.codimension - len(self.constraints)

    @property
    def conditions(self) -> str:
        """ "q2 = 0 or ±π; q3, q4 and q5 tied by an equation"."""
        texts = [constraint.text for constraint in self.constraints]
        if self.equations > 0:
            count = "an equation" if self.equations == 1 else f"{self.equations} equations"
            texts.append(f"{listed(self.related)} tied by {count}")
        return "; ".join(texts) or "everywhere"

    @property
    def free_text(self) -> str:
        """ "q1 and q3 free", "all else free" where they are many, "nothing free"."""
        if len(self.free) > MANY:
            return "all else free"
        return f"{listed(self.free)} free" if self.free else "nothing free"

    @property
    def text(self) -> str:
        """One line: "q2 = 0 or ±π; q1 free; loses ee.x; 200 starts"."""
        lost = f"loses {listed(self.lost)}" if len(self.lost) == 1 else f"loses {len(self.lost)} directions"
        starts = counted(self.starts, "start")
        return f"{self.conditions}; {self.free_text}; {lost} (rank {self.rank}); {starts}"

    def contains(self, q: Array) -> bool:
        """Whether q (n,) satisfies `constraints`; the equations of what is tied are not looked at."""
        values = dict(zip(self.names, q, strict=True))
        return all(constraint.holds(values) for constraint in self.constraints)

    @property
    def kind(self) -> object:
        """The same for families that differ in values alone."""
        kinds = tuple(relation.kind for relation in self.constraints)
        return self.free, self.related, self.rank, self.dimension, kinds

    def same_as(self, other: SingularFamily) -> bool:
        """Whether both are the same, by kind and values."""
        return self.kind == other.kind and not _different(self, other)


def _different(family: SingularFamily, other: SingularFamily) -> list[int]:
    """Which constraints of two families of one kind have different values."""
    pairs = enumerate(zip(family.constraints, other.constraints, strict=True))
    return [i for i, (mine, its) in pairs if not mine.same_values(its)]


def merged(families: list[SingularFamily]) -> list[SingularFamily]:
    """Join families that differ in the values of one constraint alone into one with all these values."""
    result = list(families)
    while True:  # what is one now may go with an earlier one
        pairs = ((i, j, _together(result[i], result[j])) for i, j in combinations(range(len(result)), 2))
        merging = next(((i, j, both) for i, j, both in pairs if both is not None), None)
        if merging is None:
            return result
        i, j, result[i] = merging
        del result[j]


def _together(family: SingularFamily, other: SingularFamily) -> SingularFamily | None:
    if family.kind != other.kind:
        return None
    different = _different(family, other)
    if len(different) > 1:
        return None
    constraints = list(family.constraints)
    for i in different:
        mine, its = family.constraints[i], other.constraints[i].values
        new = [
            value for value in its if not any(mine._apart(value - old) <= SAME_VALUE for old in mine.values)
        ]
        constraints[i] = replace(mine, values=tuple(sorted([*mine.values, *new])))
    return replace(
        family,
        constraints=tuple(constraints),
        examples=np.concatenate([family.examples, other.examples]),
        starts=family.starts + other.starts,
    )


def values_text(values: Iterable[float], unit: str, circular: bool = False) -> str:
    """Several values: "0 or ±π", "±π/2". A circular π is ±π."""
    texts: list[str] = []
    left = sorted(values, key=lambda value: (round(abs(value), 6), -value))
    while left:
        value = left.pop(0)
        opposite = next((other for other in left if abs(other + value) <= 2.0 * NEAR_PI), None)
        both = opposite is not None and abs(value) > NEAR_PI
        if both:
            left.remove(opposite)  # type: ignore[arg-type]  # one was found
        text = value_text(abs(value) if both else value, unit)
        whole_turn = circular and unit == "rad" and abs(abs(value) - np.pi) <= NEAR_PI
        texts.append(f"±{text.lstrip('-')}" if both or whole_turn else text)
    return listed(texts, "or")
