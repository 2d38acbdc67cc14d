"""Simulation: the closed loop over a duration, by legs where tasks come and go, and what became of it."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace

from numpy.typing import ArrayLike

from nmm.base.arrays import positive
from nmm.base.errors import InputError, expect_kind
from nmm.base.lazy_call import lazy_call
from nmm.control.controller import Controller
from nmm.control.goal import Goal
from nmm.control.plant import Plant, method_for
from nmm.motion.disturbances import Disturbances, check_disturbed
from nmm.motion.joining import join
from nmm.motion.leg import Leg
from nmm.motion.recorded_run import record_run, run_legs, sample_times
from nmm.motion.recording import Recorder
from nmm.motion.trajectory import Trajectory

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
    until: Goal | None = None,
    watch: Callable[[Recorder], object] | None = None,
    disturbances: Disturbances | None = None,
) -> Trajectory:
    """Integrate q_dot = S(q) u(t, q) from q0 over `duration`, sampled every dt; at order 2 also
    u_dot(t, q, u), from rest.

    What a resolver decides from call to call (the reduced gradient's partition) is decided at the samples
    and kept between them, as a sampled controller does, so that an integration step sees one smooth
    right-hand side. A step on which that does not hold is taken again, decided anew at its beginning.

    Parameters
    ----------
    controller : the controller
    q0 : (n,) or by name, m and rad
    duration : s, above 0
    dt : s, above 0; the last step is shorter when it does not divide the duration
    method : "rk4", "midpoint", "euler", "zoh" (inputs held over dt), "zoh_midpoint" (held, but those at
        t + dt/2, q + dt/2 S u, within the limits of the sample; u of a sample is what is held after it) or
        "adaptive" (SciPy's DOP853)
    tolerance : of the adaptive method, local error in m and rad
    progress : called with the fraction done, about a hundred times
    until : a target to reach: the run ends where the error is within its tolerances
    watch : called with what records the samples, before the first one; of tasks that come and go, at each
        event. Another thread may read the samples in it, all but the last, which may be taken again
    disturbances : what the robot does otherwise than it is told; such a run is not judged by its gain

    Returns
    -------
    Trajectory, whose `outcome` says whether it is complete; a singular, diverged or interrupted
    run returns what it has.

    Raises
    ------
    InputError : wrong q0 (also one outside limits that the controller does not keep, or with a joint that is
        not where the one that it follows has it), duration, dt, method; an `until` that is no Goal;
        disturbances with a method that does not hold inputs

    Examples
    --------
    >>> robot = nmm.load("unicycle_2r")
    >>> task = nmm.Task(nmm.Position("ee", "xy"), [2.0, 1.0], gain=1.0)
    >>> controller = nmm.Controller(robot, task, nmm.ProjectedGradient())
    >>> run = nmm.simulate(controller, {"q2": 0.5}, duration=5.0, dt=0.01)
    >>> np.allclose(run.error_norm[-1], run.error_norm[0] * np.exp(-5.0))
    True
    """
    robot = controller.robot
    q = robot.q(q0)
    come_back = controller.limits is not None and controller.limits.position is not False
    robot.check_limits(q, come_back=come_back)
    q = robot.following.placed(q)
    expect_kind(until, Goal | None, "until", "a Goal, as Goal(m=0.005, rad=0.02)")
    duration = positive(duration, "duration")
    dt = positive(dt, "dt")
    steps = max(1, math.ceil(duration / dt - 1e-9))
    if steps > MOST_SAMPLES:
        raise InputError(
            f"{duration:g} s in steps of {dt:g} s are {steps} samples",
            where="dt",
            expected=f"at most {MOST_SAMPLES}",
        )
    advance = method_for((controller,), method, positive(tolerance, "tolerance"))
    if controller.solver.scene is not None:
        controller.solver.scene.check_start(0.0, q)
    times = sample_times(0.0, dt, steps, duration)
    expect_kind(disturbances, Disturbances | None, "disturbances", "Disturbances, as Disturbances(slip=0.99)")
    plant, schedule = Plant(advance), controller.schedule
    if disturbances is not None:
        plant = disturbances.on(robot, dt).plant(advance, 0, len(times))
    check_disturbed(plant.disturbed, method)
    if schedule is not None:
        legs = run_legs(controller, schedule, plant, times, q, progress, until, watch)
        run, distances = join(controller, schedule, legs, dt, method)
        verdict = lazy_call("nmm.motion.diagnosis.diagnose:diagnose_legs")(
            controller, schedule, legs, run, distances, until
        )
    else:
        recorder, ended = record_run(controller, plant, times, q, progress, until, None, watch)
        run = recorder.trajectory(dt, method)
        leg = Leg(controller, (), advance, recorder, ended, duration)
        verdict = lazy_call("nmm.motion.diagnosis.diagnose:diagnose")(leg, run, until)
    return replace(run, verdict=verdict)
