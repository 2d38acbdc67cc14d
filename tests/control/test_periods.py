"""Periods of references: found where circles make them, asked for elsewhere, and never believed unseen."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy import pi
from numpy.typing import NDArray

from nmm.analysis.null_space.laps import Repeatability, repeatability
from nmm.base.errors import InputError
from nmm.control.controller import Controller
from nmm.control.functions.references import (
    Bearing,
    Circle,
    Constant,
    Line,
    PoseReference,
    Spline,
    SteadyTurn,
)
from nmm.control.functions.tasks import Heading, Orientation, Pose, Position, Task
from nmm.control.resolvers import ProjectedGradient
from nmm.model.robots.robot import Robot
from nmm.scenario import Scenario

Array = NDArray[np.float64]

TIP = Position("ee", "xy")


def with_reference(robot: Robot, *references: Any) -> tuple[dict[str, Controller], Array]:
    functions = (TIP, Heading("link2"))
    tasks = [Task(f, g) for f, g in zip(functions, references, strict=False)]
    return {"pg": Controller(robot, tasks, ProjectedGradient())}, robot.q({"q1": 0.5, "q2": 0.7})


def quick(subject: Any, **settings: Any) -> Repeatability:
    return repeatability(subject, **{"laps": 1, "dt": 0.05, **settings})


def test_periods_of_circles_and_what_is_made_of_them(robot_2r: Robot) -> None:
    fast, slow = Circle([1.0, 0.2], 0.1, pi), Circle([0.0, 0.0], 0.1, 2 * pi / 3)
    assert quick(with_reference(robot_2r, fast)).period == pytest.approx(2.0)
    backwards = Circle([1.0, 0.2], 0.1, -pi)
    assert quick(with_reference(robot_2r, backwards, Constant([0.4]))).period == pytest.approx(2.0)
    both = with_reference(robot_2r, fast, Bearing(slow, [5.0, 1.0]))
    assert quick(both).period == pytest.approx(6.0)


def test_a_period_is_asked_for_where_none_is_known(ur5: Robot) -> None:
    turning = PoseReference([0.6, 0.1, 0.7], SteadyTurn([0, 0, 1], pi / 2, [pi, 0, 0]))
    controllers = {"pg": Controller(ur5, Task(Pose("tool0"), turning), ProjectedGradient())}
    q0 = ur5.q(
        {"shoulder_lift_joint": -1.2, "elbow_joint": 1.5, "wrist_1_joint": -1.8, "wrist_2_joint": -1.4}
    )
    with pytest.raises(InputError, match="Turn does not say its period") as refused:
        quick((controllers, q0))
    assert refused.value.where == "period"
    assert quick((controllers, q0), period=4.0, laps=2, dt=0.1).period == 4.0  # by half a turn it jumps
    with pytest.raises(InputError, match="not where it was 3 s before"):
        quick((controllers, q0), period=3.0)
    only = {"pg": Controller(ur5, Task(Orientation("tool0"), SteadyTurn([0, 0, 1], pi)), ProjectedGradient())}
    assert quick((only, q0), period=2.0, dt=0.1).period == 2.0


def test_angles_come_round_too(robot_2r: Robot) -> None:
    """A bearing that goes round by a turn is where it was."""
    around = Bearing(Circle([0.0, 0.0], 3.0, pi), [0.1, 0.0])
    controllers = {"pg": Controller(robot_2r, Task(Heading("link2"), around), ProjectedGradient())}
    assert quick((controllers, robot_2r.q())).period == pytest.approx(2.0)


@pytest.mark.parametrize(
    ("reference", "settings", "message"),
    [
        (Line([1, 0], [1.2, 0], 2.0), {}, "Line does not say its period"),
        (Line([1, 0], [1.2, 0], 2.0), {"period": 2.0}, "expected a path that goes round"),
        ([1.0, 0.2], {}, "stands still"),
        (Circle([1.0, 0.2], 0.1, 0.0), {}, "stands still"),
        (Circle([1.0, 0.2], 0.1, pi), {"period": 1.5}, "not where it was 1.5 s before"),
        (Circle([1.0, 0.2], 0.1, pi), {"period": 0}, "period: expected a number above 0"),
        (Circle([1.0, 0.2], 0.1, pi), {"laps": 0}, "whole number above 0"),
        (Circle([1.0, 0.2], 0.1, pi), {"laps": 2.5}, "whole number above 0"),
        (Circle([1.0, 0.2], 0.1, pi), {"laps": True}, "whole number above 0"),
        (Circle([1.0, 0.2], 0.1, pi), {"dt": -1}, "dt"),
    ],
)
def test_paths_that_do_not_go_round(
    robot_2r: Robot, reference: Any, settings: dict[str, Any], message: str
) -> None:
    with pytest.raises(InputError, match=message):
        quick(with_reference(robot_2r, reference), **settings)


def test_a_periodic_spline_says_its_period(robot_2r: Robot) -> None:
    points = [[1.0, 0.2], [1.1, 0.3], [1.0, 0.4], [0.9, 0.3], [1.0, 0.2]]
    times = [0, 1, 2, 3, 4]
    assert quick(with_reference(robot_2r, Spline(times, points, ends="periodic")), laps=2).period == 4.0
    once = with_reference(robot_2r, Spline(times, points))
    assert quick(once, period=4.0).period == 4.0
    with pytest.raises(InputError, match="not where it was 4 s before"):
        quick(once, period=4.0, laps=2)


def test_periods_without_a_common_one(robot_2r: Robot) -> None:
    one, other = Circle([1.0, 0.2], 0.1, 1.0), Bearing(Circle([0.0, 0.0], 0.1, np.sqrt(2.0)), [5.0, 1.0])
    with pytest.raises(InputError, match="no common period"):
        quick(with_reference(robot_2r, one, other))


def test_bad_subjects(robot_2r: Robot) -> None:
    with pytest.raises(InputError, match="expected a Scenario"):
        repeatability("unicycle_2r_position")  # type: ignore[arg-type]
    with pytest.raises(InputError, match="at least one"):
        repeatability(({}, [0.0]))
    with pytest.raises(InputError, match="at least one"):
        repeatability(Scenario.load("unicycle_2r_position"), resolvers=())
    with pytest.raises(InputError, match="added_task"):
        repeatability(Scenario.load("unicycle_2r_manipulability"), resolvers=("ej",))
    with pytest.raises(InputError, match="unknown resolver 'rg'; available: pg"):
        quick(with_reference(robot_2r, Circle([1.0, 0.2], 0.1, pi)))["rg"]
