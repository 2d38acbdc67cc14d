"""Points that lie on curves, put in the order of the curves; and those that stand alone."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from nmm.arrays import Array

#: In cells of the grid: points closer than SAME are one; neighbours on a curve are no farther apart than
#: LINK, also where curves cross and hide each other's minima; a piece shorter than SHORTEST is no curve.
SAME, LINK, SHORTEST = 0.3, 2.6, 3.5
#: A curve turns by less than TURN (a cosine) from one point to the next; a crossing, where it steps on no
#: more than so many points of another curve, it passes straight on.
TURN, STRAIGHT, CROSSING = 0.93, 0.97, 3


def curves_and_points(points: Array) -> tuple[list[Array], Array]:
    """Curves, each (k, 2) in order, and the points (p, 2) that are on none.

    Parameters
    ----------
    points : (N, 2), in cells of the grid on which they were found: a curve has about one a row or column
    """
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
            curves.append(_closed(curve))
    alone = points[free]
    if curves and len(alone):
        # What lies beside a curve is of the curve.
        distance, _ = cKDTree(np.vstack(curves)).query(alone)
        alone = alone[distance > LINK]
    return curves, _apart(alone)


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
    """Points one after the other from `start`, in a direction that turns little at each.

    At a crossing the points may be another curve's already: a few of these are stepped on, straight ahead.
    """
    path, taken, borrowed = [start], {start}, 0
    while borrowed <= CROSSING:
        here = path[-1]
        near = np.array([i for i in neighbours[here] if i not in taken], dtype=np.int64)
        offsets = points[near] - points[here]
        lengths = np.linalg.norm(offsets, axis=1)
        cosines = offsets @ direction / np.where(lengths == 0.0, 1.0, lengths)
        ahead = cosines > np.where(free[near], TURN, STRAIGHT)
        if not ahead.any():
            break
        # The nearest; of two that are as near, the one straight on.
        costs = np.where(ahead, lengths / np.where(ahead, cosines, 1.0) ** 2, np.inf)
        best = int(near[np.argmin(costs)])
        step = (points[best] - points[here]) / lengths[np.argmin(costs)]
        borrowed = 0 if free[best] else borrowed + 1
        path.append(best)
        taken.add(best)
        direction = direction + step
        direction /= np.linalg.norm(direction)
    # Up to the other curve, not along it.
    return path[: len(path) - max(borrowed - 1, 0)]


def _apart(points: Array) -> Array:
    """One of each few points that are the same up to a fraction of a cell."""
    kept: list[Array] = []
    for point in points:
        if all(np.linalg.norm(point - other) > 2.0 * SAME for other in kept):
            kept.append(point)
    return np.array(kept).reshape(-1, 2)


def _closed(curve: Array) -> Array:
    """A loop's curve ends where it began."""
    if len(curve) > 8 and np.linalg.norm(curve[0] - curve[-1]) <= LINK:
        return np.vstack([curve, curve[:1]])
    return curve
