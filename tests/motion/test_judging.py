"""What judges a run in compiled code is what the same words give in NumPy, sample by sample."""

from __future__ import annotations

import numpy as np
import pytest

import nmm
from nmm.control.step.idle_inputs import _configurations
from nmm.model.robots.frame_path import FramePath
from nmm.model.robots.robot import CENTER_OF_MASS
from nmm.motion.diagnosis.assessment import linearisation, linearisations
from nmm.motion.diagnosis.error_bound import SAFETY, Feedback, TaskSamples, step_errors

CASES = ("unicycle_2r_position", "tiago_tray", "unicycle_2r_switching")


def around(name: str) -> tuple[nmm.Controller, np.ndarray, np.ndarray]:
    """A scenario's controller, times and configurations about its start."""
    scenario = nmm.Scenario.load(name)
    controller = scenario.controller()
    q = _configurations(controller, controller.robot.q(scenario.parts.q0))
    return controller, np.linspace(0.0, 1.0, len(q)), q


@pytest.mark.parametrize("name", CASES)
def test_linearisations_are_those_of_single_calls(name: str) -> None:
    """Compiled kinematics and Pinocchio's differ by rounding, which differences over 6e-6 magnify."""
    controller, times, q = around(name)
    found = linearisations(controller, times, q)
    assert np.isfinite(found).any()
    for F, t, one in zip(found, times, q, strict=True):
        controller.reset()
        try:
            with controller.without_limits():
                expected = linearisation(controller, t, one)
        except nmm.SingularError:
            assert not np.isfinite(F).all()
        else:
            np.testing.assert_allclose(F, expected, atol=1e-7 * max(1.0, np.abs(expected).max()))


def test_a_linearisation_beside_a_singular_matrix_is_no_number(robot_2r: nmm.Robot) -> None:
    task = nmm.Task(nmm.Position("ee", "xyz"), [1.0, 0.5, 0.0])
    controller = nmm.Controller(robot_2r, task, nmm.ProjectedGradient())
    F = linearisations(controller, np.zeros(2), np.full((2, robot_2r.n), 0.3))
    assert np.isnan(F).any(axis=(1, 2)).all()


@pytest.mark.parametrize("name", CASES)
def test_errors_of_many_samples_are_those_of_each(name: str) -> None:
    controller, times, q = around(name)
    error, rate = controller.solver.errors(times, q)
    for k, t in enumerate(times):
        one = controller.evaluate(t, q[k])
        np.testing.assert_allclose(error[k], one.error, atol=1e-12)
        np.testing.assert_allclose(rate[k], one.rate, atol=1e-11)


@pytest.mark.parametrize("order", [1, 2, 4])
def test_the_error_of_a_step_is_its_formula(order: int) -> None:
    """c ρ^(p-1) of error_bound's head; where u jumps with the partition, its change before counts."""
    rng = np.random.default_rng(order)
    N, s, m = 60, 2, 4
    t = np.cumsum(rng.uniform(0.005, 0.02, N))
    shapes = (s,), (s,), (s, m), (m,)
    error, moved, J, u = (1.0 + np.cumsum(0.1 * rng.standard_normal((N, *one)), axis=0) for one in shapes)
    u[20] = 90.0
    J[40] *= -1.0  # not resolved: nothing is allowed
    partition = np.tile(np.array([0, 1]), (N, 1))
    partition[20:] = [1, 2]
    K = np.array([[2.0, 0.3], [0.0, 1.0]])
    rows = np.full(s, np.inf), np.full(s, np.inf), np.zeros(s, dtype=np.int64)
    samples = TaskSamples(t, error, moved + error @ K.T, J, u, np.zeros(N), partition, Feedback(K, *rows))

    def change(values: np.ndarray) -> np.ndarray:
        flat = values.reshape(N, -1)
        size = np.linalg.norm(flat, axis=1)
        return np.linalg.norm(np.diff(flat, axis=0), axis=1) / np.maximum(size[1:], size[:-1])

    h, of_u = np.diff(t), change(u)
    of_u[19] = of_u[18]
    along = np.einsum("kij,kj->ki", np.diff(J, axis=0), u[:-1])
    drift = np.linalg.norm(np.diff(moved, axis=0), axis=1)
    again = np.linalg.norm(error[:-1] @ K.T @ K.T, axis=1)
    first = 0.5 * h * (np.linalg.norm(along, axis=1) + drift + h * again)
    unresolved = np.maximum(of_u, change(J))
    share = np.maximum.reduce([unresolved, change(moved), h * np.linalg.norm(K, 2)])
    expected = np.where(unresolved <= 1.0, SAFETY * first * np.minimum(share, 1.0) ** (order - 1), 0.0)
    found = step_errors(samples, order)
    np.testing.assert_allclose(found, expected, rtol=1e-9)
    assert np.flatnonzero(found == 0.0).tolist() == [39, 40]


@pytest.mark.parametrize("frame", ["ee", "arm_tool_link", None])
def test_a_path_without_jacobians_is_the_same_to_the_bit(frame: str | None, robot_2r: nmm.Robot) -> None:
    robot = nmm.Scenario.load("tiago_pose").robot() if frame == "arm_tool_link" else robot_2r
    path = FramePath(robot, frame or CENTER_OF_MASS)
    q = 0.7 * np.random.default_rng(0).standard_normal((20, robot.n))
    assert np.array_equal(path.positions(q), path.jacobians(q)[0])
