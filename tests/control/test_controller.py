"""The controller: the paper's laws on its four cases, whatever the resolver, and against the twin."""

from __future__ import annotations

import numpy as np
import pytest
import twin
from function_grid import random_configuration
from numpy import pi
from numpy.typing import NDArray
from paper_cases import CASES, CIRCLE, TIP, Case
from platform_grid import EXAMPLES, random_qp

from nmm.control.controller import Controller
from nmm.control.functions.objectives import Objective, Quadratic, QuadraticTerm
from nmm.control.functions.references import Bearing, Circle, Constant, Line
from nmm.control.functions.tasks import Heading, LinearCoordinates, Position, Task
from nmm.control.resolvers import ExtendedJacobian, ProjectedGradient, ReducedGradient, Resolver, Status
from nmm.model.platforms import WheeledPlatform
from nmm.model.robots.robot import Robot

Array = NDArray[np.float64]

each_case = pytest.mark.parametrize("case", CASES, ids=[case.name for case in CASES])
RESOLVERS = ("pg", "rg", "automatic rg", "weighted pg")


def resolver_of(kind: str, case: Case) -> Resolver:
    weights = {"v": 2.0, "q1": 0.5}
    return {
        "pg": ProjectedGradient(10.0),
        "rg": case.rg(),
        "automatic rg": ReducedGradient(10.0),
        "weighted pg": ProjectedGradient(10.0, weights),
    }[kind]


def close(found: Array, expected: Array, tolerance: float) -> None:
    scale = np.abs(expected).max(initial=1.0)
    np.testing.assert_allclose(found, expected, rtol=0, atol=tolerance * scale)


@pytest.mark.parametrize("name", EXAMPLES)
def test_A_G_is_zero(name: str, rng: np.random.Generator) -> None:
    platform = EXAMPLES[name]
    for _ in range(40):
        qp = random_qp(platform, rng, 10.0)
        A, G = platform.A(qp), platform.G(qp)
        # Products of larger numbers are rounded by as much more.
        scale = (np.abs(A) @ np.abs(G)).max(initial=1.0)
        if isinstance(platform, WheeledPlatform):  # G solves a system whose condition is about G's size
            scale *= 10 * np.abs(G).max(initial=1.0)
        np.testing.assert_allclose(A @ G, 0.0, rtol=0, atol=1e-15 * scale)
        # Together they span all velocities: G has every motion that A admits.
        if platform.n_p:  # NumPy 2.0 knows no rank of an empty matrix
            assert np.linalg.matrix_rank(np.hstack([A.T, G])) == platform.n_p


@each_case
@pytest.mark.parametrize("kind", RESOLVERS)
def test_the_task_is_done_and_the_wheels_do_not_slide(
    case: Case, kind: str, robots: dict[str, Robot], rng: np.random.Generator
) -> None:
    robot = robots[case.robot]
    controller = case.controller(robot, resolver_of(kind, case))
    for t in rng.uniform(0, 25, 50):
        q = random_configuration(robot, rng)
        u = controller(t, q)
        J, rate, _ = case.twin(t, q)
        scale = max(1.0, float(np.abs(J).max() * np.abs(u).max()))
        np.testing.assert_allclose(J @ u, rate, rtol=0, atol=1e-11 * scale)
        step = controller.evaluate(t, q)
        np.testing.assert_array_equal(step.u, u)
        assert step.status is Status.SOLVED
        assert step.residual <= 1e-11 * scale
        close(step.q_dot, twin.S(q) @ u, 1e-15)
        assert abs(robot.platform.A(q[:3]) @ step.q_dot[:3]) <= 1e-15 * scale
        np.testing.assert_array_equal(controller.velocity(t, q), step.q_dot)


@each_case
def test_inputs_are_the_twins(case: Case, robots: dict[str, Robot], rng: np.random.Generator) -> None:
    robot = robots[case.robot]
    pg, rg = case.controller(robot, ProjectedGradient(10.0)), case.controller(robot, case.rg())
    for t in rng.uniform(0, 25, 50):
        q = random_configuration(robot, rng)
        J, rate, gradient = case.twin(t, q)
        # eps times the condition, of which J and the right-hand sides contribute their own.
        close(pg(t, q), twin.projected_gradient(J, rate, gradient, twin.S(q)), 1e-13 * np.linalg.cond(J) ** 2)
        rg.reset()
        step = rg.evaluate(t, q)
        basic = list(step.partition)
        expected = twin.reduced_gradient(J, rate, gradient, twin.S(q), basic)
        close(step.u, expected, 1e-14 * np.linalg.cond(J[:, basic]) ** 2 + 1e-12)


@each_case
@pytest.mark.parametrize("method", ["pg", "rg"])
def test_the_motion_is_the_twins(case: Case, method: str, robots: dict[str, Robot]) -> None:
    """Two seconds of closed loop from the paper's start: the transient, through every buffer many times."""
    robot = robots[case.robot]
    start = case.controller(robot, case.rg()).evaluate(0.0, case.q0).partition
    if case.basic:
        assert tuple(sorted(start)) == case.basic
    basic = [int(column) for column in start]
    resolver = ProjectedGradient(10.0) if method == "pg" else ReducedGradient(10.0, [basic])
    controller = case.controller(robot, resolver)

    def velocity(t: float, q: Array) -> Array:
        J, rate, gradient = case.twin(t, q)
        S = twin.S(q)
        if method == "pg":
            return S @ twin.projected_gradient(J, rate, gradient, S)
        return S @ twin.reduced_gradient(J, rate, gradient, S, basic)

    times = np.linspace(0.0, 2.0, 401)
    expected = twin.runge_kutta(velocity, case.q0, times)
    found = twin.runge_kutta(controller.velocity, case.q0, times)
    assert np.abs(expected[-1] - expected[0]).max() > 0.5
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-10)


def test_extended_jacobian_does_both_tasks(robot_2r: Robot, rng: np.random.Generator) -> None:
    added = Task(
        LinearCoordinates("q2", {"theta": 1, "q1": 1, "q2": 1}), Line([0, 1], [1, -1], 9.0), gain=[2.0, 0.5]
    )
    controller = Controller(robot_2r, TIP, ExtendedJacobian(), added_task=added)
    for t in rng.uniform(0, 9, 50):
        q = random_configuration(robot_2r, rng)
        J, rate, _ = twin.case_1(t, q)
        Jc = np.array([[0.0, 0.0, 0.0, 1.0], [0.0, 1.0, 1.0, 1.0]])
        y, y_d = np.array([q[4], q[2:].sum()]), np.array([t / 9, 1 - 2 * t / 9])
        rate_c = np.array([1 / 9, -2 / 9]) + np.array([2.0, 0.5]) * (y_d - y)
        condition = np.linalg.cond(np.vstack([J, Jc]))
        close(controller(t, q), twin.extended_jacobian(J, rate, Jc, rate_c), 1e-14 * condition**2)


def test_no_redundancy_left(robot_2r: Robot, rng: np.random.Generator) -> None:
    """Four rows, four inputs: one answer, by whatever method and for whatever objective."""
    tasks = (TIP, Task(Heading("link2"), [0.3]), Task(LinearCoordinates("q2"), [-1.0]))
    q = random_configuration(robot_2r, rng)
    J, rate, _ = twin.case_1(2.0, q)
    J = np.vstack([J, [0, 1, 1, 1], [0, 0, 0, 1]])
    expected = np.linalg.solve(J, [*rate, twin.wrapped(0.3 - q[2:].sum()), -1.0 - q[4]])
    for resolver in (ProjectedGradient(), ReducedGradient(), ExtendedJacobian()):
        for objective in (None, CASES[0].objective):
            close(Controller(robot_2r, tasks, resolver, objective)(2.0, q), expected, 1e-11)


# Gains, errors and planning mode.


def test_gains(robot_2r: Robot, rng: np.random.Generator) -> None:
    q = random_configuration(robot_2r, rng)
    t = 6.0
    r_d, speed = twin.circle(t)
    error = r_d - twin.Planar().f(q)
    matrix = np.array([[2.0, 0.7], [-0.4, 1.0]])
    for gain, K in ((3.0, 3.0 * np.eye(2)), ([3.0, 0.5], np.diag([3.0, 0.5])), (matrix, matrix)):
        task = Task(Position("ee", "xy"), CIRCLE, gain)
        found = Controller(robot_2r, task, ProjectedGradient()).evaluate(t, q)
        close(found.rate, speed + K @ error, 1e-14)
        close(found.error, error, 1e-14)
        close(found.r, r_d - error, 1e-14)
        close(found.r_d, r_d, 1e-14)
    planning = Task(Position("ee", "xy"), CIRCLE, None)
    close(Controller(robot_2r, planning, ProjectedGradient()).evaluate(t, q).rate, speed, 1e-15)


def test_each_task_of_a_stack_has_its_own_gain(robot_2r: Robot, rng: np.random.Generator) -> None:
    q = random_configuration(robot_2r, rng)
    matrix = np.array([[2.0, 0.7], [-0.4, 1.0]])
    stack = [
        Task(Heading("link2"), 0.3, 4.0),
        Task(Position("ee", "xy"), CIRCLE, matrix),
        Task(LinearCoordinates("q1"), 0.1, None),
    ]
    found = Controller(robot_2r, stack, ProjectedGradient()).evaluate(6.0, q)
    r_d, speed = twin.circle(6.0)
    heading = 4.0 * twin.wrapped(0.3 - q[2:].sum())
    close(found.rate, np.array([heading, *(speed + matrix @ (r_d - twin.Planar().f(q))), 0.0]), 1e-13)
    assert [row.name for row in Controller(robot_2r, stack, ProjectedGradient()).rows] == [
        "link2.heading", "ee.x", "ee.y", "q1",
    ]  # fmt: skip


@pytest.mark.parametrize("turns", [-3, 0, 5])
def test_angular_errors_are_wrapped_and_coordinates_are_not(turns: int, robot_2r: Robot) -> None:
    targets = Constant([0.0], "rad")
    for angle in (0.1, 3.1, -3.1, pi / 2):
        q = np.array([0.0, 0.0, angle + 2 * pi * turns, 0.0, 0.0])
        wrapped = Controller(robot_2r, Task(Heading("link2"), targets), ProjectedGradient()).evaluate(0, q)
        assert wrapped.error[0] == pytest.approx(-angle, abs=1e-13)
        plain = Controller(robot_2r, Task(LinearCoordinates("theta"), targets), ProjectedGradient()).evaluate(
            0, q
        )
        assert plain.error[0] == -q[2]
    # Targets many turns away, and the branch point, of which the interval holds the upper end.
    for target, error in (
        (7 * pi - 0.5, pi - 0.5),
        (7 * pi + 0.5, 0.5 - pi),
        (pi, pi),
        (-pi, pi),
        (3 * pi, pi),
    ):
        task = Task(Heading("link2"), Constant([target], "rad"))
        found = Controller(robot_2r, task, ProjectedGradient()).evaluate(0.0, np.zeros(5))
        assert found.error[0] == pytest.approx(error, abs=1e-14)


def test_h_is_the_gradient_seen_by_the_inputs(robot_2r: Robot, rng: np.random.Generator) -> None:
    """A sum of objectives has the sum of their gradients, with the weights and signs."""
    parts = {
        "a": Quadratic(QuadraticTerm("x", 0.3)),
        "b": Quadratic(QuadraticTerm({"theta": 1, "q2": -1}, 0.1, 3.0)),
    }
    sums: list[tuple[Objective, float, float]] = [
        (parts["a"] + parts["b"], 1.0, 1.0),
        (2.0 * parts["a"] - parts["b"], 2.0, -1.0),
        (-(parts["a"] + parts["b"]) * 3.0, -3.0, -3.0),
    ]
    for objective, a, b in sums:
        q = random_configuration(robot_2r, rng)
        found = Controller(robot_2r, TIP, ProjectedGradient(), objective).evaluate(0.0, q)
        p, s = q[0] - 0.3, q[2] - q[4] - 0.1
        close(found.h, twin.S(q).T @ np.array([a * p, 0, 3 * b * s, 0, -3 * b * s]), 1e-14)
        assert found.objective == pytest.approx(a * p**2 / 2 + 3 * b * s**2 / 2, rel=1e-14)
    assert Controller(robot_2r, TIP, ProjectedGradient()).evaluate(0.0, q).objective == 0.0


def rotation(turn: float) -> Array:
    return np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])


def moved_case(case: Case, turn: float, shift: Array) -> tuple[tuple[Task, ...], Objective]:
    """The case as it reads in a world frame in which everything stands turned by `turn` and shifted."""
    R = rotation(turn)
    center, T = R @ [2.0, 2.0] + shift, R @ twin.TARGET + shift
    circle = Circle(center, 3, 0.08 * pi, 5 / 4 * pi + turn)
    absolute = {"theta": 1, "q1": 1, "q2": 1}
    tip = Task(Position("ee", "xy"), circle)
    match case.name:
        case "case 1":
            return (tip,), Quadratic(QuadraticTerm(absolute, pi / 2 + turn), QuadraticTerm("q1", pi / 4))
        case "case 2":
            return (tip, Task(Heading("link2"), Bearing(circle, T))), case.objective
        case "case 3":
            pointing = Task(Heading("link1"), Bearing(Position("link2", "xy"), T))
            return (tip, pointing), Quadratic(QuadraticTerm(absolute, turn))
        case _:
            circle = Circle([*center, 0.5], 3, 0.08 * pi, 5 / 4 * pi + turn)
            return (Task(Position("ee", "xyz"), circle),), case.objective


@each_case
@pytest.mark.parametrize("kind", RESOLVERS)
def test_the_world_frame_does_not_matter(
    case: Case, kind: str, robots: dict[str, Robot], rng: np.random.Generator
) -> None:
    robot = robots[case.robot]
    turn, shift = 2.3, np.array([-4.0, 1.7])
    tasks, objective = moved_case(case, turn, shift)
    here = case.controller(robot, resolver_of(kind, case))
    there = Controller(robot, tasks, resolver_of(kind, case), objective)
    for t in (0.0, 3.0, 11.0):
        q = case.q0 + rng.normal(scale=0.5, size=robot.n)
        moved = q.copy()
        moved[:2] = rotation(turn) @ q[:2] + shift
        moved[2] += turn
        close(there(t, moved), here(t, q), 1e-11)
        assert there.evaluate(t, moved).objective == pytest.approx(here.evaluate(t, q).objective, rel=1e-12)
