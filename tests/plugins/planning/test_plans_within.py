"""Plans within limits of position: start, goal, way, smooth; a car there and back; plans of no length."""

import numpy as np
import pytest
from findings import codes

import nmm
from nmm.plugins.planning.search_space import drawn_within

POSITION = {"q1": [-1.0, 1.0], "q2": [-1.0, 1.0], "y": [-0.3, 0.3]}


def limits(**position):
    return nmm.Limits(velocity={"v": 1.0}, acceleration=2.0, position=position or POSITION)


def coordinates(plan, *names):
    """Of a plan at many times, (N, len(names))."""
    q, _ = plan(np.linspace(0.0, plan.duration, 3000))
    return q[:, [plan.robot.coordinate(name) for name in names]]


@pytest.mark.parametrize(
    ("start", "goal", "where"),
    [
        ({"q1": 1.5}, {"x": 2.0}, "start"),
        ({}, {"x": 2.0, "q1": 1.5}, "goal"),
        ({}, {"x": 2.0, "y": 1.0}, "goal"),
        ({}, [2.0, 0.0, 0.0, 1.2, 0.0, 0.0], "goal"),
    ],
)
def test_what_is_outside_is_refused(start, goal, where):
    with pytest.raises(nmm.NmmError, match=where):
        nmm.plan(nmm.load("unicycle_3r"), start, goal, limits=limits())


@pytest.mark.parametrize("goal", [{"x": 2.0, "q1": 1.5}, [{"q1": 1.5}, {"x": 2.0}]])
def test_a_coordinate_of_a_goal_outside_is_named(goal):
    with pytest.raises(nmm.InputError, match=r"q1 = 1\.5"):
        nmm.plan(nmm.load("unicycle_3r"), {}, goal, limits=limits())


def test_configurations_are_drawn_within_limits_of_theta_beyond_half_a_turn():
    robot = nmm.load("unicycle_3r")
    start, within = robot.q({"theta": 4.5}), np.tile([-np.inf, np.inf], (robot.n, 1))
    within[2] = 4.0, 5.0
    low, high = drawn_within(robot, start, [{"x": 2.0}], (), within)
    assert (low[2], high[2]) == (4.0, 5.0)
    plan = nmm.plan(robot, {"theta": 4.5}, {"q1": 0.5}, limits=limits(theta=[4.0, 5.0]))
    assert np.allclose(plan.end[2], 4.5)


@pytest.mark.parametrize("seed", range(5))
def test_a_platform_stays_in_its_lane(seed):
    """Where it has to turn round and arcs would lead out; x, y and theta by the sum of its inputs, too."""
    robot = nmm.load("unicycle_3r")
    rng = np.random.default_rng(seed)
    goal = {"x": rng.uniform(0.5, 2.0), "y": rng.uniform(-0.25, 0.25), "theta": rng.uniform(-3.0, 3.0)}
    plan = nmm.plan(robot, {"theta": rng.uniform(-3.0, 3.0), "q1": 0.9}, goal, limits=limits(), seed=seed)
    assert np.abs(coordinates(plan, "y")).max() <= 0.3 + 1e-9
    assert np.abs(coordinates(plan, "q1", "q2")).max() <= 1.0 + 1e-9
    t = np.linspace(0.0, plan.duration, 20_001)
    q, u = plan(t)
    driven = q[0, 1] + np.cumsum(u[:-1, 0] * np.sin(q[:-1, 2])) * (t[1] - t[0])
    assert np.abs(driven - q[1:, 1]).max() < 2e-3


def test_a_task_is_reached_by_joints_within_limits():
    robot = nmm.load("unicycle_3r")
    task = nmm.Task(nmm.Position("ee", "xy"), [2.0, 0.2])
    for seed in range(4):
        plan = nmm.plan(robot, {"q1": 0.5}, task, limits=limits(), seed=seed)
        assert np.abs(coordinates(plan, "q1", "q2")).max() <= 1.0 + 1e-9
        assert np.abs(coordinates(plan, "y")).max() <= 0.3 + 1e-9


@pytest.mark.parametrize("most", [0.3, 0.15])
def test_a_car_that_may_steer_less_turns_wider(most):
    robot = nmm.load("car_base")
    goal = {"x": 0.0, "y": 1.0, "theta": 0.0}
    plan = nmm.plan(robot, {}, goal, limits=limits(steering=[-most, most]))
    assert np.abs(coordinates(plan, "steering")).max() <= most + 1e-9
    assert np.abs(plan.end[:3] - [0.0, 1.0, 0.0]).max() < 1e-9
    with pytest.raises(nmm.InputError, match="about 0"):
        nmm.plan(robot, {"steering": 0.1}, goal, limits=limits(steering=[0.05, 0.3]))


def test_smooth_motions_keep_them_and_are_found():
    """19 of 20 round a wall, within limits that the arm's ways from posture to posture come near to."""
    robot = nmm.load("unicycle_3r")
    found = 0
    for k in range(20):
        rng = np.random.default_rng(k)
        wall = nmm.Obstacle(nmm.Box([0.2, 2.0, 2.0]), [2.0, rng.uniform(-0.5, 0.5), 0.5], name="wall")
        arm = {name: rng.uniform(-0.9, 0.9) for name in ("q1", "q2")}
        goal = nmm.Task(nmm.Position("ee", "xy"), [rng.uniform(3.5, 4.5), rng.uniform(-0.8, 0.8)])
        kept = limits(q1=[-1.0, 1.0], q2=[-1.0, 1.0])
        plan = nmm.plan(robot, arm, goal, [wall], limits=kept, seed=k, smooth=True)
        assert np.abs(coordinates(plan, "q1", "q2")).max() <= 1.0 + 1e-9
        found += plan.smooth
    assert found >= 19


def test_a_car_takes_as_long_there_as_back():
    robot = nmm.load("car_base")
    rng = np.random.default_rng(0)
    home = {"x": 0.0, "y": 0.0, "theta": 0.0}
    for _ in range(40):
        pose = dict(zip(home, rng.uniform([-3.0, -3.0, -np.pi], [3.0, 3.0, np.pi]), strict=True))
        there = nmm.plan(robot, {}, pose, limits=limits(steering=[-0.6, 0.6]))
        back = nmm.plan(robot, pose, home, limits=limits(steering=[-0.6, 0.6]))
        assert np.isclose(there.duration, back.duration, rtol=1e-9)


@pytest.mark.parametrize("name", ["unicycle_3r", "car_base", "trailer_base"])
def test_a_plan_of_no_length_is_a_plan(name, tmp_path):
    robot = nmm.load(name)
    goal = dict(zip(robot.q_names, robot.rest.tolist(), strict=True))
    plan = nmm.plan(robot, robot.rest, goal, limits=limits(x=[-5.0, 5.0]))
    assert plan.duration == 0.0
    run = plan.trajectory()
    run.save(tmp_path / "run", html=True)
    assert len(nmm.Trajectory.load(tmp_path / "run")) == 1
    controller = nmm.Controller(robot, plan.reference(), nmm.ProjectedGradient())
    followed = nmm.simulate(controller, robot.rest, 1.0, 0.02)
    assert followed.complete
    assert not codes(followed)
    np.testing.assert_array_equal(followed.q[-1], robot.rest)
