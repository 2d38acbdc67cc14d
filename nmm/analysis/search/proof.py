"""Families held against random members: those told by a walk, and their twins half a turn away."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from nmm.analysis.search.family import Relation, SingularFamily
from nmm.analysis.search.local import localised, stay_singular
from nmm.analysis.search.search import Search
from nmm.analysis.search.space import Space
from nmm.arrays import Array, Flags

#: Random members that prove a family, and how much less exact than a point that has converged they are.
MEMBERS, SLACK = 16, 100.0


def holds(search: Search, family: SingularFamily, points: Array, free: Flags) -> bool:
    """Whether J's rank is as low at random members, far away: all members, where nothing else ties them."""
    space, rng = search.space, search.rng
    names = space.robot.q_names
    named = {name for one in family.constraints for name in one.coefficients} | set(family.free)
    silent = {names[j] for j in space.moving} - named
    if family.equations < 0 or (silent and not family.equations) or (family.equations and not family.related):
        return False
    drawn = space.draw(rng, MEMBERS)
    if family.equations:
        own = points[rng.integers(len(points), size=MEMBERS)]
        q = space.q(np.where(free, drawn, own))
    else:
        q = space.q(drawn)
        for relation in family.constraints:
            (name, first), *others = relation.coefficients.items()
            total = relation.values[0] - sum(
                number * q[:, space.robot.coordinate(other)] for other, number in others
            )
            q[:, space.robot.coordinate(name)] = total / first
    rank = np.full(MEMBERS, family.rank)
    return bool(np.all(stay_singular(search.looser(SLACK), space.z(q), rank)))


def completed(search: Search, found: list[SingularFamily]) -> list[SingularFamily]:
    """With the families where a pinned angle or sum has the opposite value, or that and half a turn.

    Where no start ended there: random members prove that they are singular, and as free as those found.
    """
    every = list(found)
    for family in every:  # it grows meanwhile
        for i, relation in enumerate(family.constraints):
            for value in _twins(relation):
                constraints = list(family.constraints)
                constraints[i] = replace(relation, values=(value,))
                twin = replace(
                    family,
                    constraints=tuple(constraints),
                    examples=_moved(search.space, family.examples, relation, value),
                    starts=0,
                )
                if not any(one.same_as(twin) for one in every) and _proved(search, twin):
                    every.append(twin)
    return every


def _twins(relation: Relation) -> list[float]:
    """-v, v + π and π - v of an angle that makes the whole turn, from -π to π."""
    if not relation.circular:
        return []
    (value,) = relation.values
    return [
        float(np.pi - np.mod(np.pi - other, 2.0 * np.pi)) for other in (-value, value + np.pi, np.pi - value)
    ]


def _moved(space: Space, q: Array, relation: Relation, value: float) -> Array:
    """Configurations (N, n) that satisfy a relation with another value, by its first coordinate."""
    name, number = next(iter(relation.coefficients.items()))
    moved = q.copy()
    moved[:, space.robot.coordinate(name)] += (value - relation.values[0]) / number
    return space.fold(moved)


def _proved(search: Search, family: SingularFamily) -> bool:
    """Whether its examples and random members are singular, with the same freedom and no more."""
    space = search.space
    z = space.z(family.examples)
    free = np.array([space.robot.q_names[j] in family.free for j in space.axes])
    if not holds(search, family, z, free):
        return False
    drawn = np.where(free, space.draw(search.rng, len(z)), z)
    local = localised(search.looser(SLACK), drawn)
    return bool(np.all(local.free == free) and np.all(local.rank == family.rank))
