"""Every analytic derivative against central differences, over the grid of options and on all robots."""

from __future__ import annotations

from typing import Literal

import numpy as np
import pytest
from derivatives import (
    assert_close,
    check_equation,
    check_function_at,
    derivative,
    partials,
)
from function_grid import ENTRIES, TIMES, Entry, concrete_subclasses, random_configuration
from gripping import folding, hitched
from numpy.typing import NDArray
from paper_cases import CASES, Case
from platform_grid import EXAMPLES, random_qp

from nmm.analysis.singular.jacobians import Reached
from nmm.base.kinds import OBJECTIVES, REFERENCES, TASKS
from nmm.control.controller import Controller
from nmm.control.functions.function import Function
from nmm.control.functions.objectives import (
    Clearance,
    Manipulability,
    Objective,
    Quadratic,
    QuadraticTerm,
    WeightedSum,
)
from nmm.control.functions.program import Program, evaluate
from nmm.control.functions.pursuit import Pursuit
from nmm.control.functions.references import CallableReference, Circle
from nmm.control.functions.tasks import LinearCoordinates, MeasuredPoints, Position, Task
from nmm.control.functions.tasks.measured import MeasuredPoint
from nmm.control.functions.tasks.pose import PartsOfPose
from nmm.control.functions.tasks.task import Comparison
from nmm.control.resolvers import ProjectedGradient
from nmm.model.robots.configuration import Configuration
from nmm.model.robots.robot import Robot
from nmm.plugins.planning.following import FromPlan
from nmm.plugins.planning.parking import Parking

Array = NDArray[np.float64]


@pytest.mark.parametrize("entry", ENTRIES, ids=[entry.name for entry in ENTRIES])
def test_value_t_and_value_q(entry: Entry, robots: dict[str, Robot], rng: np.random.Generator) -> None:
    """On one robot at all times: with which robot it is, nothing changes in time."""
    for name in entry.robots:
        times = TIMES if name == entry.robots[0] else TIMES[1:3]
        points = [(t, random_configuration(robots[name], rng)) for t in times]
        check_function_at(entry.function, robots[name], points)


def test_the_grid_holds_every_function() -> None:
    # A comparison is no function on its own: the closed loops below are its test. A target that is reached
    # wherever the robot is stands still by definition: test_analysis_subjects.py. What parts of a pose share
    # is a base, and the pursuit's angles are values alone: its spring's gradient is in test_steering.py.
    # Distances have kinks and Coal's last digits: test_clearance.py. One from a plan needs the plan:
    # test_plans_followed.py. A parking law's rows are velocities: test_parking.py. Measured points change
    # with pictures alone: test_measured_points.py.
    apart = {Clearance, Comparison, FromPlan, Parking, Reached, PartsOfPose, Pursuit}
    apart |= {MeasuredPoints, MeasuredPoint}
    examples = {type(entry.function) for entry in ENTRIES}
    for listed in (TASKS, REFERENCES, OBJECTIVES):
        without = [name for name, kind in listed.items() if kind not in examples | apart]
        assert not without, f"add entries to function_grid.py for the {listed.what}s {', '.join(without)}"
    missing = concrete_subclasses(Function) - examples - apart
    assert not missing, f"add entries to function_grid.py for {sorted(kind.__name__ for kind in missing)}"


@pytest.mark.parametrize("name", ["unicycle_2r", "unicycle_3r", "unicycle_3r_folding"])
def test_functions_laid_out_together_do_not_disturb_each_other(
    name: str, robots: dict[str, Robot], rng: np.random.Generator
) -> None:
    robot = robots[name]
    listed = [e.function for e in ENTRIES if name in e.robots and not isinstance(e.function, WeightedSum)]
    functions = [listed[k] for k in rng.permutation(len(listed))]
    program = Program(robot, functions)
    program.lay_out()
    for t in TIMES[:3]:
        q = random_configuration(robot, rng)
        for function, together in zip(functions, program.evaluate(t, q), strict=True):
            alone = evaluate(function, t, Configuration(robot, q))
            for a, b in zip(together, alone, strict=True):
                np.testing.assert_array_equal(a, b, err_msg=repr(function))


def test_an_objective_as_a_function_is_its_value_and_gradient(
    robot_3r: Robot, rng: np.random.Generator
) -> None:
    configuration = Configuration(robot_3r, random_configuration(robot_3r, rng))
    for function in (entry.function for entry in ENTRIES):
        if isinstance(function, Objective) and not isinstance(function, WeightedSum):
            found = evaluate(function, 0.0, configuration)
            assert found.value[0] == function.value(configuration)
            np.testing.assert_array_equal(found.value_q[0], function.gradient(configuration))


def test_differences_of_callables_stay_good_late_and_far_away(robot_2r: Robot) -> None:
    """After an hour, and kilometres and hundreds of turns away, a sine still changes over a radian."""
    q = np.array([3000.0, -4000.0, 800.0, 300.0, -500.0])
    late = CallableReference(  # fast in t and in x, slow in theta
        lambda t, c: np.sin(6 * t) + np.sin(3 * c.q[0]) + np.cos(c.q[2] + 2 * c.q[3]),
        1,
        of_configuration=True,
    )
    found = evaluate(late, 3600.0, Configuration(robot_2r, q))
    assert found.value_t[0] == pytest.approx(6 * np.cos(6 * 3600.0), rel=1e-6)
    slope = -np.sin(q[2] + 2 * q[3])
    expected = [3 * np.cos(3 * q[0]), 0.0, slope, 2 * slope, 0.0]
    np.testing.assert_allclose(found.value_q[0], expected, rtol=1e-6, atol=1e-8)


each_case = pytest.mark.parametrize("case", CASES, ids=[case.name for case in CASES])


@each_case
def test_J_bar_and_h_are_derivatives_along_every_input(
    case: Case, robots: dict[str, Robot], rng: np.random.Generator
) -> None:
    robot = robots[case.robot]
    for t in (0.0, 3.3, 17.0):
        check_equation(case.controller(robot), t, case.q0 + rng.normal(scale=0.7, size=robot.n))


@pytest.mark.parametrize("robot", [folding(), hitched()], ids=["folding", "hitched"])
@pytest.mark.parametrize("of", ["robot", "arm"])
def test_J_bar_and_h_through_joints_that_follow(
    robot: Robot, of: Literal["robot", "arm"], rng: np.random.Generator
) -> None:
    """One that follows its arm's, and one that follows a coordinate of the platform, by which G changes."""
    tasks = [Task(Position("ee", "xy"), Circle([2, 2], 3, 0.08), 1.0), Task(LinearCoordinates("q3"), [0.4])]
    bent = Quadratic(*(QuadraticTerm(name, 0.3) for name in robot.q_names[2:]))
    objective = 2.0 * Manipulability("ee", "xy", of) - bent
    controller = Controller(robot, tasks, ProjectedGradient(), objective)
    for _ in range(5):
        q = robot.following.placed(rng.uniform(-1.0, 1.0, robot.n))
        check_equation(controller, 1.3, q)
        here = controller.evaluate(1.3, q)
        np.testing.assert_allclose(here.q_dot, robot.S(q) @ here.u, atol=1e-13)


@each_case
def test_the_error_obeys_its_equation(case: Case, robots: dict[str, Robot], rng: np.random.Generator) -> None:
    """J_bar u = rate means e_dot = -K e along the motion: however the target moves, and with q too."""
    controller = case.controller(robots[case.robot])
    q = case.q0 + rng.normal(scale=0.3, size=case.q0.size)
    here = controller.evaluate(4.0, q)
    assert_close(derivative(lambda h: controller.evaluate(4.0 + h, q + h * here.q_dot).error), -here.error)


@pytest.mark.parametrize("name", EXAMPLES)
def test_platform_G_q(name: str, rng: np.random.Generator) -> None:
    platform = EXAMPLES[name]
    for _ in range(20):
        qp = random_qp(platform, rng, 4.0)
        G_q = partials(platform.G, qp)
        for direction in (*np.eye(platform.n_p), rng.normal(size=platform.n_p)):
            assert_close(platform.G_dot(qp, direction), G_q @ direction)


@pytest.mark.parametrize("name", ["unicycle_2r", "unicycle_3r"])
def test_frame_jacobians_and_hessians(name: str, robots: dict[str, Robot], rng: np.random.Generator) -> None:
    robot = robots[name]
    for frame in robot.frames:
        q = random_configuration(robot, rng)
        check_frame(robot, frame, q)


def check_frame(robot: Robot, frame: str, q: Array) -> None:
    here = Configuration(robot, q)
    R = here.placement(frame).rotation

    def pose(q: Array) -> Array:
        there = Configuration(robot, q).placement(frame)
        turn = there.rotation @ R.T
        # Half the skew part of a rotation is the sine of its angle times its axis.
        axis = np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]])
        return np.concatenate([there.translation, axis / 2])

    assert_close(here.jacobian(frame), partials(pose, q))
    assert_close(here.hessian(frame), partials(lambda q: Configuration(robot, q).jacobian(frame), q))
