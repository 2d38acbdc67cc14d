"""Distances as rows, compiled: d, ∂d/∂q = n·(Jp2 - Jp1) and ∂d/∂t of near pairs."""

import math
from typing import NamedTuple

import numpy as np

from nmm.base.arrays import Array
from nmm.base.kernels.compiled import compiled, scratch
from nmm.base.kernels.record_layout import (
    IntegerCell,
    SampledIntegerCell,
    SampledIntegerVector,
    SampledMatrix,
    SampledVector,
)
from nmm.model.collisions.broad_phase import PairArrays, to_world


class DistanceRows(NamedTuple):
    """K rows of distances, of which `used` () are; at most `most` () of them are written here.

    pair (K,) : its number; d (K,), m; d_q (K, n); d_t (K,), m/s
    points (K, 9) : the nearest points of both shapes and the normal from the first to the second, world, m
    element (K, 3) : of sensed obstacles, the middle of the nearest ball or the nearest point of a box, in
        their axes; edition (K,) : of these, 0 for none
    """

    used: SampledIntegerCell
    most: IntegerCell
    pair: SampledIntegerVector
    d: SampledVector
    d_q: SampledMatrix
    d_t: SampledVector
    points: SampledMatrix
    element: SampledMatrix
    edition: SampledIntegerVector


@compiled
def write_row(scene: PairArrays, J: Array, places: Array, rows: DistanceRows, slot: int) -> None:
    """d, d_q and d_t of a row whose pair and points are there; J (n, 6) : twists about the world's origin."""
    i, j = scene.pairs[rows.pair[slot], 0], scene.pairs[rows.pair[slot], 1]
    x = rows.points[slot]
    n0, n1, n2 = x[6], x[7], x[8]
    rows.d[slot] = n0 * (x[3] - x[0]) + n1 * (x[4] - x[1]) + n2 * (x[5] - x[2])
    # n·(v + ω × p) = n·v + ω·(p × n)
    a0, a1, a2 = x[1] * n2 - x[2] * n1, x[2] * n0 - x[0] * n2, x[0] * n1 - x[1] * n0
    b0, b1, b2 = x[4] * n2 - x[5] * n1, x[5] * n0 - x[3] * n2, x[3] * n1 - x[4] * n0
    for c in range(J.shape[0]):
        total = 0.0
        # A coordinate that carries both shapes has no effect: their points differ only along n.
        if scene.apart[rows.pair[slot], c] > 0.0:
            along = n0 * J[c, 0] + n1 * J[c, 1] + n2 * J[c, 2]
            if scene.supports[j, c] > 0.0:
                total = along + b0 * J[c, 3] + b1 * J[c, 4] + b2 * J[c, 5]
            else:
                total = -(along + a0 * J[c, 3] + a1 * J[c, 4] + a2 * J[c, 5])
        rows.d_q[slot, c] = total
    drift = 0.0
    for side in range(2):
        shape = i if side == 0 else j
        o = (
            x[3 * side] - places[shape, 9],
            x[3 * side + 1] - places[shape, 10],
            x[3 * side + 2] - places[shape, 11],
        )
        w = scene.twists[shape, 3], scene.twists[shape, 4], scene.twists[shape, 5]
        moved = (
            n0 * (scene.twists[shape, 0] + w[1] * o[2] - w[2] * o[1])
            + n1 * (scene.twists[shape, 1] + w[2] * o[0] - w[0] * o[2])
            + n2 * (scene.twists[shape, 2] + w[0] * o[1] - w[1] * o[0])
        )
        drift += moved if side == 1 else -moved
    rows.d_t[slot] = drift


@compiled
def set_points(scene: PairArrays, results: Array, places: Array, pair: int, x: Array) -> None:
    """x (9,): nearest points and normal of a pair; without Coal's normal, along their boxes' centres."""
    for k in range(3):
        x[k], x[3 + k], x[6 + k] = results[pair, 4 + k], results[pair, 7 + k], results[pair, 1 + k]
    size = x[6] * x[6] + x[7] * x[7] + x[8] * x[8]
    if not 0.5 < size < 2.0:
        i, j = scene.pairs[pair, 0], scene.pairs[pair, 1]
        ends = scratch((2, 3))
        to_world(places, i, scene.boxes[i, 0], scene.boxes[i, 1], scene.boxes[i, 2], ends, 0)
        to_world(places, j, scene.boxes[j, 0], scene.boxes[j, 1], scene.boxes[j, 2], ends, 1)
        square = 0.0
        for k in range(3):
            x[6 + k] = ends[1, k] - ends[0, k]
            square += x[6 + k] * x[6 + k]
        if square > 1e-18:
            for k in range(3):
                x[6 + k] /= math.sqrt(square)
        else:
            x[6], x[7], x[8] = 0.0, 0.0, 1.0
        for k in range(3):  # Coal's points may be the same, or no numbers: d stays what it said
            middle = 0.5 * (x[k] + x[3 + k])
            if not math.isfinite(middle):
                middle = 0.5 * (ends[0, k] + ends[1, k])
            x[k] = middle - 0.5 * results[pair, 0] * x[6 + k]
            x[3 + k] = middle + 0.5 * results[pair, 0] * x[6 + k]


def no_rows(n: int, most: int = 0, more: int = 0) -> DistanceRows:
    """Room for `most` rows on n coordinates, and for `more` beside them."""
    K = most + more
    return DistanceRows(
        used=np.array(0, dtype=np.int64),
        most=np.array(most, dtype=np.int64),
        pair=np.zeros(K, dtype=np.int64),
        d=np.zeros(K),
        d_q=np.zeros((K, n)),
        d_t=np.zeros(K),
        points=np.zeros((K, 9)),
        element=np.zeros((K, 3)),
        edition=np.zeros(K, dtype=np.int64),
    )
