"""Runs that come to singularities: targets out of reach, the 3R's singular line, algorithmic ones of EJ."""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np
import pytest
from findings import codes, the, why
from numpy.typing import NDArray
from places import UR5

import nmm
from nmm import Scenario
from nmm.control.resolvers.answer import Status
from nmm.control.resolvers.damped_least_squares import Damping
from nmm.motion.diagnosis.jumps import chattering

STRETCHED = {"unicycle_2r": ("xy", [2.0, 0.6]), "unicycle_3r": ("xyz", [1.0, 1.0, 1.2])}
START = {"unicycle_2r": {"q1": 0.4, "q2": 1.2}, "unicycle_3r": {"q1": 0.4, "q2": 0.7, "q3": 0.8}}


def pulled(
    name: str, resolver: nmm.extending.Resolver, method: str, dt: float, limits: Any = None
) -> nmm.Trajectory:
    """An arm that stands on a fixed base, pulled towards a point farther away than it is long."""
    axes, target = STRETCHED[name]
    robot = nmm.load(name, platform="fixed")
    task = nmm.Task(nmm.Position("ee", axes), nmm.Constant(target), gain=2.0)
    controller = nmm.Controller(robot, task, resolver, limits=limits)
    return nmm.simulate(controller, START[name], 6.0, dt, method=method)


def stands_still_and_says_why(run: nmm.Trajectory) -> None:
    assert run.outcome == "missed"
    assert "out_of_reach" in why(run)
    assert "stretched" in codes(run)
    assert "chattering" not in codes(run)
    assert chattering(run.t, run.u, run.robot.u_names) is None
    late = run.t > 0.75 * run.t[-1]
    assert np.abs(run.u[late]).max() < 1e-3
    # As near as it can be: straight, and towards the target.
    assert np.abs(run.q[-1, -1]) < 1e-3


@pytest.mark.parametrize(("method", "dt"), [("rk4", 0.005), ("rk4", 0.02), ("zoh", 0.01), ("zoh", 0.04)])
@pytest.mark.parametrize("name", STRETCHED)
def test_an_arm_stretches_towards_a_target_out_of_reach(name: str, method: str, dt: float) -> None:
    """Whatever the step: without the damping that the step asks for, the arm would whip to and fro."""
    resolvers: list[nmm.extending.Resolver] = [nmm.ReducedGradient(singular="damped")]
    laws: tuple[Damping, ...] = ("constant", "variable", "directions")
    resolvers += [nmm.DampedLeastSquares(law=law) for law in laws]
    for resolver in resolvers:
        run = pulled(name, resolver, method, dt)
        stands_still_and_says_why(run)
        if name == "unicycle_2r":
            target, reach = np.array(STRETCHED[name][1]), 0.8
            joint = nmm.Configuration(run.robot, run.q[-1]).placement("ee").translation[:2] - run.r[-1]
            assert np.abs(joint).max() < 1e-12
            base = run.r[-1] - reach * np.array([math.cos(run.q[-1, 0]), math.sin(run.q[-1, 0])])
            away = float(np.linalg.norm(target - base))
            assert run.error_norm[-1] == pytest.approx(away - reach, abs=1e-6)


def test_it_does_so_within_limits() -> None:
    run = pulled(
        "unicycle_2r",
        nmm.DampedLeastSquares(),
        "zoh",
        0.01,
        nmm.Limits(velocity={"q1": 1.0, "q2": 1.0}, acceleration={"q1": 5.0, "q2": 5.0}),
    )
    stands_still_and_says_why(run)
    assert np.abs(run.u).max() <= 1.0 + 1e-11
    assert np.abs(np.diff(run.u, axis=0)).max() <= 5.0 * 0.01 + 1e-11


def test_the_scenario_out_of_reach_ends_on_the_singular_line() -> None:
    run = Scenario.load("unicycle_3r_out_of_reach").run()
    stands_still_and_says_why(run)
    np.testing.assert_allclose(run.q[-1, -2:], 0.0, atol=1e-6)
    np.testing.assert_allclose(run.r[-1], [2.0, 1.0, 1.6], atol=1e-6)
    stopped = Scenario.load("unicycle_3r_out_of_reach", {"method": "adaptive"}).with_resolver("pg").run()
    assert not stopped.complete


#: The largest accelerations of inputs at the top, and on the whole way, m/s² and rad/s². RG's own are larger
#: where its block Ja comes near its threshold, at t = 7.6 s, far from the top, before it takes another one.
STEEPEST = {"rg": (2.1, 13.0), "dls": (0.4, 0.4)}


@pytest.mark.parametrize("resolver", STEEPEST)
def test_over_the_top_with_the_arm_upright(resolver: str) -> None:
    """Undamped, the inputs jump at the top from one sample to the next; damped, they have a derivative there:
    half of dt is half of the jump."""
    scenario = Scenario.load("unicycle_3r_vertical_line")
    scenario = scenario if resolver == "rg" else scenario.with_resolver("dls")
    jumps = []
    for dt in (0.01, 0.005, 0.0025):
        run = scenario.override("dt", dt).run()
        assert run.outcome == "completed"
        assert run.error_norm[-1] < 1e-6
        late, top = run.t > 5.0, np.abs(run.t - 10.0) < 1.5
        assert run.error_norm[late].max() < 0.003  # of 1.6 m
        assert run.scale[top].min() < 1.0 - 1e-3
        assert run.scale[late & ~top].min() == 1.0  # before, and back
        assert run.residual[~top].max() < 1e-12
        assert np.abs(run.u[late]).max() < 1.0
        assert chattering(run.t, run.u, run.robot.u_names) is None
        switched = np.any(np.diff(run.partition, axis=0) != 0, axis=1)  # RG's own jumps
        assert switched.sum() == (1 if resolver == "rg" else 0)
        assert not np.any(switched & top[:-1])
        jump = np.abs(np.diff(run.u, axis=0)).max(axis=1)
        jumps.append([jump[top[:-1]].max(), jump[~switched & (run.t[:-1] > 2.0)].max()])
        assert np.all(np.array(jumps[-1]) < np.array(STEEPEST[resolver]) * dt)
    for longer, shorter in itertools.pairwise(jumps):
        np.testing.assert_allclose(shorter, np.array(longer) / 2.0, rtol=0.02)
    undamped = scenario.with_resolver("pg").run()
    assert np.abs(np.diff(undamped.u, axis=0)).max() > 1.0


def lever(run: nmm.Trajectory) -> NDArray[np.float64]:
    """det J_e of the scenario: how far the end-effector is ahead of the axle, m."""
    return np.asarray(0.3 + 0.5 * np.cos(run.q[:, 3]) + 0.3 * np.cos(run.q[:, 3] + run.q[:, 4]))


def test_ej_drives_through_an_algorithmic_singularity() -> None:
    """The task is done all along; the added one gives way for 0.1 s and is done again.

    det J_e changes its sign once, and the platform turns round. Half of dt is half of the largest jump.
    """
    scenario = Scenario.load("unicycle_2r_algorithmic")
    jumps = []
    for dt in (0.01, 0.005, 0.0025):
        run = scenario.override("dt", dt).run()
        assert run.outcome == "completed"
        (said,) = run.warnings
        assert said == run.summary()["warnings"][0]
        (missed,) = run.findings
        assert (missed.code, missed.values["unit"]) == ("added_task_missed", "rad/s")
        assert missed.values["again"]
        assert run.residual.max() < 1e-12
        assert run.scale.min() == 1.0
        expected = run.error_norm[0] * math.exp(-run.t[-1]) + 1e-11 * (dt / 0.005) ** 4
        assert run.error_norm[-1] <= 1.1 * expected
        assert np.abs(run.u).max() < 6.0
        assert chattering(run.t, run.u, run.robot.u_names) is None
        beside = lever(run)
        assert np.sum(np.diff(np.sign(beside)) != 0) == 1
        assert (beside[0], beside[-1]) == (pytest.approx(1.1), pytest.approx(-0.5))
        through = np.abs(run.t - 5.7) < 0.2
        assert np.abs(run.q[:, 4]).max() < 0.005  # rad, by which the arm gives way
        share = np.minimum(run.t / 10.0, 1.0)
        away = run.q[:, 3] + math.pi * (10.0 * share**3 - 15.0 * share**4 + 6.0 * share**5)
        assert np.abs(away[through]).max() > 1e-3
        assert np.abs(away[run.t < 5.5]).max() < 1e-9
        assert np.abs(away[-1]) < 1e-12
        assert run.sigma_min.min() > 0.2  # J is far from singular
        assert run.u[run.t > 15.0, 0].max() < -0.3  # it drives backwards then
        jumps.append(np.abs(np.diff(run.u, axis=0)).max())
    for longer, shorter in itertools.pairwise(jumps):
        assert shorter < 0.6 * longer
    stopping = scenario.override("resolver.singular", "stop")
    assert np.abs(stopping.run().u).max() > 40.0
    stopped = stopping.override("method", "adaptive").run()
    assert stopped.outcome == "singular"
    assert the(stopped, "singular").values["status"] == "singular_je"


@pytest.mark.thorough
def test_ej_waits_where_the_arm_swings_too_slowly() -> None:
    """The end-effector drives so fast that the platform, as it turns, carries the arm back across the axle.

    What grows beyond the axle grows as |lever|^(-v / |lever rate|): the power is 3 here, 0.9 in the scenario.
    The task is done all the same, and the added one in the end, when its reference has come back.
    """
    swing = {"kind": "spline", "points": [[0], [2.5], [0]], "times": [0, 10, 20]}
    changed = {"task.reference.rate": "0.08*pi", "resolver.added_task.0.reference": swing}
    scenario = Scenario.load("unicycle_2r_algorithmic", changed)
    run = scenario.run()
    assert run.outcome == "completed"
    assert run.residual.max() < 1e-11
    assert np.abs(run.u).max() < 3.5
    assert chattering(run.t, run.u, run.robot.u_names) is None
    assert np.sum(np.abs(lever(run)) < 0.02) > 100  # it waits there
    assert lever(run).min() > -0.02
    np.testing.assert_allclose(run.q[-1, 3:], 0.0, atol=1e-9)
    whipped = scenario.override("resolver.singular", "stop").override("method", "adaptive").run()
    assert np.abs(whipped.u).max() > 50.0


def test_ej_tells_an_algorithmic_singularity_from_a_kinematic_one() -> None:
    """At lever = 0 J_e alone is singular; with d = 0 and the arm across the platform, J is."""
    scenario = Scenario.load("unicycle_2r_algorithmic", {"resolver.singular": "stop"})
    beside = {"q1": math.acos(-0.375), "q2": 0.0}
    controller = scenario.controller()
    assert controller.evaluate(0.0, controller.robot.q(beside)).status is Status.SINGULAR_JE
    with pytest.raises(nmm.SingularError, match="algorithmic singularity"):
        controller(0.0, controller.robot.q(beside))
    controller = scenario.override("robot.arguments", {"d": 0}).controller()
    across = {"q1": math.pi / 2, "q2": 0.0}
    assert controller.evaluate(0.0, controller.robot.q(across)).status is Status.SINGULAR_J


@pytest.mark.parametrize(
    ("acceleration", "speed", "order", "dt"),
    [  # each two of their values together
        (1.0, None, 1, 0.01),
        (1.0, None, 2, 0.05),
        (3.0, 0.25, 1, 0.05),
        (3.0, 0.25, 2, 0.01),
        ([-1.0, 3.0], None, 1, 0.05),
        ([-1.0, 3.0], None, 2, 0.01),
    ],
)
def test_with_limited_accelerations_an_arm_comes_to_rest_out_of_reach(
    acceleration: Any, speed: float | None, order: int, dt: float
) -> None:
    """Inputs that cannot turn back within a sample swing through, and did so for good (UR5, 1.5 rad/s)."""
    source = UR5
    robot = nmm.load(source, platform="fixed")
    task = nmm.Task(nmm.Position("ee_link"), [3.0, 1.0, 0.5], **({} if speed is None else {"speed": speed}))
    limits = nmm.Limits(acceleration=acceleration)
    controller = nmm.Controller(robot, task, nmm.DampedLeastSquares(), limits=limits, dt=dt, order=order)
    run = nmm.simulate(controller, [0.3, -1.2, 1.6, -0.9, -1.4, 0.0], 80.0, dt, "zoh")
    assert np.abs(run.u[run.t > 70.0]).max() < 1e-3
    assert "still_moving" not in codes(run)
    # As near as it can be: no joint brings the hand nearer, Jᵀ e = 0.
    step = controller.evaluate(80.0, run.q[-1])
    assert np.abs(step.J.T @ step.error).max() < 1e-3


def test_what_damping_remembers_of_overrun_inputs_is_forgotten_by_a_reset() -> None:
    robot = nmm.load("unicycle_3r", platform="fixed")
    task = nmm.Task(nmm.Position("ee"), [3.0, -1.0, 0.5])
    limits = nmm.Limits(acceleration=0.5)
    controller = nmm.Controller(robot, task, nmm.DampedLeastSquares(), limits=limits, dt=0.01)
    first, second = (nmm.simulate(controller, {"q2": 0.8, "q3": 0.5}, 10.0, 0.01) for _ in range(2))
    assert np.array_equal(first.q, second.q)
    q = first.q[200]
    before = controller(2.0, q)
    controller.evaluate(2.0, first.q[50])
    controller.velocity(2.0, first.q[50])
    again = nmm.Controller(robot, task, nmm.DampedLeastSquares(), limits=limits, dt=0.01)
    nmm.simulate(again, {"q2": 0.8, "q3": 0.5}, 10.0, 0.01)
    assert np.array_equal(again(2.0, q), before)
