"""Convex outlines of what a figure shows from one side."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.path import Path

from nmm.arrays import Array, Flags


def hull(points: Array) -> Array:
    """The convex hull of points (k, 2), counter-clockwise (Andrew's monotone chain)."""
    ordered = sorted(set(map(tuple, points.tolist())))
    if len(ordered) < 3:
        return points
    chains: list[tuple[float, ...]] = []
    for sequence in (ordered, ordered[::-1]):
        chain: list[tuple[float, ...]] = []
        for point in sequence:
            x, y = point
            while len(chain) > 1:
                (ax, ay), (bx, by) = chain[-2:]
                if (bx - ax) * (y - ay) - (by - ay) * (x - ax) > 0.0:
                    break
                chain.pop()
            chain.append(point)
        chains += chain[:-1]
    return np.array(chains)


def along(edge: Array, count: int) -> Array:
    """So many points on each side of a closed line of corners (k, 2), its ends among them, (count k, 2)."""
    fractions = np.linspace(0.0, 1.0, count)[:, np.newaxis]
    sides = np.roll(edge, -1, axis=0) - edge
    return (edge[:, np.newaxis] + fractions * sides[:, np.newaxis]).reshape(-1, 2)


class Covered:
    """What outlines (k, 2) cover."""

    def __init__(self, shapes: Sequence[Array]) -> None:
        self._shapes = shapes
        starts = np.cumsum([0, *(len(shape) for shape in shapes[:-1])])
        corners = np.vstack([np.zeros((0, 2)), *shapes])
        self._lowest = np.minimum.reduceat(corners, starts) if len(corners) else corners
        self._highest = np.maximum.reduceat(corners, starts) if len(corners) else corners

    def holds(self, points: Array) -> Flags:
        """Which of points (P, 2) lie within one of them, (P,)."""
        inside = np.zeros(len(points), dtype=bool)
        near = (self._lowest <= points.max(axis=0)) & (self._highest >= points.min(axis=0))
        for k in np.flatnonzero(near.all(axis=1)).tolist():
            inside |= Path(self._shapes[k]).contains_points(points)
        return inside
