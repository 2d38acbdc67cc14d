"""Inputs without effect on a task: found, said where nothing else moves them, moved by an objective."""

from __future__ import annotations

import numpy as np
import pytest

import nmm
from nmm.control.step.idle_inputs import idle_inputs, inputs_without_effect
from nmm.model.robots.robot import Robot

START = {"q2": 0.2, "q3": 1.7, "q4": 0.6}
TIP = [0.6, 0.1, 0.58]


@pytest.fixture(scope="module")
def car() -> Robot:
    return nmm.mount("car_base", "small_arm", at="arm_mount")


def controller(robot: Robot, objective: nmm.extending.Objective | None = None) -> nmm.Controller:
    task = nmm.Task(nmm.Position("ee"), TIP)
    return nmm.Controller(robot, task, nmm.ProjectedGradient(), objective, steering=False)


def test_neither_steering_nor_tool_roll_moves_a_position(car: Robot) -> None:
    plain = controller(car)
    assert inputs_without_effect(plain.solver, car.q(START)) == ("steering_rate", "q5")
    assert idle_inputs(plain.solver, car.q(START)) == ("steering_rate", "q5")


def test_what_lowers_the_objective_is_not_idle(car: Robot) -> None:
    steered = controller(car, nmm.Quadratic(nmm.QuadraticTerm({"steering": 1, "q1": -1})))
    assert inputs_without_effect(steered.solver, car.q(START)) == ("steering_rate", "q5")
    assert idle_inputs(steered.solver, car.q(START)) == ("q5",)


def test_what_moves_an_added_task_is_not_idle(car: Robot) -> None:
    task = nmm.Task(nmm.Position("ee"), TIP)
    held = nmm.Task(nmm.LinearCoordinates("steering", "x", "q4", "q5"), [0.1, 0, 0.6, 0])
    extended = nmm.Controller(car, task, nmm.ExtendedJacobian(), added_task=held)
    assert inputs_without_effect(extended.solver, car.q(START)) == ("steering_rate", "q5")
    assert idle_inputs(extended.solver, car.q(START)) == ()


def test_a_run_says_it_once(car: Robot) -> None:
    run = nmm.simulate(controller(car), START, 0.5, 0.01)
    (found,) = run.findings
    assert (found.code, found.values["inputs"]) == ("idle_inputs", ["steering_rate", "q5"])
    idle = run.u[:, [car.input("steering_rate"), car.input("q5")]]
    np.testing.assert_allclose(idle, 0.0, atol=1e-15)  # the kinematics' rounding


def test_the_objective_moves_what_has_no_effect_on_the_task(car: Robot) -> None:
    squares = nmm.Quadratic(nmm.QuadraticTerm("steering", 0.15), nmm.QuadraticTerm("q5", -0.3))
    run = nmm.simulate(controller(car, squares), START, 2.0, 0.01)
    assert run.warnings == ()
    # Alone in their columns, they go to their targets as the gradient's flow says: e(t) = e(0) exp(-alpha t).
    for name, target in (("steering", 0.15), ("q5", -0.3)):
        reached = run.q[:, car.coordinate(name)]
        np.testing.assert_allclose(reached, target * (1 - np.exp(-10 * run.t)), atol=1e-6)
    assert np.abs(run.error[-1]).max() < 0.15 * np.abs(run.error[0]).max()


def test_a_task_that_cannot_be_evaluated_there_says_nothing(car: Robot) -> None:
    def near_the_start(configuration: nmm.Configuration) -> float:
        if abs(configuration.q[0]) > 1e-3:
            raise ValueError("far away")
        return float(configuration.q[4])

    task = nmm.Task(nmm.CallableFunction(near_the_start, ["a"]), [0.0])
    solver = nmm.Controller(car, task, nmm.ProjectedGradient()).solver
    assert inputs_without_effect(solver, car.q(START)) == ()
