"""Plans of a tractor with trailers, checked as smooth ones are: Coal, differences against S(q) u, limits."""

import numpy as np
import pytest
from test_smoothing import LIMITS, check

import nmm
from nmm.plugins.planning.prepared import Asked, Prepared
from nmm.plugins.planning.search import PlanSearch
from nmm.plugins.planning.search_space import USUAL
from nmm.plugins.planning.smoothing import Smoothing
from nmm.plugins.planning.towing import STEADY, RoughMotion, least_radius

STRAIGHT = {"hitch1": 0.0, "hitch2": 0.0}


def box(low, high):
    ends = np.array([low, high])
    return nmm.Obstacle(nmm.Box(ends[1] - ends[0]), ends.mean(axis=0), name=f"from {low} to {high}")


@pytest.fixture(scope="module")
def train():
    return nmm.load("trailer_base")


def check_end(plan, goal):
    """The goal's coordinates, angles of the platform but for whole turns."""
    for name, value in goal.items():
        off = plan.end[plan.robot.coordinate(name)] - value
        assert abs(2.0 * np.sin(0.5 * off) if name == "theta" else off) < 1e-9


@pytest.mark.thorough
def test_a_train_gets_to_a_pose(train):
    start = {"theta": 1.0, "hitch1": 0.5, "hitch2": -0.3}
    goal = {"x": -2.0, "y": 1.0, "theta": 0.5}
    plan = nmm.plan(train, start, goal, limits=LIMITS)
    assert plan.smooth
    check(plan)
    check_end(plan, goal)
    again = nmm.plan(train, start, goal, limits=LIMITS)
    np.testing.assert_array_equal(again(1.0)[0], plan(1.0)[0])


def test_a_train_backs_into_a_slot(train):
    walls = [
        box((-2.5, 0.5, 0.0), (0.0, 0.7, 1.0)),
        box((-2.5, -0.7, 0.0), (0.0, -0.5, 1.0)),
        box((-2.6, -0.5, 0.0), (-2.4, 0.5, 1.0)),
    ]
    goal = {"x": 0.1, "y": 0.0, "theta": 0.0, **STRAIGHT}
    plan = nmm.plan(train, {"x": 3.0, "y": 1.0, "theta": 2.5}, goal, walls, limits=LIMITS)
    check(plan)
    check_end(plan, goal)


def test_a_train_that_may_not_reverse_goes_forwards_through_poses_on_its_way(train):
    limits = nmm.Limits(velocity={"v": [0.0, 1.0], "omega": 1.5}, acceleration=1.0)
    through = {"x": 0.0, "y": 4.0, "theta": np.pi}
    goal = {"x": -3.0, "y": 0.0, "theta": 0.0, **STRAIGHT}
    plan = nmm.plan(train, train.rest, goal, through=[through], limits=limits)
    check_end(plan, goal)
    assert plan(np.linspace(0.0, plan.duration, 500))[1][:, 0].min() > -1e-11
    assert len(plan.stops) == 3
    assert np.allclose(plan.corners[1, :2], (0.0, 4.0), atol=1e-9)


def test_an_arm_on_a_trailer_gets_to_its_posture():
    robot = nmm.mount("trailer_base", "small_arm", at="trailer2_mount")
    alone = nmm.plan(robot, robot.rest, {robot.q_names[-1]: 0.2}, limits=LIMITS)
    check_end(alone, {robot.q_names[-1]: 0.2})
    assert np.abs(alone(np.linspace(0.0, alone.duration, 50))[0][:, :5]).max() < 1e-3
    wall = nmm.Obstacle(nmm.Box([0.2, 4.0, 2.0]), [2.5, 0.0, 0.5], name="wall")
    goal = {"x": 5.5, "y": 0.0, "theta": 1.0, robot.q_names[-1]: 0.5}
    plan = nmm.plan(robot, robot.rest, goal, [wall], limits=LIMITS)
    check(plan)
    check_end(plan, goal)


def test_a_plan_that_is_there_already_takes_no_time(train):
    assert nmm.plan(train, train.rest, {"x": 0.0, "y": 0.0, "theta": 0.0}).duration == 0.0


@pytest.mark.parametrize("hitch", [0.25, 0.0, -0.2])
def test_on_the_least_arcs_hitches_settle_within_their_share_of_the_limit(hitch):
    """Driven round and round, by steps of the tractor's own G."""
    tractor = nmm.Tractor([nmm.Trailer(0.7, hitch), nmm.Trailer(0.5, 0.1, joint="hitch2")])
    folds = np.array([[-1.2, 1.2], [-1.0, 1.0]])
    q, radius = np.zeros(5), least_radius(tractor, folds)
    for _ in range(10_000):
        q += 0.01 * tractor.G(q) @ [1.0, 1.0 / radius]
    assert np.max(np.abs(q[3:]) / folds[:, 1]) == pytest.approx(STEADY, abs=0.01)


def test_the_solver_makes_a_motion_of_a_long_way_backwards(train):
    """On which hitches fold, so that what rounding leaves in it grows."""
    asked = Asked(nmm.Collisions(), LIMITS, nmm.Goal())
    search = PlanSearch(Prepared(train, asked), train.rest, [{"x": -25.0}])
    t = np.linspace(0.0, 40.0, 100)
    q, u = np.zeros((100, 5)), np.zeros((99, 2))
    q[:, 0], q[-1, 1], u[:, 0] = -25.0 * t / 40.0, 0.3, -25.0 / 40.0
    motion = Smoothing(train, search.limits, USUAL, search.check)(RoughMotion(t, q, u), rough=True)
    np.testing.assert_allclose(motion.corners[-1], q[-1], atol=1e-9)


def test_a_pose_that_is_walled_in_is_told_with_what_was_tried(train):
    ring = [box((3.0, -3.0, 0.0), (3.2, 3.0, 1.0)), box((8.0, -3.0, 0.0), (8.2, 3.0, 1.0))]
    ring += [box((3.0, 2.8, 0.0), (8.2, 3.0, 1.0)), box((3.0, -3.0, 0.0), (8.2, -2.8, 1.0))]
    with pytest.raises(nmm.RunError, match=r"[1-9]\d* configurations and 0 rough"):
        nmm.plan(train, train.rest, {"x": 6.0, "y": 0.0, "theta": 0.0}, ring, seconds=1.0)


def test_what_waits_and_what_goes_on_is_refused(train):
    passing = nmm.Obstacle(nmm.Box([0.2, 0.2, 1.0]), motion=lambda t: [2.0, t - 3.0, 0.5])
    goal = {"x": 4.0, "y": 0.0, "theta": 0.0}
    with pytest.raises(nmm.InputError, match="obstacles"):
        nmm.plan(train, train.rest, goal, [passing])
    plan = nmm.plan(train, train.rest, goal)
    with pytest.raises(nmm.InputError, match="replan"):
        nmm.replan(plan, train.rest)
