"""Reaching held targets: priorities under limits, the approach, the goal, the retreat."""

from __future__ import annotations

import math
import re

import numpy as np
import pytest
import yaml

import nmm
from nmm.control.goal import sizes

ROBOT = nmm.load("unicycle_3r")
DT = 0.02


def controller(**options: object) -> nmm.Controller:
    position = nmm.Task(nmm.Position("ee"), [3.0, 1.0, 0.5], gain=2.0, **options.pop("position", {}))
    heading = nmm.Task(nmm.Coordinates("q1"), 0.5, gain=2.0, **options.pop("other", {}))
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
    assert "reached" in run.message
    assert run.t[-1] < 59.0
    units = [row.unit for row in controller().rows]
    metres, radians = sizes(run.error[-1], units)
    assert metres <= goal.m
    assert radians <= goal.rad
    before = sizes(run.error[-2], units)
    assert before[0] > goal.m or before[1] > goal.rad
    assert "promise" not in " ".join(run.warnings)  # limits bind on the way, which is no failure
    assert "λ falls to" in " ".join(run.warnings)


@pytest.mark.parametrize("until", [True, 0.01, {"m": 0.01}])
def test_a_goal_that_is_none_is_refused(until: object) -> None:
    with pytest.raises(nmm.InputError, match=r"until: expected a Goal, .* got "):
        nmm.simulate(controller(), Q0, 1.0, DT, "zoh", until=until)  # type: ignore[arg-type]


def test_a_goal_out_of_reach_is_missed_with_what_is_left() -> None:
    task = nmm.Task(nmm.Position("ee"), [1.0, 0.0, 9.0])
    there = nmm.Controller(
        ROBOT, task, nmm.ProjectedGradient(alpha=1.0), limits=nmm.Limits({"arm": 1.0, "platform": 1.0}), dt=DT
    )
    run = nmm.simulate(there, Q0, 4.0, DT, "zoh", until=nmm.Goal())
    assert run.outcome == "missed"
    assert "not reached" in run.message


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
    assert any("backed off" in warning for warning in run.warnings)
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
    said = [next(one for one in each.warnings if "backed off" in one) for each in (held, staged)]
    first = [float(re.findall(r"t = ([\d.]+) s", one)[0]) for one in said]
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
        (lambda: nmm.Retreat(progress=1.0), "retreat: progress: expected below 1"),
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
