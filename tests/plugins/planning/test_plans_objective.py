"""Objectives of smooth plans: their cost by differences, what they bring, and that all else is kept."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest
from test_smoothing import BEHIND, LIMITS, WALL, check, prepared

import nmm
from nmm.plugins.planning.objective import SampleCosts
from nmm.plugins.planning.shooting import Shooting

W = nmm.Manipulability("ee", "xyz", of="arm")
START = {"q1": 0.5, "q2": -0.4, "q3": 0.2}  # a straight arm has no slope of W
FAR_OFF = nmm.Clearance(nmm.Collisions(0.03, obstacles=[WALL]), reach=1.0)


@cache
def made(objective: nmm.extending.Objective | None) -> nmm.Plan:
    robot, given = nmm.load("unicycle_3r"), {"limits": LIMITS, "smooth": True, "objective": objective}
    return nmm.plan(robot, START, BEHIND, [WALL], **given)


def mean(plan: nmm.Plan, objective: nmm.extending.Objective) -> float:
    """H's mean over the plan's time, by the kinematics of Pinocchio."""
    q = plan(np.linspace(0.0, plan.duration, 200))[0]
    return float(np.mean([objective.value(nmm.Configuration(plan.robot, one)) for one in q]))


@pytest.mark.parametrize("objective", [-3.0 * W, pytest.param(10.0 * FAR_OFF, marks=pytest.mark.thorough)])
def test_a_plan_has_less_of_its_objective_in_the_same_time_and_keeps_all(
    objective: nmm.extending.Objective,
) -> None:
    plain, plan = made(None), made(objective)
    assert plan.smooth
    assert plan.duration == plain.duration
    assert mean(plan, objective) < mean(plain, objective) - 0.1 * abs(mean(plain, objective))
    np.testing.assert_allclose(plan.end, plain.end, rtol=0.0, atol=1e-9)
    check(plan)
    # The run has its values.
    run = plan.trajectory(0.5)
    here = nmm.Configuration(plan.robot, run.q[3])
    assert run.objective[3] == pytest.approx(objective.value(here), abs=1e-9)


@pytest.mark.parametrize("factor", [0.0, pytest.param(1e300, marks=pytest.mark.thorough)])
def test_an_objective_that_nothing_lowers_leaves_the_plan_as_it_is_to_the_bit(factor: float) -> None:
    """Of no weight, or infinite."""
    infinite = nmm.Quadratic(nmm.QuadraticTerm("q1", 9.0, 1e300))
    plain, plan = made(None), made(factor * infinite)
    t = np.linspace(0.0, plain.duration, 300)
    for one, other in zip(plain(t), plan(t), strict=True):
        np.testing.assert_array_equal(one, other)


def test_the_cost_of_samples_has_the_exact_gradient() -> None:
    """By central differences of H by Pinocchio; the problem's squares have it, and curve upwards."""
    objective = -3.0 * W + 0.5 * nmm.PreferredPosture({"q1": 0.3, "q3": -0.4})
    smoothing, path = prepared([WALL], made(None))
    smoothing.costs = costs = SampleCosts(smoothing.robot, objective)
    smoothing.begin(path)
    x: Shooting = smoothing.x
    robot, h = smoothing.robot, 1e-5
    x.q[:] += np.random.default_rng(2).uniform(-0.5, 0.5, x.q.shape)
    H, H_q = costs.at(x.q)

    def value(q: np.ndarray) -> float:
        return objective.value(nmm.Configuration(robot, q))

    for one, H_here, slope in zip(x.q[::6], H[::6], H_q[::6], strict=True):
        found = [(value(one + h * e) - value(one - h * e)) / (2.0 * h) for e in np.eye(robot.n)]
        np.testing.assert_allclose(slope, found, rtol=0.0, atol=1e-8)
        assert H_here == pytest.approx(value(one), abs=1e-12)
    costs.write(x, 0.2)
    assert np.all(x.pull > 0.0)
    off = np.einsum("kei,ki->ke", x.aims, x.q) - x.aimed
    np.testing.assert_allclose(np.einsum("ke,kei->ki", x.pull * off, x.aims), 0.2 * H_q, rtol=0.0, atol=1e-8)
    # Squares alone are their own curvature.
    square = nmm.Quadratic(nmm.QuadraticTerm("q1", 0.3, 2.0), nmm.QuadraticTerm("q3", -0.4))
    costs = SampleCosts(robot, square)
    expected = np.zeros((robot.n, robot.n))
    expected[3, 3], expected[5, 5] = 2.0, 1.0
    bends = costs.curvature(x.q, costs.at(x.q)[1])
    np.testing.assert_allclose(bends, np.broadcast_to(expected, bends.shape), atol=1e-8)


def test_another_plan_has_it_too() -> None:
    plan = made(-3.0 * W)
    on = nmm.replan(plan, plan([0.3 * plan.duration])[0][0])
    assert on.found.asked.objective is plan.found.asked.objective


def test_a_scenario_asks_for_it() -> None:
    settings = {
        "plan.smooth": True,
        "plan.objective": {"kind": "manipulability", "frame": "ee", "of": "arm", "weight": 3.0},
    }
    plan = nmm.Scenario.load("behind_the_wall", settings).plan()
    plain = nmm.Scenario.load("behind_the_wall", {"plan.smooth": True}).plan()
    assert plan.duration == plain.duration
    assert mean(plan, W) > mean(plain, W)
    with pytest.raises(nmm.ScenarioError) as found:
        nmm.Scenario.load("behind_the_wall", settings | {"plan.smooth": False}).plan()
    assert found.value.where.endswith("objective")


@pytest.mark.parametrize(
    ("change", "where"),
    [
        ({"smooth": False}, "plan: objective"),
        ({"objective": 3.0}, "plan: objective"),
        ({"objective": nmm.Manipulability("hand")}, "robot unicycle_3r"),
        ({"objective": nmm.Line([0.0], [1.0], 5.0) * W}, "plan: objective"),
        ({"objective": nmm.Clearance()}, "clearance"),
    ],
)
def test_bad_input_is_refused(change: dict[str, Any], where: str) -> None:
    given = {"smooth": True, "objective": -3.0 * W, "limits": LIMITS} | change
    with pytest.raises(nmm.InputError) as found:
        nmm.plan(nmm.load("unicycle_3r"), START, {"x": 1.0}, **given)
    assert found.value.where.startswith(where)
