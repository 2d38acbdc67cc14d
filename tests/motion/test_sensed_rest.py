"""A controller beside what was sensed: rows of elements that were nearest before, and the robot at rest."""

from __future__ import annotations

from collections.abc import Callable

import coal
import numpy as np
import pytest

import nmm
from nmm.base.kernels.record_layout import Memory, views
from nmm.model.collisions.pairs import random_configurations
from nmm.model.collisions.rows import DistanceRows, no_rows


def wall() -> nmm.PointCloud:
    rng = np.random.default_rng(1)
    points = rng.uniform([2.0, -2.0, 0.0], [2.0, 2.0, 1.5], (60_000, 3))
    return nmm.PointCloud(points + rng.normal(0.0, 0.003, points.shape), radius=0.02, name="wall")


def corner() -> nmm.PointCloud:
    rng = np.random.default_rng(1)
    ahead = rng.uniform([2.0, -2.0, 0.0], [2.0, 1.0, 1.5], (40_000, 3))
    beside = rng.uniform([-1.0, 1.0, 0.0], [2.0, 1.0, 1.5], (40_000, 3))
    points = np.vstack([ahead, beside])
    return nmm.PointCloud(points + rng.normal(0.0, 0.003, points.shape), radius=0.02, name="corner")


def voxels() -> nmm.VoxelMap:
    return nmm.VoxelMap(np.ones((3, 100, 40), dtype=bool), 0.04, [2.0, -2.0, 0.0], name="voxels")


@pytest.mark.parametrize("heading", [0.0, 0.5, -0.9])
@pytest.mark.parametrize("scene", [wall, corner, voxels])
def test_a_robot_that_is_blocked_by_what_was_sensed_comes_to_rest(
    scene: Callable[[], nmm.Obstacle], heading: float
) -> None:
    """Its target is behind the wall; with a row for the nearest element alone it trembled, by 38 mm/s and
    more."""
    robot = nmm.load("unicycle_3r")
    task = nmm.Task(nmm.Position("ee", "xy"), [4.0, 0.0], speed=0.5)
    controller = nmm.Controller(
        robot,
        task,
        nmm.DampedLeastSquares(),
        collisions=nmm.Collisions(0.03, obstacles=[scene()]),
        limits=nmm.Limits(acceleration={"platform": 2.0, "arm": 8.0}),
        dt=0.02,
    )
    q = robot.q({"q1": 0.3, "q2": 0.6, "theta": heading})
    u = np.zeros((2000, robot.n_u))
    for k in range(len(u)):
        q, u[k] = controller.step(0.02 * k, q, 0.02, "zoh")
    assert np.abs(u[-100:]).max() <= 1e-3
    assert controller.solver.scene is not None
    nearest, _ = controller.solver.scene.queries.nearest(40.0, q)
    assert 0.03 <= nearest < 0.035


@pytest.mark.parametrize("name", ["unicycle_3r", "tiago_pose"])
def test_rows_of_earlier_elements_are_true_distances(name: str) -> None:
    """Beside boxes, cylinders and hulls: those of Coal from each element's ball, with their normals."""
    robot = nmm.load(name) if name == "unicycle_3r" else nmm.Scenario.load(name).robot()
    rng = np.random.default_rng(2)
    points = rng.uniform([-0.6, -0.6, 0.0], [0.6, 0.6, 1.2], (400, 3))
    cloud = nmm.PointCloud(points, radius=0.02, name="dust", placement=[0.1, 0.2, 0.0, 0.0, 0.0, 0.4])
    scene = nmm.Collisions(1.0, self_collisions=False, obstacles=[cloud], band=1.2).on(robot)
    memory = Memory()
    memory.add(no_rows(robot.n, 400))
    blocks = memory.blocks()
    rows = views(DistanceRows, *blocks, 0)
    checked = 0
    for q in random_configurations(robot, 6, seed=4):
        q[:2] = 0.3 * q[:2] / 4.0
        scene.queries.update(0.0, q, *blocks, 0)
        own = len({*rows.pair[: int(rows.used)].tolist()})
        for slot in range(own, int(rows.used)):
            i = int(scene.queries.scene.pairs[rows.pair[slot], 0])
            pose, shape = scene.queries.found.oMg[i], scene.queries.shapes.geometryObjects[i].geometry
            at = cloud.at(0.0).act(rows.element[slot])
            assert np.abs(cloud.points - rows.element[slot]).max(axis=1).min() < 1e-9
            result = coal.DistanceResult()
            d = coal.distance(
                shape,
                coal.Transform3s(pose.rotation, pose.translation),
                coal.Sphere(0.02),
                coal.Transform3s(np.eye(3), at),
                coal.DistanceRequest(),
                result,
            )
            if d > 1e-3:
                assert rows.d[slot] == pytest.approx(d, abs=2e-5)
                normal = rows.points[slot, 6:]
                off = at - rows.points[slot, :3]
                assert np.allclose(normal, off / np.linalg.norm(off), atol=1e-3)
                checked += 1
    assert checked > 20


def test_elements_of_another_edition_have_no_rows() -> None:
    """What is no longer part of a cloud is nothing to keep off."""
    robot = nmm.load("unicycle_3r")
    scene = nmm.Collisions(1.0, self_collisions=False, obstacles=[wall()], band=2.5).on(robot)
    memory = Memory()
    memory.add(no_rows(robot.n, 100))
    blocks = memory.blocks()
    rows = views(DistanceRows, *blocks, 0)
    q = robot.q({"x": 1.2})
    used = []
    for angle in (-0.2, 0.0, 0.2, 0.2):
        q[2] = angle
        scene.queries.update(0.0, q, *blocks, 0)
        used.append(int(rows.used))
    pairs = len({*rows.pair[: used[-1]].tolist()})
    assert used[0] == pairs
    assert used[-1] > pairs
    scene.queries.scene.sensed.edition[:] += 1
    scene.queries.update(0.0, q, *blocks, 0)
    assert int(rows.used) == pairs
