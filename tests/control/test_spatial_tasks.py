"""Tasks of spatial arms, on real ones: values, derivatives and errors against Pinocchio and differences."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from derivatives import assert_close, check_function, derivative, partials
from function_grid import random_configuration
from numpy import pi
from numpy.typing import NDArray
from spatial_arms import MOVING, UR5, pose

from nmm.control.functions.function import Evaluation, Function
from nmm.control.functions.program import Program, evaluate
from nmm.control.functions.references import PoseReference, Slerp, SteadyTurn, rotation_vector
from nmm.control.functions.tasks import (
    CenterOfMass,
    Distance,
    Orientation,
    Pointing,
    Pose,
    Position,
    Posture,
    Task,
)
from nmm.control.functions.tasks.task import Comparison
from nmm.model.robots.configuration import Configuration
from nmm.model.robots.robot import Robot

Array = NDArray[np.float64]


@pytest.fixture(scope="module")
def arms(ur5: Robot, tiago: Robot, robot_3r: Robot) -> dict[str, Robot]:
    return {"ur5": ur5, "tiago": tiago, "unicycle_3r": robot_3r}


#: A frame at the tip, and one that another chain or link carries.
FRAMES = {
    "ur5": ("tool0", "upper_arm_link"),
    "tiago": ("arm_tool_link", "head_2_link"),
    "unicycle_3r": ("ee", "link1"),
}
each_arm = pytest.mark.parametrize("name", FRAMES)


def functions(tip: str, other: str) -> list[Function]:
    return [
        Position(tip, "zx", other),
        Orientation(tip),
        Orientation(tip, other),
        Pose(tip),
        Pose(tip, other),
        Pointing(tip, [1, 2, 3], "x"),
        Pointing(tip, MOVING, (0.3, -1, 0.5)),
        Pointing(other, tip),
        Pointing(tip, CenterOfMass()),
        Distance(tip, other),
        Distance(tip, MOVING),
        CenterOfMass("yz"),
        CenterOfMass("zx", other),
        Posture(),
        PoseReference(Position(other), Orientation(other)),
    ]


@each_arm
def test_derivatives(name: str, arms: dict[str, Robot], rng: np.random.Generator) -> None:
    robot = arms[name]
    for function in functions(*FRAMES[name]):
        for _ in range(2):
            check_function(function, robot, 0.7, random_configuration(robot, rng))


@each_arm
def test_values_are_pinocchios(name: str, arms: dict[str, Robot], rng: np.random.Generator) -> None:
    robot, (tip, other) = arms[name], FRAMES[name]
    for _ in range(20):
        here = Configuration(robot, random_configuration(robot, rng))
        for seen_from in (None, other):
            expected = pose(here, tip, seen_from)
            value = evaluate(Pose(tip, seen_from), 0.0, here).value
            np.testing.assert_allclose(value[:3], expected.translation, rtol=0, atol=1e-13)
            np.testing.assert_allclose(pin.exp3(value[3:]), expected.rotation, rtol=0, atol=1e-13)
            assert np.linalg.norm(value[3:]) <= pi + 1e-15
            assert np.array_equal(evaluate(Orientation(tip, seen_from), 0.0, here).value, value[3:])
            position = evaluate(Position(tip, "zxy", seen_from), 0.0, here).value
            np.testing.assert_allclose(position, value[[2, 0, 1]], rtol=0, atol=1e-13)
        between = pose(here, tip).translation - pose(here, other).translation
        assert evaluate(Distance(tip, other), 0.0, here).value[0] == pytest.approx(np.linalg.norm(between))


@each_arm
def test_center_of_mass_is_that_of_the_links(
    name: str, arms: dict[str, Robot], rng: np.random.Generator
) -> None:
    robot = arms[name]
    here = Configuration(robot, random_configuration(robot, rng))
    data = robot.model.createData()
    pin.forwardKinematics(robot.model, data, here.q)
    bodies = list(zip(robot.model.inertias, data.oMi, strict=True))
    moments = [inertia.mass * placement.act(inertia.lever) for inertia, placement in bodies]
    expected = sum(moments) / sum(inertia.mass for inertia, _ in bodies)
    np.testing.assert_allclose(evaluate(CenterOfMass(), 0.0, here).value, expected, rtol=0, atol=1e-12)
    other = FRAMES[name][1]
    seen = evaluate(CenterOfMass("xyz", other), 0.0, here).value
    np.testing.assert_allclose(seen, pose(here, other).actInv(expected), rtol=0, atol=1e-12)


# Errors of orientations and poses


def error(task: Task, robot: Robot, t: float, q: Array) -> Evaluation:
    program = Program(robot, [task.function, task.reference, Comparison(task)])
    program.lay_out()
    return program.evaluate(t, q)[2]


def compared(tip: str, other: str) -> list[Task]:
    turn = SteadyTurn([0.3, -0.2, 0.9], 0.8, [0.4, 1.0, -0.6])
    slerp = Slerp([0.1, 0.2, 0.3], [-1.0, 1.5, 0.4], 4.0, "smooth")
    return [
        Task(Orientation(tip), [0.4, 1.0, -0.6]),
        Task(Orientation(tip), turn),
        Task(Orientation(tip, other), slerp),
        Task(Orientation(tip), Orientation(other)),
        Task(Pose(tip), [0.5, -0.3, 0.8, 0.4, 1.0, -0.6]),
        Task(Pose(tip), PoseReference(MOVING, turn)),
        Task(Pose(tip, other), PoseReference([0.1, 0.2, 0.3], slerp)),
        Task(Pose(tip), PoseReference(Position(other), turn)),
    ]


@each_arm
def test_derivatives_of_errors(name: str, arms: dict[str, Robot], rng: np.random.Generator) -> None:
    robot = arms[name]
    for task in compared(*FRAMES[name]):
        q = random_configuration(robot, rng)
        found = error(task, robot, 0.7, q)
        assert_close(found.value_t, derivative(lambda h: error(task, robot, 0.7 + h, q).value))  # noqa: B023
        assert_close(found.value_q, partials(lambda q: error(task, robot, 0.7, q).value, q))  # noqa: B023


@each_arm
def test_errors_are_pinocchios_logarithms(
    name: str, arms: dict[str, Robot], rng: np.random.Generator
) -> None:
    robot, (tip, other) = arms[name], FRAMES[name]
    for _ in range(20):
        here = Configuration(robot, random_configuration(robot, rng))
        R_d, p_d = pin.exp3(rng.uniform(-2, 2, 3)), rng.uniform(-1, 1, 3)
        target = np.r_[p_d, rotation_vector(matrix=R_d)]
        for seen_from in (None, other):
            T = pose(here, tip, seen_from)
            found = error(Task(Pose(tip, seen_from), target), robot, 0.0, here.q).value
            expected = pin.log6(T.actInv(pin.SE3(R_d, p_d))).vector
            np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9)
            np.testing.assert_allclose((T * pin.exp6(found)).translation, p_d, rtol=0, atol=1e-10)
            found = error(Task(Orientation(tip, seen_from), target[3:]), robot, 0.0, here.q).value
            np.testing.assert_allclose(found, pin.log3(T.rotation.T @ R_d), rtol=0, atol=1e-9)


def test_any_vector_of_a_rotation_is_the_same_target(ur5: Robot, rng: np.random.Generator) -> None:
    for _ in range(20):
        q, g = random_configuration(ur5, rng), rng.uniform(-1.5, 1.5, 3)
        for turns in (-1, 1, 2):
            longer = g * (1 + 2 * pi * turns / np.linalg.norm(g))
            for function, place in ((Orientation("tool0"), []), (Pose("tool0"), [0.1, 0.2, 0.3])):
                one, two = (error(Task(function, [*place, *v]), ur5, 0.0, q) for v in (g, longer))
                for a, b in zip(one, two, strict=True):
                    np.testing.assert_allclose(a, b, rtol=0, atol=1e-12)


def test_an_error_is_continuous_where_the_rotation_vector_jumps(ur5: Robot) -> None:
    """Through half a turn about the vertical φ changes its sign; the error moves on."""
    q = ur5.q(UR5)
    R = Configuration(ur5, q).placement("tool0").rotation
    axis = rotation_vector(matrix=R)
    start = (pi - np.linalg.norm(axis)) * axis / np.linalg.norm(axis)  # turned on by this, |φ| = π
    before, after = (rotation_vector(matrix=R @ pin.exp3(start * (1 + sign * 1e-6))) for sign in (-1.0, 1.0))
    assert np.linalg.norm(before - after) == pytest.approx(2 * pi, abs=1e-4)
    errors = [error(Task(Orientation("tool0"), g), ur5, 0.0, q).value for g in (before, after)]
    np.testing.assert_allclose(errors[0], errors[1], rtol=0, atol=1e-5)
    np.testing.assert_allclose(errors[0], start, rtol=0, atol=1e-5)
