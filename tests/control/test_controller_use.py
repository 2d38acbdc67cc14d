"""The controller in use: users' Python in its middle, its partition, copies of it and of what it returns."""

from __future__ import annotations

import copy
import pickle
from collections.abc import Callable

import numpy as np
import pytest
from function_grid import random_configuration
from numpy.typing import NDArray
from paper_cases import CASES, TIP, Case

from nmm.control.controller import Controller
from nmm.control.functions.function import Function, Row
from nmm.control.functions.objectives import CallableObjective, Objective
from nmm.control.functions.program import evaluate
from nmm.control.functions.references import CallableReference, Constant
from nmm.control.functions.tasks import CallableFunction, Position, Task
from nmm.control.limits.limited_function import Bound
from nmm.control.limits.limits import Limits
from nmm.control.resolvers import CallableResolver, Problem, ProjectedGradient, ReducedGradient
from nmm.control.step.equations import step
from nmm.model.robots.robot import Robot

Array = NDArray[np.float64]

each_case = pytest.mark.parametrize("case", CASES, ids=[case.name for case in CASES])


def close(found: Array, expected: Array, tolerance: float) -> None:
    scale = np.abs(expected).max(initial=1.0)
    np.testing.assert_allclose(found, expected, rtol=0, atol=tolerance * scale)


def task_by_hand(task: Task, robot: Robot, derivatives: bool) -> Task:
    """The task with Python functions in place of its function and reference."""
    f, g = task.function, task.reference
    names, units, angular, _ = zip(*task.rows(robot), strict=True)
    if not derivatives:
        return Task(
            CallableFunction(lambda c: evaluate(f, 0.0, c).value, names, units=units, angular=angular),
            CallableReference(lambda t, c: evaluate(g, t, c).value, len(names), of_configuration=True),
            task.gain,
        )
    return Task(
        CallableFunction(
            lambda c: evaluate(f, 0.0, c).value,
            names,
            units=units,
            angular=angular,
            jacobian=lambda c: evaluate(f, 0.0, c).value_q,
        ),
        CallableReference(
            lambda t, c: evaluate(g, t, c).value,
            len(names),
            rate=lambda t, c: evaluate(g, t, c).value_t,
            jacobian=lambda t, c: evaluate(g, t, c).value_q,
            of_configuration=True,
        ),
        task.gain,
    )


@each_case
@pytest.mark.parametrize("derivatives", [True, False], ids=["derivatives", "differences"])
def test_users_functions_give_the_built_in_inputs(
    case: Case, derivatives: bool, robots: dict[str, Robot], rng: np.random.Generator
) -> None:
    robot = robots[case.robot]
    tasks = [task_by_hand(task, robot, derivatives) for task in case.tasks]
    gradient = case.objective.gradient if derivatives else None
    objective = CallableObjective(case.objective.value, gradient)
    mixtures: list[tuple[list[Task], Objective]] = [
        (tasks, objective),
        (list(case.tasks), objective),
        ([*case.tasks[:1], *tasks[1:]], case.objective),
    ]
    for mixed, h in mixtures:
        controller = Controller(robot, mixed, ProjectedGradient(), h)
        for t in (0.0, 5.0, 20.0):
            q = case.q0 + rng.normal(scale=0.4, size=robot.n)
            built_in = case.controller(robot).evaluate(t, q)
            # Differences are good to 1e-9; J's condition passes that on to u, twice over.
            tolerance = 1e-12 if derivatives else 1e-9 * np.linalg.cond(built_in.J) ** 2
            close(controller(t, q), built_in.u, tolerance)
            close(controller.evaluate(t, q).J, built_in.J, 1e-14 if derivatives else 1e-8)


@each_case
def test_a_users_resolver_gives_the_built_in_inputs(
    case: Case, robots: dict[str, Robot], rng: np.random.Generator
) -> None:
    robot = robots[case.robot]

    def projected(problem: Problem) -> Array:
        J, rate, h = problem.arrays.J, problem.arrays.rate, problem.arrays.h
        inverse = np.linalg.pinv(J)
        found: Array = inverse @ rate - 10.0 * (h - inverse @ (J @ h))
        return found

    own = case.controller(robot, CallableResolver(projected))
    for t in (0.0, 5.0, 20.0):
        q = case.q0 + rng.normal(scale=0.4, size=robot.n)
        expected = case.controller(robot).evaluate(t, q)
        close(own(t, q), expected.u, 1e-13 * np.linalg.cond(expected.J) ** 2)
        found = own.evaluate(t, q)
        close(found.q_dot, robot.S(q) @ found.u, 1e-15)
        close(own.velocity(t, q), found.q_dot, 0.0)
        assert found.residual < 1e-10


# The partition.


def crossing(robot: Robot) -> tuple[Controller, Array, Array]:
    """Case 1's controller, a q where Δ13 leads and one where it vanishes."""
    controller = CASES[0].controller(robot, ReducedGradient(partitions=[("v", "q1"), ("v", "omega")]))
    # Δ13 = l1 c1 + l2 c12, Δ12 = d + Δ13
    return controller, np.array([0, 0, 0.3, np.pi, 0]), np.array([0, 0, 0.3, np.pi / 2, 0])


def test_the_partition_is_kept_reset_and_held(robot_2r: Robot) -> None:
    controller, ahead, at = crossing(robot_2r)
    first, second = [0, 2], [0, 1]

    def taken(q: Array) -> list[int]:
        controller(0.0, q)
        return list(controller.last(0.0, q).partition)

    beside = at - np.array([0, 0, 0, 0.05, 0])  # Δ13 = 0.04, Δ12 = 0.34
    assert taken(ahead) == first
    assert taken(beside) == first
    controller.reset()
    assert taken(beside) == second
    controller.reset()
    controller(0.0, ahead)
    nearly = at + np.array([0, 0, 0, 1e-3, 0])  # Δ13 = -0.0008, below the threshold
    with controller.solver.state.held():
        assert taken(nearly) == first
    assert taken(nearly) == second
    assert taken(ahead) == second
    controller.reset()
    assert taken(ahead) == first


def test_tracking_survives_a_switch(robot_2r: Robot) -> None:
    """J u = rate on both sides of a switch, with inputs that stay of the same size."""
    controller, ahead, at = crossing(robot_2r)
    seen = set()
    for s in np.linspace(0.0, 1.5, 301):
        there = controller.evaluate(0.0, ahead + s * (at - ahead))
        seen.add(tuple(there.partition))
        assert there.residual < 1e-10
        assert there.measure >= 0.01
    assert seen == {(0, 2), (0, 1)}


# Copies.


def test_what_is_returned_belongs_to_the_caller(robot_2r: Robot, rng: np.random.Generator) -> None:
    case = CASES[2]
    controller, q = case.controller(robot_2r), random_configuration(robot_2r, rng)
    u, everything, q_dot = controller(1.0, q), controller.evaluate(1.0, q), controller.velocity(1.0, q)
    quantities = {**vars(everything), **everything.more}
    given = (u, q_dot, *(quantities[name] for name in quantities if name not in ("robot", "more")))
    kept = copy.deepcopy(given)
    controller(7.0, q + 1.0)
    for found, before in zip(given, kept, strict=True):
        np.testing.assert_array_equal(found, before)
    for array in (u, q_dot, everything.u, everything.J, everything.q):
        array[...] = -1e9
    np.testing.assert_array_equal(controller(1.0, q), kept[0])


def test_q_is_neither_kept_nor_changed(robot_2r: Robot, rng: np.random.Generator) -> None:
    controller, q = CASES[2].controller(robot_2r), random_configuration(robot_2r, rng)
    before = q.copy()
    u = controller(1.0, q)
    np.testing.assert_array_equal(q, before)
    q[:] = 0.0
    np.testing.assert_array_equal(controller(1.0, before), u)


def test_controllers_do_not_share_memory(robot_2r: Robot, rng: np.random.Generator) -> None:
    a, b = (CASES[k].controller(robot_2r, ReducedGradient()) for k in (0, 2))
    points = [(t, random_configuration(robot_2r, rng)) for t in (0.0, 1.0, 2.0)]
    apart = [a(t, q) for t, q in points]
    a.reset()
    for (t, q), expected in zip(points, apart, strict=True):
        b(t + 1, q - 1)
        np.testing.assert_array_equal(a(t, q), expected)


@pytest.mark.parametrize(
    "copied",
    [copy.copy, copy.deepcopy, lambda c: pickle.loads(pickle.dumps(c))],
    ids=["copy", "deepcopy", "pickle"],
)
@each_case
def test_a_copy_is_a_controller_of_its_own(
    case: Case, copied: Callable[[Controller], Controller], robots: dict[str, Robot], rng: np.random.Generator
) -> None:
    robot = robots[case.robot]
    controller = case.controller(robot, case.rg())
    controller(0.0, case.q0)
    second = copied(controller)
    for t in (1.0, 2.0):
        q = case.q0 + rng.normal(scale=0.2, size=robot.n)
        fresh = case.controller(robot, case.rg())
        np.testing.assert_array_equal(second(t, q), fresh(t, q))
        controller(9.0, q + 0.3)
        second.reset()


def test_every_kind_of_array_and_number_is_taken(robot_2r: Robot) -> None:
    controller = Controller(robot_2r, TIP, ProjectedGradient())
    q = np.array([-1.0, 2.0, 3.0, 0.0, 1.0])
    expected = controller(2.0, q)
    frozen, spread = q.copy(), np.zeros(10)
    frozen.flags.writeable = False
    spread[::2] = q
    by_name = dict(zip(robot_2r.q_names, q, strict=True))
    others = (q.astype(kind) for kind in (int, np.float32, ">f8"))
    for given in (list(q), tuple(q), frozen, spread[::2], by_name, *others):
        np.testing.assert_array_equal(controller(2.0, given), expected)
    for t in (2, np.float32(2.0), np.float64(2.0), np.int64(2), np.array(2.0)):
        np.testing.assert_array_equal(controller(t, q), expected)
        np.testing.assert_array_equal(controller.evaluate(t, q).u, expected)
        np.testing.assert_array_equal(controller.velocity(t, q), controller.evaluate(t, q).q_dot)
    compiled_for = getattr(step, "signatures", [()])  # absent in plain Python
    assert len(compiled_for) == 1, "another kind of argument was compiled for: seconds, in a control loop"


def test_arrays_that_compiled_code_made_are_taken_as_they_are(robot_2r: Robot) -> None:
    """Those read from disk give float64 in an object of its own: in every stage of a Runge-Kutta step."""

    class Never(Controller):
        def _copied(self, q: object) -> Array:
            raise AssertionError("copied, and checked number by number")

    controller = Never(robot_2r, TIP, ProjectedGradient())
    float64 = pickle.loads(pickle.dumps(np.dtype(np.float64)))
    q = np.array([-1.0, 2.0, 3.0, 0.0, 1.0], dtype=float64)
    assert q.dtype is not np.dtype(np.float64)
    np.testing.assert_array_equal(
        controller(2.0, q), Controller(robot_2r, TIP, ProjectedGradient())(2.0, list(q))
    )


@pytest.mark.parametrize("order", [1, 2])
def test_each_function_is_asked_once_for_its_rows(
    order: int, robot_2r: Robot, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[Function] = []
    for kind in (Position, Constant):
        rows = kind.rows

        def counted(
            self: Function, robot: Robot, rows: Callable[..., tuple[Row, ...]] = rows
        ) -> tuple[Row, ...]:
            asked.append(self)
            return rows(self, robot)

        monkeypatch.setattr(kind, "rows", counted)
    tasks = [Task(Position("ee", axis), [1.0], priority=i + 1) for i, axis in enumerate("xy")]
    limits = Limits(bounds=Bound(Position("ee", "x"), -5.0, 5.0))
    Controller(robot_2r, tasks, ProjectedGradient(), limits=limits, dt=0.01, order=order)
    assert len(asked) == len({*map(id, asked)}) == 5
