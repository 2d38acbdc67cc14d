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

from nmm.analysis.maps.lines import curves_and_points
from nmm.analysis.singular.singularity import TOLERANCE
from nmm.arrays import Array, Integers
from nmm.cores import over_cores
from nmm.kernels.spectra import spectra
from nmm.progress import Progress

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
    >>> found = nmm.analysis.singularity_map((robot, nmm.Position("ee", "xy")), samples=20, part="arm")
    >>> isinstance(found.singular, nmm.analysis.SingularSet), found.singular.text()
    (True, 'lines')
    """

    lines: tuple[Array, ...] = ()
    points: Array = field(default_factory=lambda: np.zeros((0, 2)))
    everywhere: bool = False

    @property
    def empty(self) -> bool:
        """Whether no singularity was found."""
        return not (self.lines or len(self.points) or self.everywhere)

    def text(self) -> str:
        """In words: "lines, 1 point".

        Lines are not counted: those that cross are found in pieces, and the ends of a turn are one place.
        """
        if self.everywhere:
            return "everywhere"
        n = len(self.points)
        counts = ["lines"] * bool(self.lines) + [f"{n} point{'s' * (n > 1)}"] * bool(n)
        return ", ".join(counts) or "none found"


def singular_set(
    J_of: Callable[[Array], Array],
    smallness: Sequence[Array],
    rank: Integers,
    full: int,
    axes: tuple[Array, Array],
    progress: Progress | None = None,
) -> SingularSet:
    """The singular set over two coordinates.

    Parameters
    ----------
    J_of : points (N, 2) of the plane -> J (N, s, m)
    smallness : what comes to zero there, at the grid's nodes, (rows, columns) each: σ_min and w. Beside a
        valley that is much wider, σ_min does not see a narrow one; w does
    rank : at the nodes
    full : the rank of a J that is not singular
    axes : the grid's coordinates, of the columns and of the rows
    """
    if np.all(rank < full):
        if _lost_between(J_of, axes):
            return SingularSet(everywhere=True)
        axes, smallness = _finer(J_of, axes)
    origin = np.array([axes[0][0], axes[1][0]])
    cell = np.array([axes[0][1] - axes[0][0], axes[1][1] - axes[1][0]])
    last = np.array([len(axes[0]) - 1.0, len(axes[1]) - 1.0])
    rows, columns = np.nonzero(np.any([candidates(values) for values in smallness], axis=0))
    start = np.column_stack([columns, rows]).astype(np.float64)
    found = polish(lambda x: J_of(origin + cell * x), start, progress=progress)
    # The ends of a range are in it, whatever the rounding.
    found = found[np.all((found > -1e-6) & (found < last + 1e-6), axis=1)]
    lines, points = curves_and_points(np.clip(found, 0.0, last))
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
    """Nodes (rows, columns) that are lowest along the row or the column, where zero may be near."""
    lower = np.where(np.isnan(values), np.inf, values)
    found = np.zeros(values.shape, dtype=bool)
    for axis in (0, 1):
        before, after = np.full(values.shape, np.inf), np.full(values.shape, np.inf)
        inner, outer = [slice(None)] * 2, [slice(None)] * 2
        inner[axis], outer[axis] = slice(1, None), slice(None, -1)
        before[tuple(inner)], after[tuple(outer)] = lower[tuple(outer)], lower[tuple(inner)]
        higher = np.where(np.isfinite(before), before, after)
        higher = np.maximum(higher, np.where(np.isfinite(after), after, before))
        minimum = (lower <= before) & (lower <= after) & ((lower < before) | (lower < after))
        at_edge = ~(np.isfinite(before) & np.isfinite(after))
        with np.errstate(invalid="ignore"):
            found |= minimum & (at_edge | (lower <= STEEP * (higher - lower))) & np.isfinite(lower)
    return found


def polish(
    J_of: Callable[[Array], Array],
    start: Array,
    farthest: float = FARTHEST,
    steps: int = STEPS,
    progress: Progress | None = None,
) -> Array:
    """The singular points (k, d) to which Gauss-Newton steps lead from `start` (N, d).

    Parameters
    ----------
    J_of : points (N, d) -> J (N, s, m); not a number where there is none
    start : in units of which a step takes at most one
    farthest, steps : a point that goes farther from its start, or needs more steps, is given up
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
        if not len(going):
            break
        U, values, Vt = np.linalg.svd(J, full_matrices=False)
        singular = values[:, -1] <= TOLERANCE * values[:, 0]
        done[going[singular]] = True
        on = ~singular
        going, J, U, values, Vt = going[on], J[on], U[on], values[on], Vt[on]
        if not len(going):
            break
        here = x[going]
        best, best_J, best_volume = here.copy(), J, np.prod(values, axis=1)
        for step in _steps(J_of, here, U, values, Vt):
            length = np.linalg.norm(step, axis=1)
            shorter = np.minimum(1.0, reach[going] / np.where(length == 0.0, 1.0, length))
            trial = here + step * shorter[:, np.newaxis]
            J_trial = J_of(trial)
            volume = np.prod(spectra(J_trial), axis=1)
            better = volume < best_volume  # not where there is no J
            best[better], best_J[better], best_volume[better] = trial[better], J_trial[better], volume[better]
        moved = np.linalg.norm(best - here, axis=1)
        x[going], J = best, best_J
        reach[going] = np.where(moved == 0.0, 0.25 * reach[going], reach[going])
        near = np.linalg.norm(x[going] - start[going], axis=1) <= farthest
        keep = near & (reach[going] > 1e-9)
        going, J = going[keep], J[keep]
    return x[done]


def _steps(J_of: Callable[[Array], Array], x: Array, U: Array, values: Array, Vt: Array) -> Array:
    """The shortest steps (2, N, d) to where uᵀJ is zero to first order, as a whole and in its leading part.

    u belongs to the singular value that would be zero first along its own gradient. The other singular
    vectors turn so that they take their own part of uᵀ dJ; only what is outside them counts. A point needs
    the whole of that. On the way to a curve what is not the leading part tells only how the curve bends, and
    a step that heeds it goes astray.
    """
    ways = STEP * np.eye(x.shape[1])
    beside = np.concatenate([*(x + way for way in ways), *(x - way for way in ways)])
    ahead, behind = J_of(beside).reshape(2, len(ways), *U.shape[:2], -1)
    rates = np.nan_to_num(np.stack(list((ahead - behind) / (2.0 * STEP)), axis=-1))  # (N, s, m, d)
    found = np.empty((2, *x.shape))

    def write(first: int, last: int) -> None:
        some = slice(first, last)
        found[:, some] = _shortest(rates[some], U[some], values[some], Vt[some])

    over_cores(len(x), AT_ONCE, lambda: write)
    return found


def _shortest(rates: Array, U: Array, values: Array, Vt: Array) -> Array:
    """These steps, from dJ (N, s, m, d)."""
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
