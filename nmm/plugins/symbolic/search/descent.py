"""Down to a singular configuration: damped Gauss-Newton on Wᵀ J V = 0, many starts in step. And what the
singular set is like at one of its points: which coordinates are free, its tangents, and walks along them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import Bounds, minimize

from nmm.analysis.singular.parts import null_space
from nmm.base.arrays import Array, Flags, Integers
from nmm.base.progress import Progress
from nmm.plugins.symbolic.search.space import ROUNDING, SearchSpace

#: So many of the lowest ends are followed to the bottom.
FOLLOWED = 3
#: Below this beside the largest, σ_min may well be meant to be zero.
NEARLY = 1e-4


@dataclass(frozen=True, eq=False)
class LocalMinimum:
    """A configuration beside which σ_min does not get smaller, and is not zero.

    Attributes
    ----------
    q (n,) : m and rad
    sigma_min : smallest singular value, in the sizes of the search
    ratio : beside the largest of the whole J

    Examples
    --------
    >>> robot = nmm.load("unicycle_2r")
    >>> search = nmm.analysis.find_singularities((robot, nmm.Position("ee", "xy")), starts=40)
    >>> round(search.smallest.sigma_min, 3)
    0.212
    """

    q: Array
    sigma_min: float
    ratio: float

    @property
    def text(self) -> str:
        """One line."""
        text = (
            f"smallest σ_min at a local minimum that is not singular: {self.sigma_min:.4g} "
            f"({self.ratio:.2g} of the largest)"
        )
        if self.ratio < NEARLY:
            text += (
                "; nearly singular, as where a file writes pi/2 as 1.5708, or beside a target: a larger "
                "tolerance counts it as singular"
            )
        return text


def followed(search: SearchSpace, z: Array) -> Array:
    """The lowest of the ends z (N, a), each brought to its minimum of σ, (FOLLOWED or fewer, a)."""
    if not len(z) or not len(search.axes):
        return z[:FOLLOWED]
    sigma, _ = search.sigma(z)
    order = np.argsort(sigma, kind="stable")
    order = order[np.isfinite(sigma[order])][:FOLLOWED]
    return np.array([_bottom(search, z[i]) for i in order]).reshape(-1, z.shape[1])


def _bottom(search: SearchSpace, z: Array) -> Array:
    def sigma(point: Array) -> tuple[float, Array]:
        _, C, values = search.equations(point[np.newaxis], corank=1)
        return float(values[0, -1]), C[0, 0]

    lowest = minimize(
        sigma, z, jac=True, method="L-BFGS-B", bounds=Bounds(*search.bounds),
        options={"gtol": 1e-9, "ftol": 1e-14},
    ).x  # fmt: skip
    both = np.array([z, lowest])
    return np.asarray(both[np.argmin(search.sigma(both)[0])])


def lowest(search: SearchSpace, z: Array) -> LocalMinimum | None:
    """Of points z (N, a) that with the smallest σ; None without points."""
    if not len(z):
        return None
    sigma, ratio = search.sigma(z)
    best = int(np.argmin(sigma))
    if not np.isfinite(sigma[best]):
        return None
    return LocalMinimum(search.fold(search.q(z)[best]), float(sigma[best]), float(ratio[best]))


#: Lengths of a step that are tried.
FACTORS = np.array([1.0, 0.5, 0.2, 0.04])
#: And where σ falls slowly: exact where it touches zero as a square does. Elsewhere it would lead to the
#: places where pieces of the singular set meet.
DOUBLE = 2.0
#: Relative decreases of σ below this are no progress; so many in a row end a start.
LITTLE, PATIENCE = 1e-3, 4
#: Slopes this small beside the largest are the differences' rounding.
NOISE = 1e-8
#: Two singular values within this factor may be on their way to zero together; where σ alone falls slower
#: than by this in a step, both are asked to.
TOGETHER, SLOW = 20.0, 0.3


def _minimum_norm_step(search: SearchSpace, z: Array, corank: int, damping: Array) -> tuple[Array, Array]:
    """-Cᵀ (C Cᵀ + damping |F|²)⁻¹ F, (N, a), inside the bounds, and the singular values.

    The damping falls with σ², so that convergence stays quadratic.
    """
    F, C, values = search.equations(z, corank)
    damping = damping * np.sum(F**2, axis=1)

    def step(usable: Flags) -> Array:
        left, sizes, right = np.linalg.svd(C * usable[:, np.newaxis], full_matrices=False)
        gain = sizes / np.maximum(sizes**2 + damping[:, np.newaxis], 1e-300)
        gain[sizes <= NOISE * np.max(sizes, axis=1, initial=0.0)[:, np.newaxis]] = 0.0
        along = gain * (np.swapaxes(left, 1, 2) @ F[..., np.newaxis])[..., 0]
        return -(np.swapaxes(right, 1, 2) @ along[..., np.newaxis])[..., 0]

    return search.step(z, step), values


def descend(
    search: SearchSpace, z: Array, *, iterations: int = 60, progress: Progress | None = None
) -> tuple[Array, Array]:
    """Local minima of σ from z (N, a): end points (N, a), and σ beside the largest (N,). σ never grows."""
    z = search.clip(z)
    sigma, ratio = search.sigma(z)
    damping = np.ones(len(z))
    waited = np.zeros(len(z), dtype=np.int64)
    slow = np.zeros(len(z), dtype=bool)
    for iteration in range(iterations):
        live = np.flatnonzero((ratio > ROUNDING) & (waited < PATIENCE) & np.isfinite(ratio))
        if not len(live) or not len(search.axes):
            break
        trials = _trials(search, z[live], damping[live], slow[live])
        count = trials.shape[1]
        tried, ratios = search.sigma(trials.reshape(-1, trials.shape[2]))
        tried, ratios = tried.reshape(-1, count), ratios.reshape(-1, count)
        best = np.argmin(tried, axis=1)
        row = np.arange(len(live))
        value = tried[row, best]
        better = value < sigma[live]
        slow[live] = value > SLOW * sigma[live]
        progressed = value < (1.0 - LITTLE) * sigma[live]
        waited[live] = np.where(progressed, 0, waited[live] + 1)
        damping[live] *= np.where(~better, 10.0, np.where(best == 0, 0.2, 1.0))
        chosen = live[better]
        z[chosen] = trials[row, best][better]
        sigma[chosen], ratio[chosen] = value[better], ratios[row, best][better]
        if progress is not None:
            progress((iteration + 1) / iterations)
    return z, ratio


def _trials(search: SearchSpace, z: Array, damping: Array, slow: Flags) -> Array:
    """Points (N, tries, a): towards one singular value at zero, and towards two where two fall slowly."""
    step, values = _minimum_norm_step(search, z, 1, damping)
    steps = step[:, np.newaxis] * FACTORS[:, np.newaxis]
    longer = np.where(slow, DOUBLE, 0.7)[:, np.newaxis, np.newaxis] * step[:, np.newaxis]
    steps = np.concatenate([steps, longer], axis=1)
    if search.measure.full_rank > 1:
        twin = np.flatnonzero(slow & (values[:, -2] < TOGETHER * values[:, -1]))
        second = np.tile(step[:, np.newaxis] * 1.5, (1, 2, 1))
        if len(twin):
            both, _ = _minimum_norm_step(search, z[twin], 2, damping[twin])
            second[twin] = both[:, np.newaxis] * np.array([[1.0], [0.3]])
        steps = np.concatenate([steps, second], axis=1)
    return search.clip(z[:, np.newaxis] + steps)


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
    """Singular points z (N, a): rank of J, free coordinates, and number of independent slopes."""

    z: Array
    rank: Integers
    free: Flags
    codimension: Integers

    def signature(self, i: int) -> tuple[int, int, tuple[bool, ...]]:
        """A sorting key, the same at all points of a family; the largest families come first."""
        return int(self.codimension[i]), int(self.rank[i]), tuple(bool(flag) for flag in self.free[i])


def localised(search: SearchSpace, z: Array) -> Local:
    """What the singular set is like at its points z (N, a)."""
    rank = search.ranks(z)
    corank = search.measure.full_rank - rank
    codimension = np.zeros(len(z), dtype=np.int64)
    for lost in set(corank.tolist()) - {0}:
        of = np.flatnonzero(corank == lost)
        codimension[of] = [len(normals) for normals in normal_spaces(search, z[of], lost)]
    return Local(z, rank, free_coordinates(search, z, rank), codimension)


def normal_spaces(search: SearchSpace, z: Array, corank: int) -> list[Array]:
    """Orthonormal rows of each point's slopes, (codimension, a)."""
    _, C, values = search.equations(z, corank)
    _, sizes, rows = np.linalg.svd(C, full_matrices=False)
    return [
        own[size > FLAT * max(float(largest), 1e-300)]
        for own, size, largest in zip(rows, sizes, values[:, 0], strict=True)
    ]


def free_coordinates(search: SearchSpace, z: Array, rank: Integers) -> Flags:
    """(N, a): whether J's rank stays as low when one coordinate takes values from all over its range."""
    count, a = z.shape
    drawn = search.draw(count * a * MOVES).reshape(count, a, MOVES, a)
    points = np.tile(z[:, np.newaxis, np.newaxis], (1, a, MOVES, 1))
    for j in range(a):
        points[:, j, :, j] = drawn[:, j, :, j]
    stays = stay_singular(search, points.reshape(-1, a), np.repeat(rank, a * MOVES))
    return np.asarray(np.all(stays.reshape(count, a, MOVES), axis=2))


def stay_singular(search: SearchSpace, z: Array, rank: Integers) -> Flags:
    """Whether points z (N, a) have rank at most `rank` (N,), or reach it by a motion of ROUNDED.

    So 1.5708 in a file counts as π/2. What has no J stays.
    """
    stay = search.ranks(z) <= rank
    _, ratio = search.sigma(z)
    near = np.flatnonzero(~stay & (ratio < 10.0 * ROUNDED))
    if len(near):
        mended, _ = descend(search, z[near], iterations=8)
        close = np.max(np.abs(mended - search.clip(z[near])), axis=1, initial=0.0) < ROUNDED
        stay[near] = close & (search.ranks(mended) <= rank[near])
    return np.asarray(stay | ~np.isfinite(ratio))


def shaken(search: SearchSpace, z: Array, size: float = SHAKE) -> Array:
    """Singular points (N, a) beside z (N, a): moved at random, then brought back; where it fails, z."""
    moved, ratio = descend(search, z + search.rng.uniform(-size, size, z.shape), iterations=30)
    good = (ratio <= search.tolerance) & (np.max(np.abs(moved - z), axis=1, initial=0.0) < 6.0 * size)
    return np.asarray(np.where(good[:, np.newaxis], moved, z))


def tangents(search: SearchSpace, z: Array, rank: int) -> Array:
    """Orthonormal tangents (dimension, a) of the singular set at z (a,).

    Given by the equations' slopes; where these vanish (σ touches zero as a square), by close points.
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


def walk(search: SearchSpace, z: Array, rank: int, along: Array) -> Array:
    """Points (N, a) of one piece of the singular set, z (a,) first, by random steps along its tangents.

    Points that return from far, or where the tangents turn much, may lie on another piece and are dropped.
    """
    normals = normal_spaces(search, z[np.newaxis], search.measure.full_rank - rank)[0]
    complete = len(normals) == len(z) - len(along)  # else slopes do not tell the tangents; only z has them
    points = [z[np.newaxis]]
    walkers, directions = np.tile(z, (WALKERS, 1)), [along] * WALKERS
    for _ in range(ROUNDS):
        mixes = search.rng.standard_normal((len(walkers), len(along)))
        sizes = np.maximum(np.linalg.norm(mixes, axis=1), 1e-300)
        mixes *= (search.rng.uniform(*STEPS, len(mixes)) / sizes)[:, np.newaxis]
        step = np.array([mix @ own for mix, own in zip(mixes, directions, strict=True)])
        landed, ratio = descend(search, walkers + step, iterations=30)
        back = np.linalg.norm(landed - search.clip(walkers + step), axis=1)
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
        points.append(walkers)
    return np.concatenate(points)


def _same_piece(normals: Array, along: Array, count: int) -> bool:
    """Whether the normals after a step are as many as before, and about orthogonal to the tangents before."""
    if len(normals) != count or not (count and len(along)):
        return len(normals) == count
    return float(np.linalg.norm(normals @ along.T, 2)) < TURNED
