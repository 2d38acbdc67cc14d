"""Plans whose motors keep their torque limits."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest
from places import UR5

import nmm

LIMITS = nmm.Limits(velocity={"platform": 1.0, "arm": 3.0}, acceleration={"platform": 4.0, "arm": 20.0})
START = {"ur5_shoulder_lift_joint": -0.3, "ur5_elbow_joint": 0.3}
GOAL = {
    "x": 2.0, "y": 1.0, "theta": 0.0, "ur5_shoulder_pan_joint": 2.0, "ur5_shoulder_lift_joint": -1.5,
    "ur5_elbow_joint": 1.5,
}  # fmt: skip
LOAD = {"ur5_ee_link": 8.0}


@cache
def robot() -> nmm.Robot:
    base = nmm.load("differential_base", platform="unicycle")
    return nmm.mount(base, nmm.load(UR5), prefix="ur5_")


@cache
def planned(smooth: bool, load: bool, kept: bool) -> nmm.Plan:
    effort: Any = LOAD if load and kept else kept
    return nmm.plan(robot(), START, GOAL, limits=LIMITS, smooth=smooth, effort=effort)


def shares(plan: nmm.Plan, payload: dict[str, float] | None) -> np.ndarray:
    """The largest share of each motor's limit along a plan, by accelerations that are differences within its
    pieces."""
    motion, h = plan.found.motion, 1e-5
    kinks = motion.samples.begin if plan.smooth else motion.stops
    t = np.linspace(0.0, plan.duration, 3000)
    t = t[np.abs(t[:, np.newaxis] - kinks).min(axis=1) > 2.0 * h]
    (q, u), before, after = plan(t), plan(t - h)[1], plan(t + h)[1]
    dynamics = nmm.Dynamics(robot(), payload)
    f = dynamics.inverse(q, u, (after - before) / (2.0 * h))
    return np.abs(dynamics.actuators.torques(q, f)).max(axis=0) / dynamics.actuators.efforts


@pytest.mark.parametrize("smooth", [False, True])
def test_motors_keep_their_limits_with_a_load(smooth: bool) -> None:
    plain, kept = planned(smooth, True, False), planned(smooth, True, True)
    assert kept.smooth is smooth
    assert shares(plain, LOAD).max() > 1.0
    assert shares(kept, LOAD).max() < 1.0
    assert kept.duration > plain.duration
    np.testing.assert_allclose(kept.end, plain.end, atol=1e-9)


@pytest.mark.parametrize("smooth", [False, True])
def test_what_needs_less_is_as_fast_as_before(smooth: bool) -> None:
    plain, kept = planned(smooth, False, False), planned(smooth, False, True)
    assert shares(plain, None).max() < 0.98
    assert kept.duration == plain.duration


def test_a_load_that_no_motor_holds_is_named() -> None:
    with pytest.raises(nmm.RunError, match="ur5_shoulder_lift_joint"):
        nmm.plan(robot(), START, GOAL, limits=LIMITS, effort={"ur5_ee_link": 60.0})


@pytest.mark.parametrize(
    ("given", "where"),
    [
        ({"effort": True, "limits": None}, "plan: effort"),
        ({"effort": {"hand": 1.0}}, "payload"),
        ({"effort": {"ur5_ee_link": -1.0}}, "payload: ur5_ee_link: mass"),
    ],
)
def test_bad_input_is_named(given: dict[str, Any], where: str) -> None:
    with pytest.raises(nmm.InputError) as found:
        nmm.plan(robot(), START, GOAL, **({"limits": LIMITS} | given))
    assert found.value.where.startswith(where)


def test_a_scenario_asks_for_it() -> None:
    scenario = nmm.Scenario.load("behind_the_wall", {"plan.effort": {"ee": 3.0}})
    assert scenario.plan().duration >= nmm.Scenario.load("behind_the_wall").plan().duration
    with pytest.raises(nmm.ScenarioError, match="hand"):
        nmm.Scenario.load("behind_the_wall", {"plan.effort": {"hand": 3.0}}).plan()


def test_another_plan_keeps_them_too() -> None:
    kept = planned(False, True, True)
    (half,), _ = kept(0.5 * kept.duration)
    on = nmm.replan(kept, half)
    assert shares(on, LOAD).max() < 1.0
