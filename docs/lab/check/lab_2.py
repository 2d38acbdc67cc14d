"""The checks of lab 2: closing the loop."""

from __future__ import annotations

from math import pi

import numpy as np

import nmm
from check.lab_1 import HAND, ROBOT, SAMPLES, Q, U, problems
from check.verdicts import Matrix, NotYet, Wrong, called, exercise, named, one_number, shaped

GAIN, ALPHA = 1.0, 10.0
CIRCLE = nmm.Circle(center=[2, 2], radius=3, rate=0.08 * pi, phase=5 / 4 * pi)
TIMES = np.linspace(0, 20, len(SAMPLES))


def _closed_loop(t: float, q: Matrix) -> nmm.extending.Step:
    objective = nmm.Quadratic(
        nmm.QuadraticTerm({"theta": 1, "q1": 1, "q2": 1}, pi / 2), nmm.QuadraticTerm("q1", pi / 4)
    )
    task = nmm.Task(nmm.Position("ee", "xy"), CIRCLE, gain=GAIN)
    return nmm.Controller(ROBOT, task, nmm.ProjectedGradient(ALPHA), objective).evaluate(t, q)


@exercise
def task_rate(rate: object) -> str:
    for t, q in zip(TIMES, SAMPLES, strict=True):
        given, step = called(rate, t, q), _closed_loop(t, q)
        shaped("rate", given, HAND)
        if np.allclose(given, step.rate, atol=1e-9):
            continue
        if np.allclose(given, GAIN * step.error):
            raise Wrong("rate: it follows the error alone: the target moves while the hand comes near")
        moving = step.rate - GAIN * step.error
        if np.allclose(given, moving):
            raise Wrong(
                "rate: it does what the target does, whatever the error is: nothing brings the hand to it"
            )
        if np.allclose(given, moving - GAIN * step.error):
            raise Wrong("rate: the sign of the error: the hand would run away from its target")
        raise Wrong(f"rate: not right at t = {t:.1f} s")
    return "the error will decay with the gain K, whatever the target does"


@exercise
def closed_loop(q_dot: object) -> str:
    for t, q in zip(TIMES, SAMPLES, strict=True):
        given, step = called(q_dot, t, q), _closed_loop(t, q)
        if given.shape == step.u.shape:
            raise Wrong(
                "q_dot: 4 numbers are inputs u. Which matrix makes velocities of the 5 coordinates of them?"
            )
        shaped("q_dot", given, Q)
        if not np.allclose(given, step.q_dot, atol=1e-7):
            raise Wrong(
                f"q_dot: {', '.join(np.array(Q)[abs(given - step.q_dot) > 1e-7])} not right at t = {t:.1f} s"
            )
    return "the loop is closed: q_dot is a function of t and q"


@exercise
def euler(step: object) -> str:
    start, one = np.array([1.0, 2.0]), np.array([1.0, -1.0])
    moved = called(step, lambda t, y: one, 0.0, start, 0.1)
    name = named(step)
    shaped(name, moved, ("y0", "y1"))
    if np.allclose(moved, 0.1 * one):
        raise Wrong(f"{name}: it gives the change; expected q at t + dt, which begins at q")
    share = float((moved - start) @ one / (one @ one)) / 0.1
    if not np.allclose(moved, start + 0.1 * one):
        raise Wrong(f"{name}: a constant velocity is taken {share:.3g} times")
    moved = called(step, lambda t, y: t * y, 2.0, start, 0.1)
    if not np.allclose(moved, 1.2 * start):
        raise Wrong(f"{name}: at which t, and at which q, is the velocity taken?")
    return "its order is 1: halving dt halves the error"


@exercise
def fitted_gain(fit: object) -> str:
    t = np.linspace(0, 4, 200)
    for K in (0.5, 1.7):
        for size in (1.0, 2.5):
            given = one_number(fit, t, size * np.exp(-K * t))
            if np.isclose(given, -K):
                raise Wrong("gain: the sign: a decaying error has K > 0")
            if np.isclose(given, K / np.log(10)):
                raise Wrong("gain: e^(-K t) asks for the natural logarithm")
            if not np.isclose(given, K):
                start = "" if size == 1.0 else f" that begins with {size}"
                raise Wrong(f"gain: an error{start} with K = {K} is found to have K = {given:.3g}")
    return "the slope of log ‖e‖ is -K"


@exercise
def effort(of: object) -> str:
    t = np.linspace(0, 8, 401)
    constant = np.tile([3.0, 0.0, -4.0, 0.0], (len(t), 1))
    given = one_number(of, t, constant)
    if not np.isclose(given, 200.0):
        raise Wrong(f"effort: constant inputs (3, 0, -4, 0) have ‖u‖² = 25, for 8 s: 200; got {given:.4g}")
    wave = constant * np.sin(2 * pi * t / 8)[:, None]
    given = one_number(of, t, wave)
    if not np.isclose(given, 100.0, rtol=0.01):
        raise Wrong(f"effort: a sine of amplitude 5 has half of a constant's, 100; got {given:.4g}")
    return "∫‖u‖² dt"


@exercise
def peaks(of: object) -> str:
    u = np.array([[0.0, 1.0, -7.0, 0.5], [2.0, -3.0, 1.0, 0.1]])
    given = called(of, u)
    shaped("peaks", given, U)
    if not np.allclose(given, [2.0, 3.0, 7.0, 0.5]):
        raise Wrong(
            "peaks: an input of -7 has a peak of 7" if given[2] != 7.0 else "peaks: each input has its own"
        )
    return "a motor is bought for its peak"


@exercise
def share_left(share: object) -> str:
    for J, rate, _, _ in problems():
        for wanted in (1.0, 0.3, 0.0):
            u = np.linalg.pinv(J) @ (wanted * rate)
            given = one_number(share, J, u, rate)
            if wanted and np.isclose(given, 1 / wanted) and wanted != 1:
                raise Wrong("share: upside down: what the hand does, of what the task asks")
            if not np.isclose(given, wanted, atol=1e-7):
                raise Wrong(f"share: where J u is {wanted} times the rate, it gives {given:.3g}")
    return "λ: J u = λ rate"


#: What the robot of the design task is given, and what its motors and its hand have to keep.
PATH = nmm.Spline([0, 5, 10, 15, 20], [[1, 0.5], [2.5, 1.2], [3.5, 0.2], [4.5, 1.2], [6, 0.5]])
START = {"x": -0.8, "y": -0.4, "theta": pi / 2}
DURATION, DT, ARRIVED = 20.0, 0.02, 5.0
ERROR, ELBOW = 0.01, (-2.0, -0.8)
SPEED, ACCELERATION = np.array([0.8, 1.5, 1.5, 1.5]), np.array([1.5, 4.0, 6.0, 6.0])


def _driven(design: object) -> nmm.Trajectory:
    wanted = ("gain", "resolver", "objective", "limits")
    if not isinstance(design, dict) or sorted(design) != sorted(wanted):
        raise Wrong(f"design: expected a dictionary with {', '.join(wanted)}")
    if dots := [key for key in wanted if design[key] is ...]:
        raise NotYet(f"design: {', '.join(dots)} to be chosen")
    try:
        task = nmm.Task(nmm.Position("ee", "xy"), PATH, gain=design["gain"])
        controller = nmm.Controller(
            ROBOT, task, design["resolver"], design["objective"], limits=design["limits"], dt=DT
        )
        return nmm.simulate(controller, START, DURATION, DT, method="zoh")
    except nmm.NmmError as error:
        raise Wrong(f"design: {error}") from None


def drive(design: object) -> nmm.Trajectory | None:
    """The motion that a design gives, for a look at it; None where there is none."""
    try:
        return _driven(design)
    except (NotYet, Wrong):
        return None


@exercise
def design(chosen: object) -> str:
    run = _driven(chosen)
    if run.t[-1] < DURATION - 1e-9:
        raise Wrong(f"design: the run ends at t = {run.t[-1]:.2f} s: {run.message}")
    found = []
    later = run.t >= ARRIVED
    off = np.where(later, run.error_norm, 0.0)
    if off.max() > ERROR:
        worst = f"{100 * off.max():.2g} cm at t = {run.t[off.argmax()]:.2f} s"
        found.append(f"the hand is off by {worst}; at most {100 * ERROR:g} cm from {ARRIVED:g} s on")
    changes = abs(np.diff(run.u, axis=0, prepend=0.0)) / DT
    for name, unit, u, speed, change, most in zip(
        U, ROBOT.u_units, abs(run.u).max(axis=0), SPEED, changes.max(axis=0), ACCELERATION, strict=True
    ):
        if u > speed * (1 + 1e-6):
            found.append(f"{name} reaches {u:.3g} {unit}; at most {speed:g}")
        if change > most * (1 + 1e-6):
            found.append(f"{name} changes by {change:.3g} {unit} in a second; at most {most:g}")
    elbow = run.q[later, Q.index("q2")]
    if elbow.min() < ELBOW[0] or elbow.max() > ELBOW[1]:
        went = f"q2 is between {elbow.min():.2f} and {elbow.max():.2f} rad"
        found.append(f"{went}; from {ARRIVED:g} s on it has to stay between {ELBOW[0]:g} and {ELBOW[1]:g}")
    if found:
        raise Wrong("design:\n    " + "\n    ".join(found))
    return (
        f"at most {1000 * off.max():.1f} mm off from {ARRIVED:g} s on, ∫‖u‖² dt = {np.sum(run.u**2) * DT:.2f}"
    )
