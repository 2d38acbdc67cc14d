"""Simulation: laws of every run, and every way in which a run can end."""

from __future__ import annotations

import sys
from collections import Counter
from types import FrameType
from typing import TYPE_CHECKING

import numpy as np
import pytest
from findings import codes, every, the, why
from numpy import pi

import nmm
from nmm.control.integrators import METHODS
from nmm.model.robots.robot import Robot
from nmm.motion import recording
from nmm.motion.diagnosis.assessment import instabilities

if TYPE_CHECKING:
    from _typeshed import TraceFunction

START = {"x": -1, "y": -1, "theta": pi}
CIRCLE = nmm.Circle([2, 2], 3, 0.08 * pi, 5 / 4 * pi)
TIP = nmm.Task(nmm.Position("ee", "xy"), CIRCLE)
H1 = nmm.Quadratic(nmm.QuadraticTerm({"theta": 1, "q1": 1, "q2": 1}, pi / 2), nmm.QuadraticTerm("q1", pi / 4))


def case_1(robot: Robot, alpha: float = 10.0) -> nmm.Controller:
    return nmm.Controller(robot, TIP, nmm.ReducedGradient(alpha, [("v", "q1"), ("v", "omega")]), H1)


@pytest.mark.parametrize("method", METHODS)
def test_every_method_tracks_and_reports_its_rows(robot_2r: Robot, method: str) -> None:
    run = nmm.simulate(case_1(robot_2r), START, 2.0, 0.005, method)
    assert run.complete, run.message
    assert len(run) == 401
    assert run.t[0] == 0.0
    assert run.t[-1] == 2.0
    # e_dot = -K e exactly in continuous time; first-order methods miss it by O(dt).
    expected = run.error[0] * np.exp(-2.0)
    order_one = method in ("euler", "zoh")
    assert np.allclose(run.error[-1], expected, rtol=0, atol=0.02 if order_one else 1e-4)
    assert np.all(run.residual < 1e-10)


def test_the_last_step_is_shorter_when_dt_does_not_divide_the_duration(robot_2r: Robot) -> None:
    run = nmm.simulate(case_1(robot_2r), START, 0.0525, 0.01)
    assert np.allclose(np.diff(run.t)[:-1], 0.01)
    assert run.t[-1] == 0.0525
    assert 0 < run.t[-1] - run.t[-2] < 0.01


def test_zero_order_hold_drives_exact_arcs(robot_2r: Robot) -> None:
    """With constant v and omega the unicycle drives a circle of radius v / omega."""
    v, omega = 0.7, 1.3
    constant = nmm.CallableResolver(lambda problem: np.array([v, omega, 0.2, -0.1]))
    run = nmm.simulate(nmm.Controller(robot_2r, TIP, constant), START, 2.0, 0.02, "zoh")
    angle = pi + omega * run.t
    centre = np.array([-1 - v / omega * np.sin(pi), -1 + v / omega * np.cos(pi)])
    arc = centre + v / omega * np.stack([np.sin(angle), -np.cos(angle)], axis=1)
    # RK4's local error on an arc: (omega dt)^5 v / omega / 120 a step.
    assert np.abs(run.q[:, :2] - arc).max() < 100 * (omega * 0.02) ** 5 / 120
    assert np.allclose(run.q[:, 2], angle, rtol=0, atol=1e-13)
    assert np.allclose(run.q[:, 3:], np.outer(run.t, [0.2, -0.1]), rtol=0, atol=1e-13)


def test_planning_mode_follows_from_a_start_on_the_path(robot_2r: Robot) -> None:
    """Without feedback an initial error stays as it is: f(q(t)) - g(t) is constant."""
    controller = nmm.Controller(
        robot_2r, nmm.Task(TIP.function, CIRCLE, gain=None), nmm.ProjectedGradient(), H1
    )
    run = nmm.simulate(controller, START, 2.0, 0.002)
    assert np.allclose(run.error, run.error[0], rtol=0, atol=1e-6)
    assert run.error_norm[0] > 2.0


def test_alpha_dt_too_large_is_reported_as_such(robot_2r: Robot) -> None:
    diverged = nmm.simulate(case_1(robot_2r, alpha=1000.0), START, 5.0, 0.005)
    assert diverged.outcome is nmm.Outcome.DIVERGED
    assert "tried" in the(diverged, "dt_too_long").values
    assert 1 <= len(diverged) < 1001
    assert np.all(np.isfinite(diverged.q))

    bounded = nmm.simulate(case_1(robot_2r, alpha=200.0), START, 25.0, 0.005)
    assert bounded.outcome in (nmm.Outcome.UNSTABLE, nmm.Outcome.DIVERGED)
    assert "dt_too_long" in why(bounded)

    fine = nmm.simulate(case_1(robot_2r), START, 5.0, 0.005)
    assert fine.complete
    assert fine.warnings == ()


@pytest.mark.parametrize(
    ("method", "limit"),
    [("euler", 2.0), ("midpoint", 2.0), ("zoh_midpoint", 2.0), ("rk4", 2.785)],
)
def test_the_stability_limit_is_the_textbooks(robot_2r: Robot, method: str, limit: float) -> None:
    """H = ½ q2² with a task that leaves q2 alone decays with exactly alpha: the limit is z = -alpha dt."""
    task = nmm.Task(nmm.LinearCoordinates("theta", "q1"), [0.0, 0.0])
    alpha = 50.0
    controller = nmm.Controller(
        robot_2r, task, nmm.ProjectedGradient(alpha), nmm.Quadratic(nmm.QuadraticTerm("q2"))
    )
    from nmm.control.integrators import integrator

    stability = integrator(method, robot_2r, 1e-9).stability
    at = np.zeros(1), np.array([[0, 0, 0.1, 0.1, 0.1]])
    assert instabilities(controller, *at, 0.99 * limit / alpha, stability) == []
    (found,) = instabilities(controller, *at, 1.5 * limit / alpha, stability)
    assert found.rate == pytest.approx(alpha, rel=1e-6)
    assert found.limit == pytest.approx(limit / alpha, rel=2e-3)


def test_a_singular_run_keeps_what_it_has() -> None:
    """With d = 0 a straight arm along the wheels' axle cannot move sideways: J loses rank on the way."""
    robot = nmm.load("unicycle_2r", arguments={"d": 0})
    line = nmm.Line([0.8, 0.0], [3.0, 0.0], 4.0)
    task = nmm.Task(nmm.Position("ee", "xy"), line)
    controller = nmm.Controller(robot, task, nmm.ReducedGradient(10.0, [("omega", "q1")]))
    run = nmm.simulate(controller, {}, 4.0, 0.005)
    assert run.outcome is nmm.Outcome.SINGULAR
    singular = the(run, "singular")
    assert (singular.values["status"], singular.where["t"]) == ("singular_ja", 0.0)
    assert len(run) == 0


@pytest.mark.parametrize("dt", [0.01, 0.005])
def test_a_step_into_a_singular_partition_is_taken_again(dt: float) -> None:
    """With the paper's threshold and a fast objective the minor of [v, omega] passes zero within one step:
    at dt = 5 ms a stage sees it small, at 10 ms only its sign tells."""
    changes = {"resolver.threshold": 0.01, "resolver.alpha": 10, "dt": dt}
    run = nmm.Scenario.load("unicycle_2r_switching", changes).run()
    assert run.complete
    assert run.switches == 1
    # Without taking the step again omega reaches hundreds of rad/s and the error 0.2 m.
    assert run.error_norm.max() < 0.01
    assert np.abs(run.u).max() < 100.0
    assert np.all(run.residual < 1e-10)
    assert run.error_norm[-1] < 1e-6


def test_a_singular_partition_without_an_alternative_is_warned_about() -> None:
    changes = {"resolver.partitions": [["v", "omega"]], "resolver.alpha": 10, "dt": 0.01}
    run = nmm.Scenario.load("unicycle_2r_switching", changes).run()
    assert the(run, "partition_singular").values["inputs"] == ["v", "omega"]
    assert run.switches == 0
    assert nmm.Scenario.load("unicycle_2r_switching").run().warnings == ()


def test_a_target_out_of_reach_is_warned_about(robot_3r: Robot) -> None:
    """Above the arm's reach J becomes singular in the limit: the run completes, and says so."""
    out_of_reach = nmm.Task(nmm.Position("ee"), [0.3, 0.0, 1.7])
    controller = nmm.Controller(robot_3r, out_of_reach, nmm.ProjectedGradient())
    run = nmm.simulate(controller, {"q2": 0.5, "q3": 0.2}, 5.0)
    assert "nearly_singular" in codes(run)
    within = nmm.simulate(case_1(nmm.load("unicycle_2r")), START, 1.0)
    assert within.warnings == ()


def test_an_interrupted_run_keeps_what_it_has(robot_2r: Robot) -> None:
    def interrupt(fraction: float) -> None:
        if fraction > 0.5:
            raise KeyboardInterrupt

    run = nmm.simulate(case_1(robot_2r), START, 2.0, 0.005, progress=interrupt)
    assert run.outcome is nmm.Outcome.INTERRUPTED
    assert 200 <= len(run) < 220
    assert why(run) == ["interrupted"]
    assert len(run.q) == len(run.u) == len(run.sigma_min) == len(run.t)


#: What records a sample.
WRITING = ("add", "replace_last", "_write", "hold", "passed_over")


class InterruptAt:
    """Ctrl-C at line number `left` of those that record samples, each counted at its first two visits."""

    def __init__(self, left: int) -> None:
        self.left = left
        self._visits: Counter[int] = Counter()

    def __call__(self, frame: FrameType, event: str, _: object) -> TraceFunction | None:
        code = frame.f_code
        return self.line if code.co_filename == recording.__file__ and code.co_name in WRITING else None

    def line(self, frame: FrameType, event: str, _: object) -> TraceFunction:
        self._visits[frame.f_lineno] += event == "line"
        if event == "line" and self._visits[frame.f_lineno] <= 2:
            self.left -= 1
            if self.left == -1:
                sys.settrace(None)
                raise KeyboardInterrupt
        return self.line


def test_ctrl_c_at_any_line_that_records_leaves_a_whole_run() -> None:
    """Where limits contradict each other, by turns, and distances change the inputs."""
    robot = nmm.load("unicycle_2r")
    x = nmm.Position("base_link", "x")
    limits = nmm.Limits(
        bounds=[nmm.Bound(x, 0.5, 1.0, name="corridor"), nmm.Bound(x, -1.0, -0.5, name="wall")]
    )
    ball = nmm.Obstacle(nmm.Sphere(0.1), [0.0, 0.0, 2.0])
    task = nmm.Task(nmm.Position("ee", "xy"), [1.0, 0.5])
    collisions = nmm.Collisions(0.03, obstacles=[ball])
    controller = nmm.Controller(robot, task, nmm.ProjectedGradient(), limits=limits, collisions=collisions)
    lines = 0
    while True:
        controller.reset()
        interrupt = InterruptAt(lines)
        sys.settrace(interrupt)
        try:
            run = nmm.simulate(controller, {"q1": 0.5, "q2": 0.5}, 0.01, 0.005)
        finally:
            sys.settrace(None)
        if interrupt.left >= 0:
            break
        assert run.outcome is nmm.Outcome.INTERRUPTED
        assert len(run.q) == len(run.u) == len(run.t)
        contradicted = every(run, "limit_contradicted")
        assert all(finding.where["t"] <= run.t[-1] for finding in contradicted)
        lines += 1
    assert lines > 20
    assert run.complete
    assert every(run, "limit_contradicted")


def test_progress_goes_from_nothing_to_one(robot_2r: Robot) -> None:
    seen: list[float] = []
    nmm.simulate(case_1(robot_2r), START, 1.0, 0.005, progress=seen.append)
    assert seen[0] == 0.0
    assert seen[-1] == 1.0
    assert seen == sorted(seen)


def test_a_run_is_repeatable_to_the_last_bit(robot_2r: Robot) -> None:
    controller = case_1(robot_2r)
    first = nmm.simulate(controller, START, 1.0)
    second = nmm.simulate(controller, START, 1.0)
    assert np.array_equal(first.q, second.q)
    assert np.array_equal(first.u, second.u)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"duration": 0.0}, "duration"),
        ({"duration": np.nan}, "duration"),
        ({"dt": -0.1}, "dt"),
        ({"dt": 1e-12}, "samples"),
        ({"method": "rk5"}, "rk4"),
        ({"q0": [0, 0, 0]}, "5 numbers"),
        ({"q0": [0, 0, 0, 0, np.inf]}, "finite"),
        ({"q0": {"q7": 1.0}}, "q7"),
        ({"tolerance": 0.0}, "tolerance"),
    ],
)
def test_bad_input_is_refused(robot_2r: Robot, change: dict, words: str) -> None:
    arguments = {"q0": START, "duration": 1.0, "dt": 0.01, "method": "rk4", "tolerance": 1e-9} | change
    q0, duration = arguments.pop("q0"), arguments.pop("duration")
    with pytest.raises(nmm.InputError, match=words):
        nmm.simulate(case_1(robot_2r), q0, duration, **arguments)


def test_a_singularity_passed_between_two_samples_is_no_success() -> None:
    """A trailer's arm without a posture to keep: the reduced gradient runs it into its end of reach."""
    run = nmm.Scenario.load("small_arm_second_trailer", {"objective": None}).run()
    assert run.outcome == "missed"
    assert "along" in the(run, "singularity_passed").values["lost"]


def test_a_target_that_jumps_is_not_taken_for_a_singularity(robot_2r: nmm.Robot) -> None:
    step = nmm.CallableReference(lambda t: [1.0 if t < 0.5 else 1.3, 0.2], 2, rate=lambda t: [0.0, 0.0])
    task = nmm.Task(nmm.Position("ee", "xy"), step, 5.0)
    run = nmm.simulate(nmm.Controller(robot_2r, task, nmm.ProjectedGradient()), {"q2": 0.7}, 2.0, 0.01)
    assert run.complete, run.message
    assert run.error_norm[-1] < 1e-3
