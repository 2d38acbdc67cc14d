"""Convex outlines of what a figure shows from one side."""

from __future__ import annotations

import numpy as np

from nmm.arrays import Array


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
