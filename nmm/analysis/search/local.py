"""What the singular set is like at one of its points: which coordinates are free, and its tangents."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from nmm.analysis.search.descent import descend
from nmm.analysis.search.search import Search
from nmm.analysis.singular.parts import null_space
from nmm.arrays import Array, Flags, Integers

#: Slopes this small beside those of J itself are none.
FLAT = 3e-5
#: Large random moves that a free coordinate has to stand.
MOVES = 5
#: What a mended motion may change, in units.
ROUNDED = 1e-4
#: How far points are shaken, in units, to leave places where two pieces of the singular set meet.
SHAKE = 0.05
#: Size of the motions that measure a dimension, in units.
BESIDE = 1e-3
#: Walks: so many at once, so many steps, of these lengths, in units.
WALKERS, ROUNDS, STEPS = 8, 4, (0.04, 0.15)
#: The largest way back to the set beside the step, and the sine of the largest turn of the tangents.
RETURN, TURNED = 0.3, 0.6


@dataclass(frozen=True, eq=False)
class Local:
    """Singular points and what the set is like there.

    Attributes
    ----------
    z (N, a) : the points
    rank (N,) : of J
    free (N, a) : coordinates that alone may take any value
    codimension (N,) : independent slopes of the equations
    """

    z: Array
    rank: Integers
    free: Flags
    codimension: Integers

    def signature(self, i: int) -> tuple[int, int, tuple[bool, ...]]:
        """Points of one family have the same one; the first are the largest families."""
        return int(self.codimension[i]), int(self.rank[i]), tuple(bool(one) for one in self.free[i])


def localised(search: Search, z: Array) -> Local:
    """What the singular set is like at its points z (N, a)."""
    rank = search.ranks(z)
    corank = search.measure.full_rank - rank
    codimension = np.zeros(len(z), dtype=np.int64)
    for lost in set(corank.tolist()) - {0}:
        of = np.flatnonzero(corank == lost)
        codimension[of] = [len(normals) for normals in normal_spaces(search, z[of], lost)]
    return Local(z, rank, free_coordinates(search, z, rank), codimension)


def normal_spaces(search: Search, z: Array, corank: int) -> list[Array]:
    """Orthonormal rows of each point's slopes, (codimension, a)."""
    _, C, values = search.equations(z, corank)
    _, sizes, rows = np.linalg.svd(C, full_matrices=False)
    return [
        own[size > FLAT * max(float(largest), 1e-300)]
        for own, size, largest in zip(rows, sizes, values[:, 0], strict=True)
    ]


def free_coordinates(search: Search, z: Array, rank: Integers) -> Flags:
    """(N, a): whether J's rank stays as low when one coordinate takes values from all over its range."""
    count, a = z.shape
    drawn = search.space.draw(search.rng, count * a * MOVES).reshape(count, a, MOVES, a)
    points = np.tile(z[:, np.newaxis, np.newaxis], (1, a, MOVES, 1))
    for j in range(a):
        points[:, j, :, j] = drawn[:, j, :, j]
    stays = stay_singular(search, points.reshape(-1, a), np.repeat(rank, a * MOVES))
    return np.asarray(np.all(stays.reshape(count, a, MOVES), axis=2))


def stay_singular(search: Search, z: Array, rank: Integers) -> Flags:
    """Whether points z (N, a) have no more rank than `rank` (N,), or get there by a motion of ROUNDED.

    So that a file that writes pi/2 as 1.5708 has the families of the robot that was meant. Points without a
    J do not count: they stay.
    """
    stay = search.ranks(z) <= rank
    _, ratio = search.sigma(z)
    near = np.flatnonzero(~stay & (ratio < 10.0 * ROUNDED))
    if len(near):
        mended, _ = descend(search, z[near], iterations=8)
        close = np.max(np.abs(mended - search.space.clip(z[near])), axis=1, initial=0.0) < ROUNDED
        stay[near] = close & (search.ranks(mended) <= rank[near])
    return np.asarray(stay | ~np.isfinite(ratio))


def shaken(search: Search, z: Array, size: float = SHAKE) -> Array:
    """Singular points (N, a) beside z (N, a): moved at random, then brought back; where it fails, z."""
    moved, ratio = descend(search, z + search.rng.uniform(-size, size, z.shape), iterations=30)
    good = (ratio <= search.tolerance) & (np.max(np.abs(moved - z), axis=1, initial=0.0) < 6.0 * size)
    return np.asarray(np.where(good[:, np.newaxis], moved, z))


def tangents(search: Search, z: Array, rank: int) -> Array:
    """Orthonormal tangents (dimension, a) of the singular set at z (a,).

    The slopes of the equations tell, unless they vanish although the set is thinner (where σ touches zero as
    a square does): singular points close by tell that.
    """
    a = len(z)
    normals = normal_spaces(search, z[np.newaxis], search.measure.full_rank - rank)[0]
    by_slopes = null_space(normals, len(normals))
    beside = z + BESIDE * search.rng.standard_normal((2 * a + 4, a))
    around, ratio = descend(search, beside, iterations=30)
    D = around[(ratio <= search.tolerance) & (np.max(np.abs(around - z), axis=1) < 10.0 * BESIDE)] - z
    if len(D) < a:
        return by_slopes
    _, sizes, rows = np.linalg.svd(D)
    extended = rows[: int(np.sum(sizes > 0.1 * BESIDE * np.sqrt(len(D))))]
    return extended if len(extended) < len(by_slopes) else by_slopes


def walk(search: Search, z: Array, rank: int, along: Array) -> Array:
    """Points (N, a) of the same piece of the singular set, z (a,) first, by random steps on its tangents.

    A point that had to come far back to the set, or where the set stands in another direction, may lie on
    another piece and is left out.
    """
    normals = normal_spaces(search, z[np.newaxis], search.measure.full_rank - rank)[0]
    complete = len(normals) == len(z) - len(along)  # else slopes do not tell the tangents; only z has them
    found = [z[np.newaxis]]
    walkers, directions = np.tile(z, (WALKERS, 1)), [along] * WALKERS
    for _ in range(ROUNDS):
        mixes = search.rng.standard_normal((len(walkers), len(along)))
        sizes = np.maximum(np.linalg.norm(mixes, axis=1), 1e-300)
        mixes *= (search.rng.uniform(*STEPS, len(mixes)) / sizes)[:, np.newaxis]
        step = np.array([mix @ own for mix, own in zip(mixes, directions, strict=True)])
        landed, ratio = descend(search, walkers + step, iterations=30)
        back = np.linalg.norm(landed - search.space.clip(walkers + step), axis=1)
        stays = (ratio <= search.tolerance) & (back <= RETURN * np.linalg.norm(step, axis=1))
        stays[stays] = search.ranks(landed[stays]) == rank
        walkers = landed[stays]
        directions = [own for own, ok in zip(directions, stays, strict=True) if ok]
        if complete and len(walkers):
            spaces = normal_spaces(search, walkers, search.measure.full_rank - rank)
            same = [_same_piece(*pair, len(normals)) for pair in zip(spaces, directions, strict=True)]
            walkers = walkers[same]
            directions = [null_space(own, len(own)) for own, ok in zip(spaces, same, strict=True) if ok]
        if not len(walkers):
            break
        found.append(walkers)
    return np.concatenate(found)


def _same_piece(normals: Array, along: Array, count: int) -> bool:
    """Whether the normals after a step are as many as before, and about orthogonal to the tangents before."""
    if len(normals) != count or not (count and len(along)):
        return len(normals) == count
    return float(np.linalg.norm(normals @ along.T, 2)) < TURNED
