"""What the analyses take: functions without targets, and many configurations in one loop."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from function_grid import ENTRIES, Entry
from numpy.typing import NDArray

from nmm.analysis import analyse
from nmm.analysis.singular.jacobians import Jacobians
from nmm.base.errors import InputError
from nmm.control.functions.program import evaluate
from nmm.control.functions.tasks import Heading, Orientation, Pose, Position, Task
from nmm.model.robots.configuration import Configuration
from nmm.model.robots.loading import load
from nmm.model.robots.robot import Robot

Array = NDArray[np.float64]


def subtracted() -> list[Entry]:
    """Tasks whose error is a difference; the others' rows are those of their error, tested below."""
    tasks = [
        entry
        for entry in ENTRIES
        if type(entry.function).__module__.startswith("nmm.control.functions.tasks")
    ]
    return [entry for entry in tasks if entry.function.comparison is None]


@pytest.mark.parametrize("entry", subtracted(), ids=lambda entry: entry.name)
def test_a_function_without_target_has_the_J_of_its_own_derivative(
    entry: Entry, robots: dict[str, Robot], rng: np.random.Generator
) -> None:
    able = [
        robots[name] for name in entry.robots if len(entry.function.rows(robots[name])) <= robots[name].n_u
    ]
    if not able:
        return
    robot = able[-1]
    q = rng.uniform(-1.5, 1.5, robot.n)
    here = Configuration(robot, q)
    expected = evaluate(entry.function, 0.0, here).value_q @ here.S
    np.testing.assert_allclose(Jacobians((robot, entry.function)).J(0.0, q), expected, atol=1e-14)


@pytest.mark.parametrize("function", [Orientation("tool0"), Pose("tool0")], ids=["orientation", "pose"])
def test_a_pose_without_target_has_the_jacobian_in_the_frames_own_axes(
    function: Orientation | Pose, ur5: Robot, rng: np.random.Generator
) -> None:
    jacobians = Jacobians((ur5, function))
    data = ur5.model.createData()
    for q in rng.uniform(-3.0, 3.0, (20, ur5.n)):
        body = pin.computeFrameJacobian(ur5.model, data, q, ur5.frame_id("tool0"), pin.LOCAL)
        expected = (body if isinstance(function, Pose) else body[3:]) @ ur5.S(q)
        np.testing.assert_allclose(jacobians.J(0.0, q), expected, atol=1e-12)


def test_functions_and_tasks_stand_above_each_other(robot_2r: Robot) -> None:
    mixed = (Position("ee", "xy"), Task(Heading("link2"), 0.3))
    report = analyse((robot_2r, mixed), [0.1, 0.2, 0.3, 0.4, 0.5])
    assert report.rows == ("ee.x", "ee.y", "link2.heading")
    targets = (Task(Position("ee", "xy"), [4.0, 5.0]), mixed[1])
    np.testing.assert_array_equal(report.J, analyse((robot_2r, targets), report.q).J)


@pytest.mark.parametrize("task", ["ee", [Position("ee"), "ee"], 3])
def test_what_is_no_task_is_named(robot_2r: Robot, task: object) -> None:
    with pytest.raises(InputError, match=r"task: expected a task, a function of the robot as Position"):
        analyse((robot_2r, task), np.zeros(5))  # type: ignore[arg-type]  # that is the point


def test_a_loop_over_configurations_finds_what_single_calls_find(
    ur5: Robot, rng: np.random.Generator
) -> None:
    jacobians = Jacobians((ur5, Pose("tool0")))
    q = rng.uniform(-3.0, 3.0, (150, ur5.n))
    found = jacobians.batch(q)
    np.testing.assert_array_equal(found, [jacobians.J(0.0, point) for point in q])
    seen: list[float] = []
    often = jacobians.batch(np.tile(q, (30, 1)), progress=seen.append)
    np.testing.assert_array_equal(often, np.tile(found, (30, 1, 1)))
    assert len(seen) > 3
    assert seen == sorted(seen)
    assert seen[0] >= 0.0
    assert seen[-1] < 1.0
    np.testing.assert_array_equal(jacobians.batch(np.asfortranarray(q)), found)


def test_where_the_wheels_cannot_roll_there_is_no_number() -> None:
    robot = load("car_base")
    across = [[0.0, 0.0, 0.0, angle] for angle in (0.3, np.pi / 2, -0.3)]
    found = Jacobians((robot, Position("base_footprint", "xy"))).batch(np.array(across))
    assert np.isnan(found[1]).all()
    assert np.isfinite(found[[0, 2]]).all()
