"""Limits of acceleration with two sides, by differences of what was recorded; digits beyond limits."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
import yaml

import nmm
from nmm.base.arrays import Array
from nmm.base.errors import InputError
from nmm.base.findings import Finding
from nmm.base.text_format import apart
from nmm.control.limits.bounds import approach

DT = 0.01
SIDES = {"v": [-3.0, 1.0], "omega": 2.0, "arm": [-2.0, 4.0]}
LOWER, UPPER = np.array([-3.0, -2.0, -2.0, -2.0]), np.array([1.0, 2.0, 4.0, 4.0])


def changes(u: Array, dt: float = DT) -> Array:
    return np.diff(u, axis=0, prepend=0.0) / dt


def within(u_dot: Array, slack: float = 1e-9) -> None:
    assert np.all(u_dot >= LOWER - slack)
    assert np.all(u_dot <= UPPER + slack)


@pytest.mark.parametrize("method", ["zoh", "rk4"])
@pytest.mark.parametrize(
    "resolver", [nmm.ProjectedGradient(), nmm.ReducedGradient(), nmm.DampedLeastSquares()]
)
def test_inputs_fall_and_rise_by_no_more_than_each_side(
    resolver: nmm.extending.Resolver, method: str
) -> None:
    robot = nmm.load("unicycle_2r")
    task = nmm.Task(nmm.Position("ee", "xy"), nmm.Circle([1.0, 0.5], 0.8, rate=2.0), gain=4.0)
    limits = nmm.Limits(velocity={"v": 1.0, "omega": 2.0}, acceleration=SIDES)
    controller = nmm.Controller(robot, task, resolver, limits=limits, dt=DT)
    run = nmm.simulate(controller, {"q2": 0.5}, 4.0, DT, method)
    u_dot = changes(run.u)
    within(u_dot)
    # Both sides of an input that differ are used up.
    assert u_dot[:, 0].max() == pytest.approx(1.0)
    assert u_dot[:, 0].min() < -1.5


def test_a_stop_brakes_as_hard_as_its_side_lets_it() -> None:
    robot = nmm.load("unicycle_2r")
    limits = nmm.Limits(velocity={"v": 0.6}, acceleration=SIDES)
    task = nmm.Task(nmm.Posture("x"), [9.0])
    controller = nmm.Controller(robot, task, nmm.ProjectedGradient(), limits=limits, dt=DT)
    run = nmm.simulate(controller, robot.rest, 1.0, DT, "zoh")
    assert run.u[-1, 0] == pytest.approx(0.6)
    assert np.flatnonzero(run.u[:, 0] > 0.6 - 1e-9)[0] == 60 - 1  # 0.6 m/s at 1 m/s² and a sample each
    speeds = [float(controller.stop(1.0 + DT * k, run.q[-1])[0]) for k in range(25)]
    assert speeds == pytest.approx([max(0.6 - 3.0 * DT * (k + 1), 0.0) for k in range(25)])


@pytest.mark.parametrize(("target", "braking"), [(9.0, 1.0), (-9.0, 4.0)])
def test_a_joint_comes_to_its_limit_as_the_side_that_brakes_allows(target: float, braking: float) -> None:
    """From speed v it takes v / (braking dt) samples, and no more, to rest at the limit."""
    robot = nmm.load("unicycle_2r", platform="fixed")
    limits = nmm.Limits(
        velocity={"q1": 2.0}, position={"q1": [-1.0, 1.0]}, acceleration={"q1": [-1.0, 4.0], "q2": 9.0}
    )
    task = nmm.Task(nmm.Posture("q1"), [target], gain=5.0)
    controller = nmm.Controller(robot, task, nmm.ProjectedGradient(), limits=limits, dt=DT)
    run = nmm.simulate(controller, {"q1": 0.0}, 4.0, DT, "zoh")
    end = math.copysign(1.0, target)
    assert run.q[-1, 0] == pytest.approx(end, abs=1e-9)
    assert np.abs(run.q[:, 0]).max() <= 1.0 + 1e-11
    u = run.u[:, 0] * end
    fastest = int(np.argmax(u))
    least = u[fastest] ** 2 / (2.0 * braking)
    assert 1.0 - abs(run.q[fastest, 0]) == pytest.approx(least, abs=2.0 * u[fastest] * DT)
    assert np.diff(u).min() >= -braking * DT - 1e-12


def test_the_fastest_approach_brakes_exactly_at_its_limit(rng: np.random.Generator) -> None:
    """The way of a speed that falls by a in each sample, summed up, is the room that there was."""
    for room, acceleration, dt in rng.uniform([1e-3, 0.1, 1e-3], [1.0, 9.0, 0.1], (100, 3)):
        u = approach(room, dt, acceleration, 0.1)
        speeds = np.arange(u, 0.0, -acceleration * dt)
        assert dt * speeds.sum() == pytest.approx(room, rel=1e-9)


def test_beyond_its_limit_a_coordinate_returns_at_its_own_speed_and_no_farther() -> None:
    assert approach(-0.3, DT, 5.0, 0.2) == -0.2
    assert approach(-0.001, DT, 5.0, 0.2) == pytest.approx(-0.1)


def test_plans_slow_down_harder_than_they_speed_up() -> None:
    robot = nmm.load("unicycle_3r")
    far = {"x": 3.0, "y": 0.0, "theta": 0.0}
    velocity = {"platform": 1.0, "arm": 1.0}
    sides = nmm.Limits(velocity=velocity, acceleration={"v": [-3.0, 1.0], "omega": 2.0, "arm": 2.0})
    plan = nmm.plan(robot, robot.rest, far, limits=sides)
    # By hand: 3 m with 1 s and 1/3 s of ramps at 1 m/s.
    assert plan.duration == pytest.approx(3.0 + 0.5 + 1.0 / 6.0)
    t = np.linspace(0.0, plan.duration, 2001)
    q, u = plan(t)
    assert q[-1, :3] == pytest.approx([3.0, 0.0, 0.0], abs=1e-9)
    rates = np.diff(u[:, 0]) / np.diff(t)
    assert (rates.max(), rates.min()) == (pytest.approx(1.0), pytest.approx(-3.0))
    assert np.trapezoid(u[:, 0], t) == pytest.approx(3.0, abs=1e-5)
    alike = nmm.plan(robot, robot.rest, far, limits=nmm.Limits(velocity=velocity, acceleration=2.0))
    assert alike.duration == pytest.approx(3.0 + 0.5)


@pytest.mark.parametrize("kind", ["smooth", "held", "horizon", "waiting"])
def test_all_kinds_of_plans_keep_both_sides(kind: str) -> None:
    robot = nmm.load("unicycle_3r")
    limits = nmm.Limits(
        velocity={"platform": 1.0, "arm": 1.0},
        acceleration={"v": [-2.0, 0.8], "omega": [-1.5, 2.5], "arm": [-2.0, 4.0]},
    )
    start, goal = {"q1": 0.2, "q2": 0.5, "q3": 0.9}, {"x": 1.5, "y": 0.6, "theta": 0.4}
    if kind == "horizon":
        task = nmm.Task(nmm.Position("ee", "xy"), [2.0, 0.6])
        run = nmm.Horizon(robot, task, limits=limits, dt=0.05).run(start, 6.0)
        t, u = run.t, run.u
    else:
        post = nmm.Obstacle(nmm.Sphere(0.2), motion=lambda t: [0.8, 2.0 - 0.8 * t, 0.3], name="ball")
        here = nmm.Configuration(robot, robot.q(start)).placement("ee").translation
        given = {
            "smooth": {"smooth": True},
            "held": {"hold": nmm.Task(nmm.Position("ee"), here)},
            "waiting": {"obstacles": [post]},
        }[kind]
        if kind == "held":
            goal = {"x": 0.2, "y": 0.0, "theta": 0.3}
        plan = nmm.plan(robot, start, goal, limits=limits, **given)
        t = np.linspace(0.0, plan.duration, 8001)
        u = plan(t)[1]
    u_dot = np.diff(u, axis=0) / np.diff(t)[:, np.newaxis]
    assert np.all(u_dot >= np.array([-2.0, -1.5, -2.0, -2.0, -2.0]) - 2e-3)
    assert np.all(u_dot <= np.array([0.8, 2.5, 4.0, 4.0, 4.0]) + 2e-3)


def test_a_side_may_be_free_and_one_pair_is_for_all() -> None:
    robot = nmm.load("unicycle_2r")
    on = nmm.Limits(acceleration=[-np.inf, 2.0]).on(robot)
    assert on.changes.tolist() == [[-np.inf, 2.0]] * 4
    assert on.accelerations.tolist() == [2.0] * 4
    assert nmm.Limits(acceleration={"arm": 2.0}).on(robot).changes[2:].tolist() == [[-2.0, 2.0]] * 2


@pytest.mark.parametrize(
    "value", [[1.0, 3.0], [0.0, 1.0], [-1.0, 0.0], [3.0, -1.0], [1.0], "fast", [None, 1]]
)
def test_sides_that_let_an_input_not_come_back_are_refused(value: object) -> None:
    with pytest.raises(InputError, match="acceleration: v"):
        nmm.Limits(acceleration={"v": value})  # type: ignore[dict-item]


def test_scenarios_take_sides(tmp_path: Path) -> None:
    for given in ({"limits.acceleration.v": [-3, 1]}, {"limits.acceleration": [-3, 1]}):
        scenario = nmm.Scenario.load("unicycle_2r_position", {"duration": 1, "method": "zoh", **given})
        run = scenario.run()
        u_dot = changes(run.u, run.dt)[:, 0]
        assert u_dot.max() <= 1.0 + 1e-9
        assert u_dot.min() >= -3.0 - 1e-9
        again = tmp_path / "again.yaml"
        again.write_text(yaml.safe_dump(scenario.resolved()), "utf-8")
        told = nmm.Scenario.load(again).resolved()
        assert told["limits"]["acceleration"] == scenario.resolved()["limits"]["acceleration"]


def test_numbers_are_told_apart_in_as_few_digits_as_it_takes() -> None:
    assert apart(3.0001, -3.0, 3.0) == ["3.0001", "-3", "3"]
    assert apart(3.00000001, -3.0, 3.0) == ["3.00000001", "-3", "3"]
    assert apart(2.0, -3.0, 3.0) == ["2", "-3", "3"]
    assert apart(3.0, -3.0, 3.0) == ["3", "-3", "3"]
    assert apart(3.1416001, -np.inf, 3.1416) == ["3.1416001", "-inf", "3.1416"]


def test_what_is_beyond_a_limit_is_told_in_digits_that_show_it() -> None:
    robot = nmm.load("unicycle_2r")
    limited = nmm.Limits(position={"q1": [-3.0, 3.0]}).on(robot).coordinates
    (words,) = robot.outside(robot.q({"q1": 3.0000001}), limited).values()
    assert words == "q1 = 3.0000001 rad (from -3 to 3)"
    beyond = {"name": "j1", "t": 0.0, "value": 3.0001, "unit": "rad", "lower": -3.0, "upper": 3.0}
    for code, values, told in (
        ("coordinates_beyond_limits", {"coordinates": [beyond]}, "3.0001 rad; from -3 to 3"),
        (
            "inputs_beyond_limits",
            {"inputs": [{"name": "v", "largest": 1.00001, "unit": "m/s", "limit": 1.0}]},
            "v (1.00001 m/s; at most 1)",
        ),
        (
            "distance_not_kept",
            {"distance": 0.02, "samples": 2, "name": "a and b", "clearance": 0.0199999},
            "the distance of 0.02 m could not be kept in 2 samples: a and b came to 0.0199999 m",
        ),
        (
            "effort_exceeded",
            {"actuator": "j1", "peak": 12.0004, "effort": 12.0, "unit": "N m"},
            "j1 needs 12.0004 N m",
        ),
        ("outside_limits", {**beyond, "value": 3.00002}, "3.00002 rad, outside its limits (from -3 to 3)"),
    ):
        assert told in str(Finding(code, values, {"t": 0.0}))
