"""Robots among what was sensed: plans, controllers, horizons, scenarios, folders and pages."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from scanned import door, walls

import nmm
from nmm.base.errors import InputError
from nmm.model.collisions.elements import Elements
from nmm.plugins.planning.collisions.motion_check import MotionCheck

GOAL = {"x": 4.0, "y": 0.6, "theta": 0.0}
START = {"x": 0.3, "y": -0.9, "q1": 0.5}
#: By how much a cloud may be off: three standard deviations of its noise.
NOISE = 3 * 0.003


def least(robot: nmm.Robot, q: np.ndarray, obstacles: list[nmm.Obstacle]) -> float:
    """The least true distance of configurations (N, n), by Coal on boxes, m."""
    queries = nmm.Collisions(0.03, self_collisions=False, obstacles=obstacles).on(robot).queries
    return min(queries.nearest(0.0, at)[0] for at in q)


@pytest.mark.parametrize("smooth", [False, True])
@pytest.mark.parametrize("seed", [0, 1])
def test_a_plan_through_a_scanned_door_keeps_its_distance_of_the_true_walls(seed: int, smooth: bool) -> None:
    robot = nmm.load("unicycle_3r")
    cloud = nmm.PointCloud(door(20_000, seed), radius=0.025, name="wall")
    plan = nmm.plan(robot, START, GOAL, [cloud], seed=seed, smooth=smooth)
    q, _ = plan(np.linspace(0.0, plan.duration, 400))
    assert np.allclose(plan.end[:3], [4.0, 0.6, 0.0], atol=1e-6)
    assert least(robot, q, walls()) >= 0.03 - NOISE
    # The way leads through the door: without it there is none.
    between = q[np.abs(q[:, 0] - 2.0) < 0.05]
    assert len(between)
    assert np.abs(between[:, 1]).max() < 0.45


def test_a_cloud_beside_shapes_and_maps_is_one_more_obstacle() -> None:
    robot = nmm.load("unicycle_3r")
    cells = np.zeros((80, 4), dtype=int)
    cells[:, 1] = 100
    cells[31:49] = 0
    room = nmm.OccupancyMap(cells, 0.05, [1.925, -2.0, 0.0], height=2.0, name="map")
    pillar = nmm.Obstacle(nmm.Cylinder(0.1, 2.0), [3.0, 0.3, 1.0], name="pillar")
    plan = nmm.plan(robot, START, GOAL, [room, pillar])
    q, _ = plan(np.linspace(0.0, plan.duration, 300))
    assert least(robot, q, [*walls(0.05), pillar]) >= 0.03 - 1e-3
    assert plan.trajectory().clearance_between.min() >= 0.03 - 1e-3


@pytest.mark.parametrize("kind", ["cloud", "map", "voxels"])
def test_a_controller_keeps_its_distance_of_what_was_sensed(kind: str) -> None:
    """Its goal is behind a wall that has no door."""
    robot = nmm.load("unicycle_3r")
    if kind == "cloud":
        points = np.array([[2.0, 0.02 * i, 0.02 * k] for i in range(-80, 81) for k in range(80)])
        wall: nmm.Obstacle = nmm.PointCloud(points, radius=0.02, name="wall")
        true = [nmm.Obstacle(nmm.Box([0.04, 3.24, 1.64]), [2.0, 0.0, 0.79], name="true")]
    elif kind == "map":
        wall = nmm.OccupancyMap(np.full((64, 1), 100), 0.05, [1.975, -1.6, 0.0], height=1.6, name="wall")
        true = [nmm.Obstacle(nmm.Box([0.05, 3.2, 1.6]), [2.0, 0.0, 0.8], name="true")]
    else:
        wall = nmm.VoxelMap(np.ones((1, 64, 32), dtype=bool), 0.05, [1.975, -1.6, 0.0], name="wall")
        true = [nmm.Obstacle(nmm.Box([0.05, 3.2, 1.6]), [2.0, 0.0, 0.8], name="true")]
    task = nmm.Task(nmm.Position("ee", "xy"), [3.0, 0.1], speed=0.4)
    collisions = nmm.Collisions(0.05, self_collisions=False, obstacles=[wall])
    controller = nmm.Controller(robot, task, nmm.DampedLeastSquares(), collisions=collisions, dt=0.02)
    run = nmm.simulate(controller, {"q1": 0.3, "q2": 0.6}, 12, 0.02, "zoh")
    reached = least(robot, run.q, true)
    assert reached >= 0.05 - 1e-3
    assert reached < 0.12
    assert run.clearance_between.min() >= 0.05 - 1e-3


def test_a_robot_that_touches_a_cloud_or_stands_in_a_map_is_told_so() -> None:
    robot = nmm.load("unicycle_3r")
    near = nmm.PointCloud(np.random.default_rng(0).uniform(-0.2, 0.2, (500, 3)), name="dust")
    with pytest.raises(InputError, match="dust"):
        nmm.plan(robot, robot.rest, GOAL, [near])
    around = nmm.OccupancyMap(np.full((100, 100), -1), 0.05, [-2.5, -2.5, 0.0], name="unknown")
    with pytest.raises(InputError, match="unknown"):
        nmm.plan(robot, robot.rest, GOAL, [around])
    task = nmm.Task(nmm.Position("ee", "xy"), [3.0, 0.1])
    controller = nmm.Controller(
        robot, task, nmm.ProjectedGradient(), collisions=nmm.Collisions(obstacles=[around]), dt=0.02
    )
    with pytest.raises(InputError, match="unknown"):
        nmm.simulate(controller, robot.rest, 1, 0.02, "zoh")


def test_all_of_a_distance_is_kept_of_a_cloud_in_a_narrow_band() -> None:
    """`keep` and `widen` look beyond the band where there is room; in one large cell nothing else says so."""
    robot = nmm.load("unicycle_3r")
    far = nmm.PointCloud([[3.0, 0.0, 0.3], [-3.0, 0.0, 0.3]], name="far", cell=7.0)
    scene = nmm.Collisions(0.03, self_collisions=False, obstacles=[far], band=0.031).on(robot)
    check = MotionCheck(robot, scene)
    check.keep(robot.rest[None])
    assert np.all(check.kept == 0.03)
    assert not check.nearer
    check.widen(robot.rest[None], 0.2)
    assert np.allclose(check.kept, 0.23)


def test_a_run_far_from_a_cloud_has_no_nearest_points() -> None:
    robot = nmm.load("unicycle_3r")
    cloud = nmm.PointCloud([[9.0, 0.0, 0.3], [9.0, 4.0, 0.3]], name="far")
    task = nmm.Task(nmm.Position("ee", "xy"), [1.0, 0.1], speed=0.4)
    collisions = nmm.Collisions(0.05, self_collisions=False, obstacles=[cloud])
    controller = nmm.Controller(robot, task, nmm.DampedLeastSquares(), collisions=collisions, dt=0.02)
    run = nmm.simulate(controller, {"q1": 0.3, "q2": 0.6}, 0.2, 0.02, "zoh")
    assert np.all(run.clearance >= 1.0)
    assert np.isnan(run.clearance_points).all()


def test_a_horizon_keeps_off_a_cloud() -> None:
    robot = nmm.load("unicycle_3r")
    cloud = nmm.PointCloud(door(10_000, 3), radius=0.03, name="wall")
    plan = nmm.plan(robot, START, GOAL, [cloud], smooth=True)
    horizon = nmm.Horizon(robot, plan, collisions=nmm.Collisions(0.03, obstacles=[cloud]), dt=0.1)
    run = horizon.run(robot.q(START), 5.0)
    assert np.linalg.norm(run.q[-1, :2] - run.q[0, :2]) > 0.5
    assert least(robot, run.q, walls()) >= 0.03 - NOISE - 2e-3


def test_a_run_among_a_cloud_is_saved_and_opened_with_it(tmp_path: Path) -> None:
    robot = nmm.load("unicycle_3r")
    cloud = nmm.PointCloud(door(3000, 4), radius=0.04, name="wall")
    voxels = nmm.VoxelMap(np.ones((3, 3, 3), dtype=bool), 0.1, [5.0, 0.0, 0.0], name="block")
    run = nmm.plan(robot, START, GOAL, [cloud, voxels]).trajectory(0.1)
    run.save(tmp_path / "run", figures=False)
    again = nmm.Trajectory.load(tmp_path / "run")
    for obstacle, other in zip(run.obstacles, again.obstacles, strict=True):
        shape, read = obstacle.shape, other.shape
        assert isinstance(shape, Elements)
        assert isinstance(read, Elements)
        assert np.array_equal(shape.centres, read.centres)
        assert (shape.halves is None) == (read.halves is None)
        assert shape.radius == read.radius
    summary = tmp_path / "run" / "summary.json"
    data = json.loads(summary.read_text())
    data["obstacles"][0]["shape"]["cell"] = [0.05, 0.05]
    summary.write_text(json.dumps(data))
    with pytest.raises(InputError, match="cell"):
        nmm.Trajectory.load(tmp_path / "run")


def test_what_is_drawn_of_a_large_cloud_is_small_and_around_all_points() -> None:
    points = np.random.default_rng(5).uniform([-5, -5, 0], [5, 5, 3], (200_000, 3))
    mesh = nmm.PointCloud(points).shape.drawn()
    assert mesh.num_vertices * 12 + mesh.num_tris * 12 < 2_000_000
    vertices = np.array(mesh.vertices()).reshape(-1, 3)
    assert np.all(vertices.min(axis=0) <= points.min(axis=0))
    assert np.all(vertices.max(axis=0) >= points.max(axis=0))
    block = nmm.VoxelMap(np.ones((2, 3, 4), dtype=bool), 0.5).shape.drawn()
    assert block.num_tris == 2 * 6  # faces of one plane beside each other are one
    block.computeLocalAABB()
    # Outward triangles: the signed volume is the block's.
    corners = np.array(block.vertices()).reshape(-1, 3)
    each = [block.tri_indices(k) for k in range(block.num_tris)]
    triangles = np.array([[triangle[i] for i in range(3)] for triangle in each])
    a, b, c = (corners[triangles[:, k]] for k in range(3))
    assert np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6.0 == pytest.approx(2 * 3 * 4 * 0.5**3)


def test_a_scenario_names_the_files_of_clouds_and_maps(tmp_path: Path) -> None:
    np.savez(tmp_path / "scan.npz", points=door(3000, 6))
    pixels = np.full((20, 20), 254, dtype=np.uint8)
    pixels[3] = 0
    Image.fromarray(pixels).save(tmp_path / "room.png")
    (tmp_path / "room.yaml").write_text(
        "image: room.png\nresolution: 0.1\norigin: [5.0, -1.0, 0.5]\nnegate: 0\n"
        "free_thresh: 0.196\noccupied_thresh: 0.65\n"
    )
    np.savez(tmp_path / "slope.npz", heights=np.full((4, 5), 0.3), resolution=0.2, origin=[7.0, 7.0])
    (tmp_path / "door.yaml").write_text(
        "name: door\nrobot: unicycle_3r\nq0: {q1: 0.3, q2: 0.6}\nduration: 0.2\ndt: 0.02\n"
        "task: [{kind: position, frame: ee, axes: xy, reference: {kind: constant, value: [1.0, 0.0]}}]\n"
        "resolver: {kind: pg}\n"
        "collisions:\n  obstacles:\n"
        "    - {name: wall, shape: {kind: point_cloud, file: scan.npz, radius: 0.03}, xyz: [0.5, 0, 0]}\n"
        "    - {name: room, shape: {kind: occupancy_map, file: room.yaml, height: 1.5}, rpy: [0, 0, 0.3]}\n"
        "    - {name: slope, shape: {kind: elevation_map, file: slope.npz}, xyz: [0, 0, 0.1]}\n"
    )
    run = nmm.Scenario.load(tmp_path / "door.yaml").run()
    wall, room, slope = run.obstacles
    assert slope.shape.box[1] + slope.placement(0.0)[:3, 3] == pytest.approx([7.8, 8.0, 0.4])
    assert np.allclose(wall.placement(0.0)[:3, 3], [0.5, 0.0, 0.0])
    place = room.placement(0.0)
    assert np.arctan2(place[1, 0], place[0, 0]) == pytest.approx(0.8)
    c, s = np.cos(0.3), np.sin(0.3)
    assert np.allclose(place[:2, 3], [5.0 * c + s, 5.0 * s - c])
    text = (tmp_path / "door.yaml").read_text().replace("scan.npz", "none.npz")
    (tmp_path / "wrong.yaml").write_text(text)
    with pytest.raises(InputError, match=r"shape\.file: .*none\.npz: cannot be read"):
        nmm.Scenario.load(tmp_path / "wrong.yaml").run()
