"""A robot built by hand, and motions of it, for the tests of playback."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import trimesh

from nmm.model.platforms import Unicycle
from nmm.model.robots.robot import Robot
from nmm.model.robots.wheel import Wheel
from nmm.views.playback import Motion

fcl = pin.hppfcl


def wedge(folder: Path) -> Path:
    """A mesh file whose mirror image differs from it."""
    mesh = trimesh.Trimesh(
        [[0, 0, 0], [0.3, 0, 0], [0, 0.2, 0], [0, 0, 0.1]], [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]]
    )
    path = folder / "wedge.stl"
    mesh.export(path)
    return path


def hand_built_robot(folder: Path) -> Robot:
    """A unicycle with skew joints, a sliding one, wheels of two sizes, and every kind of visual."""

    def pose(roll: float, pitch: float, yaw: float, *xyz: float) -> pin.SE3:
        return pin.SE3(pin.rpy.rpyToMatrix(roll, pitch, yaw), np.array(xyz))

    wheels = tuple(
        Wheel(name, center, np.array([0.0, axis, 0.0]), radius, center)
        for name, center, axis, radius in (
            ("left", np.array([0.0, 0.25, 0.1]), 1.0, 0.1),
            ("right", np.array([0.0, -0.2, 0.15]), -1.0, 0.15),
        )
    )
    arm = [
        ("q1", pin.JointModelRZ(), pose(0, 0, 0.3, 0.1, 0.0, 0.3)),
        ("q2", pin.JointModelRevoluteUnaligned(np.array([0.6, 0.0, 0.8])), pose(0.4, -0.2, 0.1, 0.3, 0.1, 0)),
        ("q3", pin.JointModelPrismaticUnaligned(np.array([0.0, 0.6, 0.8])), pose(0.1, 0.5, 0.2, 0.2, 0, 0.1)),
    ]

    def build(with_wheels: bool) -> pin.Model:
        model = pin.Model()
        joint = 0
        chain = {"x": pin.JointModelPX(), "y": pin.JointModelPY(), "theta": pin.JointModelRZ()}
        for name, kind in chain.items():
            joint = model.addJoint(joint, kind, pin.SE3.Identity(), name)
        if with_wheels:
            for wheel in wheels:
                kind = pin.JointModelRevoluteUnaligned(wheel.axis)
                model.addJoint(joint, kind, pin.SE3(np.eye(3), wheel.center), wheel.joint)
        for name, kind, placement in arm:
            joint = model.addJoint(joint, kind, placement, name)
        model.addFrame(pin.Frame("ee", joint, 0, pose(0, 0, 0, 0.2, 0, 0), pin.FrameType.OP_FRAME))
        return model

    model, display = build(False), build(True)
    visuals = pin.GeometryModel()

    def add(
        joint: str, name: str, shape: fcl.CollisionGeometry, at: pin.SE3, mesh: str = "", scale: float = 1.0
    ) -> None:
        geometry = pin.GeometryObject(name, display.getJointId(joint), at, shape)
        if mesh:
            geometry.meshPath, geometry.meshScale = mesh, np.array([1.0, scale, 1.0])
        geometry.meshColor = np.array([0.8, 0.4, 0.2, 1.0])
        visuals.addGeometryObject(geometry)

    path = str(wedge(folder))
    add("theta", "box", fcl.Box(0.6, 0.3, 0.2), pose(0, 0, 0, 0.1, 0, 0.2))
    add("left", "left tyre", fcl.Cylinder(0.1, 0.05), pose(np.pi / 2, 0, 0, 0, 0, 0))
    add("right", "right/tyre", fcl.Cylinder(0.15, 0.05), pose(np.pi / 2, 0, 0, 0, 0, 0))
    add("q1", "capsule", fcl.Capsule(0.05, 0.3), pose(0.3, 0.2, 0.1, 0.1, 0, 0))
    add("q1", "cone", fcl.Cone(0.05, 0.2), pose(0.1, 0.9, 0.1, 0.2, 0, 0))
    add("q2", "ball", fcl.Sphere(0.06), pose(0, 0, 0, 0, 0.1, 0))
    add("q2", "egg", fcl.Ellipsoid(0.05, 0.1, 0.08), pose(0.2, 0.3, 0.4, 0.1, 0.1, 0))
    for name, scale in (("mesh", 1.0), ("mirrored mesh", -1.0)):
        loaded = fcl.MeshLoader().load(path, np.array([1.0, scale, 1.0]))
        add("q3", name, loaded, pose(0.5, 0.1, 0.2, 0.0, 0.1 * scale, 0.0), path, scale)
    return Robot("hand_built", model, pin.GeometryModel(), display, visuals, Unicycle(), wheels)


def inputs(robot: Robot, t: float) -> np.ndarray:
    arm = (0.4 * np.sin(t + i) for i in range(robot.n_u - 2))
    # A car must not steer to 90 degrees.
    turn = 0.2 if "steering_rate" in robot.u_names else 0.8
    return np.array([0.5 * np.cos(t), turn * np.sin(0.7 * t), *arm])


def drive(
    robot: Robot, duration: float = 4.0, dt: float = 0.01, frame: str | None = "ee", **fields: Any
) -> Motion:
    """A motion that swings about: q_dot = S(q) u(t), integrated by the midpoint rule."""
    t = np.linspace(0.0, duration, round(duration / dt) + 1)
    q = np.zeros((len(t), robot.n))
    for k in range(len(t) - 1):
        middle = q[k] + 0.5 * dt * robot.S(q[k]) @ inputs(robot, t[k])
        q[k + 1] = q[k] + dt * robot.S(middle) @ inputs(robot, t[k] + 0.5 * dt)
    u = np.array([inputs(robot, now) for now in t])
    # A base has no end-effector.
    return Motion(robot, t, q, u, frame=frame if frame in robot.frames else None, **fields)


def straight(robot: Robot, v: float, omega: float, t: np.ndarray) -> Motion:
    """Constant inputs: the closed form of the arc that the platform drives."""
    theta = omega * t + 0.4
    if omega:
        x = v / omega * (np.sin(theta) - np.sin(0.4))
        y = v / omega * (np.cos(0.4) - np.cos(theta))
    else:
        x, y = v * t * np.cos(0.4), v * t * np.sin(0.4)
    q = np.zeros((len(t), robot.n))
    q[:, :3] = np.column_stack([x, y, theta])
    u = np.zeros((len(t), robot.n_u))
    u[:, :2] = v, omega
    return Motion(robot, t, q, u)
