"""Inputs that are held over a sample, taken from its middle."""

import numpy as np
import pytest
from findings import refused

import nmm
from nmm.model.robots.robot import Robot
from nmm.model.robots.zero_order_hold import HeldInputs
from nmm.motion import closed_loop

DT = 0.01
MIDDLE = "zoh_midpoint"


def circling(robot: Robot, **more: object) -> nmm.Controller:
    task = nmm.Task(nmm.Position("ee", "xy"), nmm.Circle([0.0, 0.0], 1.5, rate=0.8), gain=2.0)
    square = nmm.Quadratic(nmm.QuadraticTerm("q2", 0.7))
    return nmm.Controller(robot, task, nmm.ProjectedGradient(alpha=1.0), square, **more)  # type: ignore[arg-type]


def start(robot: Robot) -> np.ndarray:
    return robot.q({"x": 0.6, "theta": 0.4, "q1": 0.3, "q2": 0.9})


def test_it_is_of_second_order_where_holding_the_samples_inputs_is_of_first(robot_2r: Robot) -> None:
    fine = nmm.simulate(circling(robot_2r), start(robot_2r), 2.0, 0.002, "rk4")
    for method, order in (("zoh", 1.0), (MIDDLE, 2.0)):
        off = [
            np.abs(
                nmm.simulate(circling(robot_2r), start(robot_2r), 2.0, dt, method).q - fine.q[::every]
            ).max()
            for dt, every in ((0.02, 10), (0.01, 5))
        ]
        assert np.log2(off[0] / off[1]) == pytest.approx(order, abs=0.1)


def test_a_runs_inputs_are_those_that_were_held(robot_2r: Robot) -> None:
    """Sent to a robot one after the other they make the same motion, and they are the controller's own
    answers at the middle of the samples."""
    run = nmm.simulate(circling(robot_2r), start(robot_2r), 0.5, DT, MIDDLE)
    held, controller = HeldInputs(robot_2r), circling(robot_2r)
    for k in range(len(run) - 1):
        t, q = run.t[k], run.q[k]
        np.testing.assert_allclose(held(q, run.u[k], DT), run.q[k + 1], rtol=0.0, atol=1e-14)
        ahead = q + 0.5 * DT * robot_2r.S(q) @ controller(t, q)
        np.testing.assert_allclose(controller(t + 0.5 * DT, ahead), run.u[k], rtol=0.0, atol=1e-11)
    np.testing.assert_allclose(run.u[-1], controller(run.t[-1], run.q[-1]), rtol=0.0, atol=1e-11)
    S_u = [robot_2r.S(q) @ u for q, u in zip(run.q, run.u, strict=True)]
    np.testing.assert_allclose(run.q_dot, S_u, rtol=0.0, atol=1e-13)


@pytest.mark.parametrize("compiled", [True, False])
def test_limits_are_kept_by_what_is_held(
    robot_2r: Robot, compiled: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Speeds, accelerations from one held input to the next, and coordinates: all of them bind."""
    if not compiled:
        monkeypatch.setattr(closed_loop, "compiled_loop", lambda *_: None)
    speed, most = {"platform": 0.6, "arm": 0.9}, 3.0
    limits = nmm.Limits(speed, acceleration=most, position={"q2": (0.4, 1.0)})
    run = nmm.simulate(circling(robot_2r, limits=limits, dt=DT), start(robot_2r), 4.0, DT, MIDDLE)
    fastest = np.array([0.6, 0.6, 0.9, 0.9])
    change = np.abs(np.diff(run.u, axis=0, prepend=0.0))
    q2 = run.q[:, robot_2r.coordinate("q2")]
    assert (np.abs(run.u) - fastest).max() == pytest.approx(0.0, abs=1e-11)
    assert change.max() == pytest.approx(most * DT, abs=1e-11)
    assert 0.4 - 1e-11 <= q2.min() < 0.4 + 1e-6 or 1.0 - 1e-6 < q2.max() <= 1.0 + 1e-11
    assert q2.min() >= 0.4 - 1e-11
    assert q2.max() <= 1.0 + 1e-11


def test_where_anything_is_near_the_samples_inputs_are_held_as_they_were_certified(robot_3r: Robot) -> None:
    """A post on the way: the distance is kept between samples too, and a single step, which cannot look, is
    refused."""
    pillar = nmm.Obstacle(nmm.Box([0.3, 0.6, 1.0]), [1.6, 0.0, 0.5], name="pillar")
    task = nmm.Task(nmm.Position("ee", "xy"), [3.0, 0.2], gain=1.0, speed=0.5)
    keep = nmm.Collisions(0.03, obstacles=[pillar])
    controller = nmm.Controller(robot_3r, task, nmm.ProjectedGradient(), collisions=keep, dt=0.02)
    q0 = robot_3r.q({"q1": 0.3, "q2": 0.6})
    run = nmm.simulate(controller, q0, 4.0, 0.02, MIDDLE)
    assert 0.03 - 1e-6 <= run.clearance_between.min() < 0.04
    with refused("method", got=MIDDLE):
        controller.step(0.0, q0, 0.02, MIDDLE)


def test_a_bounded_feedback_is_not_taken_for_inputs_that_fall_short(robot_2r: Robot) -> None:
    task = nmm.Task(nmm.Position("ee", "xy"), [3.0, 1.0], gain=2.0, speed=0.5)
    runs = [
        nmm.simulate(
            nmm.Controller(robot_2r, task, nmm.ProjectedGradient()), start(robot_2r), 8.0, DT, method
        )
        for method in ("zoh", MIDDLE)
    ]
    assert [one.code for one in runs[0].findings] == [one.code for one in runs[1].findings]
    assert runs[0].outcome == runs[1].outcome
