"""The record of a robot's shapes beside what was sensed, as kernels read it."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import Any, NamedTuple

import coal
import numpy as np

from nmm.base.arrays import Array, unwritable
from nmm.base.kernels.pointers import address_of
from nmm.base.kernels.record_layout import IntegerMatrix, IntegerVector, Matrix
from nmm.model.collisions.elements.boxes import Elements

#: Kinds of the robot's shapes: boxes; spheres and capsules; cylinders; hulls of points.
BOX, ROUND, DISC, HULL = 0, 1, 2, 3
#: At most so many balls cover a shape along each axis; half of the boxes that they go around, m.
ALONG, PIECE = 6, 0.1


class SensedShapes(NamedTuple):
    """G shapes, a robot's and obstacles', and C obstacles among them that were sensed; lengths in m.

    row (G,) : of a sensed obstacle in `grids`, -1 of others
    kind (G,) : BOX, ROUND, DISC or HULL; of the robot's shapes
    boxes (G, 6) : centre and half extents of a shape's box, in its axes
    heart (G, 3) : a point inside
    size (G, 2) : radius of what is round, and half of its length along z
    first_corner (G + 1,), corners (..., 3) : of hulls
    first_ball (G + 1,), balls (..., 4) : centres and radii; together they cover a shape
    grids (C, 8) : addresses of field, starts, centres and halves (0 where all have the same), nx, ny, nz, N
    lattice (C, 10) : corner, edges of a cell, radius, halves (0 of points)
    edition (C,) : of the elements, from 1 on: one more where others have taken their place
    """

    row: IntegerVector
    kind: IntegerVector
    boxes: Matrix
    heart: Matrix
    size: Matrix
    first_corner: IntegerVector
    corners: Matrix
    first_ball: IntegerVector
    balls: Matrix
    grids: IntegerMatrix
    lattice: Matrix
    edition: IntegerVector


def sensed_shapes(geometries: Sequence[Any], obstacles: Sequence[Any], own: int) -> SensedShapes:
    """Of Coal's shapes, the first `own` of which are the robot's, and the shapes of the obstacles after them.
    Without one that was sensed there is nothing in it. The caller holds the shapes."""
    seen = [(own + i, shape) for i, shape in enumerate(obstacles) if isinstance(shape, Elements)]
    count = len(geometries)
    row = np.full(count, -1, dtype=np.int64)
    kind = np.zeros(count, dtype=np.int64)
    boxes, heart, size = np.zeros((count, 6)), np.zeros((count, 3)), np.zeros((count, 2))
    corners: list[Array] = [np.zeros((0, 3))] * count
    balls: list[Array] = [np.zeros((0, 4))] * count
    for k, (i, _) in enumerate(seen):
        row[i] = k
    for i in range(own if seen else 0):
        kind[i], boxes[i], heart[i], size[i], corners[i] = _described(geometries[i])
        balls[i] = covering(geometries[i])
    grids, lattice = np.zeros((len(seen), 8), dtype=np.int64), np.zeros((len(seen), 10))
    for k, (_, shape) in enumerate(seen):
        grids[k], lattice[k] = grid_of(shape)
    return SensedShapes(
        row=row,
        kind=kind,
        boxes=boxes,
        heart=heart,
        size=size,
        first_corner=np.cumsum([0, *map(len, corners)], dtype=np.int64),
        corners=np.concatenate([*corners, np.zeros((0, 3))]),
        first_ball=np.cumsum([0, *map(len, balls)], dtype=np.int64),
        balls=np.concatenate([*balls, np.zeros((0, 4))]),
        grids=grids,
        lattice=lattice,
        edition=np.ones(len(seen), dtype=np.int64),
    )


def grid_of(shape: Elements) -> tuple[Any, Array]:
    """A row of `grids` and one of `lattice`."""
    cells = shape.cells
    same = cells.halves[0] if len(cells.halves) == 1 else np.zeros(3)
    halves = address_of(cells.halves) if len(cells.halves) > 1 else 0
    addresses = address_of(cells.field), address_of(cells.starts), address_of(cells.centres), halves
    lattice = np.array([*cells.corner, *cells.cell, shape.radius, *same])
    return (*addresses, *cells.field.shape, len(cells.centres)), lattice


def _described(geometry: Any) -> tuple[int, Array, Array, tuple[float, float], Array]:
    """Kind, box, a point inside, radius and half length, and corners of one of Coal's shapes."""
    geometry.computeLocalAABB()
    low, high = geometry.aabb_local.min_, geometry.aabb_local.max_
    box, none = np.array([*(low + high) / 2.0, *(high - low) / 2.0]), np.zeros((0, 3))
    if isinstance(geometry, coal.Box):
        return BOX, np.array([0.0, 0.0, 0.0, *geometry.halfSide]), np.zeros(3), (0.0, 0.0), none
    if isinstance(geometry, coal.Sphere):
        return ROUND, box, np.zeros(3), (float(geometry.radius), 0.0), none
    if isinstance(geometry, coal.Capsule):
        return ROUND, box, np.zeros(3), (float(geometry.radius), float(geometry.halfLength)), none
    if isinstance(geometry, coal.Cylinder):
        return DISC, box, np.zeros(3), (float(geometry.radius), float(geometry.halfLength)), none
    if not isinstance(geometry, coal.ConvexBase):  # an ellipsoid, a cone: the box around it
        return BOX, box, box[:3].copy(), (0.0, 0.0), none
    points = np.array(geometry.points()).reshape(-1, 3)
    return HULL, box, points.mean(axis=0), (0.0, 0.0), points


def covering(geometry: Any) -> Array:
    """Balls (B, 4), centre and radius, m, that cover a convex shape of Coal's, in its axes: around the parts
    into which planes cut its box, where a part can meet it."""
    _, box, _, (radius, _), points = _described(geometry)
    if isinstance(geometry, coal.Sphere):
        return np.array([[0.0, 0.0, 0.0, radius]])
    return _covering(box.tobytes(), radius, points.tobytes())


@lru_cache(maxsize=256)
def _covering(box_data: bytes, radius: float, corners: bytes) -> Array:
    """The same of what is not a sphere, kept: a robot's shapes are covered anew for each scene."""
    box, points = np.frombuffer(box_data), np.frombuffer(corners).reshape(-1, 3)
    parts = np.clip(np.ceil(box[3:] / PIECE), 1, ALONG).astype(int)
    if radius:  # slices along z
        count = int(np.clip(np.ceil(box[5] / radius), 1, 2 * ALONG))
        z = (np.arange(count) + 0.5) / count * 2.0 - 1.0
        far = float(np.hypot(radius, box[5] / count))
        return unwritable(np.array([[0.0, 0.0, box[5] * share, far] for share in z]))
    edges = box[3:] / parts
    grid = np.array([*np.ndindex(*parts)])
    centres = box[:3] - box[3:] + (2.0 * grid + 1.0) * edges
    far = float(np.linalg.norm(edges))
    if len(points):
        from scipy.spatial import ConvexHull

        planes = ConvexHull(points).equations
        centres = centres[(centres @ planes[:, :3].T + planes[:, 3]).max(axis=1) <= far + 1e-9]
    return unwritable(np.column_stack([centres, np.full(len(centres), far)]))
