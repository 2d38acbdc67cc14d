"""Closed loops of spatial tasks: errors that shrink as exponentials, and laws of the inputs."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from function_grid import random_configuration
from numpy import pi
from numpy.typing import NDArray
from spatial_arms import MOVING, UR5, near, pose

import nmm
from nmm.control.functions.program import evaluate
from nmm.control.functions.references import Circle, PoseReference, SteadyTurn, rotation_vector
from nmm.control.functions.tasks import (
    CenterOfMass,
    Distance,
    LinearCoordinates,
    Orientation,
    Pointing,
    Pose,
    Position,
    Posture,
    Task,
)
from nmm.model.robots.configuration import Configuration
from nmm.model.robots.robot import Robot

Array = NDArray[np.float64]


# Closed loops


GAIN = 4.0


def settled(robot: Robot, tasks: list[Task], q0: Array, duration: float) -> nmm.Trajectory:
    """A run whose error shrinks as exp(-K t), row by row, which this checks; to 1e-6 of where it began."""
    controller = nmm.Controller(robot, tasks, nmm.ProjectedGradient())
    run = nmm.simulate(controller, q0, duration, 0.005, "rk4")
    assert run.complete, run.message
    expected = np.exp(-GAIN * run.t)[:, None] * run.error[0]
    assert np.abs(run.error[0]).max() > 0.1
    np.testing.assert_allclose(run.error, expected, rtol=0, atol=3e-8)
    assert np.abs(run.error[-1]).max() < 1e-6
    return run


def circling(robot: Robot, q0: Array) -> Task:
    """A pose near that at q0, which turns about the vertical while it moves on a circle."""
    start = near(robot, q0, "tool0", np.array([0.2, -0.1, 0.15, 0.5, -0.7, 0.4]))
    turn = SteadyTurn(start.rotation.T @ [0.0, 0.0, 1.0], 1.6, rotation_vector(matrix=start.rotation))
    circle = Circle(start.translation - [0.0, 0.3, 0.0], 0.3, 0.8, pi / 2)
    return Task(Pose("tool0"), PoseReference(circle, turn), GAIN)


def test_a_pose_is_tracked_along_exponentials(ur5: Robot) -> None:
    """By more than a whole turn: the rotation vectors of frame and target jump on the way."""
    q0 = ur5.q(UR5)
    run = settled(ur5, [circling(ur5, q0)], q0, 4.5)
    assert np.abs(np.diff(run.r[:, 3:], axis=0)).max() > 1.0
    start = near(ur5, q0, "tool0", np.array([0.2, -0.1, 0.15, 0.5, -0.7, 0.4]))
    last = Configuration(ur5, run.q[-1]).placement("tool0")
    turned = pin.exp3(np.array([0, 0, 1.6 * 4.5])) @ start.rotation
    np.testing.assert_allclose(last.rotation, turned, rtol=0, atol=1e-7)
    along = [np.cos(pi / 2 + 0.8 * 4.5), np.sin(pi / 2 + 0.8 * 4.5) - 1.0, 0.0]
    np.testing.assert_allclose(last.translation, start.translation + 0.3 * np.array(along), rtol=0, atol=1e-7)


def test_the_exponential_is_met_to_the_integrators_order(ur5: Robot) -> None:
    q0 = ur5.q(UR5)
    controller = nmm.Controller(ur5, circling(ur5, q0), nmm.ProjectedGradient())
    deviations = []
    for dt in (0.04, 0.02, 0.01):
        run = nmm.simulate(controller, q0, 2.0, dt, "rk4")
        deviations.append(np.abs(run.error - np.exp(-GAIN * run.t)[:, None] * run.error[0]).max())
    orders = np.log2(np.divide(deviations[:-1], deviations[1:]))
    assert np.all((orders > 3.7) & (orders < 4.6)), orders


def test_a_pose_at_rest_is_reached_along_one_screw(ur5: Robot) -> None:
    q0 = ur5.q(UR5)
    target = near(ur5, q0, "tool0", np.array([0.3, -0.1, 0.2, 0.8, -0.9, 1.0]))
    goal = np.r_[target.translation, rotation_vector(matrix=target.rotation)]
    run = settled(ur5, [Task(Pose("tool0"), goal, GAIN)], q0, 4.5)
    for q, t in zip(run.q[::100], run.t[::100], strict=True):
        expected = target * pin.exp6(-np.exp(-GAIN * t) * run.error[0])
        found = Configuration(ur5, q).placement("tool0")
        np.testing.assert_allclose(found.homogeneous, expected.homogeneous, rtol=0, atol=1e-6)


def test_an_orientation_is_tracked(tiago: Robot) -> None:
    q0 = tiago.q({"arm_2_joint": -0.5, "arm_4_joint": 1.2, "arm_6_joint": 0.4, "torso_lift_joint": 0.1})
    goal = near(tiago, q0, "arm_tool_link", np.array([0, 0, 0, 0.5, 0.8, -0.6])).rotation
    settled(tiago, [Task(Orientation("arm_tool_link"), rotation_vector(matrix=goal), GAIN)], q0, 4.5)


def test_a_relative_pose_is_held(tiago: Robot) -> None:
    """The gripper before the head's camera, while the base drives: neither frame rests in the world."""
    q0 = tiago.q({"arm_2_joint": -0.5, "arm_3_joint": -0.4, "arm_4_joint": 1.4, "arm_6_joint": 0.7})
    here = Configuration(tiago, q0)
    relative = here.placement("xtion_link").actInv(here.placement("arm_tool_link"))
    target = relative * pin.exp6(np.array([0.05, 0.1, -0.05, 0.3, -0.2, 0.2]))
    goal = np.r_[target.translation, rotation_vector(matrix=target.rotation)]
    tasks = [
        Task(Pose("arm_tool_link", "xtion_link"), goal, GAIN),
        Task(Position("base_footprint", "x"), nmm.Line([0.5], [1.0], 5.0), GAIN),
    ]
    run = settled(tiago, tasks, q0, 4.5)
    last = Configuration(tiago, run.q[-1])
    found = last.placement("xtion_link").actInv(last.placement("arm_tool_link"))
    np.testing.assert_allclose(found.homogeneous, target.homogeneous, rtol=0, atol=1e-6)
    assert run.q[-1, 0] - q0[0] > 0.8


def test_pointing_at_a_moving_point(ur5: Robot) -> None:
    """While the tip stays where it is."""
    q0 = ur5.q(UR5)
    place = Configuration(ur5, q0).placement("tool0").translation
    point = Circle([2.0, 1.0, 0.7], 0.5, 0.9, 0.0, "yz")
    tasks = [Task(Pointing("tool0", point), [0, 0], GAIN), Task(Position("tool0"), place, GAIN)]
    run = settled(ur5, tasks, q0, 4.5)
    last = Configuration(ur5, run.q[-1]).placement("tool0")
    target = np.array([2.0, 1.0 + 0.5 * np.cos(0.9 * 4.5), 0.7 + 0.5 * np.sin(0.9 * 4.5)])
    along = (target - last.translation) / np.linalg.norm(target - last.translation)
    np.testing.assert_allclose(last.rotation[:, 2], along, rtol=0, atol=1e-6)


def test_pointing_at_a_frame_of_the_robot(tiago: Robot) -> None:
    """The camera looks at the gripper, which goes elsewhere."""
    q0 = tiago.q({"arm_2_joint": -0.5, "arm_4_joint": 1.2, "arm_1_joint": 0.4, "head_2_joint": -0.3})
    start = Configuration(tiago, q0).placement("arm_tool_link").translation + np.array([0.1, 0.2, 0.1])
    camera = Pointing("xtion_rgb_optical_frame", "arm_tool_link")
    tasks = [
        Task(camera, [0, 0], GAIN),
        Task(Position("arm_tool_link"), nmm.Line(start, start + np.array([0.5, -0.1, 0.1]), 5.0), GAIN),
    ]
    run = settled(tiago, tasks, q0, 4.5)
    last = Configuration(tiago, run.q[-1])
    seen = pose(last, "arm_tool_link", "xtion_rgb_optical_frame").translation
    np.testing.assert_allclose(seen[:2] / seen[2], 0.0, atol=1e-6)
    assert seen[2] > 0.0


def test_other_tasks_together(ur5: Robot) -> None:
    """A distance from a moving point, the centre of mass, a coupling and a posture."""
    q0 = ur5.q(UR5)
    tasks = [
        Task(Distance("tool0", MOVING), 0.9, GAIN),
        Task(CenterOfMass("z"), Configuration(ur5, q0).center_of_mass()[0][2] + 0.05, GAIN),
        Task(LinearCoordinates({"wrist_1_joint": 1, "wrist_2_joint": -2}), 1.0, GAIN),
        Task(Posture("elbow_joint", "wrist_3_joint"), [1.2, 0.0], GAIN),
    ]
    run = settled(ur5, tasks, q0, 4.5)
    last = dict(zip(ur5.q_names, run.q[-1], strict=True))
    assert last["wrist_1_joint"] == pytest.approx(1.0 + 2 * last["wrist_2_joint"], abs=1e-6)
    assert last["elbow_joint"] == pytest.approx(1.2, abs=1e-6)


# Laws


def test_moving_the_world_moves_nothing_else(ur5: Robot, rng: np.random.Generator) -> None:
    """Robot and targets carried along together: the same inputs."""
    for _ in range(5):
        q = ur5.q(UR5) + rng.normal(scale=0.2, size=ur5.n)
        x, y, angle = rng.uniform(-4, 4, 3)
        move = pin.SE3(pin.exp3(np.array([0, 0, angle])), np.array([x, y, 0.0]))
        moved = q.copy()
        moved[:3] = [*move.act(np.array([q[0], q[1], 0.0]))[:2], q[2] + angle]
        target = near(ur5, q, "tool0", rng.uniform(-0.5, 0.5, 6))
        axis, center, point = rng.normal(size=3), rng.normal(size=3), rng.normal([3, 0, 0])

        def tasks(
            carried: pin.SE3, turned: float, target=target, axis=axis, center=center, point=point
        ) -> list[list[Task]]:
            T = carried * target
            turn = SteadyTurn(axis, 0.7, rotation_vector(matrix=T.rotation))
            circle = Circle(carried.act(center), 0.4, 0.9, 0.2 + turned)
            return [
                [Task(Pose("tool0"), PoseReference(circle, turn), 2.0)],
                [Task(Orientation("tool0"), turn, 2.0), Task(Distance("tool0", circle), 1.0)],
                [Task(Pointing("tool0", carried.act(point)), [0, 0]), Task(CenterOfMass("z"), 0.3)],
                [
                    Task(Orientation("tool0", "upper_arm_link"), [0.1, 0.2, 0.3]),
                    Task(Posture("elbow_joint"), 1.0),
                ],
            ]

        here, there = tasks(pin.SE3.Identity(), 0.0), tasks(move, angle)
        for a, b in zip(here, there, strict=True):
            u, v = (
                nmm.Controller(ur5, given, nmm.ProjectedGradient())(0.6, at)
                for given, at in ((a, q), (b, moved))
            )
            np.testing.assert_allclose(v, u, rtol=0, atol=1e-9 * max(1.0, np.abs(u).max()))


def test_a_relative_pose_does_not_feel_the_platform(tiago: Robot, rng: np.random.Generator) -> None:
    here = Configuration(tiago, random_configuration(tiago, rng))
    for function in (Pose("arm_tool_link", "head_2_link"), Distance("arm_tool_link", "head_2_link")):
        found = evaluate(function, 0.0, here).value_q
        np.testing.assert_allclose(found[:, :3], 0.0, atol=1e-13)
        assert np.abs(found[:, 3:]).max() > 0.1


def test_poses_each_of_the_other_are_inverse(ur5: Robot, rng: np.random.Generator) -> None:
    here = Configuration(ur5, random_configuration(ur5, rng))
    one, two = (
        evaluate(Pose(*frames), 0.0, here).value
        for frames in (("tool0", "elbow_joint"), ("elbow_joint", "tool0"))
    )
    T, inverse = (pin.SE3(pin.exp3(value[3:]), value[:3]) for value in (one, two))
    np.testing.assert_allclose((T * inverse).homogeneous, np.eye(4), rtol=0, atol=1e-14)
