"""What the controller refuses: bad input in one line, singular configurations, and what is undefined."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from findings import refused
from numpy import pi
from numpy.typing import NDArray
from paper_cases import CIRCLE, H1, TIP

from nmm.base.errors import InputError, NmmError, SingularError
from nmm.control.controller import Controller
from nmm.control.functions.objectives import (
    CallableObjective,
    JointRange,
    Manipulability,
    Quadratic,
    QuadraticTerm,
    WeightedSum,
)
from nmm.control.functions.program import evaluate
from nmm.control.functions.references import (
    Bearing,
    CallableReference,
    Circle,
    Constant,
    PiecewisePolynomial,
    Spline,
)
from nmm.control.functions.tasks import CallableFunction, Heading, LinearCoordinates, Position, Task
from nmm.control.resolvers import (
    CallableResolver,
    ExtendedJacobian,
    ProjectedGradient,
    ReducedGradient,
    Resolver,
    Status,
)
from nmm.model.robots.configuration import Configuration
from nmm.model.robots.loading import load
from nmm.model.robots.robot import Robot

Array = NDArray[np.float64]

PG, RG, EJ = ProjectedGradient(), ReducedGradient(), ExtendedJacobian()
REST = Constant([0.0])


def made(task: Any, resolver: Resolver = PG, *more: Any, **named: Any) -> Callable[[Robot], Any]:
    return lambda robot: Controller(robot, task, resolver, *more, **named)


def called(q: Any, resolver: Resolver = PG) -> Callable[[Robot], Any]:
    return lambda robot: Controller(robot, TIP, resolver)(0.0, q)


def with_callable(function: Any, **options: Any) -> Callable[[Robot], Any]:
    task = Task(CallableFunction(function, **options), REST)
    return lambda robot: Controller(robot, task, PG)(0.0, np.zeros(5))


TOO_MANY = [TIP, Task(Heading("link1"), REST), Task(LinearCoordinates("q1", "q2"), [0, 0])]
REFUSED: list[tuple[Callable[[Robot], Any], str]] = [
    (made(Task(Position("tool", "xy"), CIRCLE)), {"where": "robot unicycle_2r", "got": "tool"}),
    (made(Task(Position("e", "xy"), CIRCLE)), {"where": "robot unicycle_2r", "got": "e"}),
    (made(Task(Heading("universe"), REST)), {"where": "robot unicycle_2r", "got": "universe"}),
    (made(TIP, PG, Manipulability("hand", "xy")), {"where": "robot unicycle_2r", "got": "hand"}),
    (made(Task(LinearCoordinates("q9"), REST)), {"where": "robot unicycle_2r", "got": "q9"}),
    (
        made(TIP, PG, Quadratic(QuadraticTerm({"q1": 1, "q8": 1}))),
        {"where": "robot unicycle_2r", "got": "q8"},
    ),
    (made(TIP, PG, JointRange(["q7"])), {"where": "robot unicycle_2r", "got": "q7"}),
    (made(TIP, PG, JointRange()), {"where": "joint range: q1"}),
    (made(TIP, PG, JointRange(["q1"], [1.0], [1.0])), {"where": "joint range: q1"}),
    (
        made(TIP, PG, JointRange(["q1"], [1.0, 2.0], [3.0, 4.0])),
        {"where": "joint range: lower", "got": [1.0, 2.0]},
    ),
    (made(TIP, ReducedGradient(partitions=[("v", "w")])), {"where": "partitions", "got": "w"}),
    (made(TIP, ProjectedGradient(weights={"x": 1.0})), {"where": "weights", "got": "x"}),
    (made(Task(Position("ee", "xyz"), CIRCLE)), {"where": "task ee.x, ee.y, ee.z", "got": 2}),
    (made(Task(Heading("link1"), CIRCLE)), {"where": "task link1.heading", "got": 2}),
    (made(TOO_MANY), {"where": "task", "got": 5}),
    (made([]), {"where": "task"}),
    (made(TIP, PG, added_task=Task(LinearCoordinates("q1"), REST)), {"where": "added_task"}),
    (made(TIP, EJ), {"where": "added_task", "got": 0}),
    (made(TIP, EJ, added_task=Task(LinearCoordinates("q1"), REST)), {"where": "added_task", "got": 1}),
    (made(Task(Position("ee", "xy"), CIRCLE, 0.0)), {"where": "gain of task ee.x, ee.y", "got": 0.0}),
    (
        made(Task(Position("ee", "xy"), CIRCLE, [1, 2, 3])),
        {"where": "gain of task ee.x, ee.y", "got": [1.0, 2.0, 3.0]},
    ),
    (
        made(Task(Position("ee", "xy"), CIRCLE, [[1, 3], [0, 1]])),
        {"where": "gain of task ee.x, ee.y", "got": [[1.0, 3.0], [0.0, 1.0]]},
    ),
    (
        made(Task(Position("ee", "xy"), CIRCLE, [[1, np.nan], [0, 1]])),
        {"where": "gain of task ee.x, ee.y", "got": [[1.0, np.nan], [0.0, 1.0]]},
    ),
    (
        made(Task(Heading("link1"), Bearing(Heading("link2"), [6, 2]))),
        {"where": "bearing", "got": ["link2.heading (rad)"]},
    ),
    (
        made(Task(Heading("link1"), Bearing(Position("ee", "x"), [6, 2]))),
        {"where": "bearing", "got": ["ee.x (m)"]},
    ),
    (
        made(TIP, PG, Manipulability("ee", ("x", "y", "rz"), "arm")),
        {"where": "manipulability of the arm", "got": ("x", "y", "rz")},
    ),
    (made(Task(H1 + H1, REST)), {"where": "sum of objectives"}),
    (called(np.zeros(4)), {"where": "q", "got": np.zeros(4)}),
    (called(np.zeros((5, 1))), {"where": "q", "got": np.zeros((5, 1))}),
    (called([0, 0, np.nan, 0, 0]), {"where": "q"}),
    (called(np.array([0, 0, np.nan, 0, 0])), {"where": "q"}),
    (called(np.full(5, np.nan), RG), {"where": "q"}),
    (called(np.array([0, np.inf, 0, 0, 0]), RG), {"where": "q"}),
    (called({"q1": 1, "q7": 2}), {"where": "robot unicycle_2r", "got": "q7"}),
    (called("home"), {"where": "q", "got": "home"}),
    (
        with_callable(lambda c: [1, 2, 3], names=["a"]),
        {"got": [1.0, 2.0, 3.0]},
    ),
    (
        with_callable(lambda c: "far", names=["a"]),
        {"got": "far"},
    ),
    (
        lambda robot: evaluate(
            CallableFunction(lambda c: c.q[:2], ["a", "b"], jacobian=lambda c: np.eye(5)[:, :2]),
            0.0,
            Configuration(robot, np.zeros(5)),
        ),
        {"got": np.eye(5)[:, :2]},
    ),
    (lambda _: CallableFunction(lambda c: 0, ["a", "b"], units=["m"]), {"where": "callable function"}),
    (lambda _: CallableReference(lambda t: 0, 0), {"where": "dimension", "got": 0}),
    (lambda _: CallableReference(lambda t: 0, 1, jacobian=lambda t, c: 0), {"where": "of_configuration"}),
    (lambda _: Position("ee", "xx"), {"where": "axes", "got": "xx"}),
    (lambda _: Position("ee", ""), {"where": "axes", "got": ""}),
    (lambda _: Heading("ee", "w"), {"where": "direction", "got": "w"}),
    (lambda _: Heading("ee", [0, 0, 0]), {"where": "direction", "got": [0.0, 0.0, 0.0]}),
    (lambda _: Heading("ee", about="w"), {"where": "about", "got": "w"}),
    (lambda _: Manipulability("ee", "xq"), {"got": "q"}),
    (lambda _: Manipulability("ee", "xy", "leg"), {"got": "leg"}),
    (lambda _: Quadratic(), {"where": "quadratic objective"}),
    (lambda _: Quadratic(QuadraticTerm("q1", 0.0, -1.0)), {"where": "term q1: weight", "got": -1.0}),
    (lambda _: H1 * np.inf, {"where": "weight", "got": np.inf}),
    (lambda _: Circle([2, 2], 0.0, 1.0), {"where": "radius", "got": 0.0}),
    (lambda _: Circle([2, 2], 1.0, 1.0, plane="yz"), {"where": "plane", "got": "yz"}),
    (lambda _: PiecewisePolynomial([0, 1, 2], np.ones((4, 1, 3))), {"where": "coefficients"}),
    (lambda _: PiecewisePolynomial([0, 1], np.ones((4, 1))), {"where": "coefficients"}),
    (lambda _: PiecewisePolynomial([1, 0], np.ones((4, 1, 3))), {"where": "breaks", "got": [1.0, 0.0]}),
    (lambda _: Spline([0, 1, 1], [[0], [1], [2]]), {"where": "times", "got": [0.0, 1.0, 1.0]}),
    (lambda _: Spline([0, 1], [[0], [1]], 4), {"where": "spline: degree", "got": (4, "rest")}),
    (lambda _: Spline([0, 1], [[0], [1]], 5, "natural"), {"where": "points", "got": 2}),
    (lambda _: Spline([0, 1], [[0], [1]], ends="periodic"), {"where": "points"}),
]


@pytest.mark.parametrize(("call", "fields"), REFUSED)
def test_bad_input_is_refused_in_one_line(
    call: Callable[[Robot], Any], fields: dict[str, Any], robot_2r: Robot
) -> None:
    with refused(**fields) as caught:
        call(robot_2r)
    assert "\n" not in str(caught.value)


# Singular and undefined.


def stretched() -> tuple[Robot, Array]:
    """The arm over the axle, stretched sideways: one direction only."""
    return load("unicycle_2r", arguments={"d": 0}), np.array([0.4, 0.1, 0.7, pi / 2, 0.0])


def upright() -> tuple[Robot, Array]:
    return load("unicycle_3r"), np.array([0.4, 0.1, 0.7, 0.3, 0.0, 0.0])


@pytest.mark.parametrize(
    "kind", [PG, RG, ProjectedGradient(weights={"v": 2.0})], ids=["pg", "rg", "weighted"]
)
@pytest.mark.parametrize("place", [stretched, upright])
def test_a_singular_configuration_is_an_error_with_the_time(kind: Resolver, place: Any) -> None:
    robot, q = place()
    axes = "xy" if robot.n == 5 else "xyz"
    controller = Controller(robot, Task(Position("ee", axes), np.zeros(len(axes))), kind)
    beside = q + 0.3
    good = controller(1.5, beside)
    for ask in (controller, controller.velocity):
        with pytest.raises(SingularError, match=r"at t = 2.5 s: the task Jacobian J lost rank"):
            ask(2.5, q)
    step = controller.evaluate(2.5, q)
    assert step.status is Status.SINGULAR_J
    # What was found before must not pass for an answer here.
    assert np.all(np.isnan(step.u))
    assert np.isnan(step.residual)
    assert np.linalg.matrix_rank(step.J, tol=1e-9) == len(axes) - 1
    np.testing.assert_array_equal(controller(1.5, beside), good)


def test_an_algorithmic_singularity_is_another_error(robot_2r: Robot) -> None:
    ask_twice = [Task(Position("ee", "x"), [1.0]), Task(LinearCoordinates("q1"), [0.0])]
    controller = Controller(robot_2r, TIP, EJ, added_task=ask_twice)
    with pytest.raises(SingularError, match="extended Jacobian J_e is singular though J is not"):
        controller(0.0, np.zeros(5))


NOWHERE = [
    Task(Heading("link1"), Bearing(Position("link2", "xy"), [0.8, 0.0])),  # the elbow at the target
    Task(Position("ee", "xy"), CallableReference(lambda t: [np.nan, 0.0], 2)),
    Task(CallableFunction(lambda c: [np.inf], ["a"], jacobian=lambda c: np.ones(5)), REST),
    Task(CallableFunction(lambda c: [0.0], ["a"], jacobian=lambda c: np.full(5, np.nan)), REST),
]


@pytest.mark.parametrize("kind", ["pg", "weighted", "rg", "listed rg", "ej", "callable"])
@pytest.mark.parametrize("k", range(len(NOWHERE)))
def test_what_is_undefined_is_an_error_too(kind: str, k: int, robot_2r: Robot) -> None:
    """Neither a crash nor a NaN for an input; the partition is not decided by it either."""
    task, more = NOWHERE[k], {}
    s = len(task.rows(robot_2r))
    resolver: Resolver = {
        "pg": PG,
        "weighted": ProjectedGradient(weights={"v": 2.0}),
        "rg": RG,
        "listed rg": ReducedGradient(partitions=[range(s), range(1, s + 1)]),
        "ej": EJ,
        "callable": CallableResolver(lambda problem: np.linalg.pinv(problem.J) @ problem.rate),
    }[kind]
    if kind == "ej":
        more = {"added_task": Task(LinearCoordinates(*("q1", "q2", "theta")[: 4 - s]), np.zeros(4 - s))}
    controller = Controller(robot_2r, task, resolver, **more)
    with pytest.raises(SingularError, match=r"not finite|lost rank"):
        controller(0.0, np.zeros(5))
    assert controller.evaluate(0.0, np.zeros(5)).status is not Status.SOLVED


@pytest.mark.parametrize("t", [np.nan, np.inf])
def test_a_time_that_is_not_finite_is_named(t: float, robot_2r: Robot) -> None:
    circling = Task(Position("ee", "xy"), Circle([0.0, 0.0], 1.0, 0.2))
    with refused("t"):
        Controller(robot_2r, circling, PG)(t, np.zeros(5))


def test_an_undefined_objective_is_an_error(robot_2r: Robot) -> None:
    steep = CallableObjective(lambda c: 0.0, lambda c: np.full(5, np.nan))
    for resolver in (PG, RG):
        with pytest.raises(SingularError, match="not finite"):
            Controller(robot_2r, TIP, resolver, steep)(0.0, np.zeros(5))


def test_a_resolver_that_answers_nonsense_is_named(robot_2r: Robot) -> None:
    resolver = CallableResolver(lambda problem: np.full(4, np.nan))
    with pytest.raises(SingularError, match="not finite: the resolver's answer"):
        Controller(robot_2r, TIP, resolver)(0.0, np.zeros(5))


def test_errors_have_one_root() -> None:
    assert issubclass(InputError, NmmError)
    assert issubclass(SingularError, NmmError)
    assert issubclass(InputError, ValueError)


@pytest.mark.parametrize(
    ("build", "fields"),
    [
        (lambda robot: Controller(robot, [TIP], "pg"), {"where": "controller", "got": "pg"}),
        (
            lambda robot: Controller("unicycle_2r", [TIP], ProjectedGradient()),
            {"where": "controller", "got": "unicycle_2r"},
        ),
        (lambda robot: Controller(robot, Position("ee", "xy"), ProjectedGradient()), {"where": "task"}),
        (lambda robot: Controller(robot, [TIP], ProjectedGradient(), lambda q: 0.0), {"where": "controller"}),
        (
            lambda robot: Controller(robot, [TIP], ProjectedGradient(), Position("ee")),
            {"where": "controller"},
        ),
        (
            lambda robot: Controller(
                robot, [TIP], ProjectedGradient(), WeightedSum((1.0, Position("ee", "xy")))
            ),
            {"where": "objective", "got": ["ee.x", "ee.y"]},
        ),
        (lambda robot: Task("ee", [1, 2]), {"where": "task", "got": "ee"}),
        (lambda robot: Quadratic(QuadraticTerm({})), {"where": "quadratic objective", "got": None}),
        (lambda robot: H1 + 3, {"where": "objective", "got": 3}),
        (lambda robot: 3 + H1, {"where": "objective", "got": 3}),
        (lambda robot: WeightedSum(), {"where": "sum of objectives"}),
        (lambda robot: Controller(robot, [TIP], ProjectedGradient())(0.0, None), {"where": "q", "got": None}),
        (
            lambda robot: Controller(robot, [TIP], ProjectedGradient()).velocity(0.0, [0.0]),
            {"where": "q", "got": [0.0]},
        ),
        (lambda robot: PiecewisePolynomial([1.0], np.zeros((2, 0, 1))), {"where": "breaks", "got": 1}),
        (
            lambda robot: PiecewisePolynomial([0.0, 1.0], np.zeros((0, 1, 1))),
            {"where": "coefficients", "got": np.zeros((0, 1, 1))},
        ),
        (
            lambda robot: PiecewisePolynomial([1.0, 0.0], np.zeros((1, 1, 1))),
            {"where": "breaks", "got": [1.0, 0.0]},
        ),
    ],
)
def test_the_wrong_kind_of_thing_is_named(
    robot_2r: Robot, build: Callable[[Robot], object], fields: dict[str, Any]
) -> None:
    with refused(**fields):
        build(robot_2r)


def test_pythons_sum_adds_objectives(robot_2r: Robot) -> None:
    at = Configuration(robot_2r, [0.1, 0.2, 0.3, 0.4, 0.5])
    assert sum([H1, H1, H1]).value(at) == pytest.approx(3 * H1.value(at), rel=1e-15)
