"""Plans among obstacles that move: checked by Coal with the obstacle where it is then, S(q) u, the limits."""

import numpy as np
import pytest

import nmm
from nmm.plugins.planning import planned

LIMITS = nmm.Limits(velocity={"platform": 1.0, "arm": 1.5}, acceleration={"platform": 1.0, "arm": 3.0})
WALL = nmm.Obstacle(nmm.Box([0.2, 4.0, 2.0]), [3.0, -2.5, 0.5], name="wall")
START, GOAL = {"q1": 0.5, "q2": -0.4}, {"x": 6.0, "y": 0.0, "theta": 0.0}


@pytest.fixture(scope="module")
def robot():
    return nmm.load("unicycle_3r")


def passer_by(when, turns=0.0):
    """A bar that crosses the line from start to goal at x = 3, at 0.4 m/s, and may turn."""

    def motion(t):
        return [3.0, 0.4 * (when - t), 0.9, 0.0, 0.0, turns * t]

    return nmm.Obstacle(nmm.Box([0.3, 0.9, 1.8]), motion=motion, name="passer-by")


def least(plan, obstacles):
    """The least distance of all, 100 times a second, m."""
    t = np.arange(0.0, plan.duration + 1.0, 0.01)
    scene = nmm.Collisions(0.03, False, obstacles).on(plan.robot)
    return min(scene.queries.nearest(float(time), q)[0] for time, q in zip(t, plan(t)[0], strict=True))


@pytest.mark.parametrize(("turns", "standing"), [(0.0, []), (0.7, [WALL])])
def test_it_waits_for_what_crosses_its_way(robot, standing, turns):
    own = nmm.plan(robot, START, GOAL, standing, limits=LIMITS)
    t = np.linspace(0.0, own.duration, 500)
    when = t[np.abs(own(t)[0][:, 0] - 3.0).argmin()]  # the robot is there then
    bar = passer_by(when, turns)
    assert least(own, [bar]) < 0.0
    plan = nmm.plan(robot, START, GOAL, [*standing, bar], limits=LIMITS)
    assert least(plan, [*standing, bar]) >= 0.03
    assert plan.duration > own.duration
    assert np.allclose(plan.end, own.end, rtol=0.0, atol=1e-9)
    on, h = LIMITS.on(robot), 1e-6
    t = np.linspace(h, plan.duration - h, 400)
    t = t[np.abs(t[:, np.newaxis] - plan.stops).min(axis=1) > 2.0 * h]
    (after, then), (before, was) = plan(t + h), plan(t - h)
    for rate, q, u in zip((after - before) / (2.0 * h), *plan(t), strict=True):
        assert np.allclose(rate, robot.S(q) @ u, rtol=0.0, atol=1e-8)
        assert np.all(np.abs(u) <= on.inputs[:, 1] + 1e-11)
    assert np.all(np.abs(then - was) / (2.0 * h) <= on.accelerations + 1e-6)
    assert np.allclose(plan(plan.stops)[1], 0.0, atol=1e-6)
    run = plan.trajectory(0.05)
    assert run.clearance_between.min() >= 0.03 - 1e-4


def test_what_is_far_when_it_passes_costs_no_time(robot):
    own = nmm.plan(robot, START, GOAL, limits=LIMITS)
    plan = nmm.plan(robot, START, GOAL, [passer_by(500.0)], limits=LIMITS)
    assert plan.duration == pytest.approx(own.duration, abs=0.2 * len(own.stops))


@pytest.mark.parametrize(
    "motion",
    [
        lambda t: [6.0, 0.0, 0.9],  # on the goal, always
        lambda t: [-2.0 + 1.5 * t, 0.0, 0.9],  # it runs over the start, and comes after the robot
    ],
)
def test_where_no_timing_works_it_is_refused(robot, motion, monkeypatch):
    monkeypatch.setattr(planned, "WAYS", 3)  # each kind of other way once
    post = nmm.Obstacle(nmm.Cylinder(0.3, 1.8), motion=motion, name="post")
    with pytest.raises(nmm.RunError, match="post"):
        nmm.plan(robot, START, GOAL, [post], limits=LIMITS)


def test_another_way_is_taken_where_one_is_blocked_for_ever(robot):
    def moves_in_and_stays(t):
        return [3.0, max(1.5, 6.0 - 3.0 * t), 0.9]

    gate = nmm.Obstacle(nmm.Box([0.2, 2.0, 2.0]), [3.0, 4.0, 0.5], name="gate")
    stays = nmm.Obstacle(nmm.Box([0.3, 3.2, 1.8]), motion=moves_in_and_stays, name="stays")
    plan = nmm.plan(robot, START, GOAL, [WALL, gate, stays], limits=LIMITS)
    assert least(plan, [WALL, gate, stays]) >= 0.03
    assert np.allclose(plan.end[:3], [6.0, 0.0, 0.0], atol=1e-9)


def test_it_comes_to_its_goal_when_it_can_stay_there(robot):
    later = nmm.Obstacle(nmm.Cylinder(0.3, 1.8), motion=lambda t: [6.0, 30.0 - t, 0.9], name="later")
    plan = nmm.plan(robot, START, GOAL, [later], limits=LIMITS)
    assert plan.duration > 30.0
    assert least(plan, [later]) >= 0.03


def test_it_is_followed_at_its_own_pace(robot):
    plan = nmm.plan(robot, START, GOAL, [passer_by(3.0)], limits=LIMITS)
    with pytest.raises(nmm.InputError, match="plan: pace"):
        plan.reference()
    assert plan.reference(pace=1.0).function.duration == pytest.approx(plan.duration)


def test_it_is_not_replanned(robot):
    plan = nmm.plan(robot, START, GOAL, limits=LIMITS)
    with pytest.raises(nmm.InputError, match="replan: obstacles"):
        nmm.replan(plan, plan.end, [passer_by(3.0)])
