"""Lower bounds of the distance between convex shapes, compiled: Gilbert, Johnson and Keerthi's algorithm.

Coal computes the same distances exactly, pair by pair from Python. A search looks at ten thousand postures,
and only asks whether a pair is farther apart than a number; a bound from below answers that, and never
wrongly.
"""

import math
from typing import NamedTuple

from nmm.base.arrays import Array
from nmm.base.kernels.compiled import compiled, scratch
from nmm.base.kernels.record_layout import IntegerCell, IntegerMatrix, IntegerVector, Matrix, Vector

#: Rounds of the algorithm; it ends before where the bound is within `CLOSE` of the distance, as a share of
#: it, or within `ROUGH` of what the bound is above the distance to keep, as a share of that.
ROUNDS, CLOSE, ROUGH = 24, 0.01, 0.2


class ConvexShapes(NamedTuple):
    """G shapes, half-spaces last, and P pairs of them; lengths in m.

    boxes (G, 7) : centre, half extents and radius of a shape's box; a half-space's normal and offset
    planes () : half-spaces are the shapes from this one on, and second in their pairs
    first_corner (G + 1,), corners (..., 3) : corners in a shape's axes
    first_neighbour (C + 1,), neighbours (...) : corners at the other ends of a corner's edges; none of shapes
        whose corners are few
    rounding (G,) : radius about them; disc (G,) : radius of a cylinder, in place of corners, 0 of others
    pairs (P, 2); between (P, 3) : a direction from the second to the first that separated them last, world
        axes
    last (4 P,) : the corners of a pair's two shapes found last: in directions that separate them, then others
    """

    boxes: Matrix
    planes: IntegerCell
    first_corner: IntegerVector
    corners: Matrix
    first_neighbour: IntegerVector
    neighbours: IntegerVector
    rounding: Vector
    disc: Vector
    pairs: IntegerMatrix
    between: Matrix
    last: IntegerVector


@compiled
def extreme(
    shapes: ConvexShapes, places: Array, shape: int, d: Array, sign: float, slot: int, out: Array
) -> None:
    """out (3,): the point of a shape, without its rounding, farthest along sign d, world axes. Where
    edges are known it is climbed to along them from the corner in this slot of `last`."""
    x = y = z = 0.0
    for i in range(3):
        x += sign * places[shape, i] * d[i]
        y += sign * places[shape, 3 + i] * d[i]
        z += sign * places[shape, 6 + i] * d[i]
    if shapes.disc[shape] > 0.0:
        across = math.hypot(x, y)
        share = shapes.disc[shape] / across if across > 0.0 else 0.0
        x, y = share * x, share * y
        z = math.copysign(shapes.boxes[shape, 5], z)
    else:
        first, after = shapes.first_corner[shape], shapes.first_corner[shape + 1]
        best, most = first, -math.inf
        if shapes.first_neighbour[first] < shapes.first_neighbour[after]:
            best = first + shapes.last[slot]
            most = x * shapes.corners[best, 0] + y * shapes.corners[best, 1] + z * shapes.corners[best, 2]
            at = -1
            while at != best:
                at = best
                for e in range(shapes.first_neighbour[at], shapes.first_neighbour[at + 1]):
                    c = shapes.neighbours[e]
                    along = x * shapes.corners[c, 0] + y * shapes.corners[c, 1] + z * shapes.corners[c, 2]
                    if along > most:
                        best, most = c, along
            shapes.last[slot] = best - first
        else:
            for c in range(first, after):
                along = x * shapes.corners[c, 0] + y * shapes.corners[c, 1] + z * shapes.corners[c, 2]
                if along > most:
                    best, most = c, along
        x, y, z = shapes.corners[best, 0], shapes.corners[best, 1], shapes.corners[best, 2]
    for i in range(3):
        out[i] = (
            places[shape, 9 + i] + places[shape, i] * x + places[shape, 3 + i] * y + places[shape, 6 + i] * z
        )


@compiled
def corner_share(a: Array, b: Array, c: Array, weights: Array) -> None:
    """weights (3,) of a triangle's point nearest to the origin."""
    ab, ac = scratch(3), scratch(3)
    d = scratch(6)
    for i in range(6):
        d[i] = 0.0
    for i in range(3):
        ab[i], ac[i] = b[i] - a[i], c[i] - a[i]
        d[0] -= ab[i] * a[i]
        d[1] -= ac[i] * a[i]
        d[2] -= ab[i] * b[i]
        d[3] -= ac[i] * b[i]
        d[4] -= ab[i] * c[i]
        d[5] -= ac[i] * c[i]
    on_a, on_b, on_c = d[2] * d[5] - d[4] * d[3], d[4] * d[1] - d[0] * d[5], d[0] * d[3] - d[2] * d[1]
    weights[0] = weights[1] = weights[2] = 0.0
    if d[0] <= 0.0 and d[1] <= 0.0:
        weights[0] = 1.0
    elif d[2] >= 0.0 and d[3] <= d[2]:
        weights[1] = 1.0
    elif d[5] >= 0.0 and d[4] <= d[5]:
        weights[2] = 1.0
    elif on_c <= 0.0 and d[0] >= 0.0 and d[2] <= 0.0:
        weights[1] = d[0] / (d[0] - d[2])
        weights[0] = 1.0 - weights[1]
    elif on_b <= 0.0 and d[1] >= 0.0 and d[5] <= 0.0:
        weights[2] = d[1] / (d[1] - d[5])
        weights[0] = 1.0 - weights[2]
    elif on_a <= 0.0 and d[3] >= d[2] and d[4] >= d[5]:
        weights[2] = (d[3] - d[2]) / ((d[3] - d[2]) + (d[4] - d[5]))
        weights[1] = 1.0 - weights[2]
    else:
        total = on_a + on_b + on_c
        weights[1], weights[2] = on_b / total, on_c / total
        weights[0] = 1.0 - weights[1] - weights[2]


@compiled
def nearest_point(simplex: Array, count: int, v: Array) -> int:
    """v (3,): the point of a simplex of `count` corners nearest to the origin. Keeps the corners that it
    needs, first in simplex (4, 3 or more), and returns how many; 4 where the origin is inside."""
    weights, trial = scratch(4), scratch(4)
    point = scratch(3)
    least = math.inf
    faces = 4 if count == 4 else 1
    inside = count == 4
    for face in range(faces):
        # Corners of the face; a segment and a point are triangles whose last corners coincide.
        i, j, k = 0, min(1, count - 1), min(2, count - 1)
        if count == 4:
            i, j, k = (face + 1) % 4, (face + 2) % 4, (face + 3) % 4
            a, b, c, o = simplex[i], simplex[j], simplex[k], simplex[face]
            nx = (b[1] - a[1]) * (c[2] - a[2]) - (b[2] - a[2]) * (c[1] - a[1])
            ny = (b[2] - a[2]) * (c[0] - a[0]) - (b[0] - a[0]) * (c[2] - a[2])
            nz = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
            to_origin = -(nx * a[0] + ny * a[1] + nz * a[2])
            to_corner = nx * (o[0] - a[0]) + ny * (o[1] - a[1]) + nz * (o[2] - a[2])
            if to_origin * to_corner > 0.0:
                continue
            inside = False
        corner_share(simplex[i], simplex[j], simplex[k], trial)
        square = 0.0
        for axis in range(3):
            point[axis] = (
                trial[0] * simplex[i, axis] + trial[1] * simplex[j, axis] + trial[2] * simplex[k, axis]
            )
            square += point[axis] * point[axis]
        if square < least:
            least = square
            for corner in range(4):
                weights[corner] = 0.0
            weights[i] += trial[0]
            weights[j] += trial[1]
            weights[k] += trial[2]
            for axis in range(3):
                v[axis] = point[axis]
    if inside:
        return 4
    remaining = 0
    for corner in range(count):
        if weights[corner] > 0.0:
            for axis in range(simplex.shape[1]):
                simplex[remaining, axis] = simplex[corner, axis]
            remaining += 1
    return remaining


@compiled
def above_half_space(shapes: ConvexShapes, places: Array, pair: int) -> float:
    """Height of the first of a pair above the second, a half-space."""
    shape, plane = shapes.pairs[pair, 0], shapes.pairs[pair, 1]
    n, lowest = scratch(3), scratch(3)
    for k in range(3):
        n[k] = 0.0
        for i in range(3):
            n[k] += places[plane, 3 * i + k] * shapes.boxes[plane, i]
    extreme(shapes, places, shape, n, -1.0, 2 * pair, lowest)
    height = -shapes.boxes[plane, 3] - shapes.rounding[shape]
    for k in range(3):
        height += n[k] * (lowest[k] - places[plane, 9 + k])
    return height


@compiled
def separation(shapes: ConvexShapes, places: Array, pair: int, enough: float, least: float) -> float:
    """A lower bound of a pair's distance, within `CLOSE` of it where it is below `enough`; not above 0 where
    the two overlap. It is within `ROUGH` alone of the distance where that is above `least`, and below `least`
    where that is; nan for neither. places (G, 12): R column by column, then p."""
    i, j = shapes.pairs[pair, 0], shapes.pairs[pair, 1]
    if j >= shapes.planes[()]:
        return above_half_space(shapes, places, pair)
    radii = shapes.rounding[i] + shapes.rounding[j]
    simplex, v, a, b = scratch((4, 3)), scratch(3), scratch(3), scratch(3)
    square = 0.0
    for k in range(3):
        v[k] = shapes.between[pair, k]
        square += v[k] * v[k]
    bound = -math.inf
    count = 0
    for _ in range(ROUNDS):
        length = math.sqrt(square)
        extreme(shapes, places, i, v, -1.0, 2 * pair, a)
        extreme(shapes, places, j, v, 1.0, 2 * pair + 1, b)
        along = 0.0
        for k in range(3):
            simplex[count, k] = a[k] - b[k]
            along += v[k] * simplex[count, k]
        if along / length > bound:
            bound = along / length
            for k in range(3):
                shapes.between[pair, k] = v[k] / length
        if bound - radii >= enough:
            break
        if count > 0:
            gap = length - bound
            if gap <= CLOSE * max(length - radii, 1e-3) or gap <= ROUGH * (bound - radii - least):
                break
            if length - radii <= least:
                break
        count = nearest_point(simplex, count + 1, v)
        square = v[0] * v[0] + v[1] * v[1] + v[2] * v[2]
        if count == 4 or square < 1e-16:
            return min(bound, 0.0) - radii
    return bound - radii
