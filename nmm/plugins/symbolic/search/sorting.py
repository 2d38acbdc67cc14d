"""From singular points to families: a walk from one point says what is pinned, others are sorted in.

Random members prove each family, and those half a turn away that no start has found.
"""

from collections import Counter
from dataclasses import replace

import numpy as np

from nmm.base.arrays import Array, Flags
from nmm.plugins.symbolic.search.descent import Local, localised, shaken, stay_singular, tangents, walk
from nmm.plugins.symbolic.search.family import Relation, SingularFamily, merged
from nmm.plugins.symbolic.search.space import SearchSpace

#: What spreads less than this along a walk stays, in units.
STAYS = 5e-5
#: Largest whole multiple of a coordinate in a sum, and how near to whole it has to be.
WHOLE, NEAR_WHOLE = 6, 1e-3
#: Shakes that leave a place where pieces meet, in units; the next where the one before was not enough.
SHAKES = (0.05, 0.2, 0.5)
#: Examples that a family keeps.
EXAMPLES = 4
#: Random members that prove a family, and how much less exact than a point that has converged they are.
MEMBERS, SLACK = 16, 100.0


def families_of(search: SearchSpace, z: Array) -> tuple[SingularFamily, ...]:
    """The families of singular points z (N, a), the thickest first."""
    if not len(z):
        return ()
    local = localised(search, shaken(search, z))
    common = Counter(local.signature(i) for i in range(len(z)))
    waiting = sorted(range(len(z)), key=lambda i: (local.signature(i)[0], -common[local.signature(i)], i))
    families: list[SingularFamily] = []
    while waiting:
        i = waiting[0]
        family = family_at(search, local.z[i])
        if family is None:  # where pieces meet; a neighbour tells more
            waiting = waiting[1:]
            continue
        members = [j for j in waiting if j == i or _belongs(search, family, local, j)]
        family = _with_examples(search, family, local, members)
        again = next((k for k, other in enumerate(families) if other.same_as(family)), None)
        if again is None:
            families.append(family)
        else:
            families[again] = replace(families[again], starts=families[again].starts + family.starts)
        waiting = [j for j in waiting if j not in members]
    families = merged(_completed(search, families))
    return tuple(sorted(families, key=lambda family: (-family.dimension, -family.starts)))


def family_at(search: SearchSpace, z: Array) -> SingularFamily | None:
    """The family of z (a,), or a larger adjoining one; None where large random motions contradict it."""
    if not len(search.axes):
        return everywhere(search, z, 1)
    for size in SHAKES:
        tries = shaken(search, np.tile(z, (5, 1)), size)
        local = localised(search, np.concatenate([z[np.newaxis], tries]))
        signatures = [local.signature(i) for i in range(len(local.z))]
        usual = Counter(signatures).most_common(1)[0][0]
        family = _family_of(search, local, signatures.index(usual))
        if family is not None:
            return family
    return None


def _family_of(search: SearchSpace, local: Local, i: int) -> SingularFamily | None:
    """The family of point i, by a walk from it; None where large random motions contradict it."""
    z, rank, free = local.z[i], int(local.rank[i]), local.free[i]
    along = tangents(search, z, rank)
    points = walk(search, z, rank, along)
    constraints, related = _ties(search, points, free)
    free_ones = {*search.indifferent, *search.axes[free]}
    family = replace(
        everywhere(search, z, 1),
        free=tuple(search.robot.q_names[j] for j in search.moving if j in free_ones),
        constraints=constraints,
        related=related,
        dimension=len(search.indifferent) + len(along),
        examples=search.fold(search.q(z[np.newaxis])),
    )
    return family if _holds(search, family, points, free) else None


def everywhere(search: SearchSpace, z: Array, starts: int) -> SingularFamily:
    """The family of all configurations, for a J without full rank anywhere."""
    names = search.robot.q_names
    q = search.q(z[np.newaxis])
    rank = int(search.ranks(z[np.newaxis])[0])
    return SingularFamily(
        free=tuple(names[j] for j in search.moving),
        constraints=(),
        related=(),
        dimension=len(search.moving),
        moving=len(search.moving),
        rank=rank,
        full_rank=search.measure.full_rank,
        lost=search.measure.lost_text(q[0], rank),
        examples=q,
        starts=starts,
        names=names,
    )


def _ties(search: SearchSpace, points: Array, free: Flags) -> tuple[tuple[Relation, ...], tuple[str, ...]]:
    """Relations along the walk (N, a): pinned coordinates and sums; and all that are tied but not pinned."""
    pinned = ~free & (np.ptp(points, axis=0) <= STAYS)
    tied = np.flatnonzero(~free & ~pinned)
    sums = [{int(j): 1} for j in np.flatnonzero(pinned)]
    for row in _whole_rows(points[:, tied] - points[0, tied]):
        sums.append({int(j): int(number) for j, number in zip(tied, row, strict=True) if number})
    # Metres and radians do not add up.
    units = [{search.robot.q_units[search.axes[j]] for j in used} for used in sums]
    ties = [_relation(search, points, used) for used, own in zip(sums, units, strict=True) if len(own) == 1]
    return tuple(ties), tuple(search.robot.q_names[j] for j in search.axes[tied])


def _relation(search: SearchSpace, points: Array, multiples: dict[int, int]) -> Relation:
    """That a sum of whole multiples of axes has the value that it has at the points (N, a)."""
    axes = search.axes[list(multiples)]
    total = np.median(sum(number * points[:, j] for j, number in multiples.items()))
    value, circular = float(total) * float(search.units[axes[0]]), bool(search.circular[axes].all())
    if circular:
        value = _wrapped(value)
        value = value + 2.0 * np.pi if value < STAYS - np.pi else value
    names = [search.robot.q_names[j] for j in axes]
    coefficients = dict(zip(names, multiples.values(), strict=True))
    return Relation(coefficients, (value,), search.robot.q_units[axes[0]], circular)


def _wrapped(angle: float) -> float:
    """From -π, exclusive, to π."""
    return float(np.pi - np.mod(np.pi - angle, 2.0 * np.pi))


def _whole_rows(D: Array) -> Array:
    """Integer vectors of a basis of the null space of D (N, k); those not integer are left out."""
    k = D.shape[1]
    if not k:
        return np.zeros((0, 0))
    _, sizes, rows = np.linalg.svd(D, full_matrices=True)
    thick = int(np.sum(sizes > STAYS * np.sqrt(len(D))))
    R = _echelon(rows[thick:])
    integer_rows = []
    for row in R:
        for times in range(1, WHOLE + 1):
            whole = np.round(row * times)
            if np.max(np.abs(whole - row * times)) < NEAR_WHOLE and np.max(np.abs(whole)) <= WHOLE:
                integer_rows.append(whole)
                break
    return np.array(integer_rows).reshape(len(integer_rows), k)


def _echelon(rows: Array) -> Array:
    R, row = rows.copy(), 0
    for column in range(R.shape[1]):
        if row == len(R):
            break
        best = row + int(np.argmax(np.abs(R[row:, column])))
        if abs(R[best, column]) < NEAR_WHOLE:
            continue
        R[[row, best]] = R[[best, row]]
        R[row] /= R[row, column]
        others = [i for i in range(len(R)) if i != row]
        R[others] -= np.outer(R[others, column], R[row])
        row += 1
    return R


def _belongs(search: SearchSpace, family: SingularFamily, local: Local, i: int) -> bool:
    """Whether point i satisfies what is pinned; and is of the same sort, where equations tie the rest."""
    if local.rank[i] > family.rank or not family.contains(search.q(local.z[i : i + 1])[0]):
        return False
    names = search.robot.q_names
    free = {names[j] for j in search.axes[local.free[i]]} | {names[j] for j in search.indifferent}
    return family.equations == 0 or (local.rank[i] == family.rank and free == set(family.free))


def _with_examples(
    search: SearchSpace, family: SingularFamily, local: Local, members: list[int]
) -> SingularFamily:
    """The family with its starts and examples, the first with the free coordinates of `at`, if possible.

    Examples where another family meets are avoided: the directions lost there would be that one's.
    """
    example = search.z(family.examples[:1])
    usual = localised(search, example).signature(0)
    z = np.concatenate([example, *(local.z[j : j + 1] for j in members if local.signature(j) == usual)])
    q = search.fold(search.q(z[:EXAMPLES]))
    plain = q[:1].copy()
    for name in family.free:
        j = search.robot.coordinate(name)
        plain[0, j] = search.at[j]
    plain = search.robot.following.placed(plain)
    at_plain = localised(search, search.z(plain))
    if at_plain.rank[0] == family.rank and at_plain.signature(0) == usual:
        q = np.concatenate([plain, q[: EXAMPLES - 1]])
    return replace(family, examples=q, starts=len(members), lost=search.measure.lost_text(q[0], family.rank))


def _holds(search: SearchSpace, family: SingularFamily, points: Array, free: Flags) -> bool:
    """Whether J's rank is as low at random members, far away: all members, where nothing else ties them."""
    names = search.robot.q_names
    named = {name for relation in family.constraints for name in relation.coefficients} | set(family.free)
    silent = {names[j] for j in search.moving} - named
    if family.equations < 0 or (silent and not family.equations) or (family.equations and not family.related):
        return False
    drawn = search.draw(MEMBERS)
    if family.equations:
        own = points[search.rng.integers(len(points), size=MEMBERS)]
        q = search.q(np.where(free, drawn, own))
    else:
        q = search.q(drawn)
        for relation in family.constraints:
            (name, first), *others = relation.coefficients.items()
            total = relation.values[0] - sum(
                number * q[:, search.robot.coordinate(other)] for other, number in others
            )
            q[:, search.robot.coordinate(name)] = total / first
    rank = np.full(MEMBERS, family.rank)
    return bool(np.all(stay_singular(search.looser(SLACK), search.z(q), rank)))


def _completed(search: SearchSpace, families: list[SingularFamily]) -> list[SingularFamily]:
    """Add the families at opposite values of a pinned angle or sum, also half a turn away.

    Those that no start found are proved by random members.
    """
    every = list(families)
    for family in every:  # it grows meanwhile
        for i, relation in enumerate(family.constraints):
            (own,) = relation.values
            twins = (-own, own + np.pi, np.pi - own) if relation.circular else ()
            for value in map(_wrapped, twins):
                constraints = list(family.constraints)
                constraints[i] = replace(relation, values=(value,))
                twin = replace(
                    family,
                    constraints=tuple(constraints),
                    examples=_moved(search, family.examples, relation, value),
                    starts=0,
                )
                if not any(other.same_as(twin) for other in every) and _proved(search, twin):
                    every.append(twin)
    return every


def _moved(search: SearchSpace, q: Array, relation: Relation, value: float) -> Array:
    """Configurations (N, n) that satisfy a relation with another value, by its first coordinate."""
    name, number = next(iter(relation.coefficients.items()))
    moved = q.copy()
    moved[:, search.robot.coordinate(name)] += (value - relation.values[0]) / number
    return search.fold(moved)


def _proved(search: SearchSpace, family: SingularFamily) -> bool:
    """Whether its examples and random members are singular, with the same freedom and no more."""
    z = search.z(family.examples)
    free = np.array([search.robot.q_names[j] in family.free for j in search.axes])
    if not _holds(search, family, z, free):
        return False
    drawn = np.where(free, search.draw(len(z)), z)
    local = localised(search.looser(SLACK), drawn)
    return bool(np.all(local.free == free) and np.all(local.rank == family.rank))
