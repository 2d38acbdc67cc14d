"""A loop at another period than its controller's dt is told so once; one that is late now and then is not."""

from __future__ import annotations

import copy
import pickle
import time
import warnings

import numpy as np
import pytest

import nmm

DT = 0.01


def towards_its_stop(kinematics: str = "pinocchio") -> tuple[nmm.Controller, np.ndarray]:
    """A planar arm whose q2 may not go below 0.5, drawn to where it would have to."""
    robot = nmm.load("unicycle_2r", platform="fixed")
    task = nmm.Task(nmm.Position("ee", "xy"), [1.3, 0.3], gain=4.0)
    limits = nmm.Limits(velocity=False, position={"q2": [0.5, 2.0]}, acceleration=4.0)
    resolver = nmm.DampedLeastSquares()
    controller = nmm.Controller(robot, task, resolver, limits=limits, dt=DT, kinematics=kinematics)
    return controller, robot.q({"q1": 0.3, "q2": 1.5})


def drive(controller: nmm.Controller, q: np.ndarray, period: float, calls: int) -> float:
    """How far q2 comes to its stop, rad, in a loop whose inputs stand for that period."""
    least = np.inf
    for k in range(calls):
        u = controller(k * period, q)
        q = q + controller.robot.S(q) @ u * period
        least = min(least, q[controller.robot.q_names.index("q2")])
    return float(least)


@pytest.mark.parametrize("kinematics", ["pinocchio", "compiled"])
def test_a_loop_at_another_period_is_told_both_numbers(kinematics: str) -> None:
    """At 4 dt the arm passes its stop. With the dt that the warning asks for it does not."""
    controller, q = towards_its_stop(kinematics)
    with pytest.warns(
        RuntimeWarning, match=r"calls are 0\.04 s apart, but dt is 0\.01 s.*controller\.dt = 0\.04"
    ):
        least = drive(controller, q, 4 * DT, 100)
    assert least < 0.5 - 1e-3
    assert controller.period_monitor.period == pytest.approx(4 * DT)
    controller.reset()
    controller.dt = controller.dt and 4 * DT
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert drive(controller, q, 4 * DT, 100) > 0.5 - 1e-11
    assert controller.period_monitor.period is None


def test_it_is_told_once() -> None:
    controller, q = towards_its_stop()
    with pytest.warns(RuntimeWarning) as told:
        drive(controller, q, 1.2 * DT, 200)
    assert len(told) == 1
    assert told[0].filename == __file__


def test_a_loop_that_is_late_now_and_then_is_not_told(rng: np.random.Generator) -> None:
    """Clocks jitter, and a call that was held up is caught up with, at the next periods or at once."""
    controller, q = towards_its_stop()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        late, t = 0.0, 0.0
        for k in range(3000):
            late = max(0.0, late - DT) if late else 0.05 * (rng.random() < 0.02)
            t = max(t + 1e-5, k * DT + 0.2 * DT * rng.random() + late)
            controller(t, q)
            assert controller.period_monitor.period is None
        for _ in range(30):  # the same instant again: a look, or an integrator of the user's
            controller(t, q)
        controller.reset()
        for t in (0.0, 5.0, 9.0):  # a clock that is set anew
            controller(t, q)


def test_a_loop_by_the_clock_is_not_told() -> None:
    controller, q = towards_its_stop("compiled")
    controller(0.0, q)
    controller.reset()
    began = time.perf_counter()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for k in range(60):
            while time.perf_counter() - began < k * DT:
                pass
            controller(time.perf_counter() - began, q)


def test_simulations_and_copies_begin_anew() -> None:
    """A run's compiled loop leaves most calls out, and its last sample may be shorter."""
    controller, q = towards_its_stop("compiled")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for dt in (0.02, 0.003):
            nmm.simulate(controller, q, 0.5, dt)
        nmm.simulate(controller, q, 2.0, 0.005, progress=lambda share: None)  # in a hundred parts
        for k in range(30):
            controller.step(0.003 * k, q, 0.003)
    with pytest.warns(RuntimeWarning):
        drive(controller, q, 0.03, 30)
    for one in (copy.copy(controller), pickle.loads(pickle.dumps(controller))):
        assert one.period_monitor.period is None
        assert one.dt == controller.dt


def test_without_what_counts_on_dt_any_period_is_fine() -> None:
    robot = nmm.load("unicycle_2r")
    controller = nmm.Controller(
        robot, nmm.Task(nmm.Position("ee", "xy"), [2, 1]), nmm.ProjectedGradient(), dt=DT
    )
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for k in range(40):
            controller(0.1 * k, robot.rest)
