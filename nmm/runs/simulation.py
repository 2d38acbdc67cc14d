"""Simulation: the closed loop integrated in time, sampled every dt, ending cleanly whatever happens."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import ArrayLike

from nmm.arrays import Array, positive
from nmm.control.controller import Controller, Step
from nmm.control.idle_inputs import idle_inputs
from nmm.errors import DivergedError, InputError, RunError, SingularError
from nmm.robots.slip import told as told_slip
from nmm.runs.integrators import Integrator, integrator
from nmm.runs.recording import Recorder
from nmm.runs.stability import Instability, find_instability
from nmm.runs.trajectory import Outcome, Trajectory

#: Coordinates or inputs whose norm is beyond this have diverged, m, rad, m/s or rad/s.
BOUND = 1e6
#: At how many instants of a run the integrator's stability is examined.
EXAMINED = 20
#: The most samples that a run may have; beyond it the numbers do not fit in memory.
MOST_SAMPLES = 20_000_000


def simulate(
    controller: Controller,
    q0: ArrayLike | Mapping[str, float],
    duration: float,
    dt: float = 0.005,
    method: str = "rk4",
    *,
    tolerance: float = 1e-9,
    progress: Callable[[float], None] | None = None,
) -> Trajectory:
    """Integrate q_dot = S(q) u(t, q) from q0 over `duration`, sampled every dt.

    The partition of the reduced gradient is decided at the samples and kept between them, as a
    sampled controller does, so that an integration step sees one smooth right-hand side. A step on
    which the partition falls below its threshold is taken again, with the best one at its beginning.

    Parameters
    ----------
    controller : the controller
    q0 : (n,) or by name, m and rad
    duration : s, above 0
    dt : s, above 0; the last step is shorter when it does not divide the duration
    method : "rk4", "midpoint", "euler", "zoh" (inputs held over dt) or "adaptive" (SciPy's DOP853)
    tolerance : of the adaptive method, local error in m and rad
    progress : called with the fraction done, about a hundred times

    Returns
    -------
    Trajectory, whose `outcome` says whether it is complete; a singular, diverged or interrupted
    run returns what it has.

    Raises
    ------
    InputError : wrong q0 (also one outside the robot's limits), duration, dt, method
    """
    robot = controller.robot
    q = robot.q(q0)
    robot.check_limits(q)
    duration = positive(duration, "duration")
    dt = positive(dt, "dt")
    steps = max(1, math.ceil(duration / dt - 1e-9))
    if steps > MOST_SAMPLES:
        raise InputError(
            f"dt: {duration:g} s in steps of {dt:g} s are {steps} samples; expected at most {MOST_SAMPLES}"
        )
    times = np.minimum(np.arange(steps + 1) * dt, duration)
    times[-1] = duration
    advance = integrator(method, robot, positive(tolerance, "tolerance"))
    recorder = Recorder(controller, times)
    outcome, message = Outcome.COMPLETED, ""
    recorder.warnings += told_slip(robot)
    idle = idle_inputs(controller, q)
    if idle:
        recorder.warnings.append(
            f"neither the task nor the objective feels {', '.join(idle)}: at first order nothing moves "
            f"{'it' if len(idle) == 1 else 'them'} (an objective can)"
        )
    controller.reset()
    try:
        _integrate(controller, advance, recorder, times, q, progress)
    except SingularError as error:
        outcome, message = Outcome.SINGULAR, str(error)
    except DivergedError as error:
        outcome, message = Outcome.DIVERGED, str(error)
    except RunError as error:
        outcome, message = Outcome.FAILED, str(error)
    except KeyboardInterrupt:
        outcome, message = Outcome.INTERRUPTED, f"interrupted after {recorder.reached:g} s of {duration:g} s"
    finally:
        controller.hold_partition(False)
    try:
        unstable, examined = _examine(controller, recorder, advance, dt)
    except KeyboardInterrupt:  # the motion is there; what is lost is advice
        unstable, examined = [], 0
    if unstable:
        worst = max(unstable, key=lambda found: found.rate)
        advice = worst.describe(method, dt)
        if outcome is Outcome.COMPLETED and (2 * len(unstable) > examined or recorder.keeps_erring):
            outcome, message = Outcome.UNSTABLE, advice
        elif outcome is Outcome.COMPLETED:
            recorder.warnings.append(f"for part of the run {advice}")
        else:
            message = f"{message}; {advice}"
    if outcome is Outcome.COMPLETED and recorder.jump is not None:
        outcome, message = Outcome.UNSTABLE, recorder.jump
    return recorder.trajectory(outcome, message, dt, method)


def _integrate(
    controller: Controller,
    advance: Integrator,
    recorder: Recorder,
    times: Array,
    q: Array,
    progress: Callable[[float], None] | None,
) -> None:
    """From sample to sample, recording each.

    A step on which the partition became singular is taken again with the best one at its beginning:
    one that fell below its threshold at a stage, or whose determinant has another sign after it.
    """
    steps = len(times) - 1
    sample, sign = _sample(controller, float(times[0]), q), controller.partition_sign
    recorder.add(sample)
    for k in range(steps):
        t, dt = float(times[k + 1]), float(times[k + 1] - times[k])
        q, singular = _advance(controller, advance, sample, dt)
        if not singular:
            ahead = _sample(controller, t, q)
            singular = sign * controller.partition_sign < 0 and np.array_equal(
                ahead.partition, sample.partition
            )
        if singular:
            controller.reset()
            sample, sign = _sample(controller, sample.t, sample.q), controller.partition_sign
            recorder.replace_last(sample)
            q, _ = _advance(controller, advance, sample, dt)
            ahead = _sample(controller, t, q)
            if sign * controller.partition_sign < 0 and np.array_equal(ahead.partition, sample.partition):
                recorder.warn_of_partition(sample)
        sample, sign = ahead, controller.partition_sign
        recorder.add(sample)
        if progress is not None and k % max(1, steps // 100) == 0:
            progress(k / steps)
    if progress is not None:
        progress(1.0)


def _sample(controller: Controller, t: float, q: Array) -> Step:
    if not q.dot(q) < BOUND**2:  # a NaN compares false
        raise DivergedError(f"at t = {t:g} s the motion has diverged: the coordinates are beyond {BOUND:g}")
    controller(t, q)
    sample = controller.last(t, q)
    if not sample.u.dot(sample.u) < BOUND**2:
        raise DivergedError(f"at t = {t:g} s the motion has diverged: the inputs are beyond {BOUND:g}")
    return sample


def _advance(controller: Controller, advance: Integrator, sample: Step, dt: float) -> tuple[Array, bool]:
    """The next q, and whether the partition held through the step fell below its threshold at a stage."""
    controller.hold_partition(True)
    try:
        ahead = advance.advance(controller.velocity, sample.t, sample.q, sample.q_dot, sample.u, dt)
        return ahead, controller.partition_overdue
    except SingularError:
        if not controller.partition_overdue:
            raise
        return sample.q, True
    finally:
        controller.hold_partition(False)


def _examine(
    controller: Controller, recorder: Recorder, advance: Integrator, dt: float
) -> tuple[list[Instability], int]:
    """The instabilities at some instants of the run, and how many instants were looked at."""
    if not advance.stability or not len(recorder):
        return [], 0
    found = []
    chosen = np.unique(np.linspace(0, len(recorder) - 1, EXAMINED).astype(int))
    for k in chosen:
        controller.reset()
        try:
            instability = find_instability(
                controller, float(recorder.t[k]), recorder.q[k], dt, advance.stability
            )
        except (RunError, np.linalg.LinAlgError):  # singular just beside this sample: not a matter of dt
            continue
        if instability is not None:
            found.append(instability)
    controller.reset()
    return found, len(chosen)
