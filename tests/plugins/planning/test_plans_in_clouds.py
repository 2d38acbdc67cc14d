"""Plans of robots with meshes beside a scanned wall, against Coal on their own shapes and every point."""

from __future__ import annotations

from typing import Any

import coal
import numpy as np
import pinocchio as pin
import pytest
import scanned
from places import UR5
from scipy.spatial import cKDTree

import nmm
from nmm.base.arrays import Array

DISTANCE = 0.03


def least_distance(robot: nmm.Robot, cloud: nmm.PointCloud, configurations: Array) -> float:
    """The least distance, m, between the robot's shapes, meshes as they are, and balls at the points;
    farther ones than 0.2 m are not looked for."""
    shapes, data = robot.collision_model, robot.model.createData()
    placed, tree, ball = pin.GeometryData(shapes), cKDTree(cloud.points), coal.Sphere(cloud.radius)
    request, result, nearest = coal.DistanceRequest(), coal.DistanceResult(), 0.2
    for q in configurations:
        pin.updateGeometryPlacements(robot.model, data, shapes, placed, q)
        for i, shape in enumerate(shapes.geometryObjects):
            pose, geometry = placed.oMg[i], shape.geometry
            geometry.computeLocalAABB()
            middle, half = (
                geometry.aabb_local.center(),
                0.5 * (geometry.aabb_local.max_ - geometry.aabb_local.min_),
            )
            some = tree.query_ball_point(pose.act(middle), np.linalg.norm(half) + nearest + cloud.radius)
            points = cloud.points[some]
            local = (points - pose.translation) @ pose.rotation
            outside = np.linalg.norm(np.maximum(np.abs(local - middle) - half, 0.0), axis=1)
            for k in np.argsort(outside):
                if outside[k] - cloud.radius >= nearest:
                    break
                result.clear()
                first = coal.Transform3s(pose.rotation, pose.translation)
                second = coal.Transform3s(np.eye(3), points[k])
                d = coal.distance(geometry, first, ball, second, request, result)
                nearest = min(nearest, float(d))
    return nearest


def ur5() -> tuple[nmm.Robot, dict[str, float], dict[str, float]]:
    robot = nmm.mount(nmm.load("differential_base"), nmm.load(UR5), prefix="ur5_")
    start = {"ur5_shoulder_lift_joint": -1.5, "ur5_elbow_joint": 1.5, "ur5_wrist_1_joint": -1.5}
    return robot, start, {"x": 3.2, "y": 0.4, "theta": 0.5, "ur5_shoulder_pan_joint": 1.5}


def tiago() -> tuple[nmm.Robot, dict[str, float], dict[str, float]]:
    start = {"torso_lift_joint": 0.15, "arm_1_joint": 0.3, "arm_2_joint": -1.0, "arm_3_joint": -0.3}
    start |= {"arm_4_joint": 2.0}
    return nmm.Scenario.load("tiago_shelf").robot(), start, {"x": 3.2, "y": 0.4, "arm_1_joint": 1.2}


@pytest.mark.parametrize("make", [ur5, tiago])
def test_no_mesh_of_a_robot_is_nearer_to_any_point_than_asked(make: Any) -> None:
    robot, start, goal = make()
    meshes = [shape for shape in robot.collision_model.geometryObjects if shape.meshPath not in ("", "BOX")]
    assert any(isinstance(shape.geometry, coal.BVHModelBase) for shape in meshes)
    cloud = nmm.PointCloud(scanned.door(20_000, 3), radius=0.02)
    plan = nmm.plan(robot, start, goal, [cloud], nmm.Collisions(DISTANCE), seed=3)
    nearest = least_distance(robot, cloud, plan(np.linspace(0.0, plan.duration, 600))[0])
    assert DISTANCE - 1e-6 <= nearest < 0.2
