"""Poses of platforms to which no smooth feedback leads: said where they stand elsewhere, and only there."""

from __future__ import annotations

import pytest
from findings import codes, why

import nmm

CODE = "pose_without_feedback"
XYT = nmm.Posture("x", "y", "theta")


def ran(base: str, *tasks: nmm.Task) -> nmm.Trajectory:
    robot = nmm.load(base) if base.startswith("unicycle") else nmm.mount(base, "small_arm", at="arm_mount")
    controller = nmm.Controller(robot, tasks, nmm.DampedLeastSquares(), limits=nmm.Limits())
    return nmm.simulate(controller, robot.rest, 0.5, 0.05, "zoh", until=nmm.Goal())


@pytest.mark.parametrize("base", ["differential_base", "car_base"])
@pytest.mark.parametrize(
    "task",
    [
        nmm.Task(XYT, [0.0, 1.0, 0.5]),
        nmm.Task(nmm.LinearCoordinates({"x": 1.0, "y": 1.0}, "y", {"theta": 2.0}), [1.0, 0.0, 0.0]),
        nmm.Task(nmm.Pose("base_footprint"), [0.0, 1.0, 0.0, 0.0, 0.0, 0.0]),
    ],
    ids=["coordinates", "sums", "pose"],
)
def test_a_pose_that_stands_is_why_it_is_missed(base: str, task: nmm.Task) -> None:
    run = ran(base, task)
    assert not run.complete
    assert why(run)[:2] == ["not_reached", CODE] or CODE in why(run)[:2]
    assert CODE not in [one.code for line in run.verdict.warnings for one in line]


def test_two_tasks_may_hold_a_pose_together() -> None:
    position = nmm.Task(nmm.Position("base_footprint", "xy"), [0.0, 1.0])
    heading = nmm.Task(nmm.Heading("base_footprint"), [0.0], priority=2)
    assert CODE in codes(ran("unicycle_2r", position, heading))
    assert CODE not in codes(ran("unicycle_2r", position))


@pytest.mark.parametrize(
    ("base", "task"),
    [
        ("omni_base", nmm.Task(XYT, [0.0, 1.0, 0.5])),
        ("unicycle_2r", nmm.Task(XYT, [0.0, 0.0, 0.0])),
        ("unicycle_2r", nmm.Task(XYT, nmm.Line([0.0, 0.0, 0.0], [0.2, 0.0, 0.0], 0.5))),
        ("unicycle_2r", nmm.Task(nmm.LinearCoordinates("x", "y", {"theta": 1, "q1": 1}), [0.0, 0.5, 0.5])),
    ],
    ids=["omnidirectional", "held where it is", "moving", "with the arm's help"],
)
def test_what_feedback_can_do_is_not_warned_of(base: str, task: nmm.Task) -> None:
    assert CODE not in codes(ran(base, task))
