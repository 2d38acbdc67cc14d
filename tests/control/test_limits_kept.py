"""Limits are kept: long random motions, starts outside, every kind of limit, each resolver's own optimum."""

from __future__ import annotations

import math
from collections.abc import Callable

import daqp
import numpy as np
import pytest
from findings import codes, the
from wandering import DT, ROBOTS, beyond, wander, wanderer

import nmm
from nmm.control.integrators import integrator
from nmm.control.limits import bounds
from nmm.control.resolvers.answer import Status
from nmm.model.robots.robot import Robot

Array = np.ndarray
ROBOT = nmm.load("unicycle_3r")
START = ROBOT.q({"q1": 0.3, "q2": 0.5, "q3": 0.4})
SPARE = nmm.Quadratic(nmm.QuadraticTerm("q1"), nmm.QuadraticTerm("q2"))


def towards(
    target: tuple[float, float],
    limits: nmm.Limits | None,
    resolver: nmm.extending.Resolver | None = None,
    robot: Robot = ROBOT,
    **more: object,
) -> nmm.Controller:
    task = nmm.Task(nmm.Position("ee", "xy"), nmm.Constant(target))
    resolver = nmm.ProjectedGradient(alpha=1.0) if resolver is None else resolver
    return nmm.Controller(robot, task, resolver, SPARE, limits=limits, dt=DT, **more)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("name", "method"),
    [
        *((name, "zoh") for name in ROBOTS),
        *((next(iter(ROBOTS)), method) for method in ("rk4", "zoh_midpoint")),
    ],
)
def test_a_random_motion_keeps_position_velocity_and_acceleration(name: str, method: str) -> None:
    controller, q0 = wanderer(name)
    broken = wander(controller, q0, 1000 if method == "zoh" else 500, method=method)
    assert max(broken) <= 1e-11


@pytest.mark.parametrize("method", ["rk4", "midpoint", "euler", "zoh"])
def test_stages_keep_the_samples_bounds(method: str) -> None:
    """Whatever an integrator averages, each stage's inputs are within what the sample found."""
    controller = towards((3.0, 2.0), nmm.Limits({"platform": 0.5, "arm": 0.8}, acceleration=2.0))
    advance = integrator(method, ROBOT, 1e-9)
    q = START.copy()
    problem = controller.solver.step_memory.problem
    for k in range(100):
        u = controller(k * DT, q)
        bounds = np.column_stack([problem.u_lower, problem.u_upper])
        seen: list[float] = []

        def velocity(t: float, q: Array, bounds: Array = bounds, seen: list[float] = seen) -> Array:
            found = controller.velocity(t, q)
            np.testing.assert_array_equal(np.column_stack([problem.u_lower, problem.u_upper]), bounds)
            seen.append(beyond(controller._u, bounds))
            return found

        q_dot = controller.last(k * DT, q).q_dot
        q = advance.advance(velocity, k * DT, q, q_dot, u, DT)
        np.testing.assert_array_equal(controller.solver.before, u)
        assert max(seen, default=0.0) == 0.0
    assert len(seen) == {"rk4": 3, "midpoint": 1}.get(method, 0)


def moved(q: Array, angle: float, shift: Array) -> Array:
    c, s = math.cos(angle), math.sin(angle)
    xy = np.array([[c, -s], [s, c]]) @ q[:2] + shift
    return np.concatenate([xy, [q[2] + angle], q[3:]])


@pytest.mark.parametrize("kind", ["pg", "rg"])
def test_commands_do_not_change_when_the_world_frame_moves(kind: str) -> None:
    resolver = {"pg": nmm.ProjectedGradient(alpha=1.0), "rg": nmm.ReducedGradient(alpha=1.0)}[kind]
    limits = nmm.Limits({"platform": 0.6, "arm": 0.8}, acceleration=2.0, wheels=12.0)
    angle, shift = 0.8, np.array([2.0, -3.0])
    target = np.array([2.5, -1.5])
    there = moved(np.append(target, 0.0), angle, shift)[:2]
    one, other = (towards(tuple(at), limits, resolver) for at in (target, there))
    q, scaled = START.copy(), 0
    for k in range(200):
        u = one(k * DT, q)
        np.testing.assert_allclose(other(k * DT, moved(q, angle, shift)), u, rtol=0, atol=1e-9)
        step = one.last(k * DT, q)
        scaled += step.scale[0] < 1.0
        q = q + DT * step.q_dot
    assert scaled > 20


@pytest.mark.parametrize("resolver", [nmm.ProjectedGradient(alpha=1.0), nmm.ReducedGradient(alpha=1.0)])
def test_where_nothing_binds_the_inputs_are_the_unlimited_ones_to_the_bit(
    resolver: nmm.extending.Resolver,
) -> None:
    wide = nmm.Limits({"platform": 1e3, "arm": 1e3}, acceleration=1e6, wheels=1e6)
    free, kept = towards((1.5, 0.5), None, resolver), towards((1.5, 0.5), wide, resolver)
    q = START.copy()
    for k in range(100):
        np.testing.assert_array_equal(kept(k * DT, q), free(k * DT, q))
        step = kept.last(k * DT, q)
        assert step.scale[0] == 1.0
        assert step.status is Status.SOLVED
        q = q + DT * step.q_dot


def optimum(B: Array, free: Array, J: Array, asked: Array, A: Array, lower: Array, upper: Array) -> Array:
    """min ‖B (u - free)‖ with J u = asked and lower <= A u <= upper, by a quadratic program."""
    H = B.T @ B
    sense = np.append(np.zeros(len(A), dtype=np.int32), np.full(len(J), 5, dtype=np.int32))
    u, _, flag, _ = daqp.solve(
        *(H, -H @ free, np.ascontiguousarray(np.vstack([A, J]))),
        *(np.append(np.clip(upper, -1e30, 1e30), asked), np.append(np.clip(lower, -1e30, 1e30), asked)),
        sense,
        primal_tol=1e-10,
    )
    assert flag == 1
    return np.array(u)


def metric(kind: str, step: nmm.extending.Step, controller: nmm.Controller) -> Array:
    m = step.J.shape[1]
    if kind == "pg weighted":
        return np.diag(np.sqrt([4.0, 4.0, 1.0, 1.0, 1.0]))
    if kind == "rg":
        basic = list(step.partition)
        rest = [j for j in range(m) if j not in basic]
        return np.vstack([np.linalg.solve(step.J[:, basic], step.J), np.eye(m)[rest]])
    if kind == "ej":
        scales = np.append(
            controller.solver.step_memory.problem.row_scales,
            controller.solver.step_memory.problem.added_row_scales,
        )
        return np.vstack([step.J, controller.solver.step_memory.problem.added_J]) / scales[:, None]
    return np.eye(m)


RESOLVERS: dict[str, Callable[[], nmm.extending.Resolver]] = {
    "pg": lambda: nmm.ProjectedGradient(alpha=1.0),
    "pg weighted": lambda: nmm.ProjectedGradient(alpha=1.0, weights={"platform": 4.0}),
    "rg": lambda: nmm.ReducedGradient(alpha=1.0),
    "ej": nmm.ExtendedJacobian,
    "callable": lambda: nmm.CallableResolver(lambda p: np.linalg.pinv(p.J) @ p.rate),
}


@pytest.mark.parametrize("kind", RESOLVERS)
def test_each_resolver_finds_its_own_optimum(kind: str) -> None:
    """Against a quadratic program at the same λ; λ itself is the business of test_limits_kernel.py."""
    limits = nmm.Limits({"platform": [-0.4, 0.7], "arm": 0.8}, acceleration=4.0, wheels=20.0)
    added = nmm.Task(nmm.LinearCoordinates("q1", "q2", "q3"), nmm.Constant([0.2, 0.9, -0.6]))
    more = {"added_task": added} if kind == "ej" else {}
    free = towards((2.5, 1.5), None, RESOLVERS[kind](), **more)
    kept = towards((2.5, 1.5), limits, RESOLVERS[kind](), **more)
    problem = kept.solver.step_memory.problem
    q, bound = START.copy(), 0
    rng = np.random.default_rng(3)
    for k in range(150):
        if k % 10 == 0:
            kept.solver.before[:] = rng.uniform(-0.3, 0.3, 5)
        unlimited = free(0.0, q)
        u = kept(0.0, q)
        step, plain = kept.last(0.0, q), free.last(0.0, q)
        assert step.status in (Status.SOLVED, Status.RELAXED)
        np.testing.assert_array_equal(step.partition, plain.partition)
        A = np.vstack([np.eye(5), problem.limit_rows])
        lower, upper = (np.append(problem.u_lower, problem.lower), np.append(problem.u_upper, problem.upper))
        # u_ref: the limits' point nearest to rest
        rest = optimum(np.eye(5), np.zeros(5), np.zeros((0, 5)), np.zeros(0), A, lower, upper)
        way = step.J @ (unlimited - rest)
        scale = min(1.0, way @ step.J @ (u - rest) / (way @ way))
        asked = step.J @ rest + scale * way
        B = metric(kind, step, kept)
        np.testing.assert_allclose(step.J @ u, asked, rtol=0, atol=1e-8)
        expected = optimum(B, unlimited, step.J, asked, A, lower, upper)
        own, best = (np.linalg.norm(B @ (x - unlimited)) for x in (u, expected))
        assert own <= best + 1e-7 * (1.0 + best)
        np.testing.assert_allclose(u, expected, rtol=0, atol=1e-5)
        bound += step.scale[0] < 1.0 or not np.array_equal(u, unlimited)
        q = q + DT * step.q_dot
    assert bound > 30


@pytest.mark.parametrize("acceleration", [None, 2.0])
def test_a_joint_outside_its_limits_comes_back_at_the_stated_speed(acceleration: float | None) -> None:
    limits = nmm.Limits({"arm": 2.0}, {"q1": [-0.5, 0.5]}, acceleration, recovery=0.4)
    controller = towards((2.0, 0.5), limits)
    q = ROBOT.q({"q1": 1.1, "q2": 0.5, "q3": 0.4})
    seen = [q[3]]
    for k in range(300):
        q = q + DT * controller(k * DT, q)[[0, 0, 1, 2, 3, 4]] * [0, 0, 1, 1, 1, 1]
        seen.append(q[3])
    outside = np.array(seen)[: 1 + int(np.argmax(np.array(seen) <= 0.5 + 1e-12))]
    assert np.all(np.diff(outside) < 0.0)
    speed = -np.diff(outside) / DT
    cruising = speed[30:-2]
    assert np.all(cruising >= 0.4 - 1e-9)  # at least: the task may want more
    assert len(outside) <= 0.6 / 0.4 / DT + 30
    assert max(seen[len(outside) :]) <= 0.5 + 1e-12


def test_bounds_of_far_limits_need_no_search(monkeypatch: pytest.MonkeyPatch) -> None:
    """`approach` is cut short where it exceeds the velocity wanted for certain: the bounds are the same."""
    rng = np.random.default_rng(3)
    whole, short = bounds.approach, 0
    for _ in range(3000):
        dt, A, samples = 10.0 ** rng.uniform([-3.0, -2.0, -1.0], [0.0, 3.0, 2.0])
        room = 0.5 * A * (samples * dt) ** 2
        fastest = A * dt * max(samples - rng.uniform(-0.5, 1.5), 0.0)  # about what can just be braked
        exact = whole(room, dt, A, 0.1)
        found = whole(room, dt, A, 0.1, fastest)
        assert min(found, fastest) == pytest.approx(min(exact, fastest), rel=1e-12, abs=0.0)
        short += math.isinf(found)
    assert short > 300

    def every_bound() -> list[Array]:
        found = []
        for seed in range(5):
            stops = {"q1": [-1.0, 0.5], "q2": [-0.3, 2.0], "q3": [0.0, 0.2]}
            controller = towards((3.0, 2.0), nmm.Limits({"arm": 0.8}, stops, acceleration=2.0))
            solver, rng = controller.solver, np.random.default_rng(seed)
            limits, problem = solver.step_memory.limits, solver.step_memory.problem
            for _ in range(100):
                solver.before[:] = rng.uniform(-0.9, 0.9, ROBOT.n_u)
                q = np.append(np.zeros(3), rng.uniform([-1.1, -0.4, -0.1], [0.6, 2.1, 0.3]))
                bounds.bound_inputs.__wrapped__(limits, q, problem)
                found.append(np.concatenate([problem.u_lower, problem.u_upper, problem.stops]))
        return found

    cut = every_bound()
    monkeypatch.setattr(bounds, "approach", lambda *given: whole(*given[:4]))
    np.testing.assert_allclose(cut, every_bound(), rtol=1e-12, atol=0.0)


def test_the_way_back_is_no_faster_than_the_velocity_limit() -> None:
    controller = towards((2.0, 0.5), nmm.Limits({"q1": 0.05}, {"q1": [-0.5, 0.5]}))
    assert controller(0.0, ROBOT.q({"q1": 1.1, "q2": 0.5, "q3": 0.4}))[2] == -0.05


def test_the_way_back_into_a_point_does_not_overshoot() -> None:
    limits = nmm.Limits(False, {"q1": [0.5, 0.5]}, 2.0, recovery=0.5)
    controller = towards((2.0, 0.5), limits)
    q = ROBOT.q({"q1": 0.8, "q2": 0.5, "q3": 0.4})
    for k in range(400):
        q[3] += DT * controller(k * DT, q)[2]
        assert q[3] >= 0.5 - 1e-12
    assert q[3] <= 0.5 + 1e-9


def test_position_wins_over_a_least_speed() -> None:
    """A platform joint that must not stand still stops at its limit all the same."""
    controller = towards((2.0, 0.5), nmm.Limits({"q1": [0.2, 1.0]}, {"q1": [-2.0, 0.5]}, 2.0))
    q = START.copy()
    for k in range(300):
        q[3] += DT * controller(k * DT, q)[2]
        assert q[3] <= 0.5 + 1e-12
    assert q[3] == pytest.approx(0.5, abs=1e-9)


def test_limits_too_large_to_mean_anything_are_none() -> None:
    for large in (1e5, 1e6, np.inf):
        kept = nmm.Limits({"v": np.inf}, {"q1": [-large, large]}).on(ROBOT)
        assert np.all(np.isinf(kept.coordinates[3]))
        assert np.all(np.isinf(kept.inputs[0]))


def test_a_run_starts_outside_the_robots_own_limits_where_they_are_kept() -> None:
    scenario = nmm.Scenario.load("tiago_pose")
    robot = scenario.robot()
    name = "arm_2_joint"
    j = robot.coordinate(name)
    q0 = robot.q(scenario.parts.q0)
    q0[j] = robot.q_limits[j, 1] + 0.05
    kept = nmm.Controller(
        robot, scenario.controller().task, nmm.ProjectedGradient(alpha=1.0), limits=nmm.Limits()
    )
    run = nmm.simulate(kept, q0, 2.0, 0.01)
    outside = run.q[:, j] - robot.q_limits[j, 1]
    assert np.all(np.diff(outside[outside > 0.0]) < 0.0)
    assert outside[60] <= 1e-12  # 0.05 rad at 0.1 rad/s
    (outside_at_first,) = the(run, "start_outside_limits").values["outside"]
    assert name in outside_at_first
    free = nmm.Controller(robot, kept.task, nmm.ProjectedGradient(alpha=1.0))
    with pytest.raises(nmm.InputError, match=name):
        nmm.simulate(free, q0, 2.0, 0.01)
    velocities = nmm.Controller(robot, kept.task, kept.resolver, limits=nmm.Limits(position=False))
    with pytest.raises(nmm.InputError, match=name):
        nmm.simulate(velocities, q0, 2.0, 0.01)


def test_the_recorded_scale_is_the_share_of_the_rate_also_where_rest_is_not_allowed() -> None:
    """At full speed under acceleration limits λ counts from inputs that do most of the task."""
    kept = towards((6.0, 0.5), nmm.Limits({"platform": 0.6, "arm": 0.8}, acceleration=2.0))
    q, shares = START.copy(), []
    for k in range(300):
        u = kept(k * DT, q)
        step = kept.last(k * DT, q)
        missed = np.linalg.norm(step.J @ u - step.rate) / np.linalg.norm(step.rate)
        assert step.scale[0] == pytest.approx(max(0.0, 1.0 - missed) if missed > 1e-9 else 1.0, abs=1e-9)
        shares.append(step.scale[0])
        q = q + DT * step.q_dot
    assert 0.0 < min(shares[100:]) < 1.0


def test_without_limits_the_closed_loop_has_none() -> None:
    """Calls and stages are a controller's without limits, whatever bounds the sample before had."""
    limited = towards((3.0, 0.0), nmm.Limits({"platform": 0.05, "arm": 0.05}, acceleration=1.0))
    free = towards((3.0, 0.0), None)
    limited(0.0, START)
    with limited.without_limits():
        np.testing.assert_array_equal(limited.velocity(0.0, START), free.velocity(0.0, START))
        np.testing.assert_array_equal(limited(0.0, START), free(0.0, START))
    assert np.abs(limited(0.0, START)).max() <= 0.05


def test_a_start_from_rest_is_not_warned_about() -> None:
    """λ says it; what limits take away later is told, with its own time."""
    robot = nmm.load("unicycle_3r")

    def run(velocity: bool | dict[str, float]) -> nmm.Trajectory:
        task = nmm.Task(nmm.Position("ee", "xy"), nmm.Circle([2, 0], 1.0, rate=0.3))
        limits = nmm.Limits(velocity, acceleration=2.0)
        controller = nmm.Controller(robot, task, nmm.ProjectedGradient(), limits=limits, dt=0.01)
        return nmm.simulate(controller, {"q1": 0.3, "q2": 0.6}, 6.0, 0.01)

    free = run(False)
    assert free.unmet.samples > 0
    assert free.scale.min() < 0.1
    assert "inputs_unmet" not in codes(free)
    slow = run({"platform": 0.3, "arm": 0.3})
    assert the(slow, "inputs_unmet").where["t"] > 0.1


@pytest.mark.parametrize("velocity", [True, {"v": 1.0}, {"v": [0.2, 0.2], "omega": [-1.0, np.inf]}])
def test_inputs_without_a_velocity_limit_are_named(velocity: bool | dict[str, object]) -> None:
    """An arm on a platform without wheels: limits of velocity leave the platform alone, and say so."""
    robot = nmm.load("small_arm", platform="unicycle")
    task = nmm.Task(nmm.Position("ee", "xy"), nmm.Circle([2, 0], 1.0, rate=0.3))
    controller = nmm.Controller(robot, task, nmm.ProjectedGradient(), limits=nmm.Limits(velocity), dt=0.01)
    run = nmm.simulate(controller, {"q1": 0.3, "q2": 0.6}, 0.1, 0.01)
    stated = {*(velocity if isinstance(velocity, dict) else {})}
    platform = [name for name in robot.groups["platform"] if name not in stated]
    assert [name for name in run.summary()["without_velocity_limit"] if name in {"v", "omega"}] == platform


def test_inputs_that_wheels_bound_are_not_named() -> None:
    """Two wheels of 30 rad/s bound v and omega; a car's bound v, and its steering joint the rest."""
    for name, arm in (("unicycle_3r", None), ("car_base", "small_arm")):
        robot = nmm.load(name) if arm is None else nmm.mount(name, arm, at="arm_mount")
        task = nmm.Task(nmm.Position("ee", "xy"), nmm.Circle([2, 0], 1.0, rate=0.3))
        controller = nmm.Controller(robot, task, nmm.ProjectedGradient(), limits=nmm.Limits(), dt=0.01)
        run = nmm.simulate(controller, {"q1": 0.3, "q2": 0.6}, 0.1, 0.01)
        assert run.summary()["without_velocity_limit"] == []


@pytest.mark.parametrize(
    "resolver",
    [
        nmm.ProjectedGradient(),
        nmm.ReducedGradient(),
        nmm.DampedLeastSquares(),
        nmm.CallableResolver(lambda problem: np.linalg.pinv(problem.J) @ problem.rate),
    ],
    ids=lambda resolver: resolver.name,
)
def test_no_limit_is_active_where_the_inputs_are_within_all(resolver: nmm.extending.Resolver) -> None:
    robot = nmm.load("unicycle_2r")
    there = robot.q({"q2": 0.5})
    target = nmm.evaluate(nmm.Position("ee", "xy"), 0.0, nmm.Configuration(robot, there)).value
    limits = nmm.Limits(velocity={"platform": 0.1, "arm": 0.1})
    controller = nmm.Controller(
        robot, nmm.Task(nmm.Position("ee", "xy"), target), resolver, limits=limits, dt=0.01
    )
    active = controller.solver.step_memory.problem.active
    controller(0.0, robot.q({"x": -2.0, "q2": 0.5}))
    assert active[0] > 0
    controller(0.01, there)
    assert active[0] == 0
