"""Predictive control: runs checked by Coal with obstacles where they are then, S(q) u, and the limits."""

import numpy as np
import pytest
from findings import codes, the

import nmm

LIMITS = nmm.Limits(velocity={"platform": 1.0, "arm": 1.5}, acceleration={"platform": 1.0, "arm": 3.0})
START = {"q2": 0.5, "q3": 0.9}


@pytest.fixture(scope="module")
def robot():
    return nmm.load("unicycle_3r")


def crossing(speed=0.5):
    """A cylinder that is on the robot's way when the robot would be."""
    return nmm.Obstacle(nmm.Cylinder(0.3, 1.8), motion=lambda t: [1.6, speed * (t - 2.5), 0.9], name="post")


def check(run, limits=LIMITS, distance=0.03):
    """Distances at all samples, S(q) u by differences, limits of inputs and what they change."""
    robot, on = run.robot, limits.on(run.robot)
    if run.obstacles:
        scene = nmm.Collisions(distance, False, run.obstacles).on(robot)
        pairs = range(len(scene.names))
        assert all(
            scene.queries.distances(t, q, pairs).min() >= distance for t, q in zip(run.t, run.q, strict=True)
        )
    assert np.all(run.u >= on.inputs[:, 0] - 1e-5)
    assert np.all(run.u <= on.inputs[:, 1] + 1e-5)
    h = np.diff(run.t)[:, np.newaxis]
    assert np.all(np.abs(np.diff(run.u, axis=0)) / h <= on.accelerations + 1e-4)
    middle = zip(0.5 * (run.q[1:] + run.q[:-1]), 0.5 * (run.u[1:] + run.u[:-1]), strict=True)
    rates = np.array([robot.S(q) @ u for q, u in middle])
    assert np.allclose(np.diff(run.q, axis=0) / h, rates, rtol=0.0, atol=1e-3)


def test_it_gives_way_to_what_will_cross(robot):
    tip = nmm.Configuration(robot, robot.q(START)).placement("ee").translation
    task = nmm.Task(nmm.Position("ee"), [3.5, 0.0, tip[2]])
    keeps = nmm.Collisions(0.03, False, [crossing()])
    horizon = nmm.Horizon(robot, task, keeps, LIMITS, dt=0.1)
    run = horizon.run(START, 15.0, nmm.Goal(0.01))
    assert run.complete
    assert codes(run) <= {"reached", "horizon_unsolved"}
    check(run)
    again = horizon.run(START, 15.0, nmm.Goal(0.01))
    assert np.array_equal(run.q, again.q)  # a run begins anew


def test_a_target_that_moves_is_followed(robot):
    """0.32 m/s; feedback alone, with a gain of 2, would be 0.16 m behind."""
    circle = nmm.Circle([1.2, 0.0], 0.4, 0.8)
    run = nmm.Horizon(robot, nmm.Task(nmm.Position("ee", "xy"), circle), limits=LIMITS, dt=0.1).run(
        START, 8.0
    )
    check(run)
    assert run.error_norm[run.t > 4.0].max() < 0.05


def test_the_end_of_a_plan_is_reached_exactly(robot):
    plan = nmm.plan(robot, START, {"x": 0.0, "y": 1.0, "theta": 0.0}, limits=LIMITS, smooth=True)
    run = nmm.Horizon(robot, plan, limits=LIMITS, dt=0.1).run(
        START, 2.0 * plan.duration, nmm.Goal(0.002, 0.002)
    )
    assert run.complete
    check(run)
    off = run.q[-1] - plan.end
    assert np.abs(off).max() < 0.004


@pytest.mark.parametrize("spare", [0.002, 0.02])
def test_the_end_of_a_plan_is_reached_where_a_post_is_near(robot, spare):
    """Nearer than what is kept in motion beyond the distance, and farther."""
    end = robot.q(START | {"x": 1.0, "y": 0.3})
    tip = nmm.Configuration(robot, end).placement("ee").translation
    post, out = nmm.Obstacle(nmm.Cylinder(0.1, 1.0), name="post"), 0.0
    scene = nmm.Collisions(0.03, False, [post]).on(robot)
    for _ in range(60):
        post.move_to([tip[0] + out, *tip[1:]])
        out += 0.03 + spare - scene.queries.distances(0.0, end, range(len(scene.names))).min()
    keeps = nmm.Collisions(0.03, False, [post])
    plan = nmm.plan(robot, START, dict(zip(robot.q_names, end, strict=True)), (), keeps, LIMITS)
    horizon = nmm.Horizon(robot, plan, keeps, LIMITS, dt=0.1)
    run = horizon.run(START, 2.0 * plan.duration, nmm.Goal(0.002, 0.002))
    assert run.complete
    check(run)


def test_what_cannot_be_escaped_is_told(robot):
    """At 20 m/s it runs over the robot within half a second; no inputs lead out of its way."""
    bullet = nmm.Obstacle(nmm.Sphere(1.0), motion=lambda t: [10.0 - 20.0 * t, 0.0, 0.3], name="bullet")
    task = nmm.Task(nmm.Position("ee", "xy"), [3.0, 0.0])
    horizon = nmm.Horizon(robot, task, nmm.Collisions(0.03, False, [bullet]), LIMITS)
    assert np.array_equal(horizon(0.0, robot.q(START)), np.zeros(robot.n_u))
    assert not horizon.solved
    run = horizon.run(START, 0.2)
    assert the(run, "horizon_unsolved").values == {"samples": 4, "of": 4}
    assert np.array_equal(run.u, np.zeros_like(run.u))


def test_obstacles_that_are_set_go_on_as_they_were_set(robot):
    """The robot is where it is to be: it moves out of the way of what comes nearer, and of nothing else."""
    post = nmm.Obstacle(nmm.Cylinder(0.3, 1.8), name="post")
    tip = nmm.Configuration(robot, robot.q(START)).placement("ee").translation
    task = nmm.Task(nmm.Position("ee", "xy"), tip[:2])
    first = []
    for velocity in (0.0, -0.5):
        post.move_to([0.0, 2.2, 0.9], [0.0, velocity, 0.0])
        horizon = nmm.Horizon(robot, task, nmm.Collisions(0.03, False, [post]), LIMITS)
        first.append(np.abs(horizon(0.0, robot.q(START))).max())
        assert horizon.solved
    assert first[0] < 1e-3
    assert first[1] > 0.02


@pytest.mark.parametrize(
    ("goal", "options"),
    [
        ({"x": 1.0, "y": 1.0, "theta": 0.0}, {}),
        (nmm.Task(nmm.Position("ee", "xy"), [1.0, 0.0]), {"dt": 0.3}),
        (
            nmm.Task(nmm.Position("ee", "xy"), [1.0, 0.0]),
            {"limits": nmm.Limits(bounds=nmm.Bound(nmm.LinearCoordinates("q1"), -1, 1))},
        ),
        ([1.0, 2.0], {}),
    ],
)
def test_what_it_cannot_do_is_refused(robot, goal, options):
    with pytest.raises(nmm.InputError) as caught:
        nmm.Horizon(robot, goal, **options)
    assert str(caught.value).startswith("horizon")
