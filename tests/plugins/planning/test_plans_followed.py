"""Plans that a controller follows: from beside them, within limits and distances, against noise and slip."""

from functools import cache

import numpy as np
import pytest
from findings import codes, the

import nmm

LIMITS = nmm.Limits(velocity={"platform": 1.0, "arm": 1.5}, acceleration={"platform": 1.0, "arm": 3.0})
WALL = nmm.Obstacle(nmm.Box([0.2, 4.0, 2.0]), [3.0, 0.0, 0.5], name="wall")
POSE = {"x": 6.0, "y": 2.0, "theta": 0.5}
ROBOTS = [
    ("unicycle_3r", None),
    ("differential_base", None),
    ("car_base", "car"),
    ("car_base", "front_drive_car"),
    ("unicycle_3r", "omnidirectional"),
    ("unicycle_3r", "fixed"),
]


def planned(name, platform=None, goal=POSE, obstacles=(), **more):
    robot = nmm.load(name, platform=platform)
    goal = goal if robot.platform.n_p else {"q1": 1.0, "q2": 0.5}
    return nmm.plan(robot, robot.rest, goal, obstacles, limits=LIMITS, **more)


#: One plan a robot, for several tests.
standard = cache(planned)


def followed(plan, off, seconds=2.0, dt=0.02, method="zoh", **kept):
    """A run from beside a plan's start."""
    controller = nmm.Controller(
        plan.robot, plan.reference(), nmm.ProjectedGradient(), dt=dt, kinematics="compiled", **kept
    )
    q0 = plan.corners[0].copy()
    q0[: len(off)] += off
    return controller, nmm.simulate(controller, q0, plan.duration / 0.8 + seconds, dt, method)


@pytest.mark.parametrize(("name", "platform"), ROBOTS)
def test_a_robot_beside_its_plan_comes_back_to_it(name, platform):
    """5 cm to the left and turned by 0.1 rad: what no input of a wheeled platform undoes at once."""
    plan = standard(name, platform)
    _, run = followed(plan, (0.0, 0.05, 0.1), seconds=3.0, method="rk4")
    assert run.complete
    assert "left_plan" not in codes(run)
    there = plan(0.8 * run.t)[0]
    assert np.abs(run.q[0] - there[0]).max() > 0.05
    assert np.abs(run.q[-1] - there[-1]).max() < 1e-3


@pytest.mark.parametrize(("name", "platform"), ROBOTS)
def test_each_row_is_what_an_input_moved_too_far(name, platform):
    """Its derivatives are those of differences, and along the plan J u = u."""
    plan = standard(name, platform)
    robot, function = plan.robot, plan.reference(pace=1.0).function
    rng = np.random.default_rng(0)
    for t in rng.uniform(0.0, plan.duration, 5):
        (q,), _ = plan(t)
        np.testing.assert_allclose(
            nmm.evaluate(function, t, nmm.Configuration(robot, q)).value_q @ robot.S(q),
            np.eye(robot.n_u),
            atol=2e-3,
        )
        q = q + 0.1 * rng.standard_normal(robot.n)
        at = nmm.evaluate(function, t, nmm.Configuration(robot, q))
        h = 1e-6
        for i, axis in enumerate(np.eye(robot.n)):
            ahead, behind = (
                nmm.evaluate(function, t, nmm.Configuration(robot, q + s * h * axis)).value
                for s in (1.0, -1.0)
            )
            np.testing.assert_allclose(at.value_q[:, i], (ahead - behind) / (2.0 * h), atol=1e-7)
        ahead, behind = (
            nmm.evaluate(function, t + s * h, nmm.Configuration(robot, q)).value for s in (1.0, -1.0)
        )
        np.testing.assert_allclose(at.value_t, (ahead - behind) / (2.0 * h), atol=1e-5)


def test_limits_and_distances_hold_on_the_way():
    """By Coal's distances and the recorded inputs; 80 mm are kept by the plan and 30 by the controller."""
    plan = planned(
        "unicycle_3r",
        goal={"x": 6.0, "y": 0.0, "theta": 0.5},
        collisions=nmm.Collisions(0.08),
        obstacles=[WALL],
    )
    _, run = followed(
        plan, (0.0, 0.05, 0.1), limits=LIMITS, collisions=nmm.Collisions(0.03, obstacles=[WALL])
    )
    queries, pairs = plan.found.scene.queries, range(len(plan.found.scene.names))
    least = min(queries.distances(0.0, q, pairs).min() for q in run.q)
    assert least > 0.03
    on = LIMITS.on(plan.robot)
    assert np.all(run.u <= on.inputs[:, 1] + 1e-9)
    assert np.all(run.u >= on.inputs[:, 0] - 1e-9)
    assert np.all(np.abs(np.diff(run.u, axis=0)) <= 0.02 * on.accelerations + 1e-9)
    assert np.abs(run.q[-1] - plan.end).max() < 2e-3


def test_an_obstacle_that_the_plan_does_not_know_makes_the_robot_leave_it():
    plan = planned("unicycle_3r", goal={"x": 4.0, "y": 0.0, "theta": 0.0})
    assert np.abs(plan.corners[:, 1]).max() < 1e-9  # straight ahead
    post = nmm.Obstacle(nmm.Cylinder(0.1, 2.0), [3.0, 0.0, 0.5], name="post")
    _, run = followed(plan, (), limits=LIMITS, collisions=nmm.Collisions(0.03, obstacles=[post]))
    assert run.clearance_between.min() >= 0.03
    found = the(run, "left_plan")
    assert found.values["back"] is None
    apart = np.linalg.norm((run.q - plan(0.8 * run.t)[0])[:, :2], axis=1)
    assert np.isclose(found.values["m"], apart.max())
    assert np.isclose(found.where["t"], run.t[np.flatnonzero(apart > 0.1)[0]])


def test_below_another_task_a_plan_keeps_the_posture():
    """The arm does what the plan does while the hand's height is held."""
    robot = nmm.load("unicycle_3r")
    plan = nmm.plan(robot, {"q2": 0.4, "q3": 0.6}, {**POSE, "q1": 0.5, "q2": 0.6, "q3": 0.2}, limits=LIMITS)
    height = nmm.Task(nmm.Position("ee", "z"), [1.2], gain=3.0)
    tasks = [height, plan.reference(priority=2)]
    controller = nmm.Controller(robot, tasks, nmm.ProjectedGradient(), kinematics="compiled")
    run = nmm.simulate(controller, plan.corners[0], plan.duration / 0.8 + 2.0, 0.02)
    assert abs(run.error[-1, 0]) < 1e-3
    away = np.abs(run.q[-1] - plan.end)
    assert away[:3].max() < 1e-2
    assert abs(away[3]) < 1e-2


def test_whole_turns_of_the_platform_do_not_count():
    plan = standard("unicycle_3r")
    _, run = followed(plan, (0.0, 0.0, 2.0 * np.pi), method="rk4")
    assert run.error_norm.max() < 1e-4


def test_a_plan_is_followed_by_its_own_robot():
    plan = standard("unicycle_3r")
    with pytest.raises(nmm.InputError, match="unicycle_3r"):
        nmm.Controller(nmm.load("unicycle_2r"), plan.reference(), nmm.ProjectedGradient())


# Scenarios

TRACKED = {
    "plan": {"to": {"x": 2.0, "y": 1.0, "theta": 0.5}, "track": True},
    "duration": 30,
    "dt": 0.02,
    "method": "zoh",
    "collisions": False,
}


def test_a_scenario_follows_its_plan_in_the_closed_loop():
    """With the wall: 50 mm more than the controller keeps, so that it is back soon."""
    scenario = nmm.Scenario.load("behind_the_wall", {"plan.track": True, "duration": 20})
    plan, run = scenario.plan(), scenario.run()
    assert run.complete
    assert run.resolver == "pg"
    assert np.abs(run.q[-1] - plan.end).max() < 1e-3
    assert run.clearance_between.min() > 0.03
    np.testing.assert_allclose(run.planned, plan(0.8 * run.t)[0], atol=1e-12)
    for k in (0, 400, 1000):
        there = nmm.Configuration(plan.robot, run.planned[k]).placement("ee").translation
        np.testing.assert_allclose(run.desired[k], there, atol=1e-12)
    assert plan.trajectory(0.05).clearance_between.min() > 0.079
    again = nmm.Scenario.load("behind_the_wall", {"plan.track": {"margin": 0}, "duration": 20}).plan()
    assert again.trajectory(0.05).clearance_between.min() < 0.079


def test_a_plan_without_room_for_the_margin_is_made_without_it():
    """The goal is 45 mm before the wall: no plan keeps 80."""
    to = {"x": 1.9, "y": 0.0, "theta": 0.0, "q1": 3.0}
    scenario = nmm.Scenario.load("behind_the_wall", {"plan": {"to": to, "track": True}})
    free = scenario.plan().trajectory(0.05).clearance_between.min()
    assert 0.03 <= free <= 0.0451


def test_a_duration_that_is_too_short_for_the_plan_is_refused():
    with pytest.raises(nmm.base.errors.ScenarioError) as found:
        nmm.Scenario.load("behind_the_wall", {"plan.track": True, "duration": 5}).run()
    assert "duration" in found.value.where


def test_a_rollout_follows_a_plan_with_noise_and_slip():
    """It ends near the goal; the plan's inputs alone, with the same slip, do not."""
    scenario = nmm.Scenario.load("behind_the_wall", TRACKED)
    starts = scenario.robot().q(scenario.parts.q0) + np.zeros((4, 1))
    worn = nmm.Disturbances(noise=0.002, slip=[0.9, 0.95, 1, 1, 1], seed=1)
    found = nmm.rollout(scenario, starts, disturbances=worn, keep=["q"])
    plan = scenario.plan()
    away = np.abs(found["q"][:, -1] - plan.end).max(axis=1)
    assert away.max() < 0.05
    q, robot, dt = plan.corners[0], plan.robot, 0.01
    for u in plan(np.arange(0.0, plan.duration, dt))[1]:
        q = q + dt * robot.S(q) @ (u * [0.9, 0.95, 1, 1, 1])
    assert np.abs(q - plan.end).max() > 0.15


@pytest.mark.parametrize("track", [False, True])
def test_a_sweep_plans_for_each_row(tmp_path, track):
    """A row a start: each has a plan of its own, also where a controller is used again."""
    base = nmm.Scenario.load("behind_the_wall", {**TRACKED, "plan.track": track})
    sweep = nmm.Sweep(base, {"q0.x": [-1.0, 0.0, 0.5]})
    swept = sweep.run(tmp_path / "sweep", jobs=1)
    assert swept.outcomes == {"completed": 3}
    ends = swept.table["t_end"].to_pylist()
    assert ends == [30.0] * 3 if track else ends[0] > ends[1] > ends[2]
    assert max(swept.table["error_final"].to_pylist()) < 1e-3
    assert not track or max(swept.table["error_max"].to_pylist()) < 0.05
