"""Rows at the ends of the common part of two faces or edges, compiled: where these are nearly parallel,
nearest points jump between the ends, and rows there do not."""

import math

import numpy as np

from nmm.base.arrays import Array
from nmm.base.kernels.compiled import clear, compiled, scratch
from nmm.base.kernels.rotations import cross3
from nmm.model.collisions.broad_phase import PairArrays
from nmm.model.collisions.rows import DistanceRows, write_row

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
#: Lengths, m, that differ by less are taken for the same, so that rounding does not choose between them.
TIE = 1e-9


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
            if math.sqrt(square) <= math.sqrt(corners[slot, 3]) + TIE:
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
        if abs(x[6 + k]) < abs(x[6 + least]) - TIE:
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
            quadrant = (2 if u > -TIE else 0) + (1 if v > -TIE else 0)
            if size <= best[quadrant, 0] + TIE:
                continue
            beyond = 1.0
            for k in range(0 if plane else COUNT):
                beyond = max(beyond, (DIRECTIONS[k, 0] * u + DIRECTIONS[k, 1] * v) * inverse[1 - side, k])
            share = 1.0 / beyond
            away = share * size
            if away > 2.0 * APART and away > best[quadrant, 0] + TIE:
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
