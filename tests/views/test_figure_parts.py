"""What figures are made of: the robot's drawing against closed forms, hulls, looks."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial import ConvexHull

from nmm.base import resolver_style
from nmm.model.robots.robot import Robot
from nmm.views.figures.silhouette import Silhouette, hull


def test_arm_is_drawn_where_the_robot_is(robot_2r: Robot, rng: np.random.Generator) -> None:
    """Joints and end-effector against the closed form of eq. (14)."""
    silhouette = Silhouette(robot_2r, "ee")
    for _ in range(20):
        q = rng.uniform(-3.0, 3.0, 5)
        x, y, theta, q1, q2 = q
        pose = silhouette.at(q)
        shoulder = np.array([x, y]) + 0.3 * np.array([np.cos(theta), np.sin(theta)])
        elbow = shoulder + 0.5 * np.array([np.cos(theta + q1), np.sin(theta + q1)])
        tip = elbow + 0.3 * np.array([np.cos(theta + q1 + q2), np.sin(theta + q1 + q2)])
        np.testing.assert_allclose(pose.joints[:, :2], [shoulder, elbow], atol=1e-12)
        np.testing.assert_allclose(pose.tip[:, :2], [tip], atol=1e-12)
        np.testing.assert_allclose([ends[:, :2] for ends in pose.links], [[shoulder, elbow], [elbow, tip]])
        ahead = pose.heading[0, :2] - pose.heading[1:, :2].mean(axis=0)
        np.testing.assert_allclose(ahead / np.linalg.norm(ahead), [np.cos(theta), np.sin(theta)], atol=1e-9)


def test_wheels_are_drawn_on_their_axle(robot_2r: Robot) -> None:
    pose = Silhouette(robot_2r, "ee").at(robot_2r.q({"x": 1.0, "y": 2.0, "theta": np.pi / 2}))
    centres = sorted(points.mean(axis=0).tolist() for points in pose.wheels)
    np.testing.assert_allclose(centres, [[0.8, 2.0, 0.1], [1.2, 2.0, 0.1]], atol=1e-12)
    assert all(points[:, 2].min() >= -1e-12 for points in pose.wheels)


def test_platform_without_shapes_is_a_plate(robot_2r: Robot) -> None:
    bare = replace(robot_2r, visual_model=type(robot_2r.visual_model)(), collision_model=type(
        robot_2r.collision_model)(), wheels=())  # fmt: skip
    plate = Silhouette(bare, "ee").at(bare.q()).main[:, :2]
    assert np.all(plate.min(axis=0) < -0.15)
    assert np.all(plate.max(axis=0) > 0.15)


def test_hull_is_the_convex_hull(rng: np.random.Generator) -> None:
    for count in (3, 4, 30, 300):
        points = rng.normal(size=(count, 2))
        expected = points[ConvexHull(points).vertices]
        found = hull(points)
        assert {tuple(point) for point in found} == {tuple(point) for point in expected}
        following = np.roll(found, -1, axis=0)
        assert np.sum(found[:, 0] * following[:, 1] - found[:, 1] * following[:, 0]) > 0.0


def test_looks_tell_runs_apart() -> None:
    worn = resolver_style.looks(["rg", "pg", "rg", "mine", "other"])
    assert [look.name for look in worn] == ["RG", "PG", "RG (2)", "MINE", "OTHER"]
    assert len({(look.color, look.dashes) for look in worn}) == len(worn)
