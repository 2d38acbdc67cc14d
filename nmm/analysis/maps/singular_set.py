"""Where J loses rank, exactly: candidates made singular by Gauss-Newton steps, all at once.

A minimum of σ_min or of w = sqrt(det J Jᵀ) on a grid is singular or just small; only steps on from it can
tell. With u the left singular vector of a singular value that goes to zero, singular means uᵀJ = 0, which has
one equation a direction of the inputs that the other s - 1 singular vectors do not use: for a square J one,
that of the determinant (curves in a plane); for a redundant one more (points in a plane, if not all of them
vanish together). The steps of least norm that solve them need not know which of the two it is, nor whether
the determinant changes its sign. So a range's end that is singular is found too.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.spatial import cKDTree

from nmm.analysis.singular.singularity import TOLERANCE
from nmm.base.arrays import Array, Integers
from nmm.base.cores import over_cores
from nmm.base.kernels.spectra import spectra
from nmm.base.progress import Progress

#: Central differences, in cells of the grid.
STEP = 1e-4
#: A candidate may wander so far, in cells, in so many steps: to the singularity beside it, to no other.
FARTHEST, STEPS = 2.5, 40
#: A minimum whose value is this many times what its neighbours are above it is far from zero.
STEEP = 4.0
#: So many points' steps are found at a time.
AT_ONCE = 128
#: Where all nodes are singular, so many places between them tell whether all the plane is; if not, curves run
#: as regularly as the nodes, and are searched on a grid of at least so many nodes along each axis.
BETWEEN, FINEST = 16, 41


@dataclass(frozen=True, eq=False)
class SingularSet:
    """Where the rank is below that of the task, in the map's plane.

    Attributes
    ----------
    lines : curves, each (k, 2), in the axes' units
    points (p, 2) : singular points that are on no curve
    everywhere : the rank is lost at each node of the map and at places drawn between them; lines and points
        are then empty

    Examples
    --------
    >>> robot = nmm.load("unicycle_2r")
    >>> result = nmm.analysis.singularity_map((robot, nmm.Position("ee", "xy")), samples=20, part="arm")
    >>> isinstance(result.singular, nmm.analysis.SingularSet), result.singular.text()
    (True, 'lines')
    """

    lines: tuple[Array, ...] = ()
    points: Array = field(default_factory=lambda: np.zeros((0, 2)))
    everywhere: bool = False

    @property
    def empty(self) -> bool:
        """Whether no singularity was found."""
        return not (self.lines or len(self.points) or self.everywhere)

    @property
    def kinds(self) -> list[str]:
        """What it consists of: "lines", "point" or "points"."""
        points = ["point" if len(self.points) == 1 else "points"] if len(self.points) else []
        return [*(["lines"] if self.lines else []), *points]

    def text(self) -> str:
        """In words: "lines, 1 point".

        Lines are not counted: those that cross are found in pieces, and the ends of a turn are one place.
        """
        if self.everywhere:
            return "everywhere"
        counts = [kind if kind == "lines" else f"{len(self.points)} {kind}" for kind in self.kinds]
        return ", ".join(counts) or "none found"


def singular_set(
    J_of: Callable[[Array], Array],
    smallness: Sequence[Array],
    rank: Integers,
    full: int,
    axes: tuple[Array, Array],
    progress: Progress | None = None,
) -> SingularSet:
    """The singular set over two coordinates, `axes` of a grid; J_of : points (N, 2) -> J (N, s, m).

    smallness : σ_min and w, at the nodes (rows, columns): w reveals narrow valleys that σ_min misses
    """
    if np.all(rank < full):
        if _lost_between(J_of, axes):
            return SingularSet(everywhere=True)
        axes, smallness = _finer(J_of, axes)
    origin = np.array([axis[0] for axis in axes])
    cell = np.array([axis[1] - axis[0] for axis in axes])
    last = np.array([len(axis) - 1.0 for axis in axes])
    rows, columns = np.nonzero(np.any([candidates(values) for values in smallness], axis=0))
    start = np.column_stack([columns, rows]).astype(np.float64)
    singular = polish(lambda x: J_of(origin + cell * x), start, progress=progress)
    # The ends of a range are in it, whatever the rounding.
    singular = singular[np.all((singular > -1e-6) & (singular < last + 1e-6), axis=1)]
    lines, points = curves_and_points(np.clip(singular, 0.0, last))
    return SingularSet(tuple(origin + cell * line for line in lines), origin + cell * points)


def _lost_between(J_of: Callable[[Array], Array], axes: tuple[Array, Array]) -> bool:
    """Whether the rank is lost at some places between the nodes, too: nodes alone may all be on curves."""
    lower, upper = np.array([[axis[0], axis[-1]] for axis in axes]).T
    J = J_of(np.random.default_rng(2006).uniform(lower, upper, (BETWEEN, 2)))
    if J.shape[1] > J.shape[2]:
        return True
    values = np.linalg.svd(J[np.isfinite(J).all(axis=(1, 2))], compute_uv=False)
    return bool(np.all(values[:, -1] <= TOLERANCE * values[:, 0]))


def _finer(
    J_of: Callable[[Array], Array], axes: tuple[Array, Array]
) -> tuple[tuple[Array, Array], list[Array]]:
    """Axes with more nodes, at least twice as many, and σ_min and w there."""
    columns, rows = (np.linspace(axis[0], axis[-1], max(FINEST, 2 * len(axis))) for axis in axes)
    J = J_of(np.stack(np.meshgrid(columns, rows), axis=-1).reshape(-1, 2))
    values = spectra(J)
    shape = len(rows), len(columns)
    return (columns, rows), [values[:, -1].reshape(shape), np.prod(values, axis=1).reshape(shape)]


def candidates(values: Array) -> Array:
    """Nodes (rows, columns) that are minima along their row or column, where zero may be near."""
    lower = np.where(np.isnan(values), np.inf, values)
    lowest = np.zeros(values.shape, dtype=bool)
    for axis in (0, 1):
        around = np.pad(lower, [(1, 1) if k == axis else (0, 0) for k in (0, 1)], constant_values=np.inf)
        count = values.shape[axis]
        before, after = (around.take(range(first, first + count), axis) for first in (0, 2))
        higher = np.maximum(
            np.where(np.isfinite(before), before, after), np.where(np.isfinite(after), after, before)
        )
        minimum = (lower <= before) & (lower <= after) & ((lower < before) | (lower < after))
        at_edge = ~(np.isfinite(before) & np.isfinite(after))
        with np.errstate(invalid="ignore"):
            lowest |= minimum & (at_edge | (lower <= STEEP * (higher - lower))) & np.isfinite(lower)
    return lowest


def polish(
    J_of: Callable[[Array], Array],
    start: Array,
    farthest: float = FARTHEST,
    steps: int = STEPS,
    progress: Progress | None = None,
) -> Array:
    """The singular points (k, d) to which Gauss-Newton steps of length up to 1 lead from `start` (N, d).

    Points that move beyond `farthest` or need more than `steps` steps are dropped; J_of may give NaN.
    """
    x, done = start.copy(), np.zeros(len(start), dtype=bool)
    going = np.arange(len(start))
    J = J_of(x) if len(x) else np.zeros((0, 1, 1))
    reach = np.ones(len(start))
    for k in range(steps):
        if progress is not None:
            # Each step is of the points still on their way, which soon are few.
            progress(max(k / steps, 1.0 - len(going) / len(start)) if len(start) else 1.0)
        alive = np.isfinite(J).all(axis=(1, 2))
        going, J = going[alive], J[alive]
        U, values, Vt = np.linalg.svd(J, full_matrices=False)
        singular = values[:, -1] <= TOLERANCE * values[:, 0]
        done[going[singular]] = True
        on = ~singular
        going, J, U, values, Vt = going[on], J[on], U[on], values[on], Vt[on]
        if not len(going):
            break
        current = x[going]
        best, best_J, best_volume = current.copy(), J, np.prod(values, axis=1)
        for step in _steps(J_of, current, U, values, Vt):
            length = np.linalg.norm(step, axis=1)
            shorter = np.minimum(1.0, reach[going] / np.where(length == 0.0, 1.0, length))
            trial = current + step * shorter[:, np.newaxis]
            J_trial = J_of(trial)
            volume = np.prod(spectra(J_trial), axis=1)
            better = volume < best_volume  # not where there is no J
            best[better], best_J[better], best_volume[better] = trial[better], J_trial[better], volume[better]
        moved = np.linalg.norm(best - current, axis=1)
        x[going], J = best, best_J
        reach[going] = np.where(moved == 0.0, 0.25 * reach[going], reach[going])
        near = np.linalg.norm(x[going] - start[going], axis=1) <= farthest
        keep = near & (reach[going] > 1e-9)
        going, J = going[keep], J[keep]
    return x[done]


def _steps(J_of: Callable[[Array], Array], x: Array, U: Array, values: Array, Vt: Array) -> Array:
    """The shortest steps (2, N, d) to where uᵀJ is zero to first order, as a whole and in its leading part.

    u belongs to the singular value that reaches zero first along its gradient; the other singular vectors
    turn with it, so only what lies outside them counts. Singular points need all of uᵀJ; on the way to a
    curve, the remaining part only describes the curve's bending, and would lead the step astray.
    """
    ways = STEP * np.eye(x.shape[1])
    beside = np.concatenate([*(x + way for way in ways), *(x - way for way in ways)])
    ahead, behind = J_of(beside).reshape(2, len(ways), *U.shape[:2], -1)
    rates = np.nan_to_num(np.stack(list((ahead - behind) / (2.0 * STEP)), axis=-1))  # (N, s, m, d)
    steps = np.empty((2, *x.shape))

    def write(first: int, last: int) -> None:
        some = slice(first, last)
        steps[:, some] = _shortest(rates[some], U[some], values[some], Vt[some])

    over_cores(len(x), AT_ONCE, lambda: write)
    return steps


def _shortest(rates: Array, U: Array, values: Array, Vt: Array) -> Array:
    turned = np.einsum("nai,najk->nijk", U, rates)
    gradients = np.einsum("nijk,nij->nik", turned, Vt)
    steepness = np.linalg.norm(gradients, axis=2)
    distance = np.where(steepness > 0.0, values / np.where(steepness > 0.0, steepness, 1.0), np.inf)
    own = np.argmin(distance, axis=1)
    every = np.arange(len(rates))
    rate = turned[every, own]
    others = Vt.copy()
    others[every, own] = 0.0
    rate = rate - np.einsum("nij,nik->njk", others, np.einsum("nij,njk->nik", others, rate))
    residual = values[every, own, np.newaxis] * Vt[every, own]
    ways = [np.linalg.pinv(rate, rcond=rcond) for rcond in (1e-5, 0.99)]
    return np.array([-np.einsum("ndm,nm->nd", way, residual) for way in ways])


#: In cells of the grid: points closer than SAME are one; neighbours on a curve are no farther apart than
#: LINK, also where curves cross and hide each other's minima; a piece shorter than SHORTEST is no curve.
SAME, LINK, SHORTEST = 0.3, 2.6, 3.5
#: A curve turns by less than TURN (a cosine) from one point to the next; a crossing, where it steps on no
#: more than so many points of another curve, it passes straight on.
TURN, STRAIGHT, CROSSING = 0.93, 0.97, 3


def curves_and_points(points: Array) -> tuple[list[Array], Array]:
    """Curves, each (k, 2) in order, and isolated points (p, 2), of points (N, 2) in cells of their grid."""
    if not len(points):
        return [], np.zeros((0, 2))
    _, first = np.unique(np.round(points / SAME).astype(np.int64), axis=0, return_index=True)
    points = points[np.sort(first)]
    tree = cKDTree(points)
    neighbours = [np.array(near) for near in tree.query_ball_point(points, LINK)]
    free = np.ones(len(points), dtype=bool)
    curves: list[Array] = []
    # The straightest pieces first: there is no doubt how a curve runs there.
    straightness, directions = _tangents(points, neighbours)
    for start in np.argsort(-straightness, kind="stable"):
        if not free[start]:
            continue
        forth = _walk(points, neighbours, free, int(start), directions[start])
        taken = free.copy()
        taken[forth] = False
        back = _walk(points, neighbours, taken, int(start), -directions[start])
        path = [*reversed(back[1:]), *forth]
        curve = points[path]
        if float(np.ptp(curve, axis=0).max()) >= SHORTEST:
            free[path] = False
            loop = len(curve) > 8 and np.linalg.norm(curve[0] - curve[-1]) <= LINK
            curves.append(np.vstack([curve, curve[:1]]) if loop else curve)
    alone = points[free]
    if curves and len(alone):
        # Points beside a curve belong to it.
        distance, _ = cKDTree(np.vstack(curves)).query(alone)
        alone = alone[distance > LINK]
    isolated = np.zeros((0, 2))
    for point in alone:  # one of each few that are the same up to a fraction of a cell
        if np.all(np.linalg.norm(isolated - point, axis=1) > 2.0 * SAME):
            isolated = np.vstack([isolated, point])
    return curves, isolated


def _tangents(points: Array, neighbours: list[Array]) -> tuple[Array, Array]:
    """How straight the points lie around each (N,), from 0 to 1, and in what direction (N, 2)."""
    straightness, directions = np.zeros(len(points)), np.zeros((len(points), 2))
    for i, near in enumerate(neighbours):
        offsets = points[near] - points[i]
        values, vectors = np.linalg.eigh(offsets.T @ offsets)
        if values[1] > 0.0:
            straightness[i], directions[i] = 1.0 - values[0] / values[1], vectors[:, 1]
    return straightness, directions


def _walk(points: Array, neighbours: list[Array], free: Array, start: int, direction: Array) -> list[int]:
    """Successive points from `start`, turning little; at a crossing, up to CROSSING of another curve."""
    path, taken, borrowed = [start], {start}, 0
    while borrowed <= CROSSING:
        current = path[-1]
        near = np.array([i for i in neighbours[current] if i not in taken], dtype=np.int64)
        offsets = points[near] - points[current]
        lengths = np.linalg.norm(offsets, axis=1)
        cosines = offsets @ direction / np.where(lengths == 0.0, 1.0, lengths)
        ahead = cosines > np.where(free[near], TURN, STRAIGHT)
        if not ahead.any():
            break
        # The nearest; of two that are as near, the one straight on.
        costs = np.where(ahead, lengths / np.where(ahead, cosines, 1.0) ** 2, np.inf)
        best = int(near[np.argmin(costs)])
        step = (points[best] - points[current]) / lengths[np.argmin(costs)]
        borrowed = 0 if free[best] else borrowed + 1
        path.append(best)
        taken.add(best)
        direction = direction + step
        direction /= np.linalg.norm(direction)
    # Up to the other curve, not along it.
    return path[: len(path) - max(borrowed - 1, 0)]
