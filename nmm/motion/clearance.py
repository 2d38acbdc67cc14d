"""Distances along a run: at its samples and between them, and what was nearest."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from nmm.base.arrays import Array, Integers
from nmm.model.collisions.obstacle import Obstacle, as_passed, shifts
from nmm.model.collisions.scene import Scene
from nmm.model.robots.zero_order_hold import HeldInputs

#: Motion between two distance checks: of the coordinates, m and rad together, and of obstacles, m.
APART = 0.01
#: Most checks between two samples.
LOOKS = 10
#: A distance that is short by no more than this counts as kept, m.
ROUNDING = 1e-6


class Swept(NamedTuple):
    """Distances along N samples: clearance (N,), m, and pairs (N,), the nearest pair, at each sample; between
    and between_pairs (N,), the same up to the next sample; points (N, 6), the two nearest points, m, in world
    axes and the pair's order, NaN where nothing is near; the obstacles as they moved."""

    clearance: Array
    pairs: Integers
    between: Array
    between_pairs: Integers
    points: Array
    obstacles: tuple[Obstacle, ...]

    @property
    def kept(self) -> dict[str, Any]:
        return {
            "clearance": self.clearance,
            "clearance_pairs": self.pairs,
            "clearance_between": self.between,
            "clearance_points": self.points,
            "obstacles": self.obstacles,
        }


def swept(scene: Scene, t: Array, q: Array, u: Array, places: Sequence[Sequence[Any]]) -> Swept:
    """Distances at t (N,), q (N, n), u (N, m), and between if needed; `places`: the obstacles', by sample."""
    obstacles = tuple(
        as_passed(obstacle, t, [at[i] for at in places]) for i, obstacle in enumerate(scene.obstacles)
    )
    with scene.queries.among(obstacles):
        return _swept(scene, t, q, u, obstacles)


def _swept(scene: Scene, t: Array, q: Array, u: Array, obstacles: tuple[Obstacle, ...]) -> Swept:
    queries, held = scene.queries, HeldInputs(scene.robot)
    clearance, points = np.full(len(t), np.inf), np.full((len(t), 6), np.nan)
    pairs: Integers = np.full(len(t), -1)
    for k, (time, place) in enumerate(zip(t, q, strict=True)):
        clearance[k], pairs[k] = queries.nearest(float(time), place)
        if pairs[k] >= 0 and np.any(queries.results[pairs[k], 1:4]):  # no normal: a bound, without points
            points[k] = queries.results[pairs[k], 4:]
    between, between_pairs, shifted = clearance.copy(), pairs.copy(), shifts(obstacles, t)
    for k in range(len(t) - 1):
        dt = float(t[k + 1] - t[k])
        ends = min(clearance[k], clearance[k + 1])
        moved = float(np.abs(u[k]).sum()) * dt
        between[k] = ends
        if clearance[k + 1] < clearance[k]:
            between_pairs[k] = pairs[k + 1]
        if ends - scene.distance > moved * max(1.0, scene.robot.reach) + shifted[k]:
            continue
        # The arc that held inputs make, and what the integrator made otherwise, by and by.
        astray = q[k + 1] - held(q[k], u[k], dt)
        looks = min(LOOKS, max(1, int(np.ceil((moved + shifted[k]) / APART))))
        for i in range(1, looks + 1):
            share = (i - 0.5) / looks
            ahead = held(q[k], u[k], share * dt) + share * astray
            d, pair = queries.nearest(float(t[k]) + share * dt, ahead)
            if d < between[k]:
                between[k], between_pairs[k] = d, pair
    return Swept(clearance, pairs, between, between_pairs, points, obstacles)
