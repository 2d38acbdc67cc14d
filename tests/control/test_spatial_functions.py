"""Pointing, distances, references of orientations and poses, names, and bad input."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from derivatives import check_function
from findings import refused
from function_grid import random_configuration
from numpy import pi
from numpy.typing import NDArray
from spatial_arms import MOVING, UR5

import nmm
from nmm.control.functions.function import Function, Row, Stage
from nmm.control.functions.program import evaluate
from nmm.control.functions.references import Circle, Constant, PoseReference, Slerp, SteadyTurn
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
from nmm.model.robots.configuration import Configuration
from nmm.model.robots.robot import Robot

Array = NDArray[np.float64]


@pytest.mark.parametrize("axis", ["x", "y", "z", (1, -2, 3), (0, 0, -1)])
def test_pointing_says_how_far_and_which_way(
    ur5: Robot, axis: str | tuple[float, ...], rng: np.random.Generator
) -> None:
    """|y| is the angle from the axis to the point; y's direction is that in the plane across the axis."""
    a = np.array({"x": (1, 0, 0), "y": (0, 1, 0), "z": (0, 0, 1)}.get(axis, axis), dtype=float)  # type: ignore[call-overload]
    a /= np.linalg.norm(a)
    values, across = np.empty((20, 2)), np.empty((20, 3))
    for k in range(20):
        here = Configuration(ur5, random_configuration(ur5, rng))
        point = rng.uniform(-3, 3, 3)
        seen = here.placement("tool0").actInv(point)
        seen /= np.linalg.norm(seen)
        y = evaluate(Pointing("tool0", point, axis), 0.0, here).value
        angle = np.arctan2(np.linalg.norm(np.cross(a, seen)), a @ seen)
        assert np.linalg.norm(y) == pytest.approx(angle, abs=1e-12)
        values[k], across[k] = y / angle, (seen - (a @ seen) * a) / np.sin(angle)
    b = np.linalg.lstsq(values, across, rcond=None)[0]
    np.testing.assert_allclose(values @ b, across, atol=1e-12)
    assert np.linalg.det([a, *b]) == pytest.approx(1.0, abs=1e-12)  # right-handed and orthonormal
    np.testing.assert_allclose(np.array([a, *b]) @ np.array([a, *b]).T, np.eye(3), atol=1e-12)
    if axis == "z":
        np.testing.assert_allclose(b, np.eye(3)[:2], atol=1e-12)


def test_pointing_is_smooth_where_it_points_at_the_point(ur5: Robot) -> None:
    """Across the threshold of the series at angles of 1e-5, and at 0."""
    here = Configuration(ur5, ur5.q(UR5))
    T = here.placement("tool0")
    straight = evaluate(Pointing("tool0", T.act(np.array([0, 0, 2.0]))), 0.0, here)
    np.testing.assert_allclose(straight.value, 0.0, atol=1e-15)
    for angle in (1e-12, 1e-8, 0.999e-5, 1.001e-5, 1e-4):
        point = T.act(2.0 * np.array([np.sin(angle) * 0.6, np.sin(angle) * 0.8, np.cos(angle)]))
        found = evaluate(Pointing("tool0", point), 0.0, here)
        np.testing.assert_allclose(found.value, angle * np.array([0.6, 0.8]), rtol=0, atol=1e-15)
        np.testing.assert_allclose(found.value_q, straight.value_q, rtol=0, atol=2 * angle + 1e-14)
    check_function(Pointing("tool0", T.act(np.array([0, 0, 2.0]))), ur5, 0.0, here.q)


@pytest.mark.parametrize("height", [-2.0, 0.0])
def test_pointing_straight_away_is_singular(ur5: Robot, height: float) -> None:
    """With the point straight behind, and in the frame's origin."""
    q = np.zeros(ur5.n)
    function = Pointing("theta", [0.0, 0.0, height])
    found = evaluate(function, 0.0, Configuration(ur5, q))
    assert found.value.tolist() == [pi, 0.0]
    assert not found.value_q.any()
    with pytest.raises(nmm.SingularError, match="rank"):
        nmm.Controller(ur5, [Task(function, [0, 0])], nmm.ProjectedGradient())(0.0, q)


def test_a_distance_of_zero_is_singular(ur5: Robot) -> None:
    q = np.zeros(ur5.n)
    function = Distance("theta", [0, 0, 0])
    found = evaluate(function, 0.0, Configuration(ur5, q))
    assert found.value[0] == 0.0
    assert not found.value_q.any()
    with pytest.raises(nmm.SingularError, match="rank"):
        nmm.Controller(ur5, [Task(function, 1.0)], nmm.ProjectedGradient())(0.0, q)


class FirstThree(Function):
    """Three rows of six: what is left of the others must not disturb what comes after."""

    def __init__(self, of: Function) -> None:
        self.of = of

    def rows(self, robot: Robot) -> tuple[Row, ...]:
        return self.of.rows(robot)[:3]

    def stages(self, robot: Robot) -> tuple[Stage, ...]:
        return self.of.stages(robot)


def test_a_pose_reference_of_functions_that_need_more_rows(ur5: Robot, rng: np.random.Generator) -> None:
    here = Configuration(ur5, random_configuration(ur5, rng))
    wide, moving = FirstThree(PoseReference(MOVING, SteadyTurn([1, 0, 1], 2.0))), SteadyTurn([0, 1, 1], 0.5)
    tip = FirstThree(Pose("tool0"))
    for position, orientation in ((wide, moving), (MOVING, tip), (tip, wide), (wide, tip), (tip, [1, 2, 3])):
        reference = PoseReference(position, orientation)
        found = evaluate(reference, 0.4, here)
        halves = [evaluate(part, 0.4, here) for part in (reference.position, reference.orientation)]
        for whole, first, second in zip(found, *halves, strict=True):
            assert np.array_equal(whole, np.concatenate([first, second]))


# References


def test_slerp_goes_from_one_to_the_other_by_the_shortest_turn(robot_3r: Robot) -> None:
    here = Configuration(robot_3r, np.zeros(robot_3r.n))
    start, end = np.array([0.4, -1.0, 2.0]), np.array([-0.9, 0.3, -1.1])
    R0, R1 = pin.exp3(start), pin.exp3(end)
    for profile in ("constant", "smooth"):
        slerp = Slerp(start, end, 2.0, profile)
        for t, expected in ((-1.0, R0), (0.0, R0), (1.0, R0 @ pin.exp3(pin.log3(R0.T @ R1) / 2)), (5.0, R1)):
            found = evaluate(slerp, t, here)
            np.testing.assert_allclose(pin.exp3(found.value), expected, rtol=0, atol=1e-14)
        assert not evaluate(slerp, 5.0, here).value_t.any()


def test_a_turn_turns(robot_3r: Robot) -> None:
    here = Configuration(robot_3r, np.zeros(robot_3r.n))
    start = np.array([0.4, -1.0, 0.7])
    for t in (-30.0, 0.0, 3.0, 100.0):
        found = pin.exp3(evaluate(SteadyTurn([0, 3, 4], 0.5, start), t, here).value)
        expected = pin.exp3(start) @ pin.exp3(0.5 * t * np.array([0, 0.6, 0.8]))
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-13)


# Rows, names, bad input


def test_rows(ur5: Robot) -> None:
    assert [row[:2] for row in Pose("tool0", "base").rows(ur5)] == [
        *((f"tool0.{axis} in base", "m") for axis in "xyz"),
        *((f"tool0.r{axis} in base", "rad") for axis in "xyz"),
    ]
    assert [row[:2] for row in Orientation("tool0").rows(ur5)] == [(f"tool0.r{a}", "rad") for a in "xyz"]
    assert [row.name for row in Posture().rows(ur5)] == list(UR5)
    assert [row.unit for row in Posture("x", "theta").rows(ur5)] == ["m", "rad"]
    units = [row.unit for row in PoseReference([1, 2, 3], Constant([0, 0, 1])).rows(ur5)]
    assert units == ["m", "m", "m", "rad", "rad", "rad"]


BAD_TASKS: list[tuple[dict[str, Any], Callable[[], Task]]] = [
    ({"where": "robot ur5", "got": "tool"}, lambda: Task(Pose("tool"), np.zeros(6))),
    ({"where": "robot ur5", "got": "bas"}, lambda: Task(Orientation("tool0", "bas"), np.zeros(3))),
    ({"where": "robot ur5", "got": "a"}, lambda: Task(Pointing("a", [1, 2, 3]), [0, 0])),
    ({"where": "robot ur5", "got": "b"}, lambda: Task(Pointing("tool0", "b"), [0, 0])),
    ({"where": "robot ur5", "got": "c"}, lambda: Task(Distance("c", "tool0"), 1)),
    ({"where": "robot ur5", "got": "d"}, lambda: Task(Distance("tool0", "d"), 1)),
    ({"where": "robot ur5", "got": "elbow"}, lambda: Task(Posture("elbow"), 1)),
    ({"where": "relative_to"}, lambda: Task(Position("tool0", "x", "tool0"), 1)),
    (
        {"where": "task tool0.x, tool0.y, tool0.z, tool0.rx, tool0.ry, tool0.rz", "got": 3},
        lambda: Task(Pose("tool0"), [1, 2, 3]),
    ),
    (
        {"where": "task tool0.rx, tool0.ry, tool0.rz", "got": 2},
        lambda: Task(Orientation("tool0"), Circle([0, 0], 1, 1)),
    ),
    (
        {
            "got": 1,
        },
        lambda: Task(Posture(), 0),
    ),
    (
        {"where": "at", "got": ["x (m)", "y (m)"]},
        lambda: Task(Pointing("tool0", Circle([0, 0], 1, 1)), [0, 0]),
    ),
    ({"where": "to"}, lambda: Task(Distance("tool0", SteadyTurn([0, 0, 1], 1)), 1)),
    ({"where": "at"}, lambda: Task(Pointing("tool0", Position("elbow_joint", "xyz", "base")), [0, 0])),
    ({"where": "at"}, lambda: Task(Pointing("tool0", CenterOfMass("xyz", "base")), [0, 0])),
    ({"where": "robot ur5", "got": "bse"}, lambda: Task(CenterOfMass("x", "bse"), 0.1)),
    ({"where": "at"}, lambda: Task(Pointing("tool0", "tool0"), [0, 0])),
    ({"where": "to"}, lambda: Task(Distance("tool0", "tool0"), 1)),
    (
        {"where": "orientation", "got": ["bearing (rad)"]},
        lambda: Task(Pose("tool0"), PoseReference([1, 2, 3], nmm.Bearing(MOVING, [1, 2]))),
    ),
    ({"where": "axis", "got": [0.0, 0.0, 0.0]}, lambda: Pointing("tool0", [1, 2, 3], [0, 0, 0])),
    ({"where": "axis", "got": "w"}, lambda: Pointing("tool0", [1, 2, 3], "w")),
    ({"where": "axis", "got": [0.0, 1.0]}, lambda: Pointing("tool0", [1, 2, 3], [0, 1])),
    ({"where": "at", "got": [1.0, 2.0]}, lambda: Pointing("tool0", [1, 2])),
    ({"where": "to", "got": 3.0}, lambda: Distance("tool0", 3.0)),
    ({"where": "axes", "got": "xx"}, lambda: CenterOfMass("xx")),
    ({"where": "posture", "got": ("q1", "q1")}, lambda: Posture("q1", "q1")),
    ({"where": "posture", "got": {"q1": 1}}, lambda: Posture({"q1": 1})),  # type: ignore[arg-type]
    ({"where": "position", "got": [1.0, 2.0]}, lambda: PoseReference([1, 2], [1, 2, 3])),
    ({"where": "orientation", "got": [1.0, 2.0, np.nan]}, lambda: PoseReference([1, 2, 3], [1, 2, np.nan])),
    ({"where": "duration", "got": 0.0}, lambda: Slerp([0, 0, 0], [0, 0, 1], 0)),
    ({"got": "quick"}, lambda: Slerp([0, 0, 0], [0, 0, 1], 1, "quick")),  # type: ignore[arg-type]
    ({"where": "end", "got": [0.0, 0.0, 0.0, 1.0]}, lambda: Slerp([0, 0, 0], [0, 0, 0, 1], 1)),
    ({"where": "rate", "got": np.inf}, lambda: SteadyTurn([0, 0, 1], np.inf)),
    ({"where": "axis", "got": [0.0, 0.0, 0.0]}, lambda: SteadyTurn([0, 0, 0], 1.0)),
]


@pytest.mark.parametrize(("fields", "task"), BAD_TASKS)
def test_bad_input_is_named(ur5: Robot, fields: dict[str, Any], task: Callable[[], Task]) -> None:
    with refused(**fields):
        nmm.Controller(ur5, task(), nmm.ProjectedGradient())


def test_a_robot_without_mass_has_no_center() -> None:
    model = pin.Model()
    model.addJoint(0, pin.JointModelRZ(), pin.SE3.Identity(), "turn")
    model.addFrame(pin.Frame("tip", 1, 0, pin.SE3.Identity(), pin.FrameType.BODY))
    robot = nmm.load(model)
    with refused("centre of mass"):
        CenterOfMass().rows(robot)
