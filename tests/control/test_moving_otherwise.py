"""Motions that are not what their recorded rates say, because the inputs jump within the steps."""

from __future__ import annotations

import numpy as np
import pytest
from findings import codes

import nmm
from nmm.motion.diagnosis.jumps import STEPS, moving_otherwise

T = np.linspace(0.0, 1.0, 101)


def test_rates_of_a_smooth_motion_are_its_rates() -> None:
    """Those of a polynomial and of swings of up to a tenth of the samples' rate; at rest, too."""
    q = np.column_stack([T**3 - T, np.sin(2 * np.pi * 5 * T), np.zeros_like(T)])
    q_dot = np.column_stack([3 * T**2 - 1, 10 * np.pi * np.cos(2 * np.pi * 5 * T), np.zeros_like(T)])
    assert moving_otherwise(T, q, q_dot, ("a", "b", "c"), ("m", "rad", "rad")) is None


def test_a_motion_that_stands_still_at_a_rate_is_told() -> None:
    """From the sample at which it begins to the one at which it ends; a few steps are a transient."""
    q_dot = np.column_stack([np.ones_like(T), np.cos(T)])
    q = np.column_stack([T.copy(), np.sin(T)])
    stands = slice(30, 30 + STEPS + 1)
    q[stands, 0] = q[30, 0]
    q[31 + STEPS :, 0] = q[30, 0] + T[31 + STEPS :] - T[30 + STEPS]
    found = moving_otherwise(T, q, q_dot, ("bend", "other"), ("rad", "rad"))
    assert found is not None
    assert found.where == {"t": pytest.approx(0.3)}
    assert found.values == {
        "name": "bend",
        "end": pytest.approx(0.4),
        "moved": 0.0,
        "recorded": pytest.approx(1.0),
        "unit": "rad",
    }
    q[30 + STEPS :, 0] = q[30, 0] + T[30 + STEPS :] - T[29 + STEPS]
    assert moving_otherwise(T, q, q_dot, ("bend", "other"), ("rad", "rad")) is None


def test_rounding_is_no_motion(rng: np.random.Generator) -> None:
    q_dot = np.column_stack([np.ones_like(T), 1e-16 * rng.normal(size=len(T))])
    q = np.column_stack([T, np.zeros_like(T)])
    assert moving_otherwise(T, q, q_dot, ("a", "b"), ("m", "rad")) is None


@pytest.mark.parametrize("method", ["rk4", "zoh"])
def test_a_run_whose_stages_disagree_says_so(method: str) -> None:
    """Stretched after a target that runs away, with joints at their limits: what is recorded is the first
    stage's. One input a step is what moves the robot."""
    robot = nmm.load("unicycle_3r")
    task = nmm.Task(nmm.Position("ee"), nmm.Circle([0.0, 0.0, 0.5], radius=2.0, rate=1.0))
    limits = nmm.Limits(velocity={"v": 0.5, "omega": 0.5, "arm": 1.0})
    controller = nmm.Controller(robot, task, nmm.ProjectedGradient(), limits=limits, dt=0.01)
    run = nmm.simulate(controller, {"x": 1.0, "q2": 0.4, "q3": 0.6}, 4.0, 0.01, method)
    moved, rate = np.diff(run.q[:, 3:], axis=0) / 0.01, run.q_dot[:-1, 3:]
    apart = np.mean(np.abs(moved - rate).max(axis=1) > 0.5)
    told = "moves_otherwise" in codes(run)
    assert told == (apart > 0.05)
    assert told == (method == "rk4")
