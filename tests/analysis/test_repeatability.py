"""Repeatability: what is known of laps with fixed bases and of trailers, and honest numbers of the rest."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy import pi
from numpy.typing import NDArray
from planar_arms import planar_arm
from scipy.integrate import solve_ivp
from short_scenario import scenario

import nmm
from nmm.analysis.null_space.laps import Laps, Repeatability, repeatability
from nmm.base.errors import InputError
from nmm.control.controller import Controller
from nmm.control.functions.references import Circle
from nmm.control.functions.tasks import Heading, LinearCoordinates, Position, Task
from nmm.control.resolvers import CallableResolver, ExtendedJacobian, Problem, ProjectedGradient
from nmm.model.robots.robot import Robot
from nmm.scenario import Scenario
from nmm.views.figures.repeatability import laps as laps_figure

Array = NDArray[np.float64]

TIP = Position("ee", "xy")
#: A fast circle for the tests: period 2 s.
ROUND = "{kind: circle, center: [1.2, 0.2], radius: 0.1, rate: pi}"


@pytest.fixture(scope="module")
def arm(tmp_path_factory: pytest.TempPathFactory) -> Robot:
    return planar_arm(tmp_path_factory.mktemp("arm"), 1.0, 1.0, 1.0)


def tip(q: Array) -> Array:
    angles = np.cumsum(q)
    return np.array([np.cos(angles).sum(), np.sin(angles).sum()])


def arm_jacobian(q: Array) -> Array:
    angles = np.cumsum(q)
    return np.array(
        [[-np.sin(angles[k:]).sum() for k in range(3)], [np.cos(angles[k:]).sum() for k in range(3)]]
    )


# A fixed base ----------------------------------------------------------------------------------------------

Q0 = np.array([0.3, 0.8, 0.9])
RADIUS, PERIOD = 0.4, 4.0


def circle_from(q0: Array) -> Circle:
    """A circle on which the hand at q0 stands."""
    return Circle(tip(q0) - [RADIUS, 0.0], RADIUS, 2 * pi / PERIOD)


def test_the_extended_jacobian_of_a_fixed_base_is_cyclic(arm: Robot) -> None:
    """(r, y) fix q locally (Baillieul 1985): from the first lap on, where it begins on the path."""
    held = Task(LinearCoordinates({"q2": 1.0, "q3": -1.0}), Q0[1] - Q0[2])
    extended = Controller(arm, Task(TIP, circle_from(Q0)), ExtendedJacobian(), added_task=held)
    (found,) = repeatability(({"ej": extended}, Q0), laps=3, dt=0.01).laps
    assert np.ptp(found.trajectory.q, axis=0).min() > 0.1
    assert np.abs(found.drift).max() < 1e-8
    assert found.closes
    assert found.converges
    assert found.verdict.code == "laps_repeat"


def test_the_pseudoinverse_of_a_fixed_base_drifts(arm: Robot) -> None:
    """Klein and Huang (1983); the motion against one integrated by itself."""
    reference = circle_from(Q0)
    plain = Controller(arm, Task(TIP, reference), ProjectedGradient())
    found = repeatability(({"pg": plain}, Q0), laps=3, dt=0.01)
    assert found.period == PERIOD
    (one,) = found.laps

    def velocity(t: float, q: Array) -> Array:
        phase = 2 * pi * t / PERIOD
        target = tip(Q0) - [RADIUS, 0.0] + RADIUS * np.array([np.cos(phase), np.sin(phase)])
        rate = RADIUS * 2 * pi / PERIOD * np.array([-np.sin(phase), np.cos(phase)])
        return np.linalg.pinv(arm_jacobian(q)) @ (rate + target - tip(q))

    ends = np.arange(4) * PERIOD
    solved = solve_ivp(velocity, (0, 3 * PERIOD), Q0, "DOP853", t_eval=ends, rtol=1e-11, atol=1e-11)
    np.testing.assert_allclose(one.q, solved.y.T, atol=1e-6)
    np.testing.assert_allclose(one.drift, np.diff(solved.y.T, axis=0), atol=1e-6)
    assert one.distance.min() > 1e-2
    assert not one.closes
    assert one.displacement.max() == 0.0


def test_a_gradient_that_holds_the_posture_makes_it_repeat(arm: Robot) -> None:
    objective = nmm.Quadratic(nmm.QuadraticTerm("q2", 0.8), nmm.QuadraticTerm("q1", 0.3))
    pulled = Controller(arm, Task(TIP, circle_from(Q0)), ProjectedGradient(1.0), objective)
    (found,) = repeatability(({"pg": pulled}, Q0), laps=5, dt=0.01).laps
    assert found.converges
    assert found.factor is not None
    assert found.factor < 0.5
    assert np.all(np.diff(found.distance[:4]) < 0)


# Wheels ----------------------------------------------------------------------------------------------------

LENGTH = 0.8  # of the trailer: d + l1, with q1 held at 0


def trailer(robot: Robot, radius: float, theta: float = 0.3) -> tuple[Controller, Array]:
    """The extended Jacobian with q1 and the last link's heading held: the shoulder's link is pulled like a
    trailer by its far end, which goes round like the hand. It begins on the path, with y as it shall be."""
    heading = 0.5
    hitch = np.array([1.0 + radius, 0.0]) - 0.3 * np.array([np.cos(heading), np.sin(heading)])
    xy = hitch - LENGTH * np.array([np.cos(theta), np.sin(theta)])
    constraint = [Task(Heading("link2"), heading), Task(LinearCoordinates("q1"), 0.0)]
    task = Task(TIP, Circle([1.0, 0.0], radius, 2 * pi / PERIOD))
    controller = Controller(robot, task, ExtendedJacobian(), added_task=constraint)
    return controller, np.array([*xy, theta, 0.0, heading - theta])


def headings(radius: float, theta: float, laps: int) -> Array:
    """theta at the laps' ends, of the trailer's own equation: LENGTH theta' = hitch' across the trailer."""

    def rate(t: float, y: Array) -> list[float]:
        w = 2 * pi / PERIOD
        return [radius * w * float(np.cos(w * t - y[0])) / LENGTH]

    ends = np.arange(laps + 1) * PERIOD
    found = solve_ivp(rate, (0, laps * PERIOD), [theta], "DOP853", t_eval=ends, rtol=1e-11, atol=1e-11)
    return np.asarray(found.y[0])


@pytest.mark.parametrize("radius", [0.4, 0.84, 1.6])
def test_the_extended_jacobian_on_wheels_goes_round_like_a_trailer(robot_2r: Robot, radius: float) -> None:
    controller, q0 = trailer(robot_2r, radius)
    (found,) = repeatability(({"ej": controller}, q0), laps=4, dt=0.01).laps
    np.testing.assert_allclose(found.q[:, 2], headings(radius, 0.3, 4), atol=1e-6)
    assert found.errors.max() < 1e-8
    assert found.distance[0] > 1e-2  # not cyclic: the first lap does not come back, though on the path


def test_a_path_smaller_than_the_trailer_never_repeats(robot_2r: Robot) -> None:
    """In the turning frame φ' = w (R/L cos φ - 1) has no rest for R < L, and the mean of theta' is
    w (1 - sqrt(1 - R²/L²))."""
    controller, q0 = trailer(robot_2r, 0.4)
    (found,) = repeatability(({"ej": controller}, q0), laps=40, dt=0.04).laps
    assert found.distance.min() > 0.3
    assert not found.converges
    assert found.verdict.code == "laps_drift"
    mean = (found.q[-1, 2] - found.q[0, 2]) / 40
    # The angle differs from its mean motion by less than a turn, at both ends.
    np.testing.assert_allclose(mean, 2 * pi * (1 - np.sqrt(1 - 0.25)), atol=2 * pi / 40)


@pytest.mark.parametrize("radius", [0.82, 0.84])
def test_a_larger_path_is_repeated_in_the_limit(robot_2r: Robot, radius: float) -> None:
    """Where φ' rests it attracts: by exp(-2π sqrt(R²/L² - 1)) a lap."""
    controller, q0 = trailer(robot_2r, radius)
    (found,) = repeatability(({"ej": controller}, q0), laps=5, dt=0.02).laps
    assert found.converges
    assert found.factor is not None
    np.testing.assert_allclose(found.factor, np.exp(-2 * pi * np.sqrt((radius / LENGTH) ** 2 - 1)), rtol=0.01)
    assert found.verdict.code == "laps_converge"
    # With the circle theta goes on by a turn, the elbow goes back by one.
    np.testing.assert_array_equal(found.turns[-1], [0, 0, 1, 0, -1])
    assert found.winding.values == {"turns": {"theta": 1, "q2": -1}}
    np.testing.assert_allclose(found.drift[-1, 2], 2 * pi, atol=0.01)
    assert np.abs(found.posture_drift[-1]).max() < 0.01


@pytest.mark.parametrize("name", ["unicycle_2r_position", "unicycle_2r_extended_jacobian"])
def test_the_papers_circle_is_repeated_after_the_transient(name: str) -> None:
    given = Scenario.load(name)
    kinds = ("rg", "pg") if name == "unicycle_2r_position" else ("ej",)
    found = repeatability(given, laps=3, resolvers=kinds, dt=0.01)
    assert found.complete
    np.testing.assert_allclose(found.period, 25.0)
    assert not found.transient.values["on_path"]
    for one in found.laps:
        assert one.name in kinds
        assert one.distance[0] > 1.0
        assert one.distance[2] < 1e-9
        assert one.errors[0] > 1.0
        assert one.errors[1:].max() < 1e-8
        assert one.displacement[0] > 0.5
    assert found[kinds[0]] is found.laps[0]
    for part in (*kinds, "period 25 s", "repeats itself", "theta +1"):
        assert part in found.text()


# Bookkeeping -----------------------------------------------------------------------------------------------


def test_samples_are_taken_at_the_laps_ends(tmp_path: Path) -> None:
    given = scenario(tmp_path, dt=0.03, task__reference=ROUND)
    found = repeatability(given, laps=3, resolvers=("rg",))
    (one,) = found.laps
    steps = round(found.period / one.trajectory.dt)
    assert one.trajectory.dt <= 0.03
    assert len(one.trajectory) == 3 * steps + 1
    np.testing.assert_allclose(one.trajectory.t[::steps], 2.0 * np.arange(4), rtol=1e-14)
    np.testing.assert_array_equal(one.q, one.trajectory.q[::steps])
    np.testing.assert_array_equal(one.drift, one.q[1:] - one.q[:-1])
    np.testing.assert_allclose(one.errors, np.linalg.norm(one.trajectory.error[::steps], axis=1))
    assert one.trajectory.scenario is not None


def test_turns_count_only_where_they_are_the_same_posture(tmp_path: Path) -> None:
    """A hand that goes round the base: joints without limits turn on, others have turned."""
    for limited in (False, True):
        robot = planar_arm(tmp_path, 1.0, 0.5, limited=limited)
        task = Task(TIP, Circle([0.0, 0.0], 1.2, pi))
        start = np.array([0.0, 1.0])
        (found,) = repeatability(({"pg": Controller(robot, task, ProjectedGradient())}, start), laps=1).laps
        assert abs(found.drift[0, 0]) > 5.0
        assert found.turns[0, 0] == (0 if limited else 1)
        assert (found.distance[0] > 5.0) == limited


def test_one_lap_tells_nothing_of_the_next(tmp_path: Path) -> None:
    (one,) = repeatability(scenario(tmp_path, task__reference=ROUND), laps=1, resolvers=("pg",)).laps
    assert one.factor is None
    assert one.distance.shape == (1,)
    assert one.verdict.code == "laps_too_few"


def test_a_run_that_ends_early_keeps_its_laps(arm: Robot) -> None:
    stop = {"after": 1.6 * PERIOD, "calls": 0.0}

    def resolve(problem: Problem) -> Array:
        stop["calls"] += 1
        if stop["calls"] > 4 * stop["after"] / 0.02:
            raise np.linalg.LinAlgError
        return np.linalg.pinv(problem.J) @ problem.rate

    own = Controller(arm, Task(TIP, circle_from(Q0)), CallableResolver(resolve))
    found = repeatability(({"own": own}, Q0), laps=3, dt=0.02)
    (one,) = found.laps
    assert not found.complete
    assert one.distance.shape == (1,)
    assert one.q.shape == (2, 3)
    assert (one.verdict.code, one.verdict.values["lap"]) == ("laps_ended", 2)
    assert "lost rank" in one.verdict.values["message"]
    assert laps_figure(found).axes


def test_progress_rises_to_one(tmp_path: Path) -> None:
    seen: list[float] = []
    repeatability(scenario(tmp_path, task__reference=ROUND), laps=1, progress=seen.append)
    assert seen == sorted(seen)
    assert seen[-1] == 1.0
    assert 0.5 in np.round(seen, 2)


# The figure ------------------------------------------------------------------------------------------------


def test_the_figure_shows_drifts_and_paths(tmp_path: Path) -> None:
    found = repeatability(scenario(tmp_path, task__reference=ROUND), laps=3)
    drift, paths = laps_figure(found).axes
    for line, one in zip(drift.lines, found.laps, strict=True):
        np.testing.assert_allclose(line.get_ydata(), np.maximum(one.distance, 1e-16))
        np.testing.assert_array_equal(line.get_xdata(), [1, 2, 3])
    low, high = paths.get_xlim()
    for one in found.laps:
        x = one.trajectory.q[:, 0]
        assert low < x.min() <= x.max() < high
    named = [text.get_text() for text in paths.get_legend().get_texts()]
    assert named == ["desired path of ee", "platform, RG, last lap thick", "platform, PG, last lap thick"]
    thick = [line for line in paths.lines if line.get_label().startswith("platform, RG")]
    steps = round(found.period / found.laps[0].trajectory.dt)
    np.testing.assert_allclose(
        thick[0].get_xydata()[[0, -1]], found.laps[0].trajectory.q[[-1 - steps, -1], :2]
    )


def test_the_figure_of_a_fixed_base_has_one_panel(arm: Robot) -> None:
    plain = Controller(arm, Task(TIP, circle_from(Q0)), ProjectedGradient())
    found = repeatability(({"pg": plain}, Q0), laps=2, dt=0.05)
    assert len(laps_figure(found).axes) == 1


def test_no_lap_no_figure(arm: Robot) -> None:
    plain = Controller(arm, Task(TIP, circle_from(Q0)), ProjectedGradient())
    found = repeatability(({"pg": plain}, Q0), laps=1, dt=0.05).laps[0]
    none = Laps("pg", found.trajectory, PERIOD, 1, found.q[:1], found.errors[:1])
    with pytest.raises(InputError, match="at least one lap"):
        laps_figure(Repeatability((none,), PERIOD))
    assert not none.closes
    assert none.winding is None


@pytest.mark.parametrize(("radius", "closes"), [(3.0, True), (0.3, False)])
def test_an_extended_jacobian_on_wheels_leaves_the_heading_free(radius: float, closes: bool) -> None:
    """Task and added task fix all but the heading, which only a long path brings to its own."""
    ej = Scenario.load(
        "unicycle_2r_position", {"resolver.kind": "ej", "task.0.reference.radius": radius, "dt": 0.01}
    )
    robot, controller, lap = ej.robot(), ej.controller(), round(25.0 / 0.01)
    q0 = robot.q({"theta": 1.5, "q1": pi / 4, "q2": pi / 4 - 1.5})  # theta + q1 + q2 = pi/2: y = 0
    on_circle = 2.0 + radius * np.cos(1.25 * pi)
    q0[:2] = on_circle - nmm.Configuration(robot, q0).placement("ee").translation[:2]
    run = nmm.simulate(controller, q0, 75.0, 0.01)
    assert np.linalg.norm(run.error, axis=1).max() < 1e-8
    drift = np.abs(np.angle(np.exp(1j * (run.q[2 * lap + lap, 2] - run.q[2 * lap, 2]))))
    assert (drift < 1e-6) == closes
    assert closes or drift > 0.4
