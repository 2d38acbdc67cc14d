"""Distances of one robot at (t, q), measured and written as rows for a control step."""

import ctypes
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import coal
import numpy as np
import pinocchio as pin

from nmm.base.arrays import Array, Integers
from nmm.base.errors import NmmError
from nmm.base.kernels.compiled import checked_by_caller, compiled
from nmm.base.kernels.record_layout import BLOCKS, Blocks, Memory, views
from nmm.base.kernels.signatures import float64, int64, void
from nmm.model.collisions.broad_phase import PairArrays, find_near
from nmm.model.collisions.elements.boxes import Elements
from nmm.model.collisions.elements.nearest import measure_sensed
from nmm.model.collisions.elements.shapes_record import grid_of, sensed_shapes
from nmm.model.collisions.near_rows import write_rows
from nmm.model.collisions.obstacle import Obstacle
from nmm.model.collisions.pairs import box_around, pairs_of
from nmm.model.collisions.rows import DistanceRows, write_row
from nmm.model.collisions.seen_rows import remember
from nmm.model.collisions.shapes import Shape
from nmm.model.robots.joint_table import placement_rows
from nmm.model.robots.robot import Robot

#: Of Coal's queries: with its default, 1e-6, gradients err by up to 9e-3; a finer second one diverges.
GJK_TOLERANCE, EPA_TOLERANCE = 1e-8, 1e-6
#: How far from what was sensed the nearest of it is looked for where a motion's distances are reported, m;
#: beyond, a lower bound is.
REPORTED = 1.0
_STRIDED = float64[:, :]
_FIND = int64(*BLOCKS.types, _STRIDED)
_ROW = void(BLOCKS, _STRIDED, _STRIDED, BLOCKS, int64, int64)
_PAIR = void(BLOCKS, _STRIDED, _STRIDED, int64, float64)
_SENSED = void(BLOCKS, _STRIDED, _STRIDED)
_ROWS = float64(BLOCKS, _STRIDED, _STRIDED, _STRIDED, BLOCKS, int64)


@compiled
def _measure_pair(blocks: Blocks, places: Array, results: Array, pair: int, reach: float) -> None:
    scene = views(PairArrays, blocks.integers, blocks.floats, 0)
    measure_sensed(scene.sensed, places, scene.pairs[pair, 0], scene.pairs[pair, 1], reach, results[pair])


@compiled
def _measure_near(blocks: Blocks, places: Array, results: Array) -> None:
    scene = views(PairArrays, blocks.integers, blocks.floats, 0)
    for pair in range(scene.pairs.shape[0]):
        i, j = scene.pairs[pair, 0], scene.pairs[pair, 1]
        if scene.active[pair] == 1 and scene.sensed.row[j] >= 0:
            measure_sensed(scene.sensed, places, i, j, scene.band[()], results[pair])


@compiled
def _row(blocks: Blocks, places: Array, J: Array, row_blocks: Blocks, place: int, slot: int) -> None:
    scene = views(PairArrays, blocks.integers, blocks.floats, 0)
    rows = views(DistanceRows, row_blocks.integers, row_blocks.floats, place)
    write_row(scene, J, places, rows, slot)
    remember(scene, places, rows, slot)


class Queries:
    """A robot's shapes and obstacles, placed at one configuration at a time.

    shapes : the robot's, then the obstacles' in order, half-spaces last; with the pairs to keep apart
    band, faces, blocks, scene : see `PairArrays`: its blocks in memory, and its views
    least : the least distance among near pairs in the last `update`, m; infinite where none is near
    moving : obstacles with the numbers of their shapes
    results (P, 10) : [d, n, p1, p2] of each pair when last measured"""

    def __init__(
        self,
        robot: Robot,
        shapes: pin.GeometryModel,
        obstacles: Sequence[Obstacle],
        held: Sequence[Shape],
        band: float,
        faces: float,
    ) -> None:
        self.robot, self.shapes = robot, shapes
        self._own = len(shapes.geometryObjects) - len(obstacles)
        self._model, self._data = robot.model, robot.model.createData()
        self.found = geometry_data = pin.GeometryData(shapes)
        for shape in shapes.geometryObjects:
            shape.geometry.computeLocalAABB()
        # By default Coal starts from the previous result, and normals then depend on the history by 3e-3. A
        # start from the shapes' bounding volumes takes 0.92 times as long and halves the error.
        for request in geometry_data.distanceRequests:
            request.gjk_tolerance, request.epa_tolerance = GJK_TOLERANCE, EPA_TOLERANCE
            request.gjk_initial_guess = coal.GJKInitialGuess.BoundingVolumeGuess
            with warnings.catch_warnings():  # deprecated, but still read
                warnings.simplefilter("ignore", DeprecationWarning)
                request.enable_cached_gjk_guess = False
        self.results = _result_view(robot.model, shapes, geometry_data)
        self.places = placement_rows(geometry_data.oMg)
        for k in range(len(shapes.collisionPairs)):
            geometry_data.deactivateCollisionPair(k)
        memory = Memory()
        self._held = [*held]
        memory.add(_scene(robot, shapes, held, band, faces))
        self.blocks: Blocks = memory.blocks()
        self.scene = views(PairArrays, *self.blocks, 0)
        pin.computeJointJacobians(self._model, self._data, pin.neutral(self._model))
        self.J = np.asarray(self._data.J).reshape(6, robot.n, order="F").T
        self.least = np.inf
        self.moving = [(i, obstacle) for i, obstacle in enumerate(obstacles, self._own)]
        self._seen: dict[int, Any] = {}
        self._sensed = np.flatnonzero(self.scene.sensed.row[self.scene.pairs[:, 1]] >= 0).tolist()
        self._others = {*range(len(self.scene.pairs))} - {*self._sensed}
        self._near = checked_by_caller(_measure_near, _SENSED) if self._sensed else None
        self._pair = checked_by_caller(_measure_pair, _PAIR) if self._sensed else None
        self._find = checked_by_caller(find_near, _FIND)
        self._row = checked_by_caller(_row, _ROW)
        self._rows = checked_by_caller(write_rows, _ROWS)

    def renew(self) -> None:
        """Take what was sensed and has been updated as it is now; between two samples."""
        scene = self.scene
        for k, (i, obstacle) in enumerate(self.moving):
            shape = obstacle.shape
            if shape is self._held[k] or not isinstance(shape, Elements):
                continue
            row = int(scene.sensed.row[i])
            scene.sensed.grids[row], scene.sensed.lattice[row] = grid_of(shape)
            scene.sensed.edition[row] += 1
            low, high = shape.box
            scene.boxes[i, :3], scene.boxes[i, 3:6] = 0.5 * (low + high), 0.5 * (high - low)
            scene.boxes[i, 6] = 0.5 * np.linalg.norm(high - low)
            self._held[k] = shape

    def place(self, t: float, q: Array) -> None:
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
        """In the block, the obstacles are where these (one each, in order) are, as in a record."""
        own = self.moving
        self.moving = [(i, obstacle) for (i, _), obstacle in zip(own, obstacles, strict=True)]
        try:
            yield
        finally:
            self.moving = own

    def measure(self, t: float, q: Array) -> None:
        self.place(t, q)
        self._choose()
        pin.computeDistances(self.shapes, self.found)
        if self._near is not None:
            self._near(self.blocks, self.places, self.results)

    def _choose(self) -> None:
        """Find which pairs are near where the shapes are, for Pinocchio too."""
        changed, active, geometry_data = self.scene.changed, self.scene.active, self.found
        for k in changed[: self._find(*self.blocks, self.places)].tolist():
            if k not in self._others:
                continue
            if active[k]:
                geometry_data.activateCollisionPair(k)
            else:
                geometry_data.deactivateCollisionPair(k)

    def update(self, t: float, q: Array, integers: Integers, floats: Array, place: int) -> None:
        """Measure, and write the rows of near pairs where `DistanceRows` lies in the blocks."""
        self.renew()
        self.measure(t, q)
        self._where = Blocks(integers, floats), place
        self.least = self._rows(self.blocks, self.results, self.places, self.J, *self._where)

    def carry(
        self, pair: int, now: tuple[float, Array], later: tuple[float, Array], rows: DistanceRows, slot: int
    ) -> None:
        """Write a row of the last `update`: a pair's points nearest at `later`, (t, q), placed at `now`."""
        self.distances(*later, [pair])
        result, ends = self.results[pair, 1:].copy(), self.scene.pairs[pair].tolist()
        points = result[3:].reshape(2, 3)
        local = [self.found.oMg[i].actInv(point) for i, point in zip(ends, points, strict=True)]
        self.place(*now)
        for k, (i, point) in enumerate(zip(ends, local, strict=True)):
            rows.points[slot, 3 * k : 3 * k + 3] = self.found.oMg[i].act(point)
        rows.points[slot, 6:] = result[:3]
        rows.pair[slot] = pair
        self._row(self.blocks, self.places, self.J, *self._where, slot)

    def _compute(self, pair: int, reach: float) -> None:
        if self._pair is None or pair in self._others:
            pin.computeDistance(self.shapes, self.found, pair)
        else:
            self._pair(self.blocks, self.places, self.results, pair, reach)

    def distances(self, t: float, q: Array, pairs: Sequence[int], reach: float | None = None) -> Array:
        """Of some pairs at (t, q), (len(pairs),), m; to what was sensed a lower bound from `reach`, m, on, or
        from the band on."""
        self.place(t, q)
        for k in pairs:
            self._compute(int(k), float(self.scene.band[()]) if reach is None else reach)
        return self.results[list(pairs), 0]

    def inside(self, pair: int) -> bool:
        """Whether the middle of a pair's first shape is inside its second one, an obstacle."""
        i, j = (int(index) for index in self.scene.pairs[pair])
        if j < self._own:
            return False
        shape = self._held[j - self._own]
        if isinstance(shape, Elements):
            return shape.contains(self.found.oMg[j].actInv(self.found.oMg[i].act(self.scene.boxes[i, :3])))
        point_pose = coal.Transform3s(np.eye(3), self.found.oMg[i].act(self.scene.boxes[i, :3]))
        shape_pose = coal.Transform3s(self.found.oMg[j].rotation, self.found.oMg[j].translation)
        point, geometry = coal.Sphere(1e-6), self.shapes.geometryObjects[j].geometry
        d = coal.distance(
            point, point_pose, geometry, shape_pose, coal.DistanceRequest(), coal.DistanceResult()
        )
        return bool(d < 0.0)

    def nearest(self, t: float, q: Array) -> tuple[float, int]:
        """The least distance of all pairs at (t, q), m, and its pair; infinity and -1 without pairs."""
        self.place(t, q)
        self._choose()
        least, nearest = np.inf, -1
        bounds = self.scene.bounds
        for k in np.argsort(bounds, kind="stable").tolist():
            if bounds[k] > least:
                break  # no other pair is nearer than its bound
            self._compute(k, min(least, REPORTED))
            d = float(self.results[k, 0])
            if d < least:
                least, nearest = d, k
        return least, nearest


def _result_view(model: pin.Model, shapes: pin.GeometryModel, geometry_data: pin.GeometryData) -> Array:
    """(P, 10) = [d, n, p1, p2] of every pair's last query, m, world axes: a view of Coal's own memory, where
    they must be contiguous; else `NmmError`."""
    results = geometry_data.distanceResults
    if not len(results):
        return np.zeros((0, 10))
    pin.computeDistances(model, model.createData(), shapes, geometry_data, pin.neutral(model))
    start, end = (int(results[k].normal.ctypes.data) - 8 for k in (0, len(results) - 1))
    stride = (end - start) // (len(results) - 1) if len(results) > 1 else 80
    numbers = np.ctypeslib.as_array((ctypes.c_double * ((end + 80 - start) // 8)).from_address(start))
    rows = np.lib.stride_tricks.as_strided(numbers, (len(results), 10), (stride, 8))
    for row, result in zip(rows, results, strict=True):
        reported = [
            result.min_distance,
            *result.normal,
            *result.getNearestPoint1(),
            *result.getNearestPoint2(),
        ]
        if not np.array_equal(row, reported, equal_nan=True):
            raise NmmError("this version of Coal keeps distances in another way than nmm expects")
    return rows


def _scene(
    robot: Robot, shapes: pin.GeometryModel, held: Sequence[Shape], band: float, faces: float
) -> PairArrays:
    objects = shapes.geometryObjects
    own, count, n = len(objects) - len(held), len(objects), robot.n
    supports = np.zeros((count, n))
    boxes = np.zeros((count, 7))
    corners: list[Array] = []
    rounding = np.zeros(count)
    for i, shape in enumerate(objects):
        for joint in robot.model.supports[shape.parentJoint].tolist()[1:]:
            supports[i, robot.model.joints[joint].idx_v] = 1.0
        boxes[i] = box_around(shape.geometry)
        seen = i >= own and isinstance(held[i - own], Elements)
        points, rounding[i] = (np.zeros((0, 3)), 0.0) if seen else corners_of(shape.geometry)
        corners.append(points)
    pairs = np.array(pairs_of(shapes), dtype=np.int64).reshape(-1, 2)
    P = len(pairs)
    planes = [i for i in range(own, count) if isinstance(objects[i].geometry, coal.Halfspace)]
    return PairArrays(
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
        active=np.zeros(P, dtype=np.int64),
        changed=np.zeros(P, dtype=np.int64),
        bounds=np.zeros(P),
        risky=np.zeros(P, dtype=np.int64),
        watched=np.zeros(P, dtype=np.int64),
        kept=np.zeros(P),
        nearer=np.zeros(P),
        sensed=sensed_shapes([shape.geometry for shape in objects], held, own),
    )


def corners_of(geometry: Any) -> tuple[Array, float]:
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
