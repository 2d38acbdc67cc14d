"""The distance of a robot's shape to what was sensed, compiled, on two levels.

Far: for each of the balls that cover the shape, the field of the cell in which its centre is, less its
radius. No point of the cell is nearer to an element than its field; outside of the grid, a box that holds all
elements, the point x of the grid nearest to a centre c bounds it for any element e: |c - e|² >= |c - x|² +
|x - e|². Near: all elements of the cells within reach of the shape's box. The true distance to what was seen
changes by no more than a shape moves, so a motion may go on by any lower bound of it."""

import math

from nmm.base.arrays import Array
from nmm.base.kernels.compiled import compiled, scratch
from nmm.base.kernels.pointers import singles_at
from nmm.model.collisions.elements.near_level import near_distance
from nmm.model.collisions.elements.shapes_record import SensedShapes

#: Elements are looked for so much farther than the larger of the field's bound and the distance asked for, m.
REACH = 0.12
#: Where the field's bound is beyond the distance asked for by so much, m, it is taken as it is: a shorter
#: step costs less than a look at the elements.
NEAR = 0.06
#: How near to the distance from a hull a bound is, as a share of it: of looks, and of rows.
ROUGH, FINE = 0.01, 1e-9


@compiled
def into_axes(places: Array, outer: int, inner: int, pose: Array) -> None:
    """pose (12,): where a shape is in the axes of another; places (G, 12): R column by column, then p."""
    for i in range(3):
        for k in range(3):
            total = 0.0
            for a in range(3):
                total += places[outer, 3 * i + a] * places[inner, 3 * k + a]
            pose[3 * k + i] = total
        total = 0.0
        for a in range(3):
            total += places[outer, 3 * i + a] * (places[inner, 9 + a] - places[outer, 9 + a])
        pose[9 + i] = total


@compiled
def cell_bound(shapes: SensedShapes, row: int, x: float, y: float, z: float) -> float:
    """A lower bound of the distance of a point from all elements, in their axes; below 0 inside of what is
    full."""
    nx, ny, nz = shapes.grids[row, 4], shapes.grids[row, 5], shapes.grids[row, 6]
    lattice = shapes.lattice[row]
    beyond, flat = 0.0, 0
    for k in range(3):
        at = (x if k == 0 else (y if k == 1 else z)) - lattice[k]
        n = nx if k == 0 else (ny if k == 1 else nz)
        over = max(-at, at - n * lattice[3 + k])
        if over > 0.0:
            beyond += over * over
        index = int(min(max(math.floor(at / lattice[3 + k]), 0.0), n - 1.0))
        flat = flat * n + index
    field = singles_at(shapes.grids[row, 0], nx * ny * nz)
    bound = float(field[flat])
    if beyond > 0.0:
        return math.sqrt(beyond + max(bound, 0.0) ** 2)
    return bound


@compiled
def far_bound(shapes: SensedShapes, row: int, pose: Array, shape: int, enough: float, least: float) -> float:
    """The far level: of a shape placed at pose (12,) in the elements' axes, their radius taken off; rough
    above `enough`, and minus infinity where it is below `least`."""
    first, last = shapes.first_ball[shape], shapes.first_ball[shape + 1]
    radius = shapes.lattice[row, 6]
    if last > first + 1:  # the ball around its box says it where there is room
        box = shapes.boxes[shape]
        around = cell_bound(
            shapes,
            row,
            pose[9] + pose[0] * box[0] + pose[3] * box[1] + pose[6] * box[2],
            pose[10] + pose[1] * box[0] + pose[4] * box[1] + pose[7] * box[2],
            pose[11] + pose[2] * box[0] + pose[5] * box[1] + pose[8] * box[2],
        ) - math.sqrt(box[3] * box[3] + box[4] * box[4] + box[5] * box[5])
        if around - radius >= enough:
            return around - radius
    bound = math.inf
    for k in range(first, last):
        x, y, z = shapes.balls[k, 0], shapes.balls[k, 1], shapes.balls[k, 2]
        ball = cell_bound(
            shapes,
            row,
            pose[9] + pose[0] * x + pose[3] * y + pose[6] * z,
            pose[10] + pose[1] * x + pose[4] * y + pose[7] * z,
            pose[11] + pose[2] * x + pose[5] * y + pose[8] * z,
        )
        bound = min(bound, ball - shapes.balls[k, 3])
        if bound - radius < least:
            return -math.inf
    return bound - radius


@compiled
def is_inside(shapes: SensedShapes, row: int, pose: Array, shape: int) -> bool:
    """Whether a point of the shape is inside of what is full, where there are no elements."""
    x, y, z = shapes.heart[shape, 0], shapes.heart[shape, 1], shapes.heart[shape, 2]
    return bool(
        cell_bound(
            shapes,
            row,
            pose[9] + pose[0] * x + pose[3] * y + pose[6] * z,
            pose[10] + pose[1] * x + pose[4] * y + pose[7] * z,
            pose[11] + pose[2] * x + pose[5] * y + pose[8] * z,
        )
        < 0.0
    )


@compiled
def placed_sensed(
    shapes: SensedShapes,
    row: int,
    pose: Array,
    i: int,
    enough: float,
    least: float,
    stop: float,
    out: Array,
) -> float:
    """`sensed_bound` of a shape placed at pose (12,) in the axes of a row's elements; out (6,) as of
    `near_distance`."""
    bound = far_bound(shapes, row, pose, i, enough, least)
    if bound >= min(enough, least + NEAR):
        return bound
    if is_inside(shapes, row, pose, i):
        return -shapes.lattice[row, 3]
    d = near_distance(shapes, row, pose, i, min(enough, max(bound, least) + REACH), stop, ROUGH, out)
    return max(d, bound) if d > 0.0 else d


@compiled
def sensed_bound(
    shapes: SensedShapes,
    places: Array,
    i: int,
    j: int,
    enough: float,
    least: float,
    stop: float,
    direction: Array,
) -> float:
    """A lower bound of the distance of a robot's shape i to a sensed obstacle j, rough above `enough`; no
    less than it by more than `ROUGH` of it where it is below `least` and `NEAR`, and any number below `stop`
    where the distance is. places (G, 12).

    direction (3,) : from the nearest element to the shape, world axes; unchanged where none is near
    """
    pose, out = scratch(12), scratch(6)
    into_axes(places, j, i, pose)
    for k in range(6):
        out[k] = 0.0
    bound = placed_sensed(shapes, shapes.row[j], pose, i, enough, least, stop, out)
    if out[0] * out[0] + out[1] * out[1] + out[2] * out[2] > 0.5:
        for k in range(3):
            direction[k] = -(places[j, k] * out[0] + places[j, 3 + k] * out[1] + places[j, 6 + k] * out[2])
    return bound


@compiled
def measure_sensed(shapes: SensedShapes, places: Array, i: int, j: int, reach: float, result: Array) -> None:
    """result (10,): distance of a robot's shape i to a sensed obstacle j, normal from the first to the second
    and the nearest points of both, world axes; where none is within reach a lower bound, and no points."""
    row = shapes.row[j]
    pose, out = scratch(12), scratch(6)
    into_axes(places, j, i, pose)
    bound = far_bound(shapes, row, pose, i, math.inf, reach)
    d = bound
    for k in range(6):
        out[k] = 0.0
    if bound < reach:
        if is_inside(shapes, row, pose, i):
            d = -shapes.lattice[row, 3]
        else:
            d = near_distance(shapes, row, pose, i, reach, -math.inf, FINE, out)
            d = max(d, bound) if d > 0.0 else d
    radius = shapes.lattice[row, 6]
    square = out[0] * out[0] + out[1] * out[1] + out[2] * out[2]
    result[0] = d
    for k in range(3):
        n = places[j, k] * out[0] + places[j, 3 + k] * out[1] + places[j, 6 + k] * out[2]
        p = places[j, k] * out[3] + places[j, 3 + k] * out[4] + places[j, 6 + k] * out[5] + places[j, 9 + k]
        if square > 0.5:
            result[1 + k] = n
            result[4 + k], result[7 + k] = p - n * (d + radius), p - n * radius
        else:
            result[1 + k] = 0.0
            result[4 + k] = result[7 + k] = places[i, 9 + k]
