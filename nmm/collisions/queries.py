"""Distances of one robot at (t, q): measured, read, and written as rows where a control step reads them."""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import coal
import numpy as np
import pinocchio as pin
from numba import types

from nmm.arrays import Array, Integers
from nmm.collisions.near import Scene, find_near
from nmm.collisions.obstacle import Obstacle
from nmm.collisions.results import placement_view, result_view
from nmm.collisions.rows import Rows, write_row, write_rows
from nmm.kernels.compiled import checked_by_caller, compiled
from nmm.kernels.memory import Blocks, Memory, views
from nmm.robots.robot import Robot

#: Of Coal's queries: with its default, 1e-6, gradients err by up to 9e-3; a finer second one diverges.
GJK_TOLERANCE, EPA_TOLERANCE = 1e-8, 1e-6
_FLAT, _INTEGERS, _STRIDED = types.float64[::1], types.int64[::1], types.float64[:, :]
_FIND = types.int64(_INTEGERS, _FLAT, _STRIDED)
_ROWS = types.float64(
    *(_INTEGERS, _FLAT, _STRIDED, _STRIDED, _STRIDED),
    *(_INTEGERS, _FLAT, types.int64),
)


@compiled
def _find(integers: Integers, floats: Array, places: Array) -> int:
    return find_near(views(Scene, integers, floats, 0), places)


@compiled
def _rows(
    integers: Integers,
    floats: Array,
    results: Array,
    places: Array,
    J: Array,
    row_integers: Integers,
    row_floats: Array,
    place: int,
) -> float:
    rows = views(Rows, row_integers, row_floats, place)
    return write_rows(views(Scene, integers, floats, 0), results, places, J, rows)


@compiled
def _row(
    integers: Integers,
    floats: Array,
    places: Array,
    J: Array,
    row_integers: Integers,
    row_floats: Array,
    place: int,
    slot: int,
) -> None:
    rows = views(Rows, row_integers, row_floats, place)
    write_row(views(Scene, integers, floats, 0), J, places, rows, slot)


class Queries:
    """A robot's shapes and obstacles, with one configuration at which they were looked at.

    Parameters
    ----------
    robot : the robot
    shapes : the robot's shapes, then the obstacles', with the pairs to keep apart
    obstacles : those of the last shapes, in order; half-spaces come last
    band, faces : see `near.Scene`

    Attributes
    ----------
    least : the least distance among near pairs in the last `update`, m; infinite where none is near
    blocks, scene : a `near.Scene` in memory, and as views
    moving : obstacles with the numbers of their shapes
    results (P, 10) : [d, n, p1, p2] of each pair, as of when it was measured last
    """

    def __init__(
        self,
        robot: Robot,
        shapes: pin.GeometryModel,
        obstacles: Sequence[Obstacle],
        band: float,
        faces: float,
    ) -> None:
        self.robot, self.shapes = robot, shapes
        self._own = len(shapes.geometryObjects) - len(obstacles)
        self._model, self._data = robot.model, robot.model.createData()
        self.found = found = pin.GeometryData(shapes)
        for shape in shapes.geometryObjects:
            shape.geometry.computeLocalAABB()
        for request in found.distanceRequests:
            _exact(request)
        self.results = result_view(robot.model, shapes, found)
        self.places = placement_view(found)
        for k in range(len(shapes.collisionPairs)):
            found.deactivateCollisionPair(k)
        memory = Memory()
        memory.add(_scene(robot, shapes, obstacles, band, faces))
        self.blocks: Blocks = memory.blocks()
        self.scene = views(Scene, *self.blocks, 0)
        pin.computeJointJacobians(self._model, self._data, pin.neutral(self._model))
        self.J = np.asarray(self._data.J).reshape(6, robot.n, order="F").T
        self.least = np.inf
        self.moving = [(i, one) for i, one in enumerate(obstacles, self._own)]
        self._seen: dict[int, Any] = {}
        self._find = checked_by_caller(_find, _FIND)
        self._rows = checked_by_caller(_rows, _ROWS)

    def place(self, t: float, q: Array) -> None:
        """Put all shapes where they are at t, s, and q (n,)."""
        pin.computeJointJacobians(self._model, self._data, q)
        for i, obstacle in self.moving:
            now = obstacle.at(t)
            if self._seen.get(i) is not now:
                self.shapes.geometryObjects[i].placement = now
                self._seen[i] = now
                self.scene.twists[i] = obstacle.twist(t)
        pin.updateGeometryPlacements(self._model, self._data, self.shapes, self.found)

    @contextmanager
    def among(self, obstacles: Sequence[Obstacle]) -> Iterator[None]:
        """In the block the obstacles are where these are, one each, in order: as a record has them."""
        own = self.moving
        self.moving = [(i, one) for (i, _), one in zip(own, obstacles, strict=True)]
        try:
            yield
        finally:
            self.moving = own

    def measure(self, t: float, q: Array) -> None:
        """Find the pairs that are near, and their distances."""
        self.place(t, q)
        self._choose()
        pin.computeDistances(self.shapes, self.found)

    def _choose(self) -> None:
        """Which pairs are near where the shapes are, told to Pinocchio too."""
        changed, active, found = self.scene.changed, self.scene.active, self.found
        for k in changed[: self._find(*self.blocks, self.places)].tolist():
            if active[k]:
                found.activateCollisionPair(k)
            else:
                found.deactivateCollisionPair(k)

    def update(self, t: float, q: Array, integers: Integers, floats: Array, place: int) -> None:
        """Measure, and write the rows of near pairs where a record `Rows` lies in the blocks."""
        self.measure(t, q)
        self._where = integers, floats, place
        self.least = self._rows(*self.blocks, self.results, self.places, self.J, integers, floats, place)

    def carry(
        self, pair: int, here: tuple[float, Array], there: tuple[float, Array], rows: Rows, slot: int
    ) -> None:
        """Write a row for the points of a pair that are nearest elsewhere: where they are here.

        Parameters
        ----------
        here, there : t, s, and q (n,)
        rows : what lies in the blocks of the last `update`
        """
        self.distances(*there, [pair])
        found, ends = self.results[pair, 1:].copy(), self.scene.pairs[pair].tolist()
        points = found[3:].reshape(2, 3)
        local = [self.found.oMg[i].actInv(point) for i, point in zip(ends, points, strict=True)]
        self.place(*here)
        for k, (i, point) in enumerate(zip(ends, local, strict=True)):
            rows.points[slot, 3 * k : 3 * k + 3] = self.found.oMg[i].act(point)
        rows.points[slot, 6:] = found[:3]
        rows.pair[slot] = pair
        _row(*self.blocks, self.places, self.J, *self._where, slot)

    def distances(self, t: float, q: Array, pairs: Sequence[int]) -> Array:
        """Of some pairs at (t, q), (len(pairs),), m."""
        self.place(t, q)
        for k in pairs:
            pin.computeDistance(self.shapes, self.found, int(k))
        return self.results[list(pairs), 0]

    def inside(self, pair: int) -> bool:
        """Whether the middle of a pair's first shape is inside its second one, an obstacle."""
        i, j = (int(one) for one in self.scene.pairs[pair])
        if j < self._own:
            return False
        place = self.found.oMg[i].act(self.scene.boxes[i, :3])
        here, there = (
            coal.Transform3s(),
            coal.Transform3s(self.found.oMg[j].rotation, self.found.oMg[j].translation),
        )
        here.setTranslation(place)
        point, request, result = coal.Sphere(1e-6), coal.DistanceRequest(), coal.DistanceResult()
        return bool(
            coal.distance(point, here, self.shapes.geometryObjects[j].geometry, there, request, result) < 0.0
        )

    def nearest(self, t: float, q: Array) -> tuple[float, int]:
        """The least distance of all pairs at (t, q), m, and its pair; infinite and -1 where there is none.

        Pairs are measured from the least lower bound on, until that is beyond what was found.
        """
        self.place(t, q)
        self._choose()
        least, nearest = np.inf, -1
        bounds = self.scene.bounds
        for k in np.argsort(bounds, kind="stable").tolist():
            if bounds[k] > least:
                break
            pin.computeDistance(self.shapes, self.found, k)
            d = float(self.results[k, 0])
            if d < least:
                least, nearest = d, k
        return least, nearest


def _exact(request: Any) -> None:
    """Have queries answer finely, and by where the shapes are alone.

    By itself Coal begins with what the query before found: normals then differ by 3e-3 with the history.
    The volumes around the shapes are a better beginning (0.92 times as long, half the error).
    """
    request.gjk_tolerance, request.epa_tolerance = GJK_TOLERANCE, EPA_TOLERANCE
    request.gjk_initial_guess = coal.GJKInitialGuess.BoundingVolumeGuess
    with warnings.catch_warnings():  # the flag is to go, it says; as long as it is there, it counts
        warnings.simplefilter("ignore", DeprecationWarning)
        request.enable_cached_gjk_guess = False


def _scene(
    robot: Robot, shapes: pin.GeometryModel, obstacles: Sequence[Obstacle], band: float, faces: float
) -> Scene:
    objects = shapes.geometryObjects
    own, count, n = len(objects) - len(obstacles), len(objects), robot.n
    supports = np.zeros((count, n))
    boxes = np.zeros((count, 7))
    corners: list[Array] = []
    rounding = np.zeros(count)
    for i, shape in enumerate(objects):
        for joint in robot.model.supports[shape.parentJoint].tolist()[1:]:
            supports[i, robot.model.joints[joint].idx_v] = 1.0
        boxes[i] = _box(shape.geometry)
        points, rounding[i] = _corners(shape.geometry)
        corners.append(points)
    pairs = np.array([[pair.first, pair.second] for pair in shapes.collisionPairs], dtype=np.int64)
    pairs = pairs.reshape(-1, 2)
    planes = [i for i in range(own, count) if isinstance(objects[i].geometry, coal.Halfspace)]
    return Scene(
        band=np.array(band),
        faces=np.array(faces),
        pairs=pairs,
        apart=np.abs(supports[pairs[:, 0]] - supports[pairs[:, 1]]),
        supports=supports,
        twists=np.zeros((count, 6)),
        boxes=boxes,
        planes=np.array(planes[0] if planes else count, dtype=np.int64),
        first_corner=np.cumsum([0, *(len(points) for points in corners)], dtype=np.int64),
        corners=np.concatenate([*corners, np.zeros((0, 3))]),
        rounding=rounding,
        active=np.zeros(len(pairs), dtype=np.int64),
        changed=np.zeros(len(pairs), dtype=np.int64),
        bounds=np.zeros(len(pairs)),
        risky=np.zeros(len(pairs), dtype=np.int64),
        watched=np.zeros(len(pairs), dtype=np.int64),
        kept=np.zeros(len(pairs)),
    )


def _box(geometry: Any) -> Array:
    """Centre, half extents and radius of the box around a shape; a half-space's normal, offset and zeros."""
    if isinstance(geometry, coal.Halfspace):
        return np.array([*geometry.n, geometry.d, 0.0, 0.0, np.inf])
    geometry.computeLocalAABB()
    low, high = geometry.aabb_local.min_, geometry.aabb_local.max_
    return np.array([*(low + high) / 2.0, *(high - low) / 2.0, geometry.aabb_radius])


def _corners(geometry: Any) -> tuple[Array, float]:
    """The corners of a shape in its axes, (V, 3), and the radius about them; a cylinder's are on its rims."""
    if isinstance(geometry, coal.Box):
        grid = np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1])).reshape(3, -1).T
        return grid * np.array(geometry.halfSide), 0.0
    if isinstance(geometry, coal.Capsule):
        return np.array([[0.0, 0.0, -1.0], [0.0, 0.0, 1.0]]) * geometry.halfLength, float(geometry.radius)
    if isinstance(geometry, coal.Cylinder):
        angles = 2.0 * np.pi * np.arange(12) / 12
        rim = geometry.radius * np.column_stack([np.cos(angles), np.sin(angles), np.zeros(12)])
        up = np.array([0.0, 0.0, geometry.halfLength])
        return np.vstack([rim - up, rim + up]), 0.0
    if isinstance(geometry, coal.Sphere):
        return np.zeros((1, 3)), float(geometry.radius)
    if isinstance(geometry, coal.ConvexBase):
        return np.array(geometry.points()).reshape(-1, 3), 0.0
    return np.zeros((0, 3)), 0.0
