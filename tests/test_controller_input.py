"""What the controller refuses: bad input in one line, singular configurations, and what is undefined."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy import pi
from numpy.typing import NDArray
from paper_cases import CIRCLE, H1, TIP

from nmm.control.controller import Controller
from nmm.errors import InputError, NmmError, SingularError
from nmm.functions.objectives import CallableObjective, JointRange, Manipulability, Quadratic, Square, Sum
from nmm.functions.program import evaluate
from nmm.functions.references import Bearing, CallableReference, Circle, Constant, PiecewisePolynomial, Spline
from nmm.functions.tasks import CallableFunction, Coordinates, Heading, Position, Task
from nmm.resolvers import (
    CallableResolver,
    ExtendedJacobian,
    ProjectedGradient,
    ReducedGradient,
    Resolver,
    Status,
)
from nmm.robots.configuration import Configuration
from nmm.robots.loading import load
from nmm.robots.robot import Robot

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


TOO_MANY = [TIP, Task(Heading("link1"), REST), Task(Coordinates("q1", "q2"), [0, 0])]
REFUSED: list[tuple[Callable[[Robot], Any], str]] = [
    (made(Task(Position("tool", "xy"), CIRCLE)), "unknown frame 'tool'.*available: .*ee"),
    (made(Task(Position("e", "xy"), CIRCLE)), r"unknown frame 'e' \(did you mean 'ee'\?\)"),
    (made(Task(Heading("universe"), REST)), "unknown frame 'universe'"),
    (made(TIP, PG, Manipulability("hand", "xy")), "unknown frame 'hand'"),
    (made(Task(Coordinates("q9"), REST)), "unknown coordinate 'q9'.*available: x, y, theta, q1, q2"),
    (made(TIP, PG, Quadratic(Square({"q1": 1, "q8": 1}))), "unknown coordinate 'q8'"),
    (made(TIP, PG, JointRange(["q7"])), "unknown coordinate 'q7'"),
    (made(TIP, PG, JointRange()), "q1 of robot unicycle_2r has no limits"),
    (made(TIP, PG, JointRange(["q1"], [1.0], [1.0])), "expected lower below upper for q1, got 1 and 1"),
    (made(TIP, PG, JointRange(["q1"], [1.0, 2.0], [3.0, 4.0])), "joint range: lower: expected 1 numbers"),
    (made(TIP, ReducedGradient(partitions=[("v", "w")])), "partitions: unknown input 'w'.*v, omega, q1, q2"),
    (made(TIP, ProjectedGradient(weights={"x": 1.0})), "weights: unknown input or group 'x'.*v, omega, q1"),
    (made(Task(Position("ee", "xyz"), CIRCLE)), "expected a reference with 3 components, got Circle with 2"),
    (made(Task(Heading("link1"), CIRCLE)), "task link1.heading: .*with 1 components, got Circle with 2"),
    (made(TOO_MANY), r"5 rows for 4 inputs \(v, omega, q1, q2\); expected at most 4"),
    (made([]), "expected at least one row"),
    (made(TIP, PG, added_task=Task(Coordinates("q1"), REST)), "added_task: resolver pg takes none"),
    (made(TIP, EJ), "added_task: expected 2 rows .*got 0"),
    (made(TIP, EJ, added_task=Task(Coordinates("q1"), REST)), "added_task: expected 2 rows .*got 1"),
    (made(Task(Position("ee", "xy"), CIRCLE, 0.0)), "gain of task ee.x, ee.y: expected positive definite"),
    (made(Task(Position("ee", "xy"), CIRCLE, [1, 2, 3])), "gain .*: expected a number, 2 numbers or a 2 x 2"),
    (made(Task(Position("ee", "xy"), CIRCLE, [[1, 3], [0, 1]])), "gain .*: expected positive definite"),
    (made(Task(Position("ee", "xy"), CIRCLE, [[1, np.nan], [0, 1]])), "gain .*: expected finite numbers"),
    (made(Task(Heading("link1"), Bearing(Heading("link2"), [6, 2]))), "bearing: expected the point"),
    (made(Task(Heading("link1"), Bearing(Position("ee", "x"), [6, 2]))), "bearing: expected the point"),
    (made(TIP, PG, Manipulability("ee", ("x", "y", "rz"), "arm")), "3 rows with 2 inputs is always 0"),
    (made(Task(H1 + H1, REST)), "sum of objectives"),
    (called(np.zeros(4)), r"q: expected 5 numbers, got shape \(4,\).*x, y, theta, q1, q2"),
    (called(np.zeros((5, 1))), r"q: expected 5 numbers, got shape \(5, 1\)"),
    (called([0, 0, np.nan, 0, 0]), "q: expected finite numbers"),
    (called(np.array([0, 0, np.nan, 0, 0])), "q: expected finite numbers"),
    (called(np.full(5, np.nan), RG), "q: expected finite numbers"),
    (called(np.array([0, np.inf, 0, 0, 0]), RG), "q: expected finite numbers"),
    (called({"q1": 1, "q7": 2}), "unknown coordinate 'q7'"),
    (called("home"), "q: expected numbers"),
    (with_callable(lambda c: [1, 2, 3], names=["a"]), r"expected a value of shape \(1,\), got shape \(3,\)"),
    (with_callable(lambda c: "far", names=["a"]), "expected a value of shape .*got 'far'"),
    (
        lambda robot: evaluate(
            CallableFunction(lambda c: c.q[:2], ["a", "b"], jacobian=lambda c: np.eye(5)[:, :2]),
            0.0,
            Configuration(robot, np.zeros(5)),
        ),
        r"expected a Jacobian of shape \(2, 5\), got shape \(5, 2\)",
    ),
    (lambda _: CallableFunction(lambda c: 0, ["a", "b"], units=["m"]), "as many units and angular flags"),
    (lambda _: CallableReference(lambda t: 0, 0), "dimension: expected at least 1"),
    (lambda _: CallableReference(lambda t: 0, 1, jacobian=lambda t, c: 0), "of_configuration=True"),
    (lambda _: Position("ee", "xx"), "axes: expected some of x, y, z, each once"),
    (lambda _: Position("ee", ""), "axes: expected some of x, y, z"),
    (lambda _: Heading("ee", "w"), "unknown direction 'w'"),
    (lambda _: Heading("ee", [0, 0, 0]), "direction: expected a vector that is not zero"),
    (lambda _: Heading("ee", about="w"), "unknown axis 'w'"),
    (lambda _: Manipulability("ee", "xq"), "unknown manipulability row 'q'"),
    (lambda _: Manipulability("ee", "xy", "leg"), "unknown manipulability of 'leg'"),
    (lambda _: Quadratic(), "at least one term"),
    (lambda _: Quadratic(Square("q1", 0.0, -1.0)), "weight: expected a number above 0"),
    (lambda _: H1 * np.inf, "weight: expected finite"),
    (lambda _: Circle([2, 2], 0.0, 1.0), "radius: expected a number above 0"),
    (lambda _: Circle([2, 2], 1.0, 1.0, plane="yz"), "plane: expected xy, or yz or zx with a center of 3"),
    (lambda _: PiecewisePolynomial([0, 1, 2], np.ones((4, 1, 3))), r"coefficients: expected shape .*, 2, "),
    (lambda _: PiecewisePolynomial([0, 1], np.ones((4, 1))), r"coefficients: expected shape .*, 1, "),
    (lambda _: PiecewisePolynomial([1, 0], np.ones((4, 1, 3))), "breaks: expected them to increase"),
    (lambda _: Spline([0, 1, 1], [[0], [1], [2]]), "times: expected them to increase"),
    (lambda _: Spline([0, 1], [[0], [1]], 4), "spline: expected degree 3, or 5"),
    (lambda _: Spline([0, 1], [[0], [1]], 5, "natural"), "at least 3 for degree 5 with natural ends"),
    (lambda _: Spline([0, 1], [[0], [1]], ends="periodic"), "expected the last to equal the first"),
]  # fmt: skip


@pytest.mark.parametrize(("call", "message"), REFUSED, ids=[message for _, message in REFUSED])
def test_bad_input_is_refused_in_one_line(
    call: Callable[[Robot], Any], message: str, robot_2r: Robot
) -> None:
    with pytest.raises(InputError, match=message) as caught:
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
    ask_twice = [Task(Position("ee", "x"), [1.0]), Task(Coordinates("q1"), [0.0])]
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
        more = {"added_task": Task(Coordinates(*("q1", "q2", "theta")[: 4 - s]), np.zeros(4 - s))}
    controller = Controller(robot_2r, task, resolver, **more)
    with pytest.raises(SingularError, match=r"not finite|lost rank"):
        controller(0.0, np.zeros(5))
    assert controller.evaluate(0.0, np.zeros(5)).status is not Status.SOLVED


@pytest.mark.parametrize("t", [np.nan, np.inf])
def test_a_time_that_is_not_finite_is_named(t: float, robot_2r: Robot) -> None:
    circling = Task(Position("ee", "xy"), Circle([0.0, 0.0], 1.0, 0.2))
    with pytest.raises(InputError, match=r"^t: "):
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
    ("build", "words"),
    [
        (lambda robot: Controller(robot, [TIP], "pg"), "Resolver"),
        (lambda robot: Controller("unicycle_2r", [TIP], ProjectedGradient()), "Robot"),
        (lambda robot: Controller(robot, Position("ee", "xy"), ProjectedGradient()), "Task"),
        (lambda robot: Controller(robot, [TIP], ProjectedGradient(), lambda q: 0.0), "Objective"),
        (lambda robot: Controller(robot, [TIP], ProjectedGradient(), Position("ee")), "Objective"),
        (
            lambda robot: Controller(robot, [TIP], ProjectedGradient(), Sum((1.0, Position("ee", "xy")))),
            "one row",
        ),
        (lambda robot: Task("ee", [1, 2]), "function of the robot"),
        (lambda robot: Quadratic(Square({})), "coordinate in every term"),
        (lambda robot: H1 + 3, "objective to add"),
        (lambda robot: 3 + H1, "objective to add"),
        (lambda robot: Sum(), "at least one"),
        (lambda robot: Controller(robot, [TIP], ProjectedGradient())(0.0, None), "None"),
        (lambda robot: Controller(robot, [TIP], ProjectedGradient()).velocity(0.0, [0.0]), "5 numbers"),
        (lambda robot: PiecewisePolynomial([1.0], np.zeros((2, 0, 1))), "at least 2"),
        (lambda robot: PiecewisePolynomial([0.0, 1.0], np.zeros((0, 1, 1))), "order"),
        (lambda robot: PiecewisePolynomial([1.0, 0.0], np.zeros((1, 1, 1))), "increase"),
    ],
)
def test_the_wrong_kind_of_thing_is_named(
    robot_2r: Robot, build: Callable[[Robot], object], words: str
) -> None:
    with pytest.raises(InputError, match=words):
        build(robot_2r)


def test_pythons_sum_adds_objectives(robot_2r: Robot) -> None:
    at = Configuration(robot_2r, [0.1, 0.2, 0.3, 0.4, 0.5])
    assert sum([H1, H1, H1]).value(at) == pytest.approx(3 * H1.value(at), rel=1e-15)
