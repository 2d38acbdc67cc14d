"""Distances as rows, compiled: d, ∂d/∂q = n·(Jp2 - Jp1) and ∂d/∂t of near pairs.

Where faces or edges are nearly parallel, nearest points jump between the ends of their common part; rows at
these ends do not."""

import math
from typing import NamedTuple

import numpy as np

from nmm.base.arrays import Array
from nmm.base.kernels.compiled import clear, compiled, scratch
from nmm.base.kernels.record_layout import (
    Blocks,
    IntegerCell,
    SampledIntegerCell,
    SampledIntegerVector,
    SampledMatrix,
    SampledVector,
    views,
)
from nmm.base.kernels.rotations import cross3
from nmm.model.collisions.broad_phase import PairArrays, to_world

#: A corner belongs to a face or an edge along the other shape if it is behind that plane by at most this
#: share of its distance from the nearest point plus this length, m, and by at most the third number.
SLOPE, ROUNDED, DEEPEST = 0.2, 1e-3, 0.05
#: Points nearer to the nearest point than this, m, are left out; a common part is widened by as much.
APART = 5e-3
#: A face is represented by its extent in this many directions.
COUNT = 24
DIRECTIONS = np.array(
    [[math.cos(2.0 * math.pi * k / COUNT), math.sin(2.0 * math.pi * k / COUNT)] for k in range(COUNT)]
)
#: At most this many corners of a face are used.
CORNERS = 16


class DistanceRows(NamedTuple):
    """K rows of distances, of which `used` () are; at most `most` () of them are written here.

    pair (K,) : its number; d (K,), m; d_q (K, n); d_t (K,), m/s
    points (K, 9) : the nearest points of both shapes and the normal from the first to the second, world, m
    """

    used: SampledIntegerCell
    most: IntegerCell
    pair: SampledIntegerVector
    d: SampledVector
    d_q: SampledMatrix
    d_t: SampledVector
    points: SampledMatrix


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


@compiled
def write_rows(
    blocks: Blocks, results: Array, places: Array, J: Array, row_blocks: Blocks, place: int
) -> float:
    """Write the rows of near pairs; returns their least distance, or infinity."""
    scene = views(PairArrays, blocks.integers, blocks.floats, 0)
    rows = views(DistanceRows, row_blocks.integers, row_blocks.floats, place)
    most = rows.most[()]
    used = 0
    least = math.inf
    for pair in range(scene.active.shape[0]):
        d = results[pair, 0]
        if scene.active[pair] == 0:
            continue
        if not d < scene.band[()]:
            scene.bounds[pair] = max(d, scene.bounds[pair])
            continue
        scene.bounds[pair] = d
        least = min(least, d)
        slot = used
        if used == most:  # replaces the farthest
            slot = 0
            for k in range(most):
                if results[rows.pair[k], 0] > results[rows.pair[slot], 0]:
                    slot = k
            if not d < results[rows.pair[slot], 0]:
                continue
        else:
            used += 1
        rows.pair[slot] = pair
    own = used
    for slot in range(own):
        set_points(scene, results, places, rows.pair[slot], rows.points[slot])
        write_row(scene, J, places, rows, slot)
        rows.d[slot] = results[rows.pair[slot], 0]
    for slot in range(own):
        if results[rows.pair[slot], 0] < scene.faces[()] and used < most:
            used = add_faces(scene, places, J, rows, slot, used)
    rows.used[()] = used
    return least


@compiled
def facing(
    scene: PairArrays,
    places: Array,
    shape: int,
    x: Array,
    side: int,
    e: Array,
    deepest: float,
    corners: Array,
) -> int:
    """Write the corners of a shape that lie along the other one, and return their count.
    corners (CORNERS, 4) : place in e (2, 3) about the nearest point, m behind it, distance in e squared"""
    sign = 1.0 if side == 0 else -1.0
    count = 0
    to, local = scratch(3), scratch((3, 3))  # the nearest point from the shape's origin; n and e in its axes
    behind = 0.0
    for k in range(3):
        to[k] = x[3 * side + k] - places[shape, 9 + k]
        behind += sign * x[6 + k] * to[k]
        for a in range(3):
            local[a, k] = 0.0
    for k in range(3):
        for i in range(3):
            local[0, k] += sign * places[shape, 3 * k + i] * x[6 + i]
            local[1, k] += places[shape, 3 * k + i] * e[0, i]
            local[2, k] += places[shape, 3 * k + i] * e[1, i]
    u0 = to[0] * e[0, 0] + to[1] * e[0, 1] + to[2] * e[0, 2]
    v0 = to[0] * e[1, 0] + to[1] * e[1, 1] + to[2] * e[1, 2]
    for c in range(scene.first_corner[shape], scene.first_corner[shape + 1]):
        X, Y, Z = scene.corners[c, 0], scene.corners[c, 1], scene.corners[c, 2]
        depth = behind - (local[0, 0] * X + local[0, 1] * Y + local[0, 2] * Z) - scene.rounding[shape]
        if depth > deepest:
            continue
        depth = max(depth, 0.0)
        u = local[1, 0] * X + local[1, 1] * Y + local[1, 2] * Z - u0
        v = local[2, 0] * X + local[2, 1] * Y + local[2, 2] * Z - v0
        square = u * u + v * v
        if square < APART * APART or (depth > ROUNDED and (depth - ROUNDED) ** 2 > SLOPE * SLOPE * square):
            continue
        slot = count
        if count == CORNERS:  # replaces the one nearest to the middle
            slot = 0
            for k in range(CORNERS):
                if corners[k, 3] < corners[slot, 3]:
                    slot = k
            if square <= corners[slot, 3]:
                continue
        else:
            count += 1
        corners[slot, 0], corners[slot, 1], corners[slot, 2], corners[slot, 3] = u, v, depth, square
    return count


@compiled
def add_faces(scene: PairArrays, places: Array, J: Array, rows: DistanceRows, slot: int, used: int) -> int:
    """Add rows at the ends of the common part of two faces or edges; returns the number of rows then."""
    pair = rows.pair[slot]
    i, j = scene.pairs[pair, 0], scene.pairs[pair, 1]
    x = rows.points[slot]
    e, inverse = scratch((2, 3)), scratch((2, COUNT))
    least = 0
    for k in range(3):
        if abs(x[6 + k]) < abs(x[6 + least]):
            least = k
    e[0, 0], e[0, 1], e[0, 2] = 0.0, 0.0, 0.0
    e[0, least] = 1.0
    size = math.sqrt(1.0 - x[6 + least] * x[6 + least])
    for k in range(3):
        e[0, k] = (e[0, k] - x[6 + least] * x[6 + k]) / size
    cross3(x[6:], e[0], e[1])
    first_corners, second_corners = scratch((CORNERS, 4)), scratch((CORNERS, 4))
    plane = j >= scene.planes[()]
    first = facing(scene, places, i, x, 0, e, DEEPEST, first_corners)
    second = 0 if plane else facing(scene, places, j, x, 1, e, DEEPEST, second_corners)
    if first == 0 or (second == 0 and not plane):  # a part in common takes two
        return used
    for side in range(0 if plane else 2):
        corners = first_corners if side == 0 else second_corners
        for k in range(COUNT):
            reach = 0.0
            for a in range(first if side == 0 else second):
                reach = max(reach, DIRECTIONS[k, 0] * corners[a, 0] + DIRECTIONS[k, 1] * corners[a, 1])
            inverse[side, k] = 1.0 / (reach + APART)
    best = scratch((4, 4))
    clear(best)
    for side in range(2):
        corners = first_corners if side == 0 else second_corners
        for a in range(first if side == 0 else second):
            u, v, depth, size = corners[a, 0], corners[a, 1], corners[a, 2], math.sqrt(corners[a, 3])
            quadrant = (2 if u > 0.0 else 0) + (1 if v > 0.0 else 0)
            if size <= best[quadrant, 0]:
                continue
            beyond = 1.0
            for k in range(0 if plane else COUNT):
                beyond = max(beyond, (DIRECTIONS[k, 0] * u + DIRECTIONS[k, 1] * v) * inverse[1 - side, k])
            share = 1.0 / beyond
            away = share * size
            if away > 2.0 * APART and away > best[quadrant, 0]:
                best[quadrant, 0] = away
                best[quadrant, 1], best[quadrant, 2] = share * u, share * v
                best[quadrant, 3] = share * depth if side == 0 else -share * depth
    for k in range(4):
        if best[k, 0] == 0.0 or used == rows.most[()]:
            continue
        y = rows.points[used]
        for a in range(3):
            lateral = best[k, 1] * e[0, a] + best[k, 2] * e[1, a]
            y[a] = x[a] + lateral - max(best[k, 3], 0.0) * x[6 + a]
            y[3 + a] = x[3 + a] + lateral + max(-best[k, 3], 0.0) * x[6 + a]
            y[6 + a] = x[6 + a]
        rows.pair[used] = pair
        write_row(scene, J, places, rows, used)
        used += 1
    return used


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
    )
