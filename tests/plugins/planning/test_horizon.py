"""Obstacles with a known motion are looked at ahead: the robot waits, or gives way, before they come."""

from __future__ import annotations

import numpy as np
import pytest
from findings import refused

import nmm

START = {"q2": 0.5, "q3": 0.9}
LIMITS = nmm.Limits(velocity={"platform": 1.0, "arm": 1.5}, acceleration={"platform": 1.0, "arm": 3.0})


def passing(at: tuple[float, float], when: float, velocity: tuple[float, float]) -> nmm.Obstacle:
    """A cylinder that is at a place at a time, s, m and m/s."""
    place, speed = np.array([*at, 0.9]), np.array([*velocity, 0.0])
    return nmm.Obstacle(
        nmm.Cylinder(0.3, 1.8), motion=lambda t: place + (t - when) * speed, velocity=lambda t: speed
    )


def ran(obstacle: nmm.Obstacle, horizon: float, goal: float, duration: float) -> nmm.Trajectory:
    robot = nmm.load("unicycle_3r")
    tip = nmm.Configuration(robot, robot.q(START)).placement("ee").translation
    task = nmm.Task(nmm.Position("ee"), [goal, 0.0, tip[2]], speed=0.5)
    keeps = nmm.Collisions(0.03, False, [obstacle], horizon=horizon)
    controller = nmm.Controller(
        robot, task, nmm.ProjectedGradient(), nmm.PreferredPosture(START), limits=LIMITS, collisions=keeps
    )
    return nmm.simulate(controller, robot.q(START), duration, 0.05, "zoh")


def test_the_robot_waits_for_what_crosses_its_way() -> None:
    """The cylinder passes the robot's way when the robot is there; before and after, nothing is near."""
    crosses = passing((1.6, 0.0), 4.0, (0.0, 0.6))
    assert ran(crosses, 0.0, 3.5, 8.0).clearance_between.min() < 0.0
    waits = ran(crosses, 4.0, 3.5, 14.0)
    assert waits.clearance_between.min() >= 0.03 - 1e-6
    assert waits.error_norm[-1] < 0.01
    stopped = np.abs(waits.u[:, 0]) < 0.02
    assert stopped[(waits.t > 1.0) & (waits.t < 7.0)].any()


def test_the_robot_leaves_its_place_for_what_comes_there() -> None:
    """It stands at its goal when the cylinder comes, which no row of distances near it makes it leave."""
    comes = passing((0.6, 0.1), 9.0, (0.42, 0.42))
    assert ran(comes, 0.0, 1.2, 11.0).clearance_between.min() < 0.0
    leaves = ran(comes, 4.0, 1.2, 16.0)
    assert leaves.clearance_between.min() >= 0.03 - 1e-6
    assert leaves.error_norm[-1] < 0.05


def test_what_stands_is_kept_from_as_before() -> None:
    pillar = nmm.Obstacle(nmm.Cylinder(0.3, 1.8), [1.8, 0.1, 0.9])
    one, other = (ran(pillar, horizon, 3.0, 4.0) for horizon in (0.0, 4.0))
    assert np.array_equal(one.q, other.q)


@pytest.mark.parametrize("horizon", [-1.0, np.inf, np.nan])
def test_a_horizon_is_a_finite_time(horizon: float) -> None:
    with refused("collisions: horizon"):
        nmm.Collisions(0.03, horizon=horizon)
