"""From singular points to families: a walk from one point says what is pinned, others are sorted in."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

import numpy as np

from nmm.analysis.search.family import Relation, SingularFamily, merged
from nmm.analysis.search.local import Local, localised, shaken, tangents, walk
from nmm.analysis.search.proof import completed, holds
from nmm.analysis.search.search import Search
from nmm.analysis.search.space import Space
from nmm.arrays import Array, Flags

#: What spreads less than this along a walk stays, in units.
STAYS = 5e-5
#: Largest whole multiple of a coordinate in a sum, and how near to whole it has to be.
WHOLE, NEAR_WHOLE = 6, 1e-3
#: Shakes that leave a place where pieces meet, in units; the next where the one before was not enough.
SHAKES = (0.05, 0.2, 0.5)
#: Examples that a family keeps.
EXAMPLES = 4


def families_of(search: Search, z: Array) -> tuple[SingularFamily, ...]:
    """The families of singular points z (N, a), the thickest first."""
    if not len(z):
        return ()
    local = localised(search, shaken(search, z))
    common = Counter(local.signature(i) for i in range(len(z)))
    waiting = sorted(range(len(z)), key=lambda i: (local.signature(i)[0], -common[local.signature(i)], i))
    found: list[SingularFamily] = []
    while waiting:
        i = waiting[0]
        family = family_at(search, local.z[i])
        if family is None:  # where pieces meet; a neighbour tells more
            waiting = waiting[1:]
            continue
        members = [j for j in waiting if j == i or _belongs(search.space, family, local, j)]
        family = _with_examples(search, family, local, members)
        again = next((k for k, one in enumerate(found) if one.same_as(family)), None)
        if again is None:
            found.append(family)
        else:
            found[again] = replace(found[again], starts=found[again].starts + family.starts)
        waiting = [j for j in waiting if j not in members]
    found = merged(completed(search, found))
    return tuple(sorted(found, key=lambda family: (-family.dimension, -family.starts)))


def family_at(search: Search, z: Array) -> SingularFamily | None:
    """The family of a singular point z (a,); a larger one beside it where several meet.

    None where what seemed pinned or free at the point does not hold in large random motions.
    """
    if not len(search.space.axes):
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


def _family_of(search: Search, local: Local, i: int) -> SingularFamily | None:
    """The family of point i, by a walk from it; None where large random motions contradict it."""
    z, rank, free = local.z[i], int(local.rank[i]), local.free[i]
    space = search.space
    along = tangents(search, z, rank)
    points = walk(search, z, rank, along)
    constraints, related = _ties(space, points, free)
    family = replace(
        everywhere(search, z, 1),
        free=tuple(
            space.robot.q_names[j] for j in space.moving if j in {*space.indifferent, *space.axes[free]}
        ),
        constraints=constraints,
        related=related,
        dimension=len(space.indifferent) + len(along),
        examples=space.fold(space.q(z[np.newaxis])),
    )
    return family if holds(search, family, points, free) else None


def everywhere(search: Search, z: Array, starts: int) -> SingularFamily:
    """The family of all configurations, for a J without full rank anywhere."""
    measure, space = search.measure, search.space
    names = space.robot.q_names
    q = space.q(z[np.newaxis])
    rank = int(search.ranks(z[np.newaxis])[0])
    return SingularFamily(
        free=tuple(names[j] for j in space.moving),
        constraints=(),
        related=(),
        dimension=len(space.moving),
        moving=len(space.moving),
        rank=rank,
        full_rank=measure.full_rank,
        lost=measure.lost_text(q[0], rank),
        examples=q,
        starts=starts,
        names=names,
    )


def _ties(space: Space, points: Array, free: Flags) -> tuple[tuple[Relation, ...], tuple[str, ...]]:
    """What stays along the walk (N, a): pinned coordinates and sums; and all that are tied but not pinned."""
    names = [space.robot.q_names[j] for j in space.axes]
    spread = np.ptp(points, axis=0)
    pinned = ~free & (spread <= STAYS)
    tied = np.flatnonzero(~free & ~pinned)
    middle = np.median(points, axis=0)
    found = [_relation(space, {names[j]: 1}, float(middle[j]), int(j)) for j in np.flatnonzero(pinned)]
    for row in _whole_rows(points[:, tied] - points[0, tied]):
        used = [(int(tied[i]), int(number)) for i, number in enumerate(row) if number]
        units = {space.robot.q_units[space.axes[j]] for j, _ in used}
        if len(units) > 1:
            continue  # metres and radians do not add up
        total = np.median(sum(number * points[:, j] for j, number in used))
        circular = [j for j, _ in used if space.circular[space.axes[j]]]
        relation = _relation(
            space, {names[j]: number for j, number in used}, float(total),
            used[0][0], circular=len(circular) == len(used),
        )  # fmt: skip
        found.append(relation)
    return tuple(found), tuple(names[j] for j in tied)


def _relation(
    space: Space, coefficients: dict[str, int], z: float, axis: int, circular: bool | None = None
) -> Relation:
    j = space.axes[axis]
    turn = bool(space.circular[j]) if circular is None else circular
    value = z * float(space.units[j])
    if turn:
        value = float(np.pi - np.mod(np.pi - value, 2.0 * np.pi))
        value = value + 2.0 * np.pi if value < STAYS - np.pi else value
    return Relation(coefficients, (value,), space.robot.q_units[j], turn)


def _whole_rows(D: Array) -> Array:
    """Rows of whole numbers that are orthogonal to all rows of D (N, k); none where they are not whole."""
    k = D.shape[1]
    if not k:
        return np.zeros((0, 0))
    _, sizes, rows = np.linalg.svd(D, full_matrices=True)
    thick = int(np.sum(sizes > STAYS * np.sqrt(len(D))))
    R = _echelon(rows[thick:])
    found = []
    for row in R:
        for times in range(1, WHOLE + 1):
            whole = np.round(row * times)
            if np.max(np.abs(whole - row * times)) < NEAR_WHOLE and np.max(np.abs(whole)) <= WHOLE:
                found.append(whole)
                break
    return np.array(found).reshape(len(found), k)


def _echelon(rows: Array) -> Array:
    """Reduced row echelon form of independent rows."""
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


def _belongs(space: Space, family: SingularFamily, local: Local, i: int) -> bool:
    """Whether point i satisfies what is pinned; and is of the same sort, where equations tie the rest."""
    if local.rank[i] > family.rank or not family.contains(space.q(local.z[i : i + 1])[0]):
        return False
    names = space.robot.q_names
    free = {names[j] for j in space.axes[local.free[i]]} | {names[j] for j in space.indifferent}
    return family.equations == 0 or (local.rank[i] == family.rank and free == set(family.free))


def _with_examples(
    search: Search, family: SingularFamily, local: Local, members: list[int]
) -> SingularFamily:
    """With its starts, and with examples: first one whose free coordinates are where `at` has them.

    None lies where another family is met: what is lost there, and what brings it back, would be that one's.
    """
    space = search.space
    example = space.z(family.examples[:1])
    usual = localised(search, example).signature(0)
    z = np.concatenate([example, *(local.z[j : j + 1] for j in members if local.signature(j) == usual)])
    q = space.fold(space.q(z[:EXAMPLES]))
    plain = q[:1].copy()
    for name in family.free:
        j = space.robot.coordinate(name)
        plain[0, j] = space.at[j]
    plain = space.robot.following.placed(plain)
    there = localised(search, space.z(plain))
    if there.rank[0] == family.rank and there.signature(0) == usual:
        q = np.concatenate([plain, q[: EXAMPLES - 1]])
    return replace(family, examples=q, starts=len(members), lost=search.measure.lost_text(q[0], family.rank))
