"""The near level of distances to what was sensed, compiled: of a robot's shape to the elements of the cells
around it. Columns of cells and elements whose boxes are farther than the nearest so far are passed over; of
hulls, and beside boxes of any shape, also elements beyond a plane that separated an earlier one."""

import math

from nmm.base.arrays import Array
from nmm.base.kernels.compiled import clear, compiled, scratch
from nmm.base.kernels.linear_algebra import copied
from nmm.base.kernels.pointers import doubles_at, short_integers_at
from nmm.model.collisions.elements.element_distance import box_distance, point_distance
from nmm.model.collisions.elements.shapes_record import HULL, SensedShapes

#: So many planes that touch a shape are remembered while it is beside elements.
PLANES = 8
#: Shapes' boxes are larger by this, m, against rounding.
WIDER = 1e-9


@compiled
def is_beyond(planes: Array, pose: Array, at: Array, half: Array, distance: float) -> bool:
    """Whether one of `planes` says that a shape is so far from a box, its middle at `at` (3,), half (3,) of
    its edges along the axes of pose (12,).

    planes (1 + PLANES, 4) : in the first row how many there were; then, in the axes of `at`, normals, and how
        far the shape reaches along them
    """
    for c in range(1, 1 + min(int(planes[0, 0]), PLANES)):
        beyond = planes[c, 0] * at[0] + planes[c, 1] * at[1] + planes[c, 2] * at[2] - planes[c, 3]
        for k in range(3):
            if half[k] > 0.0:
                along = pose[k] * planes[c, 0] + pose[3 + k] * planes[c, 1] + pose[6 + k] * planes[c, 2]
                beyond -= half[k] * abs(along)
        if beyond >= distance:
            return True
    return False


@compiled
def remember_plane(planes: Array, pose: Array, at: Array, half: Array, n: Array, distance: float) -> None:
    """Put the plane across n (3,) that touches the shape among `planes`, as of `is_beyond`: the box is
    `distance` beyond it."""
    c = 1 + int(planes[0, 0]) % PLANES
    planes[0, 0] += 1.0
    planes[c, 3] = -distance
    for k in range(3):
        planes[c, k] = n[k]
        along = pose[k] * n[0] + pose[3 + k] * n[1] + pose[6 + k] * n[2]
        planes[c, 3] += n[k] * at[k] - half[k] * abs(along)


@compiled
def nearest_of(
    shapes: SensedShapes,
    row: int,
    pose: Array,
    shape: int,
    begin: int,
    end: int,
    best: float,
    close: float,
    planes: Array,
    out: Array,
) -> float:
    """The less of `best` and the distance of a shape to the elements from `begin` to `end`, without their
    radius; pose, close, out : as of `near_distance`; planes : as of `is_beyond`."""
    N, lattice, box = shapes.grids[row, 7], shapes.lattice[row], shapes.boxes[shape]
    centres = doubles_at(shapes.grids[row, 2], 3 * N)
    own = shapes.grids[row, 3] != 0
    solid = own or lattice[7] > 0.0
    halves = doubles_at(shapes.grids[row, 3] if own else shapes.grids[row, 2], 3 * N)
    simple = not solid and shapes.kind[shape] != HULL
    at, half, now = scratch(3), scratch(3), scratch(6)
    clear(half)
    for e in range(begin, end):
        square = 0.0
        for a in range(3):
            at[a] = 0.0
            wide = 0.0
            for k in range(3):
                at[a] += pose[3 * a + k] * (centres[3 * e + k] - pose[9 + k])
                if solid:
                    wide += abs(pose[3 * a + k]) * (halves[3 * e + k] if own else lattice[7 + k])
            off = abs(at[a] - box[a]) - box[3 + a] - wide
            if off > 0.0:
                square += off * off
        if square >= best * best if best > 0.0 else square > 0.0:
            continue
        if simple:
            d = point_distance(shapes, shape, at, now)
            copied(at, now[3:])
        else:
            for k in range(3 if solid else 0):
                half[k] = halves[3 * e + k] if own else lattice[7 + k]
            if is_beyond(planes, pose, at, half, best):
                continue
            for k in range(3):  # the direction to the nearest one before, or 0
                now[k] = 0.0
                for a in range(3):
                    now[k] += pose[3 * k + a] * out[a]
            d = box_distance(shapes, shape, pose, at, half, best, close, now)
            if d > 0.0:
                remember_plane(planes, pose, at, half, now, d)
        if d < best:
            best = d
            for k in range(3):
                out[k], out[3 + k] = 0.0, pose[9 + k]
                for a in range(3):
                    out[k] += pose[3 * a + k] * now[a]
                    out[3 + k] += pose[3 * a + k] * now[3 + a]
    return best


@compiled
def near_distance(
    shapes: SensedShapes,
    row: int,
    pose: Array,
    shape: int,
    reach: float,
    stop: float,
    close: float,
    out: Array,
) -> float:
    """The near level: the least distance of a shape, placed at pose (12,), to the elements, or `reach` where
    there is none within it; of hulls and of boxes a lower bound within the share `close` of it. Where it is
    less than `stop`, any number that is.

    out (6,) : the direction from the shape to the nearest element, and the nearest point of it without its
    radius, in the elements' axes; 0 where there is none within reach
    """
    lattice, box = shapes.lattice[row], shapes.boxes[shape]
    ny, nz = shapes.grids[row, 5], shapes.grids[row, 6]
    starts = short_integers_at(shapes.grids[row, 1], shapes.grids[row, 4] * ny * nz + 1)
    planes, first, last, middle, wide = (
        scratch((1 + PLANES, 4)),
        scratch(3),
        scratch(3),
        scratch(3),
        scratch(3),
    )
    planes[0, 0] = 0.0
    best = reach + lattice[6]
    clear(out)
    for k in range(3):
        centre, extent = pose[9 + k], WIDER + best
        for a in range(3):
            centre += pose[3 * a + k] * box[a]
            extent += abs(pose[3 * a + k]) * box[3 + a]
        n = shapes.grids[row, 4 + k]
        first[k] = max(math.floor((centre - extent - lattice[k]) / lattice[3 + k]), 0.0)
        last[k] = min(math.floor((centre + extent - lattice[k]) / lattice[3 + k]), n - 1.0)
        if first[k] > last[k]:
            return reach
    low, high = int(first[2]), int(last[2])
    middle[2] = lattice[2] + 0.5 * float(low + high + 1) * lattice[5] - pose[11]
    for a in range(3):  # half of a column of cells, along the axes of the shape
        extent = float(high - low + 1) * lattice[5] * abs(pose[3 * a + 2])
        extent += lattice[3] * abs(pose[3 * a]) + lattice[4] * abs(pose[3 * a + 1])
        wide[a] = WIDER + 0.5 * extent
    for i in range(int(first[0]), int(last[0]) + 1):
        middle[0] = lattice[0] + (i + 0.5) * lattice[3] - pose[9]
        for j in range(int(first[1]), int(last[1]) + 1):
            column = (i * ny + j) * nz
            begin, end = starts[column + low], starts[column + high + 1]
            if begin == end:
                continue
            middle[1] = lattice[1] + (j + 0.5) * lattice[4] - pose[10]
            square = 0.0
            for a in range(3):
                along = -box[a]
                for k in range(3):
                    along += pose[3 * a + k] * middle[k]
                off = abs(along) - box[3 + a] - wide[a]
                if off > 0.0:
                    square += off * off
            if square < best * best if best > 0.0 else square == 0.0:
                best = nearest_of(shapes, row, pose, shape, begin, end, best, close, planes, out)
                if best - lattice[6] < stop:
                    return best - lattice[6]
    # The sum's rounding is not undone by taking the radius off.
    return best - lattice[6] if best < reach + lattice[6] else reach
