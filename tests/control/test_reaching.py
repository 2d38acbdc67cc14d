"""Reaching held targets: priorities under limits, the approach, the goal, the retreat."""

from __future__ import annotations

import math

import numpy as np
import pytest
import yaml
from findings import codes, refused, the, why
from places import PANDA

import nmm
from nmm.control.goal import error_sizes

ROBOT = nmm.load("unicycle_3r")
DT = 0.02


def controller(**options: object) -> nmm.Controller:
    position = nmm.Task(nmm.Position("ee"), [3.0, 1.0, 0.5], gain=2.0, **options.pop("position", {}))
    heading = nmm.Task(nmm.LinearCoordinates("q1"), 0.5, gain=2.0, **options.pop("other", {}))
    limits = options.pop("limits", nmm.Limits({"platform": 0.5, "arm": 0.4}))
    return nmm.Controller(
        ROBOT, [heading, position], nmm.ProjectedGradient(alpha=1.0), limits=limits, dt=DT, **options
    )


Q0 = ROBOT.q({"q1": -1.0, "q2": 0.7, "q3": 0.5})


def test_the_first_level_has_the_scale_it_has_alone() -> None:
    """A lower level never disturbs a higher one: with the level below it, and without."""
    alone = nmm.Controller(
        ROBOT,
        nmm.Task(nmm.Position("ee"), [3.0, 1.0, 0.5], gain=2.0),
        nmm.ProjectedGradient(alpha=1.0),
        limits=nmm.Limits({"platform": 0.5, "arm": 0.4}),
        dt=DT,
    ).evaluate(0.0, Q0)
    both = controller(other={"priority": 2}).evaluate(0.0, Q0)
    assert alone.scale[0] < 1.0
    assert both.scale[0] == pytest.approx(alone.scale[0], abs=1e-12)
    np.testing.assert_allclose(both.J[:3] @ both.u, alone.J @ alone.u, atol=1e-9)


def test_one_level_scales_all_rows_alike() -> None:
    step = controller().evaluate(0.0, Q0)
    assert step.scale.shape == (1,)
    np.testing.assert_allclose(step.J @ step.u, step.scale[0] * step.rate, atol=1e-9)


def test_tasks_are_ordered_by_priority() -> None:
    rows = controller(other={"priority": 2}).rows
    assert [row.name for row in rows] == ["ee.x", "ee.y", "ee.z", "q1"]


@pytest.mark.parametrize("limit", [{"speed": 0.3}, {"speed": {"m": 0.3}}, {"braking": 0.01}])
def test_feedback_is_bounded_and_said(limit: dict[str, object]) -> None:
    step = controller(position=limit, limits=None).evaluate(0.0, Q0)
    found = step.J[1:] @ step.u  # the heading first, as given
    error = step.error[1:]
    most = 0.3 if "speed" in limit else math.sqrt(2.0 * 0.01 * np.linalg.norm(error))
    assert np.linalg.norm(found) == pytest.approx(most, rel=1e-9)
    np.testing.assert_allclose(np.cross(found, error), 0.0, atol=1e-9)
    assert step.scale[0] < 1.0
    assert step.residual == pytest.approx(np.linalg.norm(step.J @ step.u - step.rate), rel=1e-9)


def test_a_run_ends_where_its_goal_is_reached() -> None:
    goal = nmm.Goal(m=0.01, rad=0.05)
    run = nmm.simulate(controller(), Q0, 60.0, DT, "zoh", until=goal)
    assert run.outcome == "completed"
    assert [(one.code, one.where["t"]) for one in run.verdict.reasons] == [("reached", run.t[-1])]
    assert run.t[-1] < 59.0
    units = [row.unit for row in controller().rows]
    metres, radians = error_sizes(run.error[-1], units)
    assert metres <= goal.m
    assert radians <= goal.rad
    before = error_sizes(run.error[-2], units)
    assert before[0] > goal.m or before[1] > goal.rad
    assert "promise_left" not in codes(run)  # limits bind on the way, which is no failure
    assert the(run, "inputs_unmet").values["scale"] < 1.0


@pytest.mark.parametrize("until", [True, 0.01, {"m": 0.01}])
def test_a_goal_that_is_none_is_refused(until: object) -> None:
    with refused("until"):
        nmm.simulate(controller(), Q0, 1.0, DT, "zoh", until=until)  # type: ignore[arg-type]


def test_a_goal_out_of_reach_is_missed_with_what_is_left() -> None:
    task = nmm.Task(nmm.Position("ee"), [1.0, 0.0, 9.0])
    there = nmm.Controller(
        ROBOT, task, nmm.ProjectedGradient(alpha=1.0), limits=nmm.Limits({"arm": 1.0, "platform": 1.0}), dt=DT
    )
    run = nmm.simulate(there, Q0, 4.0, DT, "zoh", until=nmm.Goal())
    assert run.outcome == "missed"
    assert why(run)[0] == "not_reached"
    assert the(run, "not_reached").values["m"] > 6.0


def test_a_goal_reached_is_completed_however_the_error_came_there() -> None:
    """alpha * dt is too large for more than half of the run: a warning, as the target is reached."""
    there = nmm.Controller(
        ROBOT,
        nmm.Task(nmm.Position("ee"), [3.0, 1.0, 0.5], gain=0.5),
        nmm.ProjectedGradient(alpha=60.0),
        nmm.Quadratic(nmm.QuadraticTerm("q3")),
        limits=nmm.Limits({"platform": 0.5, "arm": 0.4}),
    )
    run = nmm.simulate(there, Q0, 20.0, 0.05, "zoh", until=nmm.Goal(m=0.1))
    assert run.outcome == "completed"
    assert why(run) == ["reached"]
    assert any(one.code == "dt_too_long" for warning in run.verdict.warnings for one in warning)


def test_what_limits_of_acceleration_delay_is_not_stalled() -> None:
    """A base that gathers speed: the error falls by less than 3 % in the first half second."""
    there = nmm.Controller(
        ROBOT,
        nmm.Task(nmm.Position("ee"), [6.0, 0.0, 0.5], gain=2.0, speed=1.0, braking=0.2),
        nmm.ProjectedGradient(alpha=1.0),
        limits=nmm.Limits({"platform": 1.0, "arm": 0.4}, acceleration={"platform": 0.3, "arm": 2.0}),
        retreat=nmm.Retreat(),
    )
    run = nmm.simulate(there, Q0, 30.0, DT, "zoh", until=nmm.Goal())
    assert run.outcome == "completed"
    assert "backed_off" not in codes(run)


@pytest.fixture(scope="module")
def panda() -> nmm.Robot:
    base = nmm.load("differential_base", platform="unicycle")
    file = PANDA
    return nmm.mount(base, nmm.load(file, lock={"panda_finger_joint1": 0.02}))


def far_pose(robot: nmm.Robot, target: nmm.PoseReference, longest: float, **given: object) -> nmm.Trajectory:
    """One level for a pose that is metres away, to be reached with and without a retreat."""
    bounded = {"speed": {"m": 4.0, "rad": 2.5}, "braking": {"m": 1.5, "rad": 3.0}}
    retreat = given.pop("retreat", None)
    task = nmm.Task(nmm.Pose("panda_hand_tcp"), target, **bounded, **given)
    limits = nmm.Limits({"v": 4.0, "omega": 4.0}, acceleration={"platform": 4.0, "arm": 15.0})
    there = nmm.Controller(robot, task, nmm.ProjectedGradient(), limits=limits, retreat=retreat)
    start = {"panda_joint2": -0.3, "panda_joint4": -2.2, "panda_joint6": 2.0, "panda_joint7": np.pi / 4}
    return nmm.simulate(there, robot.q(start), longest, 0.05, "zoh", until=nmm.Goal())


def test_a_retreat_comes_nearer_under_limits_of_acceleration(panda: nmm.Robot) -> None:
    """5 m away and turned by 120°: λ falls to 0 before the base has turned."""
    target = nmm.PoseReference([2.99, -3.32, 0.63], [1.08, 1.43, 1.01])
    run = far_pose(panda, target, 20.0, gain=2.0, retreat=nmm.Retreat())
    assert run.outcome == "completed"
    away = np.linalg.norm(run.q[:, :2] - [2.99, -3.32], axis=1)
    assert away.max() < away[0] + 0.5


@pytest.mark.parametrize("retreat", [None, nmm.Retreat()])
def test_a_far_pose_that_is_reached_is_completed(panda: nmm.Robot, retreat: nmm.Retreat | None) -> None:
    """Modes are too fast for dt in more than half of its samples, with the default gain."""
    run = far_pose(panda, nmm.PoseReference([4.32, 1.23, 1.01], [-1.09, -0.64, 2.01]), 60.0, retreat=retreat)
    assert run.outcome == "completed"
    assert any(one.code == "dt_too_long" for warning in run.verdict.warnings for one in warning)


def test_no_two_retreats_of_a_default_are_alike() -> None:
    durations = nmm.Retreat().durations
    assert len(set(durations)) == len(durations) == 500
    assert 1.0 <= min(durations) < max(durations) < 3.5


def test_a_retreat_leaves_a_stall_and_keeps_limits() -> None:
    """A joint that stops halfway: the error stalls, the robot backs off, within its limits."""
    limits = nmm.Limits({"platform": 0.5, "arm": 0.4}, {"q2": [0.6, 0.8]}, acceleration=5.0)
    there = nmm.Controller(
        ROBOT,
        nmm.Task(nmm.Position("ee"), [1.0, 0.0, 9.0], gain=2.0),
        nmm.ProjectedGradient(alpha=1.0),
        limits=limits,
        dt=DT,
        retreat=nmm.Retreat(durations=[0.4]),
    )
    run = nmm.simulate(there, Q0, 6.0, DT, "zoh")
    assert "backed_off" in codes(run)
    assert np.any(run.scale == 0.0)
    assert np.all(np.abs(np.diff(run.u, axis=0)) <= 5.0 * DT + 1e-12)
    assert np.all(
        (run.q[:, ROBOT.coordinate("q2")] >= 0.6 - 1e-12) & (run.q[:, ROBOT.coordinate("q2")] <= 0.8 + 1e-12)
    )


@pytest.mark.parametrize("limits", [None, nmm.Limits({"platform": 0.5, "arm": 0.4}, acceleration=5.0)])
def test_a_retreat_is_a_samples_whatever_the_method(limits: nmm.Limits | None) -> None:
    """Stages between two samples neither count as samples nor go after the target meanwhile."""

    def run(method: str) -> nmm.Trajectory:
        there = nmm.Controller(
            ROBOT,
            nmm.Task(nmm.Position("ee"), [1.0, 0.0, 9.0]),
            nmm.DampedLeastSquares(),
            limits=limits,
            retreat=nmm.Retreat(durations=[0.4]),
        )
        return nmm.simulate(there, Q0, 4.0, DT, method)

    held, staged = run("zoh"), run("rk4")
    first = [the(each, "backed_off").values["times"][0] for each in (held, staged)]
    assert first[1] == first[0]
    k = np.searchsorted(held.t, first[0] - 1e-9)
    moved = [each.q[k + 20] - each.q[k] for each in (held, staged)]
    assert np.linalg.norm(moved[1]) > 0.1
    np.testing.assert_allclose(moved[1], moved[0], atol=0.02)


@pytest.mark.parametrize(
    ("made", "text"),
    [
        (lambda: nmm.Task(nmm.Position("ee"), [0, 0, 0], priority=0), "priority: expected a whole number"),
        (lambda: nmm.Task(nmm.Position("ee"), [0, 0, 0], speed=0.0), "speed: expected a number above 0"),
        (lambda: controller(position={"speed": {"kg": 1.0}}), "speed: unknown unit 'kg'"),
        (lambda: nmm.Goal(m=-1.0), "goal: m: expected a number above 0"),
        (lambda: nmm.Retreat(progress=1.0), "retreat: progress: expected a number above 0 and below 1"),
        (lambda: nmm.Retreat(durations=()), "retreat: durations"),
        (lambda: nmm.Retreat(durations=0.0), "retreat: durations: expected a number above 0"),
        (lambda: nmm.Retreat(durations="long"), "retreat: durations: expected"),  # type: ignore[arg-type]
        (lambda: nmm.Retreat(goal=0.01), "retreat: goal: expected a Goal, got 0.01"),  # type: ignore[arg-type]
        (lambda: controller(retreat=nmm.Retreat(posture={"q9": 1.0})), "unknown coordinate 'q9'"),
    ],
)
def test_what_cannot_be_is_said(made: object, text: str) -> None:
    with pytest.raises(nmm.InputError) as error:
        made()
    assert text in str(error.value)


def test_a_scenario_says_the_same(tmp_path: object) -> None:
    data = {
        "robot": "unicycle_3r",
        "q0": {"q1": -1.0, "q2": 0.7, "q3": 0.5},
        "duration": 60,
        "dt": DT,
        "method": "zoh",
        "task": [
            {
                "kind": "position",
                "frame": "ee",
                "axes": "xyz",
                "reference": [3.0, 1.0, 0.5],
                "gain": 2,
                "speed": {"m": 0.3},
            },
            {"kind": "coordinates", "of": ["q1"], "reference": 0.5, "gain": 2, "priority": 2},
        ],
        "resolver": {"kind": "pg", "alpha": 1},
        "limits": {"velocity": {"platform": 0.5, "arm": 0.4}},
        "until": {"m": 0.01, "rad": 0.05},
        "retreat": True,
    }
    path = tmp_path / "reach.yaml"
    path.write_text(yaml.safe_dump(data), encoding="utf-8")
    run = nmm.Scenario.load(path).run()
    assert run.outcome == "completed"
    assert run.scale.shape[1] == 2
    assert np.abs(run.u[:, 2:]).max() <= 0.4 + 1e-12
    folder = run.save(tmp_path / "run", figures=False)
    again = nmm.Trajectory.load(folder)
    np.testing.assert_array_equal(again.margin, run.margin)
    assert again.limited
