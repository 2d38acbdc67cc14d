"""`controller.stop`: from any motion to rest within the limits, and how near that is to the least time."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import linprog
from wandering import DT, beyond, wanderer

import nmm
from nmm.model.robots.zero_order_hold import HeldInputs

Array = np.ndarray
TOLERANCE = 1e-9


def stopped(controller: nmm.Controller, q: Array, most: int = 400) -> tuple[Array, Array]:
    """The inputs (N, m), the last ones 0, and configurations (N + 1, n) of a stop from where it is."""
    held, qs, us = HeldInputs(controller.robot), [q], []
    for k in range(most):
        us.append(controller.stop(k * DT, qs[-1]))
        qs.append(held(qs[-1], us[-1], DT))
        if not us[-1].any():
            return np.array(us), np.array(qs)
    raise AssertionError(f"still moves after {most} samples: {us[-1]}")


def least_samples(controller: nmm.Controller, q: Array, u: Array, most: int) -> int:
    """The fewest samples in which inputs can be 0, by linear programs over all of them: limits of velocity,
    acceleration, wheels and joints hold at each sample, and after it."""
    robot, kept = controller.robot, controller.solver.limits_on
    m, change, one = robot.n_u, kept.accelerations * DT, np.eye(robot.n_u)
    wheels = controller.solver.step_memory.problem.limit_rows[: len(kept.spin)].copy()
    if np.any(kept.wheels[:, 4] >= 0.0):  # rows that turn with the steering: without them, a lower bound
        wheels = wheels[:0]
    moved = robot.rate_coordinates
    joints = [j for j in range(m) if moved[j] >= 0]
    low, high = kept.coordinates[moved[joints]].T
    turned, spin = q[moved[joints]], kept.spin[: len(wheels)]
    rows: list[Array] = []
    upper: list[Array] = []
    for count in range(1, most + 1):
        k = count - 1
        before = [] if k == 0 else [(k - 1, -one)]
        for sign in (1.0, -1.0):
            rows += [placed([(k, sign * one), *((i, sign * x) for i, x in before)], m, most)]
            upper += [change + (sign * u if k == 0 else 0.0)]
            rows += [placed([(k, sign * wheels)], m, most)]
            upper += [spin]
            rows += [placed([(i, sign * DT * one[joints]) for i in range(count)], m, most)]
            upper += [high - turned if sign > 0.0 else turned - low]
        A, b = np.vstack(rows)[:, : count * m], np.concatenate(upper) + 1e-9
        box = [tuple(ends) for ends in np.tile(kept.inputs, (count, 1))]
        last, known = placed([(k, one)], m, count), np.isfinite(b)
        given = np.zeros(count * m), A[known], b[known], last, np.zeros(m), box
        if linprog(*given, method="highs").status == 0:
            return count
    raise AssertionError(f"no way to rest in {most} samples")


def placed(blocks: list[tuple[int, Array]], m: int, count: int) -> Array:
    """Rows over the inputs of `count` samples, with these blocks at their samples."""
    found = np.zeros((len(blocks[0][1]), count * m))
    for k, block in blocks:
        found[:, k * m : (k + 1) * m] += block
    return found


def moving(name: str, seed: int, order: int = 1) -> tuple[nmm.Controller, Array, Array]:
    """A controller, q and u in the middle of a random motion."""
    controller, q0 = wanderer(name, order)
    (task,) = controller.task
    rng, held, q = np.random.default_rng(seed), HeldInputs(controller.robot), q0
    u = np.zeros(controller.robot.n_u)
    for k in range(60 + 17 * seed):
        if k % 40 == 0:
            task.reference.set(q0[:3] + rng.uniform(-3.0, 3.0, 3))
        if order == 1:
            u = controller(k * DT, q)
            q = held(q, u, DT)
        else:
            u_dot = controller(k * DT, q, u)
            q, u = held(q, u, DT, u_dot), u + DT * u_dot
    return controller, q, u


def breaks(controller: nmm.Controller, u: Array, us: Array, qs: Array) -> float:
    """By how much the inputs of a stop from u, and where they bring the robot, are beyond the limits."""
    kept, own = controller.solver.limits_on, controller.robot.following.independent
    change = kept.accelerations * DT
    steps = np.diff(np.vstack([u, us]), axis=0)
    return max(
        *(beyond(one, np.column_stack([-change, change])) for one in steps),
        *(beyond(one, kept.inputs) for one in us),
        *(beyond(one[own], kept.coordinates[own]) for one in qs),
    )


@pytest.mark.parametrize("name", ["unicycle_3r_position", "tiago_pose", "kinova_car"])
def test_every_sample_of_a_stop_keeps_the_limits_in_the_least_time(name: str) -> None:
    for seed in range(2):
        controller, q, u = moving(name, seed)
        us, qs = stopped(controller, q)
        assert breaks(controller, u, us, qs) <= TOLERANCE
        assert np.abs(u).max() > 0.1
        assert len(us) == least_samples(controller, q, u, len(us))


def test_at_order_2_a_stop_ends_at_rest_too() -> None:
    controller, q, u = moving("unicycle_3r_position", 1, order=2)
    kept, held, us = controller.solver.limits_on, HeldInputs(controller.robot), [u]
    while us[-1].any() and len(us) < 200:
        u_dot = controller.stop(0.0, q, us[-1])
        assert np.all(np.abs(u_dot) <= kept.accelerations * (1 + TOLERANCE))
        q = held(q, us[-1], DT, u_dot)
        us.append(us[-1] + DT * u_dot)
        us[-1][np.abs(us[-1]) < 1e-15] = 0.0
        assert beyond(us[-1], kept.inputs) <= TOLERANCE
    needed = np.ceil(np.abs(u) / (kept.accelerations * DT) - TOLERANCE).max()
    assert len(us) - 1 == needed > 5


def towards_pillar() -> nmm.Controller:
    """A robot that drives at a pillar 1 m ahead."""
    robot = nmm.load("unicycle_3r")
    task = nmm.Task(nmm.Position("ee", "xy"), [3.0, 0.2], speed=0.8)
    limits = nmm.Limits({"platform": 1.0, "arm": 1.0}, acceleration={"platform": 1.0, "arm": 4.0})
    pillar = nmm.Obstacle(nmm.Box([0.3, 0.6, 1.0]), [1.6, 0.0, 0.5], name="pillar")
    collisions = nmm.Collisions(0.03, obstacles=[pillar])
    return nmm.Controller(robot, task, nmm.ProjectedGradient(), limits=limits, dt=DT, collisions=collisions)


@pytest.mark.parametrize("driven", [60, 100, 140])
def test_a_stop_keeps_distances_on_its_way(driven: int) -> None:
    controller = towards_pillar()
    held, q, u = HeldInputs(controller.robot), controller.robot.q({"q1": 0.3, "q2": 0.6}), np.zeros(5)
    for k in range(driven):
        u = controller(k * DT, q)
        q = held(q, u, DT)
    us, qs = stopped(controller, q)
    assert breaks(controller, u, us, qs) <= TOLERANCE
    scene = controller.solver.scene
    assert scene is not None
    every = range(len(scene.names))
    assert min(scene.queries.distances(0.0, one, every).min() for one in qs) >= 0.03 - 1e-6
    alone = np.ceil(np.abs(u) / (controller.solver.limits_on.accelerations * DT) - TOLERANCE).max()
    assert alone <= len(us) <= 1.1 * alone


def test_a_loop_among_obstacles_records_where_they_were() -> None:
    controller = towards_pillar()
    loop, held = nmm.Loop(controller, keep=40), HeldInputs(controller.robot)
    q = controller.robot.q({"q1": 0.3, "q2": 0.6})
    for k in range(60):
        q = held(q, loop.step(k * DT, q), DT)
    run = loop.trajectory()
    assert len(run) == 40
    assert run.obstacles[0].name == "pillar"
    assert controller.solver.scene is not None
    every = range(len(controller.solver.scene.names))
    last = controller.solver.scene.queries.distances(0.0, run.q[-1], every).min()
    assert run.clearance[-1] == pytest.approx(last, abs=1e-9)


def test_a_stop_needs_no_task_and_no_answer() -> None:
    """Where the task has no value the controller refuses, and the stop goes on."""
    robot = nmm.load("unicycle_3r")
    target = nmm.LiveTarget([1.0, 0.5])
    limits = nmm.Limits({"platform": 1.0, "arm": 1.0}, acceleration=2.0)
    task = nmm.Task(nmm.Position("ee", "xy"), target)
    controller = nmm.Controller(robot, task, nmm.ProjectedGradient(), limits=limits, dt=DT)
    q, held, u = robot.q({"q2": 0.6}), HeldInputs(robot), np.zeros(5)
    for k in range(30):
        u = controller(k * DT, q)
        q = held(q, u, DT)
    controller.solver.step_memory.task.gain[:] = np.nan
    with pytest.raises(nmm.SingularError):
        controller(0.3, q)
    us, qs = stopped(controller, q)
    assert breaks(controller, u, us, qs) <= TOLERANCE
    assert len(us) == least_samples(controller, q, u, len(us))


def test_beyond_a_limit_a_stop_stays_and_a_call_returns() -> None:
    robot = nmm.load("unicycle_3r")
    limits = nmm.Limits(position={"q1": [-0.5, 0.5]}, acceleration=2.0)
    task = nmm.Task(nmm.Position("ee", "xy"), [1.0, 0.5])
    controller = nmm.Controller(robot, task, nmm.ProjectedGradient(), limits=limits, dt=DT)
    q = robot.q({"q1": 0.6, "q2": 0.6})
    assert controller.stop(0.0, q).tolist() == [0.0] * 5
    for k in range(10):
        returned = controller(k * DT, q)
    assert returned[2] == pytest.approx(-0.1)
    assert controller.limits is not None
    assert controller.solver.step_memory.limits.recovery == controller.limits.recovery


def test_without_limits_a_stop_is_zero_and_bad_input_is_told() -> None:
    robot = nmm.load("unicycle_3r")
    task = nmm.Task(nmm.Position("ee", "xy"), [1.0, 0.5])
    controller = nmm.Controller(robot, task, nmm.ProjectedGradient())
    q = robot.q({"q2": 0.6})
    assert controller(0.0, q).any()
    assert not controller.stop(0.0, q).any()
    for t, wrong in ((0.0, q[:3]), (0.0, q * np.nan), (np.nan, q)):
        with pytest.raises(nmm.InputError):
            controller.stop(t, wrong)
    needs = nmm.Controller(robot, task, nmm.ProjectedGradient(), limits=nmm.Limits(acceleration=1.0))
    with pytest.raises(nmm.InputError, match="dt"):
        needs.stop(0.0, q)
