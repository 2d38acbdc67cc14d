"""A wall with a door of 0.9 m at x = 2 m, as a scanner sees it and as it is."""

from __future__ import annotations

import numpy as np

import nmm
from nmm.base.arrays import Array


def door(count: int, seed: int) -> Array:
    """About so many points on both of its faces and on the door's, off by 3 mm, (N, 3), m."""
    rng = np.random.default_rng(seed)
    faces = rng.uniform([0.0, -2.0, 0.0], [0.0, 2.0, 2.0], (2 * count, 3))
    faces[:, 0] = np.where(rng.integers(0, 2, len(faces)) == 0, 1.95, 2.05)
    jambs = rng.uniform([1.95, 0.0, 0.0], [2.05, 0.0, 2.0], (count // 10, 3))
    jambs[:, 1] = np.where(rng.integers(0, 2, len(jambs)) == 0, -0.45, 0.45)
    points = np.vstack([faces[np.abs(faces[:, 1]) > 0.45][:count], jambs])
    return points + rng.normal(0.0, 0.003, points.shape)


def walls(thick: float = 0.1) -> list[nmm.Obstacle]:
    """The true walls."""
    box = nmm.Box([thick, 1.55, 2.0])
    return [nmm.Obstacle(box, [2.0, side * 1.225, 1.0], name=f"true {side:+d}") for side in (-1, 1)]
