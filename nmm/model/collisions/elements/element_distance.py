"""The distance of a robot's shape to a point or a box, compiled: closed forms, and for hulls and boxes the
algorithm of Gilbert, Johnson and Keerthi, as in `nmm.model.collisions.separation`."""

import math

from nmm.base.arrays import Array
from nmm.base.kernels.compiled import compiled, scratch
from nmm.model.collisions.elements.shapes_record import BOX, DISC, HULL, ROUND, SensedShapes
from nmm.model.collisions.separation import corner_share, nearest_point

#: Rounds of the algorithm.
ROUNDS = 40
#: What a hull and something inside of it are said to be apart, m: how deep it is nobody computes.
DEEP = -1e-4


@compiled
def point_distance(shapes: SensedShapes, shape: int, at: Array, out: Array) -> float:
    """The distance of a point (3,) from a box, a capsule, a sphere or a cylinder, in its axes, at most 0
    inside; out (3,): the direction from the shape to it, 0, 0, 0 where there is none."""
    x, y, z = at[0], at[1], at[2]
    radius, half = shapes.size[shape, 0], shapes.size[shape, 1]
    if shapes.kind[shape] == ROUND:
        z -= min(max(z, -half), half)
        length = math.sqrt(x * x + y * y + z * z)
        share = 1.0 / length if length > 0.0 else 0.0
        out[0], out[1], out[2] = share * x, share * y, share * z
        return length - radius
    if shapes.kind[shape] == DISC:
        across = math.hypot(x, y)
        side, cap = across - radius, abs(z) - half
        share = 1.0 / across if across > 0.0 else 0.0
        a, b = max(side, 0.0), max(cap, 0.0)
        length = math.hypot(a, b)
        if length == 0.0:
            a, b = (1.0, 0.0) if side > cap else (0.0, 1.0)
            out[0], out[1], out[2] = a * share * x, a * share * y, math.copysign(b, z)
            return max(side, cap)
        out[0], out[1], out[2] = a * share * x / length, a * share * y / length, math.copysign(b, z) / length
        return length
    square, deepest, axis = 0.0, -math.inf, 0
    for k in range(3):
        off = at[k] - shapes.boxes[shape, k]
        beyond = abs(off) - shapes.boxes[shape, 3 + k]
        out[k] = math.copysign(max(beyond, 0.0), off)
        square += out[k] * out[k]
        if beyond > deepest:
            deepest, axis = beyond, k
    if square == 0.0:
        out[axis] = math.copysign(1.0, at[axis] - shapes.boxes[shape, axis])
        return deepest
    length = math.sqrt(square)
    for k in range(3):
        out[k] /= length
    return length


@compiled
def farthest(shapes: SensedShapes, shape: int, d: Array, sign: float, out: Array) -> None:
    """out (3,): the point of a shape, without its rounding, farthest along sign d, in its axes."""
    kind = shapes.kind[shape]
    x, y, z = sign * d[0], sign * d[1], sign * d[2]
    if kind == BOX:
        out[0] = shapes.boxes[shape, 0] + math.copysign(shapes.boxes[shape, 3], x)
        out[1] = shapes.boxes[shape, 1] + math.copysign(shapes.boxes[shape, 4], y)
        out[2] = shapes.boxes[shape, 2] + math.copysign(shapes.boxes[shape, 5], z)
    elif kind == HULL:
        best, most = shapes.first_corner[shape], -math.inf
        for c in range(shapes.first_corner[shape], shapes.first_corner[shape + 1]):
            along = x * shapes.corners[c, 0] + y * shapes.corners[c, 1] + z * shapes.corners[c, 2]
            if along > most:
                best, most = c, along
        out[0], out[1], out[2] = shapes.corners[best, 0], shapes.corners[best, 1], shapes.corners[best, 2]
    else:
        across = math.hypot(x, y)
        share = shapes.size[shape, 0] / across if kind == DISC and across > 0.0 else 0.0
        out[0], out[1] = share * x, share * y
        out[2] = math.copysign(shapes.size[shape, 1], z)


@compiled
def box_distance(
    shapes: SensedShapes,
    shape: int,
    pose: Array,
    at: Array,
    half: Array,
    enough: float,
    close: float,
    out: Array,
) -> float:
    """A lower bound of the distance of a shape from a box, within the share `close` of it, or rough above
    `enough`; `DEEP` where they overlap. at (3,) : the box's middle in the axes of the shape; half (3,) :
    half of its edges, 0 of a point, along the axes in which pose (12,) places the shape

    out (6,) : the direction from the shape to it, a guess of which it holds before, or 0; its nearest point
    """
    rounding = shapes.size[shape, 0] if shapes.kind[shape] == ROUND else 0.0
    simplex, v, a, b, n = scratch((4, 6)), scratch(3), scratch(3), scratch(3), scratch(3)
    square = 0.0
    for k in range(3):
        v[k] = -out[k]
        square += v[k] * v[k]
    if square < 0.5:
        square = 0.0
        for k in range(3):
            v[k] = shapes.heart[shape, k] - at[k]
            square += v[k] * v[k]
        if square < 1e-18:
            v[0], square = 1e-9, 1e-18
    for k in range(3):
        n[k] = v[k] / math.sqrt(square)
    bound = -math.inf
    count = 0
    for _ in range(ROUNDS):
        length = math.sqrt(square)
        farthest(shapes, shape, v, -1.0, a)
        for k in range(3):
            b[k] = at[k]
        for k in range(3):  # along the axes of the box
            along = pose[k] * v[0] + pose[3 + k] * v[1] + pose[6 + k] * v[2]
            edge = math.copysign(half[k], along)
            for i in range(3):
                b[i] += edge * pose[3 * i + k]
        along = 0.0
        for k in range(3):
            simplex[count, k], simplex[count, 3 + k] = a[k] - b[k], b[k]
            along += v[k] * simplex[count, k]
        if along / length > bound:
            bound = along / length
            for k in range(3):
                n[k] = v[k] / length
        if bound - rounding >= enough:
            break
        if count > 0 and length - bound <= close * max(length - rounding, 1e-3):
            break
        count = nearest_point(simplex, count + 1, v)
        square = v[0] * v[0] + v[1] * v[1] + v[2] * v[2]
        if count == 4 or square < 1e-16:
            length = 0.0
            for k in range(3):
                out[k], out[3 + k] = at[k] - shapes.heart[shape, k], at[k]
                length += out[k] * out[k]
            for k in range(3):
                out[k] = out[k] / math.sqrt(length) if length > 0.0 else (1.0 if k == 2 else 0.0)
            return min(DEEP, DEEP - rounding)
    weights = scratch(3)
    i, j = min(1, max(count, 1) - 1), min(2, max(count, 1) - 1)
    corner_share(simplex[0], simplex[i], simplex[j], weights)
    for k in range(3):
        out[k] = -n[k]
        out[3 + k] = weights[0] * simplex[0, 3 + k]
        out[3 + k] += weights[1] * simplex[i, 3 + k] + weights[2] * simplex[j, 3 + k]
    return bound - rounding
