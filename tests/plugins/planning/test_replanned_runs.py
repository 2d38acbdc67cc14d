"""Runs that go on with another plan where the robot has left the tube of the one that it follows."""

from functools import cache, partial

import numpy as np
import pytest
from findings import codes, the

import nmm
from nmm.motion import compiled_loop

LIMITS = nmm.Limits(velocity={"platform": 1.0, "arm": 1.5}, acceleration={"platform": 1.0, "arm": 3.0})
WALL = nmm.Obstacle(nmm.Box([0.2, 4.0, 2.0]), [3.0, 0.0, 0.5], name="wall")
#: Where the robot is pushed, from its start: behind the wall, close to it, and turned towards it.
PUSHED = (3.6, 0.0, 3.1)


@cache
def plan():
    robot = nmm.load("unicycle_3r")
    goal = {"x": 6.0, "y": 0.0, "theta": 0.5}
    return nmm.plan(robot, robot.rest, goal, [WALL], nmm.Collisions(0.15), limits=LIMITS)


def controller(replan, **kept):
    task = plan().reference(replan=replan)
    return nmm.Controller(plan().robot, task, nmm.ProjectedGradient(), limits=LIMITS, dt=0.02, **kept)


def least_distance(configurations):
    scene = plan().found.scene
    pairs = range(len(scene.names))
    return min(scene.queries.distances(0.0, q, pairs).min() for q in configurations)


def off_the_goal(q):
    off = np.asarray(q) - plan().end
    off[..., 2] -= 2.0 * np.pi * np.round(off[..., 2] / (2.0 * np.pi))
    return np.abs(off).max(axis=-1)


def pushed_run(replan, seconds=35.0, method="zoh"):
    kept = nmm.Collisions(0.03, obstacles=[WALL])
    q0 = plan().robot.rest + np.array([*PUSHED, 0.0, 0.0, 0.0])
    return nmm.simulate(controller(replan, collisions=kept), q0, seconds, 0.02, method)


def test_a_robot_that_was_pushed_goes_on_with_another_plan():
    """The first one leads it away from where it is; each is recorded with its time, distance and duration."""
    alone, run = pushed_run(None), pushed_run(nmm.replan)
    assert off_the_goal(alone.q[-1]) > 1.0
    assert not alone.complete
    assert "left_plan" in codes(alone)
    assert run.complete
    assert off_the_goal(run.q[-1]) < 2e-3
    assert least_distance(run.q) > 0.03
    found = the(run, "replanned").values["plans"]
    assert "left_plan" not in codes(run)
    assert [event.t for event in run.events] == [one["t"] for one in found]
    assert found[0]["t"] == 0.0
    assert np.isclose(found[0]["m"], np.hypot(*PUSHED[:2]))
    assert np.isclose(found[0]["rad"], PUSHED[2])
    first = nmm.replan(plan(), run.q[0])
    assert np.isclose(found[0]["duration"], first.duration / 0.8)
    again = pushed_run(nmm.replan, seconds=5.0)
    np.testing.assert_array_equal(run.q[: len(again)], again.q)


def test_the_target_of_a_run_is_a_function_of_time():
    """Its errors after the run, at the samples before the last plan too, are those recorded."""
    made = controller(nmm.replan)
    q0 = plan().robot.rest + np.array([*PUSHED, 0.0, 0.0, 0.0])
    run = nmm.simulate(made, q0, 15.0, 0.02, "zoh")
    assert run.events
    np.testing.assert_allclose(made.solver.errors(run.t, run.q)[0], run.error, atol=1e-12)
    np.testing.assert_array_equal(nmm.simulate(made, q0, 15.0, 0.02, "zoh").q, run.q)  # it begins anew


def test_slip_is_replanned_in_each_run_of_a_rollout(monkeypatch):
    """Of what the wheels are told to drive, 0.4 acts: the robot cuts the corner, nearer to the wall than its
    plan, and misses its goal, but where it plans again."""
    slip = np.ones((2, plan().robot.n_u))
    slip[1, 0] = 0.4
    starts = plan().robot.rest + np.zeros((2, 1))

    def rolled(replan, seconds=55.0):
        worn = nmm.Disturbances(noise=1e-4, slip=slip, seed=2)
        return nmm.rollout(controller(replan), starts, seconds, 0.02, "zoh", disturbances=worn, keep=["q"])

    alone, again = rolled(None), rolled(nmm.replan)
    assert least_distance(alone["q"][1, ::5]) < 0.1
    assert least_distance(again["q"][1, ::5]) > 0.1
    assert off_the_goal(alone["q"][1, -1]) > 0.1
    assert off_the_goal(again["q"][:, -1]).max() < 0.03
    assert "plan" not in again.message[0]
    assert "left its plan" in again.message[1]
    monkeypatch.setattr(compiled_loop, "A_CALL", 1e-4)
    shorter = rolled(nmm.replan, 8.0)["q"]
    np.testing.assert_array_equal(shorter, again["q"][:, : shorter.shape[1]])


def test_slip_is_replanned_beside_distances_of_the_controller_too():
    """As above; a plan's end is where a platform that cannot move sideways keeps what slip has left it."""

    def rolled(replans):
        settings = {"plan.track": {"replan": replans}, "duration": 30, "dt": 0.04}
        slip = nmm.Disturbances(slip=[0.6, 1.0, 1.0, 1.0, 1.0])
        return nmm.rollout(nmm.Scenario.load("behind_the_wall", settings), disturbances=slip, keep=["q"])

    alone, again = rolled(False), rolled(True)
    assert "left its plan" in again.message[0]
    scenario = nmm.Scenario.load("behind_the_wall")
    scene, end = scenario.controller().solver.scene, scenario.plan().end
    pairs = range(len(scene.names))
    (q,) = again["q"]
    assert min(scene.queries.distances(0.0, one, pairs).min() for one in q[::5]) > 0.03
    assert np.abs(alone["q"][0, -1] - end).max() > 1.0
    assert np.abs(q[-1] - end).max() < 0.03


@pytest.mark.parametrize("method", ["zoh", "rk4"])
def test_a_rollout_replans_as_a_run_does(method):
    starts = plan().robot.rest + np.array([(0.0, 0.0, 0.0), PUSHED]) @ np.eye(3, 6)
    made = controller(nmm.replan)
    rolled = nmm.rollout(made, starts, 20.0, 0.02, method, keep=["q"])
    for q0, q in zip(starts, rolled["q"], strict=True):
        np.testing.assert_array_equal(nmm.simulate(made, q0, 20.0, 0.02, method).q, q)


def test_where_no_other_plan_is_found_the_run_goes_on_and_says_so():
    def refuses(plan, q):
        raise nmm.RunError("no way")

    run = pushed_run(refuses, seconds=5.0)
    found = the(run, "not_replanned")
    assert found.values == {"times": 6, "why": "no way"}
    assert found.where["t"] == 0.0
    assert not run.events


def test_a_run_that_ends_before_its_plan_says_so():
    run = pushed_run(nmm.replan, seconds=6.0)
    last = the(run, "replanned").values["plans"][-1]
    assert np.isclose(the(run, "plan_cut").values["left"], last["t"] + last["duration"] - 6.0)


def test_obstacles_of_ones_own_are_gone_round():
    """A post that the first plan does not know stands in its way."""
    robot = plan().robot
    straight = nmm.plan(robot, robot.rest, {"x": 4.0, "y": 0.0, "theta": 0.0}, limits=LIMITS)
    post = nmm.Obstacle(nmm.Cylinder(0.1, 2.0), [2.5, 0.0, 0.5], name="post")
    ends = []
    for replan in (None, partial(nmm.replan, obstacles=[post])):
        made = nmm.Controller(
            robot, straight.reference(replan=replan), nmm.ProjectedGradient(), limits=LIMITS, dt=0.02,
            collisions=nmm.Collisions(0.03, obstacles=[post]),
        )  # fmt: skip
        run = nmm.simulate(made, robot.rest, 25.0, 0.02, "zoh")
        assert run.clearance_between.min() > 0.0299
        ends.append(np.abs(run.q[-1] - straight.end)[:2].max())
    assert ends[0] > 0.5
    assert ends[1] < 0.01


def test_a_scenario_replans_and_its_folder_says_when(tmp_path):
    """With a tube of 2 mm the limits alone make the robot leave its plan."""
    settings = {"plan.track": {"replan": True, "tube": {"m": 0.002, "rad": 0.002}}, "duration": 25}
    scenario = nmm.Scenario.load("behind_the_wall", settings)
    run = scenario.run()
    assert the(run, "replanned").values["plans"]
    assert np.abs(run.q[-1] - scenario.plan().end).max() < 5e-3
    assert run.clearance_between.min() > 0.0299
    run.save(tmp_path / "run", figures=False, html=True)
    again = nmm.Trajectory.load(tmp_path / "run")
    assert again.events == run.events
    np.testing.assert_array_equal(again.planned, run.planned)
    at = [run.t.tolist().index(event.t) for event in run.events]
    np.testing.assert_allclose(run.planned[at], run.q[at], atol=1e-12)  # each begins where the robot is
    assert "is made anew" in (tmp_path / "run" / "playback.html").read_text(encoding="utf-8")
