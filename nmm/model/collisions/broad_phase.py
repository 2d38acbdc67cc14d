"""Which pairs are near, compiled: lower bounds of all distances, from boxes around the shapes."""

import math
from typing import NamedTuple

from nmm.base.arrays import Array, Integers
from nmm.base.kernels.compiled import compiled, scratch
from nmm.base.kernels.record_layout import (
    Cell,
    IntegerCell,
    IntegerMatrix,
    IntegerVector,
    Matrix,
    Vector,
    views,
)
from nmm.model.collisions.elements.nearest import far_bound, into_axes
from nmm.model.collisions.elements.shapes_record import SensedShapes


class PairArrays(NamedTuple):
    """G shapes and P pairs of them, in memory; lengths in m.

    band () : pairs nearer than this are measured and have rows; faces () : nearer than this, several rows
    pairs (P, 2); apart (P, n) : 1 where a coordinate moves one shape of a pair and not the other
    supports (G, n) : 1 where a coordinate moves a shape
    twists (G, 6) : of obstacles, their origin's velocity over the angular one, world axes
    boxes (G, 7) : centre, half extents and radius of a shape's box; a half-space's normal and offset
    planes () : half-spaces are the shapes from this one on, and second in their pairs
    first_corner (G + 1,), corners (..., 3), rounding (G,) : corners in a shape's axes, and radius about them
    active (P,) : whether a pair is near; changed (P,) : those that came near or left in the last step
    bounds (P,) : distances of near pairs, once measured, and lower bounds of the others'
    risky (P,), watched (P,) : the pairs listed for the look-ahead, and whether a pair is
    kept (P,) : what a pair's distance may not fall below; nearer (P,) : by how much a pair may be nearer than
    what is asked for
    sensed : obstacles that were sensed, second in their pairs"""

    band: Cell
    faces: Cell
    pairs: IntegerMatrix
    apart: Matrix
    supports: Matrix
    twists: Matrix
    boxes: Matrix
    planes: IntegerCell
    first_corner: IntegerVector
    corners: Matrix
    rounding: Vector
    active: IntegerVector
    changed: IntegerVector
    bounds: Vector
    risky: IntegerVector
    watched: IntegerVector
    kept: Vector
    nearer: Vector
    sensed: SensedShapes


@compiled
def to_world(places: Array, shape: int, x: float, y: float, z: float, out: Array, row: int) -> None:
    """out[row] = R (x, y, z) + p; places (G, 12): R column by column, then p."""
    for k in range(3):
        out[row, k] = (
            places[shape, k] * x + places[shape, 3 + k] * y + places[shape, 6 + k] * z + places[shape, 9 + k]
        )


@compiled
def outside_box(places: Array, boxes: Array, box: int, centers: Array, point: int) -> float:
    """Distance of a centre from the box around another shape; -infinity inside: the depth is unknown."""
    square = 0.0
    for k in range(3):
        along = 0.0
        for i in range(3):
            along += places[box, 3 * k + i] * (centers[point, i] - centers[box, i])
        beyond = abs(along) - boxes[box, 3 + k]
        if beyond > 0.0:
            square += beyond * beyond
    return math.sqrt(square) if square > 0.0 else -math.inf


@compiled
def above_plane(places: Array, boxes: Array, plane: int, centers: Array, box: int) -> float:
    """Height of a shape's box above a half-space."""
    height = -boxes[plane, 3]
    across = 0.0
    n = scratch(3)
    for k in range(3):
        n[k] = 0.0
        for i in range(3):
            n[k] += places[plane, 3 * i + k] * boxes[plane, i]
        height += n[k] * (centers[box, k] - places[plane, 9 + k])
    for k in range(3):
        across += boxes[box, 3 + k] * abs(
            n[0] * places[box, 3 * k] + n[1] * places[box, 3 * k + 1] + n[2] * places[box, 3 * k + 2]
        )
    return height - across


@compiled
def find_near(integers: Integers, floats: Array, places: Array) -> int:
    """Write the lower bounds, and which pairs came near or left; returns their count."""
    scene = views(PairArrays, integers, floats, 0)
    count = min(scene.boxes.shape[0], scene.planes[()])
    boxes, band = scene.boxes, float(scene.band[()])
    centers, pose = scratch((count + 1, 3)), scratch(12)
    for i in range(count):
        to_world(places, i, boxes[i, 0], boxes[i, 1], boxes[i, 2], centers, i)
    changed = 0
    for k in range(scene.pairs.shape[0]):
        i, j = scene.pairs[k, 0], scene.pairs[k, 1]
        if j >= scene.planes[()]:
            bound = above_plane(places, boxes, j, centers, i)
        else:
            x = centers[i, 0] - centers[j, 0]
            y = centers[i, 1] - centers[j, 1]
            z = centers[i, 2] - centers[j, 2]
            bound = math.sqrt(x * x + y * y + z * z) - boxes[i, 6] - boxes[j, 6]
            if bound < band:
                bound = max(bound, outside_box(places, boxes, j, centers, i) - boxes[i, 6])
                bound = max(bound, outside_box(places, boxes, i, centers, j) - boxes[j, 6])
            if bound < band and scene.sensed.row[j] >= 0:
                into_axes(places, j, i, pose)
                far = far_bound(scene.sensed, scene.sensed.row[j], pose, i, math.inf, -math.inf)
                bound = max(bound, far)
        scene.bounds[k] = bound
        near = 1 if bound < band else 0
        if near != scene.active[k]:
            scene.active[k] = near
            scene.changed[changed] = k
            changed += 1
    return changed
