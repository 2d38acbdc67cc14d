"""What the base classes promise to those who add a platform, a function or a resolver of their own."""

from __future__ import annotations

import dataclasses
import math
from typing import ClassVar

import numpy as np
import pytest
from derivatives import assert_close, check_equation, check_function, partials
from findings import refused
from function_grid import random_configuration
from numpy.typing import NDArray
from paper_cases import CASES, H1, TIP, Case
from symbolic_checks import check_numbers

from nmm.base.errors import InputError
from nmm.base.kernels.compiled import PLATFORM, Kernel, kernel
from nmm.base.kernels.records import FUNCTION, At, Frames, Rows
from nmm.control.controller import Controller
from nmm.control.functions.function import Function, Row, Shown, Stage
from nmm.control.functions.objectives import Manipulability, WeightedSum
from nmm.control.functions.references import Line
from nmm.control.functions.tasks import CallableFunction, Position, Task
from nmm.control.resolvers import (
    Dimensions,
    Problem,
    ProjectedGradient,
    ReducedGradient,
    Resolver,
    Setup,
    State,
)
from nmm.control.resolvers.answer import AnswerArrays, certify
from nmm.control.resolvers.base import RESOLVER
from nmm.control.resolvers.problem_arrays import ProblemArrays
from nmm.model.platforms import Platform
from nmm.model.robots.configuration import Configuration
from nmm.model.robots.robot import Robot
from nmm.motion.simulation import simulate
from nmm.motion.trajectory import Trajectory
from nmm.plugins.symbolic import symbolic

Array = NDArray[np.float64]


@kernel(PLATFORM)
def turret(qp: Array, parameters: Array, G: Array, G_q: Array) -> None:
    """The platform turns q1 along with itself, by a gear that slips: parameters = [ratio, slip]."""
    ratio = parameters[0]
    slip = parameters[1]
    G[0, 0] = math.cos(qp[2])
    G[1, 0] = math.sin(qp[2])
    G[2, 1] = 1.0
    G[3, 1] = ratio * math.cos(qp[3])
    G[3, 2] = 1.0 + slip * math.sin(qp[3] + qp[2])
    G_q[0, 0, 2] = -math.sin(qp[2])
    G_q[1, 0, 2] = math.cos(qp[2])
    G_q[3, 1, 3] = -ratio * math.sin(qp[3])
    G_q[3, 2, 2] = slip * math.cos(qp[3] + qp[2])
    G_q[3, 2, 3] = slip * math.cos(qp[3] + qp[2])


class Turret(Platform):
    """Four coordinates, the arm's first joint among them, and three inputs."""

    name: ClassVar[str] = "turret"
    coordinates: ClassVar[tuple[str, ...]] = ("x", "y", "theta", "q1")
    inputs: ClassVar[tuple[str, ...]] = ("v", "omega", "turret")
    input_units: ClassVar[tuple[str, ...]] = ("m/s", "rad/s", "rad/s")

    def __init__(self, ratio: float, slip: float) -> None:
        self._parameters = np.array([ratio, slip])

    @property
    def parameters(self) -> Array:
        return self._parameters

    @property
    def velocity_map(self) -> Kernel:
        return turret

    def pfaffian(self, qp: Array) -> Array:
        return np.array([[-math.sin(qp[2]), math.cos(qp[2]), 0.0, 0.0]])


@pytest.fixture(scope="module")
def robot(robot_2r: Robot) -> Robot:
    return dataclasses.replace(robot_2r, platform=Turret(0.7, 0.3))


def test_platform_with_its_own_joint(robot: Robot, rng: np.random.Generator) -> None:
    platform = robot.platform
    assert robot.u_names == ("v", "omega", "turret", "q2")
    assert (robot.n, robot.n_u, platform.n_p, platform.p) == (5, 4, 4, 3)
    for _ in range(10):
        q = random_configuration(robot, rng)
        G = platform.G(q[:4])
        np.testing.assert_allclose(platform.A(q[:4]) @ G, 0.0, atol=1e-15)
        S = robot.S(q)
        np.testing.assert_array_equal(S[:4, :3], G)
        np.testing.assert_array_equal(S[4], [0, 0, 0, 1])
        assert np.all(S[:4, 3] == 0.0)
        G_q = partials(platform.G, q[:4])
        direction = rng.normal(size=4)
        assert_close(platform.G_dot(q[:4], direction), G_q @ direction)


def test_platform_and_function_of_ones_own_have_formulas(robot: Robot, rng: np.random.Generator) -> None:
    """Nothing is written for them: the kernels themselves are run on symbols."""
    for function in (Position("ee", "xy"), SquareDistance("ee", "base_footprint", 0.0)):
        check_numbers(robot, function, symbolic(robot, function), rng.uniform(-3, 3, (3, robot.n)))


@pytest.mark.parametrize("rows", ["x", "xy", ("x", "y", "rz")], ids=str)
def test_manipulability_follows_every_platform(
    rows: tuple[str, ...], robot: Robot, rng: np.random.Generator
) -> None:
    """Its gradient has dG/dq in it, in the platform's own joint too."""
    for _ in range(5):
        check_function(Manipulability("ee", rows), robot, 0.0, random_configuration(robot, rng))
    check_function(Manipulability("ee", "y", "arm"), robot, 0.0, random_configuration(robot, rng))


@pytest.mark.parametrize("case", CASES[:3], ids=[case.name for case in CASES[:3]])
def test_the_controller_takes_every_platform(case: Case, robot: Robot, rng: np.random.Generator) -> None:
    q = case.q0 + rng.normal(scale=0.5, size=5)
    for resolver in (ProjectedGradient(), ReducedGradient()):
        controller = case.controller(robot, resolver)
        check_equation(controller, 3.0, q)
        step = controller.evaluate(3.0, q)
        assert step.residual < 1e-10
        assert_close(step.q_dot, robot.S(q) @ step.u)


def test_a_model_without_the_platforms_joints_is_refused(robot_3r: Robot) -> None:
    class Elsewhere(Turret):
        coordinates: ClassVar[tuple[str, ...]] = ("x", "y", "theta", "hitch")

    with refused("unicycle_3r: platform turret", got=("x", "y", "theta", "q1")) as caught:
        dataclasses.replace(robot_3r, platform=Elsewhere(0.0, 0.0))
    assert caught.value.expected == "x, y, theta, hitch as the first coordinates"


@kernel(FUNCTION)
def square_distance(at: At, frames: Frames, numbers: Array, rows: Rows) -> None:
    """Between two frames, with a beat in time; numbers = [frequency]."""
    rows.value[0] = math.sin(numbers[0] * at.t)
    rows.value_t[0] = numbers[0] * math.cos(numbers[0] * at.t)
    for i in range(3):
        difference = frames.placements[frames.slots[0], i, 3] - frames.placements[frames.slots[1], i, 3]
        rows.value[0] += difference * difference
        for j in range(at.q.shape[0]):
            rows.value_q[0, j] += (
                2
                * difference
                * (frames.jacobians[frames.slots[0], i, j] - frames.jacobians[frames.slots[1], i, j])
            )


class SquareDistance(Function):
    def __init__(self, a: str, b: str, frequency: float) -> None:
        self.a, self.b, self.frequency = a, b, frequency

    def rows(self, robot: Robot) -> tuple[Row, ...]:
        return (Row("distance", "m²"),)

    def stages(self, robot: Robot) -> tuple[Stage, ...]:
        return (Stage(square_distance, 1, (self.a, self.b), np.array([self.frequency])),)


def test_function_with_its_own_kernel(robot_3r: Robot, rng: np.random.Generator) -> None:
    own = SquareDistance("ee", "base_footprint", 0.0)

    def distance(configuration: Configuration) -> float:
        a, b = (configuration.placement(frame).translation for frame in ("ee", "base_footprint"))
        return float(np.sum((a - b) ** 2))

    q = random_configuration(robot_3r, rng)
    check_function(SquareDistance("link2", "ee", 3.0), robot_3r, 0.4, q)
    objective = WeightedSum((0.3, own), (1.0, Manipulability("ee")))
    inputs = []
    for function in (own, CallableFunction(distance, ["distance"])):
        task = Task(function, Line(0.5, 1.5, 3.0))
        inputs.append(Controller(robot_3r, task, ProjectedGradient(), objective)(1.0, q))
    np.testing.assert_allclose(*inputs, rtol=0, atol=1e-8)


class Beacon(CallableFunction):
    """A joint over a position whose y comes first, and a point that is looked at."""

    def __init__(self, said: Shown) -> None:
        super().__init__(
            lambda c: [c.q[3], *c.placement("ee").translation[1::-1]],
            ["q1", "y", "x"],
            units=["rad", "m", "m"],
        )
        self.said = said

    def shown(self) -> Shown:
        return self.said


def test_figures_show_what_a_users_task_says(robot_2r: Robot) -> None:
    start = np.array([0.0, 0.0, 0.3, 0.4, 0.9])
    target = Line([0.4, 0.2, 0.9], [0.7, -0.3, 1.1], 1.0)

    def run(said: Shown) -> Trajectory:
        task = Task(Beacon(said), target)
        return simulate(Controller(robot_2r, task, ProjectedGradient()), start, duration=0.4, dt=0.1)

    found = run(Shown("ee", {"y": 1, "x": 2}, looks_at=np.array([1.0, 2.0])))
    path = [Configuration(robot_2r, q).placement("ee").translation for q in found.q]
    assert found.frame == "ee"
    np.testing.assert_allclose(found.path, path, rtol=0, atol=1e-15)
    np.testing.assert_array_equal(found.desired, np.c_[found.r_d[:, [2, 1]], found.path[:, 2]])
    np.testing.assert_array_equal(found.target, [1.0, 2.0, found.path[0, 2]])

    turned = run(Shown(turns="link1"))
    assert (turned.frame, turned.desired, turned.target) == ("link1", None, None)
    silent = run(Shown())
    assert (silent.frame, silent.path, silent.desired, silent.target) == (None, None, None, None)
    np.testing.assert_array_equal(silent.q, found.q)
    for said, complaint in (
        (Shown("hand"), {"where": "robot unicycle_2r", "got": "hand"}),
        (Shown("ee", {"x": 3}), {"where": "Beacon.shown", "got": {"x": 3}}),
        (Shown("ee", {"rx": 0}), {"where": "Beacon.shown", "got": {"rx": 0}}),
        (Shown("ee", looks_at=np.zeros(4)), {"where": "Beacon.shown", "got": np.zeros(4)}),
    ):
        with refused(**complaint):
            run(said)


@kernel(FUNCTION)
def folded(at: At, frames: Frames, numbers: Array, rows: Rows) -> None:
    """|cos q|, q the last coordinate."""
    last = at.q.shape[0] - 1
    rows.value[0] = abs(math.cos(at.q[last]))
    rows.value_q[0, last] = -math.sin(at.q[last]) if math.cos(at.q[last]) > 0.0 else math.sin(at.q[last])


class Folded(SquareDistance):
    def stages(self, robot: Robot) -> tuple[Stage, ...]:
        return (Stage(folded, 1),)


def test_a_kernel_with_several_formulas_is_refused(robot_2r: Robot) -> None:
    with refused("symbolic") as caught:
        symbolic(robot_2r, Folded("", "", 0.0))
    assert caught.value.what.startswith("one of the kernels branches on the configuration")


@kernel(FUNCTION)
def swaying(at: At, frames: Frames, numbers: Array, rows: Rows) -> None:
    """t^a sin q + b t, q the last coordinate; numbers = [a, b]."""
    last = at.q.shape[0] - 1
    rows.value[0] = at.t ** numbers[0] * math.sin(at.q[last]) + numbers[1] * at.t
    rows.value_t[0] = numbers[1]
    if numbers[0] != 0.0:
        rows.value_t[0] += numbers[0] * at.t ** (numbers[0] - 1.0) * math.sin(at.q[last])
    rows.value_q[0, last] = at.t ** numbers[0] * math.cos(at.q[last])


class Swaying(SquareDistance):
    def __init__(self, power: float, drift: float) -> None:
        self.numbers = np.array([power, drift])

    def stages(self, robot: Robot) -> tuple[Stage, ...]:
        return (Stage(swaying, 1, numbers=self.numbers),)


def test_a_formula_is_one_of_the_configuration_alone(robot_2r: Robot, rng: np.random.Generator) -> None:
    for function in (Swaying(1.0, 0.0), Swaying(0.0, 0.5)):
        check_function(function, robot_2r, 0.4, random_configuration(robot_2r, rng))
        with pytest.raises(
            InputError, match="no formula for Swaying: it depends on the time and on the conf"
        ):
            symbolic(robot_2r, function)
    # As a target it may drift: only its derivatives are in J.
    task = Task(Swaying(0.0, 0.0), Swaying(0.0, 0.5))
    assert not any(symbolic(robot_2r, task).minors.values())
    check_numbers(robot_2r, Swaying(0.0, 0.0), symbolic(robot_2r, Swaying(0.0, 0.0)), rng.normal(size=(3, 5)))


@kernel(RESOLVER)
def steepest(
    problem: ProblemArrays, numbers: Array, options: Array, state: Array, answer: AnswerArrays
) -> None:
    """One row: u = J' rate / |J|^2; counts its calls."""
    J = problem.J
    square = 0.0
    for j in range(J.shape[1]):
        square += J[0, j] * J[0, j]
    for j in range(J.shape[1]):
        answer.u[j] = J[0, j] * problem.rate[0] / square
    state[0] += 1
    answer.measure[()] = square
    certify(problem, answer)


class Steepest(Resolver):
    name: ClassVar[str] = "steepest"
    exact: ClassVar[bool] = True

    @property
    def kernel(self) -> Kernel:
        return steepest

    def setup(self, dimensions: Dimensions) -> Setup:
        self.check(dimensions)
        return Setup(np.zeros(0), np.zeros(0, dtype=np.int64))

    def start(self, dimensions: Dimensions) -> State:
        return State([0])


def test_resolver_with_its_own_kernel(robot_2r: Robot, rng: np.random.Generator) -> None:
    task = Task(SquareDistance("ee", "base_footprint", 0.0), [0.4])
    q = random_configuration(robot_2r, rng)
    controller = Controller(robot_2r, task, Steepest(), H1)
    expected = Controller(robot_2r, task, ProjectedGradient())(0.0, q)
    for calls in (1, 2, 3):
        np.testing.assert_allclose(controller(0.0, q), expected, rtol=1e-13)
        assert controller.solver.state.memory[0] == calls
    controller.reset()
    assert controller.evaluate(0.0, q).partition[0] == -1
    assert controller.solver.state.memory[0] == 0  # a look
    controller(0.0, q)
    assert controller.solver.state.memory[0] == 1
    alone = Steepest().resolve(Problem([[1.0, 2.0]], [5.0], np.zeros(2)))
    np.testing.assert_allclose(alone.u, [1.0, 2.0])
    with refused("added_task"):
        Controller(robot_2r, task, Steepest(), added_task=TIP)
