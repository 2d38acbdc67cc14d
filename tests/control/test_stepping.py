"""Steps of the closed loop in one call, threads, and copies."""

import copy
import threading
from itertools import product

import numpy as np
import pytest
from findings import refused
from thinned import thinned

import nmm

SCENARIOS = ["unicycle_2r_position", "unicycle_3r_position", "tiago_pose", "kinova_car"]
METHODS = ["rk4", "midpoint", "euler", "zoh", "zoh_midpoint"]


def with_kinematics(controller: nmm.Controller, kinematics: str) -> nmm.Controller:
    made, given = controller.__reduce__()
    return made(*given[:-1], kinematics)


CASES = list(product(SCENARIOS, METHODS))


@pytest.mark.parametrize(("name", "method"), thinned(CASES, lambda case: case in CASES[::2]))
def test_a_compiled_step_is_one_of_a_simulation(name: str, method: str) -> None:
    """With limits, where the scenario has some: bounds are the sample's at its stages, too."""
    scenario = nmm.Scenario.load(name)
    usual = scenario.controller()
    dt, q0 = scenario.parts.dt, usual.robot.q(scenario.parts.q0)
    run = nmm.simulate(usual, q0, 30 * dt, dt, method)
    for kinematics in ("pinocchio", "compiled"):
        one = with_kinematics(usual, kinematics)
        q = q0
        for k in range(30):
            ahead, u = one.step(run.t[k], q, dt, method)
            np.testing.assert_allclose(u, run.u[k], atol=1e-11)
            q = ahead
            np.testing.assert_allclose(q, run.q[k + 1], atol=1e-12)


def test_what_cannot_be_one_call_steps_as_well() -> None:
    """An objective in Python, and a resolver in Python."""
    robot = nmm.load("unicycle_3r")
    task = nmm.Task(nmm.Position("ee", "xy"), [2.0, 0.5], gain=1.0)
    by_hand = nmm.CallableObjective(lambda configuration: 0.5 * float(configuration.q[3] ** 2))
    square = nmm.Quadratic(nmm.QuadraticTerm("q1"))
    steps = [
        nmm.Controller(robot, task, nmm.ProjectedGradient(), objective, kinematics="compiled").step(
            0.0, robot.q({"q1": 0.4, "q2": 0.7}), 0.01
        )
        for objective in (by_hand, square)
    ]
    np.testing.assert_allclose(steps[0][0], steps[1][0], atol=1e-7)


def test_bad_steps_are_refused() -> None:
    controller = nmm.Scenario.load("unicycle_2r_position").controller()
    q = controller.robot.rest
    with refused("method", got="adaptive"):
        controller.step(0.0, q, 0.01, "adaptive")
    with refused("dt", got=0.0):
        controller.step(0.0, q, 0.0)
    with refused(got="leapfrog"):
        controller.step(0.0, q, 0.01, "leapfrog")


def test_a_second_thread_is_refused_by_name_and_copies_work() -> None:
    robot = nmm.load("unicycle_3r")
    inside, go_on, found = threading.Event(), threading.Event(), []

    def slow(configuration: nmm.Configuration) -> float:
        if threading.current_thread().name == "first":
            inside.set()
            go_on.wait(20.0)
        return 0.5 * float(configuration.q[3] ** 2)

    task = nmm.Task(nmm.Position("ee", "xy"), [2.0, 0.5], gain=1.0)
    objective = nmm.CallableObjective(slow, lambda configuration: np.eye(robot.n)[3] * configuration.q[3])
    controller = nmm.Controller(robot, task, nmm.ProjectedGradient(), objective)
    q = robot.q({"q1": 0.4, "q2": 0.7})
    expected = controller(0.0, q)
    first = threading.Thread(target=lambda: found.append(controller(0.0, q)), name="first")
    first.start()
    assert inside.wait(20.0)
    for ask in (
        controller,
        controller.evaluate,
        controller.velocity,
        lambda t, q: controller.step(t, q, 0.01),
    ):
        with pytest.raises(nmm.RunError, match=r"MainThread.*copy\.copy"):
            ask(0.0, q)
    np.testing.assert_array_equal(copy.copy(controller)(0.0, q), expected)
    go_on.set()
    first.join()
    np.testing.assert_array_equal(found[0], expected)
    np.testing.assert_array_equal(controller(0.0, q), expected)


@pytest.mark.parametrize("kinematics", ["pinocchio", "compiled"])
def test_steps_of_tasks_that_come_and_go_are_those_of_a_simulation(kinematics: str) -> None:
    robot = nmm.load("unicycle_3r")
    tasks = [
        nmm.Task(nmm.Position("ee", "xy"), target, gain=1.0, when=nmm.Between(*when))
        for target, when in (([2.0, 0.5], (0.0, 0.1)), ([1.8, -0.4], (0.1, 9.0)))
    ]
    q = q0 = robot.q({"q1": 0.4, "q2": 0.7})
    run = nmm.simulate(nmm.SequencedController(robot, tasks, nmm.ProjectedGradient()), q0, 0.2, 0.01)
    one = nmm.SequencedController(robot, tasks, nmm.ProjectedGradient(), kinematics=kinematics)
    for k in range(20):
        q, u = one.step(run.t[k], q, 0.01)
        np.testing.assert_allclose(u, run.u[k], atol=1e-11)
        np.testing.assert_allclose(q, run.q[k + 1], atol=1e-12)
    assert len(run.events) >= 2
