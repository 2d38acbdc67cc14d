"""Damped least squares between stops: against quadratic programs; arms that come to rest at their stops."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import daqp
import numpy as np
import pytest
from findings import the
from numpy.typing import NDArray

import nmm
from nmm.base.kernels.record_layout import Memory, views
from nmm.control.resolvers.answer import Answer, AnswerArrays, unanswered
from nmm.control.resolvers.base import ANSWER, resolve_one
from nmm.control.resolvers.problem import Problem
from nmm.control.resolvers.problem_arrays import LOWER, UPPER

Array = NDArray[np.float64]


def between_stops(resolver: nmm.extending.Resolver, problem: Problem) -> Array:
    """The inputs where every bound of the problem is a stop."""
    memory, arrays = Memory(), problem.arrays
    arrays.stops[:] = UPPER + LOWER
    memory.add(arrays)
    memory.add(unanswered(problem.dimensions.m, len(problem.dimensions.levels)))
    blocks, setup = memory.blocks(), resolver.setup(problem.dimensions)
    state = resolver.start(problem.dimensions).memory
    resolve_one(resolver.kernel.address, *blocks, setup.numbers, setup.options, state)
    return Answer.of(views(AnswerArrays, *blocks, ANSWER)).u


@pytest.mark.parametrize("weighted", [False, True])
@pytest.mark.parametrize("rows", [0, 3])
def test_constant_damping_between_stops_is_the_quadratic_programs(
    rows: int, weighted: bool, rng: np.random.Generator
) -> None:
    """min ‖J u - rate‖² + λ² uᵀ W u within the bounds, by DAQP.

    Of stops of inputs always; with rows the exchange of stops may end beside the optimum, 5 in 1,000 times.
    """
    held = others = 0
    for _ in range(400):
        s, m = int(rng.integers(1, 5)), int(rng.integers(4, 9))
        J, rate = rng.normal(size=(s, m)) * rng.uniform(0.05, 1.0, m), rng.normal(size=s)
        upper, lower = rng.uniform(0.02, 0.4, m), -rng.uniform(0.02, 0.4, m)
        G, high, low = rng.normal(size=(rows, m)), rng.uniform(0.02, 0.4, rows), -rng.uniform(0.02, 0.4, rows)
        W, damping = np.eye(m), 0.2
        if weighted:
            root = rng.normal(size=(m, m))
            W = np.eye(m) + 0.15 * (root + root.T) @ (root + root.T)
            W = 0.5 * (W + W.T)
        resolver = nmm.DampedLeastSquares(1.0, "constant", damping, weights=W if weighted else None)
        bounds = {"u_lower": lower, "u_upper": upper, "limit_rows": G, "lower": low, "upper": high}
        u = between_stops(resolver, Problem(J, rate, np.zeros(m), **bounds))
        best, _, flag, _ = daqp.solve(
            *(J.T @ J + damping**2 * W, -J.T @ rate, np.vstack([np.eye(m), G])),
            *(np.append(upper, high), np.append(lower, low), np.zeros(m + rows, dtype=np.int32)),
            primal_tol=1e-11,
        )
        assert flag == 1
        others += bool(np.abs(u - best).max() > 1e-8)
        held += bool(np.any((u == upper) | (u == lower)))
        assert np.all((lower <= u) & (u <= upper))
        assert np.all((low - 1e-11 <= G @ u) & (G @ u <= high + 1e-11))
    assert held > 200
    assert others <= (8 if rows else 0)


def test_where_no_stop_is_passed_nothing_changes(rng: np.random.Generator) -> None:
    resolver = nmm.DampedLeastSquares(1.0)
    for _ in range(100):
        J, rate, h = rng.normal(size=(3, 6)), rng.normal(size=3), rng.normal(size=6)
        free = resolver.resolve(Problem(J, rate, h)).u
        most = np.abs(free) + 1e-9
        assert (between_stops(resolver, Problem(J, rate, h, u_lower=-most, u_upper=most)) == free).all()


def rests(controller: nmm.Controller, q0: Any, duration: float, dt: float, method: str) -> nmm.Trajectory:
    """A run towards what is out of reach, that comes to rest where nothing within the stops comes nearer."""
    run = nmm.simulate(controller, q0, duration, dt, method)
    assert run.outcome is nmm.Outcome.MISSED
    late = run.t > 0.9 * run.t[-1]
    largest = np.abs(run.u).max()
    assert np.abs(run.u[late]).max() < 0.01 * largest
    assert not {"chattering", "still_moving"} & {one.code for one in run.verdict.reasons}
    return run


def nearest(controller: nmm.Controller, run: nmm.Trajectory) -> float:
    """How much nearer the end could come at first order within the stops, as a share of ‖J‖ ‖e‖."""
    robot, step = controller.robot, controller.evaluate(run.t[-1], run.q[-1])
    lower, upper = np.full(robot.n_u, -1.0), np.full(robot.n_u, 1.0)
    for j, i in enumerate(robot.rate_coordinates):
        if i >= 0:
            lower[j] = -1e-12 if run.q[-1, i] - controller.solver.limits_on.coordinates[i, 0] < 1e-6 else -1.0
            upper[j] = 1e-12 if controller.solver.limits_on.coordinates[i, 1] - run.q[-1, i] < 1e-6 else 1.0
    falls = step.J.T @ step.error
    best = np.where(falls > 0.0, upper, lower)
    return float(falls @ best) / float(np.linalg.norm(step.J) * np.linalg.norm(step.error))


@pytest.mark.parametrize(("method", "dt"), [("zoh", 0.01), ("zoh", 0.04), ("rk4", 0.01)])
def test_a_bent_arm_points_at_what_it_cannot_reach(method: str, dt: float) -> None:
    """q2 stops at 1 rad: what is left is a stiff arm, which ends on the line to the target."""
    robot = nmm.load("unicycle_2r", platform="fixed")
    target = np.array([1.5, 1.0])
    task = nmm.Task(nmm.Position("ee", "xy"), target, gain=2.0)
    limits = nmm.Limits(velocity={"arm": 2.0}, position={"q2": [1.0, 2.5]})
    controller = nmm.Controller(robot, task, nmm.DampedLeastSquares(), limits=limits)
    run = rests(controller, {"q1": 0.2, "q2": 1.4}, 20.0, dt, method)
    reach = math.sqrt(0.5**2 + 0.3**2 + 2 * 0.5 * 0.3 * math.cos(1.0))
    away = float(np.linalg.norm(target - [0.3, 0.0]))
    assert run.error_norm[-1] == pytest.approx(away - reach, abs=1e-6)
    assert run.q[-1, -1] == pytest.approx(1.0, abs=1e-9)
    assert nearest(controller, run) < 1e-6


@pytest.mark.parametrize("stops", [{"elbow": [1.0, 2.0]}, {"elbow": [1.0, 2.0], "lift": [-1.3, -0.5]}])
@pytest.mark.parametrize("posture", [False, True])
def test_a_ur5_on_wheels_rests_at_its_stops(stops: dict[str, list[float]], posture: bool) -> None:
    """All inputs stayed at their limits, a sample forwards and one backwards (wheels: 29 rad/s)."""
    scenario = nmm.Scenario.load("ur5_differential_line")
    robot = scenario.robot()
    names = {"elbow": "ur5_elbow_joint", "lift": "ur5_shoulder_lift_joint"}
    home = {names["lift"]: -1.2, names["elbow"]: 1.5, "ur5_wrist_1_joint": -1.87, "ur5_wrist_2_joint": -1.57}
    limits = nmm.Limits(position={names[name]: ends for name, ends in stops.items()})
    task = nmm.Task(nmm.Position("ur5_tool0"), [1.0, 1.0, 2.5], gain=2.0)
    objective = nmm.PreferredPosture({name: home[name] for name in home}) if posture else None
    controller = nmm.Controller(robot, task, nmm.DampedLeastSquares(1.0), objective, limits=limits)
    run = rests(controller, robot.q(home), 60.0, 0.01, "zoh")
    if not posture:
        assert nearest(controller, run) < 0.01


def test_a_run_that_does_not_come_to_rest_says_so() -> None:
    """The projected gradient is not damped, and goes on as `dls` did."""
    scenario = nmm.Scenario.load("ur5_differential_line")
    robot = scenario.robot()
    task = nmm.Task(nmm.Position("ur5_tool0"), [1.0, 1.0, 2.5], gain=2.0)
    limits = nmm.Limits(position={"ur5_elbow_joint": [1.0, 2.0]})
    controller = nmm.Controller(robot, task, nmm.ProjectedGradient(), limits=limits)
    run = nmm.simulate(controller, robot.q({"ur5_elbow_joint": 1.5}), 10.0, 0.01, "zoh")
    mean = np.abs(run.u[run.t >= 0.9 * run.t[-1]]).mean(axis=0)[:2].max()
    assert mean > 5.0
    moving = the(run, "still_moving").values
    assert moving["name"].startswith("omega_")
    assert (moving["mean"], moving["unit"]) == (pytest.approx(mean), "rad/s")


def test_a_wall_stops_as_a_joint_does() -> None:
    """A function's limit: the hand may not rise above 1.1 m, and the target is beyond, out of reach."""
    robot = nmm.load("unicycle_3r", platform="fixed")
    task = nmm.Task(nmm.Position("ee"), [1.6, 0.4, 1.9], gain=2.0)
    limits = nmm.Limits(
        velocity={"arm": 2.0}, position=False, bounds=nmm.Bound(nmm.Position("ee", "z"), -np.inf, 1.1)
    )
    controller = nmm.Controller(robot, task, nmm.DampedLeastSquares(), limits=limits)
    run = rests(controller, {"q1": 0.1, "q2": 1.0, "q3": 0.9}, 30.0, 0.01, "zoh")
    assert run.r[:, 2].max() < 1.1 + 1e-3
    assert run.r[-1, 2] == pytest.approx(1.1, abs=1e-6)


@pytest.mark.parametrize("kinematics", ["pinocchio", "compiled"])
def test_a_loop_and_a_simulation_are_the_same(kinematics: str) -> None:
    robot = nmm.load("unicycle_3r")
    task = nmm.Task(nmm.Position("ee"), [1.0, 1.0, 2.0], gain=2.0)
    limits = nmm.Limits(position={"q2": [-0.5, 0.6], "q3": [0.7, 1.5]}, acceleration=8.0)
    make: Callable[[], nmm.Controller] = lambda: nmm.Controller(  # noqa: E731
        robot, task, nmm.DampedLeastSquares(), limits=limits, dt=0.01, kinematics=kinematics
    )
    q = robot.q({"q2": 0.3, "q3": 0.9})
    run, loop = nmm.simulate(make(), q, 3.0, 0.01, "rk4"), make()
    for k in range(300):
        np.testing.assert_allclose(q, run.q[k], rtol=0, atol=1e-9)
        q, _ = loop.step(run.t[k], q, 0.01, "rk4")
