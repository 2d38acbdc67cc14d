"""Smooth motions: checked by Coal, differences against S(q) u, the limits; derivatives by differences."""

import numpy as np
import pytest

import nmm
from nmm.model.robots.wheel_rates import turning_wheels
from nmm.model.robots.zero_order_hold import inputs_of
from nmm.plugins.planning.prepared import Asked, Prepared
from nmm.plugins.planning.samples import flow
from nmm.plugins.planning.search import PlanSearch
from nmm.plugins.planning.search_space import USUAL
from nmm.plugins.planning.smoothing import Smoothing

LIMITS = nmm.Limits(velocity={"platform": 1.0, "arm": 1.5}, acceleration={"platform": 1.0, "arm": 3.0})
WALL = nmm.Obstacle(nmm.Box([0.2, 4.0, 2.0]), [3.0, 0.0, 0.5], name="wall")
BEHIND = {"x": 6.0, "y": 0.0, "theta": 0.5}
START = {"unicycle_3r": {"q1": 0.5, "q2": -0.4}}
PLATFORMS = [
    ("unicycle_3r", None),
    ("unicycle_3r", "omnidirectional"),
    ("differential_base", None),
]


def planned(name, platform=None, smooth=True, goal=BEHIND, **options):
    robot = nmm.load(name, platform=platform)
    start = START.get(name, robot.rest)
    return nmm.plan(robot, start, goal, [WALL], limits=LIMITS, smooth=smooth, **options)


def check(plan, samples=400):
    """Distances by Coal, S(q) u by differences of order 4 within samples, and the limits."""
    robot, motion = plan.robot, plan.found.motion
    t = np.linspace(0.0, plan.duration, samples)
    q, u = plan(t)
    queries, pairs = plan.found.scene.queries, range(len(plan.found.scene.names))
    asked = np.minimum(0.03, queries.distances(0.0, q[0], pairs) - 0.002)
    for one in q:
        assert np.all(queries.distances(0.0, one, pairs) >= asked)
    assert not any(robot.outside(one) for one in q)
    h, begin = 1e-3, motion.samples.begin
    inner = t[np.abs(t[:, np.newaxis] - begin).min(axis=1) > 2.0 * h]
    assert len(inner) > samples / 2
    near, far = (plan(inner + d)[0] - plan(inner - d)[0] for d in (h, 2.0 * h))
    rate = (8.0 * near - far) / (12.0 * h)
    for one, at, inputs in zip(rate, *plan(inner), strict=True):
        assert np.allclose(one, robot.S(at) @ inputs, rtol=0.0, atol=1e-9)
    on, (_, ends) = LIMITS.on(robot), plan(begin)
    for inputs in (u, ends):
        assert np.all(inputs >= on.inputs[:, 0] - 1e-11)
        assert np.all(inputs <= on.inputs[:, 1] + 1e-11)
    assert np.all(np.abs(np.diff(ends, axis=0)) <= (on.accelerations + 1e-11) * np.diff(begin)[:, np.newaxis])
    # Inputs are straight lines between samples' ends, so that nothing is missed there.
    middle = plan(0.5 * (begin[1:] + begin[:-1]))[1]
    assert np.allclose(middle, 0.5 * (ends[1:] + ends[:-1]), rtol=0.0, atol=1e-12)
    assert np.allclose(plan(plan.stops)[1], 0.0, atol=1e-12)


@pytest.mark.parametrize(("name", "platform"), PLATFORMS)
def test_a_smooth_motion_keeps_all_and_takes_less_time(name, platform):
    plan, before = (planned(name, platform, smooth) for smooth in (True, False))
    assert plan.smooth
    assert not before.smooth
    # Wheels of 1 rad/s take so long that rests are a small part of it.
    assert plan.duration < (1.0 if name == "differential_base" else 0.9) * before.duration
    assert np.allclose(plan.end, before.end, rtol=0.0, atol=1e-9)
    assert np.array_equal(plan.corners[0], before.corners[0])
    check(plan)


def test_a_car_whose_path_is_bent_to_its_limits_is_smoothed_too():
    plan, before = (planned("car_base", "car", smooth) for smooth in (True, False))
    assert plan.smooth
    assert plan.duration < 2.0 / 3.0 * before.duration
    check(plan)


def test_what_wheels_bear_is_kept():
    robot = nmm.load("differential_base", platform="unicycle")
    limits = nmm.Limits(wheels=3.0, acceleration=1.0)
    plan = nmm.plan(robot, robot.rest, {"x": 1.0, "y": 1.0, "theta": 0.0}, limits=limits, smooth=True)
    assert plan.smooth
    q, u = plan(np.linspace(0.0, plan.duration, 500))
    _, rates = turning_wheels(robot, q, np.array([robot.S(a) @ b for a, b in zip(q, u, strict=True)]))
    assert 2.0 < np.abs(rates).max() <= 3.0 + 1e-11


def test_rates_of_wheels_without_limits_drive_as_fast_as_with_rests():
    robot = nmm.load("differential_base")
    accelerations = nmm.Limits(acceleration=20.0)
    plan = nmm.plan(robot, robot.rest, BEHIND, [WALL], limits=accelerations, smooth=True)
    assert plan.smooth
    assert np.abs(plan(np.linspace(0.0, plan.duration, 300))[1]).max() > 9.0


def test_a_smooth_motion_rests_at_way_points_alone():
    by = {"x": 1.5, "y": 3.0, "theta": 0.5}
    plan = planned("unicycle_3r", through=[by])
    assert plan.smooth
    assert len(plan.stops) == 3
    assert np.allclose(plan.corners[1, :2], (1.5, 3.0), atol=1e-9)
    check(plan)


def test_a_seed_gives_one_smooth_plan():
    a, b = (planned("unicycle_3r", seed=4) for _ in range(2))
    t = np.linspace(0.0, a.duration, 50)
    assert a.duration == b.duration
    assert np.array_equal(a(t)[0], b(t)[0])


def test_where_no_smooth_motion_is_found_the_one_with_rests_stands(monkeypatch):
    monkeypatch.setattr(Smoothing, "solved", lambda self, most: False)
    plan = planned("unicycle_3r")
    assert not plan.smooth
    assert plan.duration == planned("unicycle_3r", smooth=False).duration


def test_a_motion_that_would_touch_between_samples_is_found():
    """A post thinner than what is driven in a sample stands on the way between two of them."""
    plan = planned("unicycle_3r")
    samples = plan.found.motion.samples
    k = int(np.linalg.norm(np.diff(samples.q[:, :2], axis=0), axis=1).argmax())
    (between,), _ = plan([0.5 * (samples.begin[k] + samples.begin[k + 1])])
    post = nmm.Obstacle(nmm.Cylinder(0.002, 2.0), [*between[:2], 1.0], name="post")
    smoothing, path = prepared([WALL, post], plan)
    smoothing.begin(path)
    N, x = len(samples.a), smoothing.x
    assert len(x.a) == N
    x.q[:], x.u[:], x.a[:] = samples.q, samples.u, samples.a
    x.step[()] = samples.begin[1]
    assert 0 <= smoothing._first_blocked(*smoothing.check.blocks, *smoothing._own) <= k


def prepared(obstacles, plan):
    """The smoothing of the timed path of a plan's problem."""
    robot, before = plan.robot, planned("unicycle_3r", smooth=False)
    asked = Asked(nmm.Collisions(obstacles=obstacles), LIMITS, nmm.Goal(), smooth=True)
    search = PlanSearch(Prepared(robot, asked), before.corners[0], [BEHIND])
    return Smoothing(robot, search.limits, USUAL, search.check), before.found.motion


# Derivatives


@pytest.mark.parametrize("name", ["unicycle_3r", "car_base", "trailer_base", "omni_base"])
def test_where_a_sample_leads_is_differentiated_exactly(name):
    robot, rng = nmm.load(name), np.random.default_rng(3)
    inputs, n, m = inputs_of(robot), robot.n, robot.n_u
    x = np.concatenate([0.3 * rng.normal(size=n), rng.normal(size=2 * m)])

    def ahead(x, columns=0):
        out, D = np.zeros(n), np.zeros((n, columns))
        flow.py_func(inputs, x[:n].copy(), x[n : n + m], x[n + m :], 0.15, 4, out, D)
        return out, D

    _, D = ahead(x, n + 2 * m)
    for i, e in enumerate(1e-6 * np.eye(n + 2 * m)):
        assert np.allclose((ahead(x + e)[0] - ahead(x - e)[0]) / 2e-6, D[:, i], rtol=0.0, atol=1e-8)


def test_distances_are_differentiated_along_the_direction_between_two():
    """Of a motion past a post, which stands beside it here and there."""
    plan, errors = planned("unicycle_3r", smooth=False), []
    (places, _) = plan(plan.duration * np.array([0.2, 0.4, 0.6, 0.8]))
    for x, y, theta in places[:, :3]:
        beside = [x - 0.6 * np.sin(theta), y + 0.6 * np.cos(theta), 1.0]
        post = nmm.Obstacle(nmm.Cylinder(0.1, 2.0), beside, name="post")
        smoothing, path = prepared([WALL, post], plan)
        smoothing.begin(path)
        assert smoothing.solved()
        errors += derivative_errors(smoothing, plan.robot)
    assert len(errors) > 50
    assert np.median(np.abs(errors)) < 1e-3
    assert np.mean(np.abs(errors)) < 0.03


def derivative_errors(smoothing, robot):
    """Derivatives of the distances of near pairs less their differences by Coal, at the samples' ends."""
    x, queries = smoothing.x, smoothing.check.scene.queries
    B, w = len(x.column), len(x.spin)
    pairs, errors = range(len(x.room)), []
    for k in range(1, len(x.a)):
        near = np.flatnonzero(np.isfinite(x.c[k, B + 2 * w :]))
        for i, e in enumerate(1e-6 * np.eye(robot.n)):
            change = queries.distances(0.0, x.q[k] + e, pairs) - queries.distances(0.0, x.q[k] - e, pairs)
            errors += list(change[near] / 2e-6 - x.rows[k, 2 * w + near, i])
    return errors


# Scenarios


def test_a_scenario_may_ask_for_a_smooth_plan():
    scenario = nmm.Scenario.load("behind_the_wall")
    before = scenario.plan()
    plan = scenario.override("plan.smooth", True).plan()
    assert plan.smooth
    assert plan.duration < before.duration


def test_a_smooth_plan_is_followed_within_its_distances():
    """From 5 cm beside it, at 0.6 of its speed: at 0.8 it is too fast for its distance from the wall."""
    plan = planned("unicycle_3r", margin=0.05)
    assert plan.smooth
    kept = nmm.Collisions(0.03, obstacles=[WALL])
    controller = nmm.Controller(
        *(plan.robot, plan.reference(pace=0.6), nmm.ProjectedGradient()),
        limits=LIMITS,
        collisions=kept,
        dt=0.02,
        kinematics="compiled",
    )
    start = plan.corners[0] + [0.0, 0.05, 0.1, 0.0, 0.0, 0.0]
    run = nmm.simulate(controller, start, plan.duration / 0.6 + 3.0, 0.02, "zoh")
    assert run.complete
    assert run.clearance_between.min() >= 0.03
    assert np.abs(run.q[-1] - plan.end).max() < 2e-3


def test_a_smooth_plan_goes_on_smooth():
    """From beside it, in less than what is left of it with rests; and round a post that stands on it now."""
    plan = planned("unicycle_3r")
    (q,), _ = plan(0.4 * plan.duration)
    for obstacles in (None, [WALL, nmm.Obstacle(nmm.Cylinder(0.1, 2.0), [5.0, 1.0, 0.5], name="post")]):
        on = nmm.replan(plan, q + np.array([0.0, 0.02, 0.05, 0.0, 0.0, 0.0]), obstacles)
        assert on.smooth
        check(on)
        off = on.end - plan.end
        assert np.abs([*off[:2], np.sin(0.5 * off[2]), *off[3:]]).max() < 1e-9
        assert on.duration < plan.duration
