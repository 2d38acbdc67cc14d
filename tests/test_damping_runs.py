"""Runs that come to singularities: targets out of reach, the 3R's singular line, algorithmic ones of EJ."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import nmm
from nmm import Scenario
from nmm.resolvers.answer import Status
from nmm.resolvers.damped_least_squares import Damping
from nmm.runs.chattering import chattering

STRETCHED = {"unicycle_2r": ("xy", [2.0, 0.6]), "unicycle_3r": ("xyz", [1.0, 1.0, 1.2])}
START = {"unicycle_2r": {"q1": 0.4, "q2": 1.2}, "unicycle_3r": {"q1": 0.4, "q2": 0.7, "q3": 0.8}}


def pulled(name: str, resolver: nmm.Resolver, method: str, dt: float, limits: Any = None) -> nmm.Trajectory:
    """An arm that stands on a fixed base, pulled towards a point farther away than it is long."""
    axes, target = STRETCHED[name]
    robot = nmm.load(name, platform="fixed")
    task = nmm.Task(nmm.Position("ee", axes), nmm.Constant(target), gain=2.0)
    controller = nmm.Controller(robot, task, resolver, limits=limits)
    return nmm.simulate(controller, START[name], 6.0, dt, method=method)


def stands_still_and_says_why(run: nmm.Trajectory) -> None:
    assert run.outcome == "missed"
    assert "out of reach" in run.message
    assert "the arm is stretched" in run.message
    assert not any("chatter" in said for said in (run.message, *run.warnings))
    assert chattering(run.t, run.u, run.robot.u_names) is None
    late = run.t > 0.75 * run.t[-1]
    assert np.abs(run.u[late]).max() < 1e-3
    # As near as it can be: straight, and towards the target.
    assert np.abs(run.q[-1, -1]) < 1e-3


@pytest.mark.parametrize(("method", "dt"), [("rk4", 0.005), ("rk4", 0.02), ("zoh", 0.01), ("zoh", 0.04)])
@pytest.mark.parametrize("name", STRETCHED)
def test_an_arm_stretches_towards_a_target_out_of_reach(name: str, method: str, dt: float) -> None:
    """Whatever the step: without the damping that the step asks for, the arm would whip to and fro."""
    resolvers: list[nmm.Resolver] = [nmm.ReducedGradient(singular="damped")]
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


@pytest.mark.parametrize("resolver", ["rg", "dls"])
def test_over_the_top_with_the_arm_upright(resolver: str) -> None:
    """Undamped, the inputs jump at the top from one sample to the next; damped, as little as dt is small."""
    scenario = Scenario.load("unicycle_3r_vertical_line")
    scenario = scenario if resolver == "rg" else scenario.with_resolver("dls")
    jumps = []
    for dt in (0.01, 0.005):
        run = scenario.override("dt", dt).run()
        assert run.outcome == "completed"
        assert run.error_norm[-1] < 1e-6
        late = run.t > 5.0
        assert run.error_norm[late].max() < 0.003  # of 1.6 m
        assert run.scale[late].min() < 1.0 - 1e-3
        assert run.scale[run.t > 15.0].min() == 1.0  # and back
        assert np.abs(run.u).max() < 1.0
        assert chattering(run.t, run.u, run.robot.u_names) is None
        switched = np.any(np.diff(run.partition, axis=0) != 0, axis=1)  # RG's own jumps, one far from the top
        assert switched.sum() <= 1
        jumps.append(np.abs(np.diff(run.u, axis=0))[~switched & (run.t[:-1] > 2.0)].max())
    assert jumps[1] < 0.6 * jumps[0]
    assert jumps[1] < 15.0 * 0.005  # m/s², rad/s²
    undamped = scenario.with_resolver("pg").run()
    assert np.abs(np.diff(undamped.u, axis=0)).max() > 1.0


def test_an_algorithmic_singularity_of_ej() -> None:
    """The task is done all along; the added task waits where J_e is singular, and is done in the end."""
    scenario = Scenario.load("unicycle_2r_algorithmic")
    run = scenario.run()
    assert run.outcome == "completed"
    assert run.warnings == ()
    assert run.residual.max() < 1e-11
    assert run.error_norm[-1] <= 1.1 * run.error_norm[0] * math.exp(-run.t[-1]) + 1e-11
    assert np.abs(run.u).max() < 3.0
    assert chattering(run.t, run.u, run.robot.u_names) is None
    lever = 0.3 + 0.5 * np.cos(run.q[:, 3]) + 0.3 * np.cos(run.q[:, 3] + run.q[:, 4])
    assert np.abs(lever).min() < 0.01  # det J_e
    assert np.sum(np.abs(lever) < 0.02) > 100  # it waits there
    np.testing.assert_allclose(run.q[-1, 3:], 0.0, atol=1e-3)
    assert run.sigma_min.min() > 0.1  # J is far from singular
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
