"""Distances to clouds, voxels and maps against a k-d tree and Coal: never more than the truth."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import coal
import numpy as np
import pinocchio as pin
import pytest
from scipy.spatial import cKDTree
from test_sensed_files import mounted

import nmm
from nmm.base.arrays import Array
from nmm.base.kernels.compiled import checked_by_caller, compiled
from nmm.base.kernels.record_layout import BLOCKS, Blocks, Memory, views
from nmm.base.kernels.signatures import float64, void
from nmm.model.collisions.elements.boxes import Elements
from nmm.model.collisions.elements.cells import far_field
from nmm.model.collisions.elements.nearest import NEAR, cell_bound, measure_sensed, sensed_bound
from nmm.model.collisions.elements.shapes_record import SensedShapes, covering, sensed_shapes
from nmm.model.collisions.obstacle import Obstacle
from nmm.model.collisions.pairs import query_shapes
from nmm.model.collisions.sensed.self_filter import point_distances
from nmm.model.collisions.shapes import hull
from nmm.model.robots.joint_table import as_row


@compiled
def cell_bounds(blocks: Blocks, points: Array, out: Array) -> None:
    shapes = views(SensedShapes, blocks.integers, blocks.floats, 0)
    for k in range(points.shape[0]):
        out[k] = cell_bound(shapes, 0, points[k, 0], points[k, 1], points[k, 2])


@compiled
def measured(blocks: Blocks, places: Array, reach: float, result: Array) -> None:
    shapes = views(SensedShapes, blocks.integers, blocks.floats, 0)
    measure_sensed(shapes, places, 0, 1, reach, result)


@compiled
def bounded(
    blocks: Blocks, places: Array, enough: float, least: float, stop: float, direction: Array
) -> float:
    shapes = views(SensedShapes, blocks.integers, blocks.floats, 0)
    return float(sensed_bound(shapes, places, 0, 1, enough, least, stop, direction))


_FLAT, _ROWS = float64[::1], float64[:, ::1]


class Pair:
    """One of Coal's shapes beside a sensed obstacle."""

    def __init__(self, geometry: Any, obstacle: Obstacle) -> None:
        self.obstacle = obstacle
        memory = Memory()
        memory.add(sensed_shapes([geometry, None], [obstacle.shape], 1))
        self.blocks = memory.blocks()
        self._measured = checked_by_caller(measured, void(BLOCKS, _ROWS, float64, _FLAT))
        self._bounded = checked_by_caller(bounded, float64(BLOCKS, _ROWS, float64, float64, float64, _FLAT))

    def places(self, pose: pin.SE3) -> Array:
        return np.array([as_row(pose), as_row(self.obstacle.at(0.0))])

    def measure(self, pose: pin.SE3, reach: float) -> Array:
        result = np.zeros(10)
        self._measured(self.blocks, self.places(pose), reach, result)
        return result

    def bound(self, pose: pin.SE3, enough: float, least: float, stop: float = -np.inf) -> tuple[float, Array]:
        direction = np.zeros(3)
        places = self.places(pose)
        return float(self._bounded(self.blocks, places, enough, least, stop, direction)), direction

    def stops_where_it_is_near(self, pose: pin.SE3, bound: float) -> bool:
        """Whether a search that stops below 0.03 m says the same as one that goes on to this bound."""
        stopped, _ = self.bound(pose, 0.2, 0.03, 0.03)
        return stopped == bound if bound >= 0.03 else bound <= stopped < 0.03


def room(count: int, rng: np.random.Generator) -> Array:
    """Points on the walls, the floor and a table of a room."""
    sides = rng.integers(0, 4, count)
    points = rng.uniform([-2.0, -1.5, 0.0], [2.0, 1.5, 2.0], (count, 3))
    points[sides == 0, 0], points[sides == 1, 1], points[sides == 2, 2] = 2.0, -1.5, 0.0
    table = sides == 3
    points[table] = rng.uniform([-0.5, 0.2, 0.7], [0.5, 0.8, 0.72], (int(table.sum()), 3))
    return points + rng.normal(0.0, 0.005, points.shape)


@pytest.mark.parametrize(("count", "cell"), [(300, 0.05), (10_000, 0.05), (10_000, 0.13), (100_000, 0.05)])
def test_no_point_is_nearer_than_the_field_says(count: int, cell: float) -> None:
    """A hundred thousand queries against a k-d tree, half of them outside of the grid."""
    rng = np.random.default_rng(count)
    points = room(count, rng)
    cloud = nmm.PointCloud(points, radius=0.0, cell=cell)
    pair = Pair(coal.Sphere(1e-3), cloud)
    queries = np.vstack([
        rng.uniform([-2.1, -1.6, -0.1], [2.1, 1.6, 2.1], (50_000, 3)), rng.uniform(-6.0, 6.0, (50_000, 3))
    ])  # fmt: skip
    bounds = np.zeros(len(queries))
    checked_by_caller(cell_bounds, void(BLOCKS, _ROWS, _FLAT))(pair.blocks, queries, bounds)
    exact = cKDTree(points).query(queries)[0]
    assert np.all(bounds <= exact)
    # Within the grid no more is lost than two diagonals of a cell, one for each end.
    low, high = points.min(axis=0), points.max(axis=0)
    within = np.all((queries >= low) & (queries <= high), axis=1)
    lost = (exact - bounds)[within]
    assert within.sum() > 30_000
    assert np.all(lost <= 2.0 * np.sqrt(3.0) * cell + 1e-4 * exact[within])


def test_the_field_is_the_least_over_cells_by_its_formula() -> None:
    rng = np.random.default_rng(0)
    for shape in ((9, 7, 5), (12, 10, 1), (1, 1, 6)):
        full = rng.uniform(size=shape) < 0.05
        full.ravel()[0] = True
        cell = np.array([0.05, 0.07, 0.11])
        far = far_field(full, cell)
        index = np.argwhere(full)
        for at in np.ndindex(*shape):
            gaps = np.maximum(np.abs(index - at) - 1, 0) * cell
            expected = np.sqrt((gaps**2).sum(axis=1)).min()
            assert expected * (1.0 - 2e-5) <= far[at] <= expected * (1.0 + 1e-12)


SHAPES = {
    "box": coal.Box(0.5, 0.3, 0.2),
    "sphere": coal.Sphere(0.2),
    "capsule": coal.Capsule(0.08, 0.4),
    "cylinder": coal.Cylinder(0.15, 0.5),
    "plate": coal.Cylinder(0.3, 0.04),
    "hull": hull(np.random.default_rng(7).normal(0.0, 0.15, (60, 3))),
}


def apart(geometry: Any, pose: pin.SE3, other: Any, at: Array, turned: Array | None = None) -> float:
    request, result = coal.DistanceRequest(), coal.DistanceResult()
    request.gjk_tolerance = 1e-9
    first = coal.Transform3s(pose.rotation, pose.translation)
    second = coal.Transform3s(np.eye(3) if turned is None else turned, at)
    return float(coal.distance(geometry, first, other, second, request, result))


def poses(rng: np.random.Generator, count: int) -> list[pin.SE3]:
    return [
        pin.SE3(pin.exp3(rng.normal(size=3)), rng.uniform([-2.2, -1.7, -0.2], [2.2, 1.7, 2.2]))
        for _ in range(count)
    ]


@pytest.mark.parametrize("placed", [False, True])
@pytest.mark.parametrize("name", SHAPES)
def test_a_shapes_distance_to_a_cloud_is_coals_to_its_nearest_point(name: str, placed: bool) -> None:
    rng = np.random.default_rng(11)
    pose = pin.SE3.Random() if placed else pin.SE3.Identity()
    points = room(2000, rng)
    geometry = SHAPES[name]
    cloud = nmm.PointCloud(points, 0.01, placement=pose.homogeneous)
    pair = Pair(geometry, cloud)
    world = points @ pose.rotation.T + pose.translation
    checked = followed = 0
    for at in poses(rng, 60):
        at = pose * at if placed else at
        near = world[np.linalg.norm(world - at.translation, axis=1) < 0.95]  # no shape's radius is 0.5
        exact = min([0.4, *(apart(geometry, at, coal.Sphere(1e-9), point) + 1e-9 for point in near)]) - 0.01
        result = pair.measure(at, 0.39)
        bound, direction = pair.bound(at, 0.2, 0.03)
        assert pair.stops_where_it_is_near(at, bound)
        if exact >= 0.39:
            assert result[0] >= 0.39 - 1e-6
            continue
        if exact <= 0.0:
            assert result[0] <= 0.0
            assert bound <= 0.0
            continue
        assert bound <= exact + 1e-6
        checked += 1
        assert result[0] == pytest.approx(exact, abs=1e-6)
        normal, own, other = result[1:].reshape(3, 3)
        assert np.linalg.norm(normal) == pytest.approx(1.0)
        assert np.allclose(own + result[0] * normal, other, atol=1e-9)
        assert np.linalg.norm(world - (other + 0.01 * normal), axis=1).min() < 1e-9
        assert point_distances(geometry, at.actInv(own)[None])[0] == pytest.approx(0.0, abs=1e-6)
        if exact < 0.03 + NEAR:
            followed += 1
            assert bound >= 0.98 * exact - 2e-4
            assert direction @ normal < -0.99
    assert checked > 15
    assert followed > 3


@pytest.mark.parametrize("name", SHAPES)
def test_a_shapes_distance_to_voxels_columns_and_heights_is_coals_to_the_boxes(name: str) -> None:
    rng = np.random.default_rng(13)
    geometry = SHAPES[name]
    full = rng.uniform(size=(20, 16, 12)) < 0.1
    full[10:14, 4:9, :6] = True
    cells = (rng.uniform(size=(16, 20)) < 0.1).astype(int) * 100
    cells[3:9, 4:10] = 100
    obstacles: list[Obstacle] = [
        nmm.VoxelMap(full, 0.15, [-1.5, -1.2, 0.0]),
        nmm.OccupancyMap(cells, 0.15, [-1.0, -1.2, 0.4], height=0.8),
        nmm.ElevationMap(rng.uniform(0.0, 0.6, (20, 16)), 0.15, [-1.5, -1.2, 0.1]),
    ]
    for obstacle in obstacles:
        shape, place = obstacle.shape, obstacle.at(0.0)
        assert isinstance(shape, Elements)
        assert shape.halves is not None
        boxes = [
            (coal.Box(*(2.0 * half)), place.act(at))
            for half, at in zip(shape.halves, shape.centres, strict=True)
        ]
        inside = shape.inside if shape.inside is not None else np.zeros((0, 3))
        boxes += [(coal.Box(*shape.cell), place.act(at)) for at in inside]
        pair = Pair(geometry, obstacle)
        checked = 0
        for at in poses(rng, 25):
            near = [box for box in boxes if np.linalg.norm(box[1] - at.translation) < 1.6]
            exact = min([9.0, *(apart(geometry, at, box, middle, place.rotation) for box, middle in near)])
            result = pair.measure(at, 0.4)
            bound, _ = pair.bound(at, 0.2, 0.03)
            assert pair.stops_where_it_is_near(at, bound)
            if exact <= 0.0:
                assert result[0] <= 0.0
                assert bound <= 0.0
                continue
            assert bound <= exact + 1e-6
            assert result[0] <= exact + 1e-6
            if exact < 0.4:
                checked += 1
                assert result[0] == pytest.approx(exact, abs=1e-6)
                normal, own, other = result[1:].reshape(3, 3)
                assert np.allclose(own + result[0] * normal, other, atol=1e-9)
                at_other = pin.SE3(np.eye(3), other)
                off = [apart(coal.Sphere(1e-9), at_other, box, at, place.rotation) for box, at in near]
                assert min(off) == pytest.approx(0.0, abs=1e-6)
        assert checked > 3, obstacle


@pytest.mark.parametrize(
    "make", [mounted, lambda: nmm.Scenario.load("tiago_shelf").robot()], ids=["ur5", "tiago"]
)
def test_balls_cover_every_corner_and_face_of_a_robots_shapes(make: Callable[[], nmm.Robot]) -> None:
    """Samples of each mesh's own corners and triangles, which its hull holds, and of primitives' surfaces."""
    rng, robot = np.random.default_rng(5), make()
    meshes = 0
    for shape, convex in zip(
        robot.collision_model.geometryObjects, query_shapes(robot).geometryObjects, strict=True
    ):
        balls = covering(convex.geometry)
        if isinstance(shape.geometry, coal.BVHModelBase):
            meshes += 1
            corners = np.array(shape.geometry.vertices()).reshape(-1, 3)
            triangles = [shape.geometry.tri_indices(k) for k in range(shape.geometry.num_tris)]
            faces = np.array([[triangle[i] for i in range(3)] for triangle in triangles])
            shares = rng.dirichlet(np.ones(3), (len(faces), 4))
            points = np.vstack([corners, np.einsum("fsk,fka->fsa", shares, corners[faces]).reshape(-1, 3)])
        else:
            convex.geometry.computeLocalAABB()
            box = convex.geometry.aabb_local
            points = rng.uniform(box.min_, box.max_, (4000, 3))
            within = [apart(convex.geometry, pin.SE3.Identity(), coal.Sphere(1e-9), p) <= 0.0 for p in points]
            points = points[within]
        off = np.linalg.norm(points[:, None] - balls[None, :, :3], axis=2) - balls[:, 3]
        assert len(points) > 100
        assert off.min(axis=1).max() <= 1e-9, convex.name
    assert meshes > 4


def test_a_shape_inside_of_what_is_full_is_not_free() -> None:
    """Where there are no elements: a map's unknown middle, a wall of voxels a metre thick."""
    cells = np.full((60, 60), -1)
    cells[:5, :5] = 0
    full = np.ones((40, 40, 40), dtype=bool)
    for obstacle in (
        nmm.OccupancyMap(cells, 0.05, height=1.0),
        nmm.VoxelMap(full, 0.05),
        nmm.ElevationMap(np.pad(np.full((38, 38), 1.5), 1), 0.05, [0.0, 0.0, -0.5]),
    ):
        pair = Pair(coal.Sphere(0.05), obstacle)
        deep = pin.SE3(np.eye(3), np.array([1.0, 1.0, 0.5]))
        assert pair.measure(deep, 0.2)[0] < 0.0
        assert pair.bound(deep, 0.2, 0.03)[0] < 0.0


def test_gradients_of_a_wall_of_voxels_do_not_jump_at_its_cells() -> None:
    """Along a flat wall of voxels the normal is the wall's and the distance is even, to a micrometre."""
    full = np.zeros((4, 60, 60), dtype=bool)
    full[0] = True
    wall = nmm.VoxelMap(full, 0.05, [0.0, -1.5, -1.5])
    for name in ("box", "hull", "capsule", "cylinder"):
        pair = Pair(SHAPES[name], wall)
        turn = pin.exp3(np.array([0.3, -0.2, 0.4]))
        rows = [
            pair.measure(pin.SE3(turn, np.array([0.6, y, 0.3 * y])), 0.5) for y in np.linspace(-0.4, 0.4, 321)
        ]
        distances, normals = np.array(rows)[:, 0], np.array(rows)[:, 1:4]
        assert np.ptp(distances) < 1e-6
        assert np.abs(normals - [-1.0, 0.0, 0.0]).max() < 1e-4, name


@pytest.mark.parametrize("radius", [0.005, 0.011, 0.012, 0.026, 0.051])
def test_where_nothing_is_within_reach_no_bound_is_below_it(radius: float) -> None:
    """Far from the grid's own bound: two points in one large cell, the shape between them."""
    cloud = nmm.PointCloud([[0.0, 0.0, 0.0], [2.0, 0.0, 0.0]], radius, cell=3.0)
    at = pin.SE3(np.eye(3), np.array([1.0, 0.0, 0.0]))
    for name in ("sphere", "box", "hull"):
        pair = Pair(SHAPES[name], cloud)
        for reach in (0.02, 0.03, 0.05, 0.1):
            assert pair.bound(at, reach, reach)[0] >= reach
            assert pair.measure(at, reach)[0] >= reach


@pytest.mark.parametrize(
    "geometry", [coal.Ellipsoid(0.2, 0.1, 0.3), coal.Cone(0.15, 0.5)], ids=["egg", "cone"]
)
def test_what_has_no_distance_of_its_own_is_the_box_around_it(geometry: Any) -> None:
    rng = np.random.default_rng(19)
    points = room(2000, rng)
    pair = Pair(geometry, nmm.PointCloud(points, 0.01))
    checked = 0
    for at in poses(rng, 40):
        near = points[np.linalg.norm(points - at.translation, axis=1) < 0.95]
        exact = min([0.4, *(apart(geometry, at, coal.Sphere(1e-9), point) for point in near)]) - 0.01
        d = pair.measure(at, 0.3)[0]
        checked += 0.0 < d < 0.3
        if exact < 0.39:  # farther points were left out
            assert d <= max(exact, 0.0) + 1e-6
        # No point of the box is farther from the shape than its half diagonal.
        assert d >= min(exact, 0.3) - np.linalg.norm(geometry.aabb_local.max_) - 1e-6
    assert checked > 5


def test_kernels_run_as_plain_python_too() -> None:
    rng = np.random.default_rng(17)
    cloud = nmm.PointCloud(room(300, rng), 0.01)
    at = pin.SE3(np.eye(3), np.array([1.5, 0.0, 0.4]))
    for name in ("box", "hull"):
        pair = Pair(SHAPES[name], cloud)
        compiled_result = pair.measure(at, 0.5)
        plain = np.zeros(10)
        shapes = views(SensedShapes, *pair.blocks, 0)
        _plain(measure_sensed)(shapes, pair.places(at), 0, 1, 0.5, plain)
        assert np.allclose(plain, compiled_result, atol=1e-12)
        assert compiled_result[0] < 0.5


def _plain(function: Any) -> Any:
    return getattr(function, "py_func", function)
