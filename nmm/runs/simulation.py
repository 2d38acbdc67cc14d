"""Simulation: the closed loop over a duration, by legs where tasks come and go, and what became of it."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

from numpy.typing import ArrayLike

from nmm.arrays import Array, positive
from nmm.control.controller import Controller
from nmm.control.equations import step
from nmm.control.goal import Goal
from nmm.control.integrators import Integrator, integrator
from nmm.control.sequenced import SequencedController
from nmm.errors import InputError, RunError
from nmm.functions.program import PLACE, place
from nmm.kernels.ahead import compile_ahead
from nmm.kernels.spectra import WRITE_SPECTRA, write_spectra
from nmm.robots.frame_path import follow
from nmm.robots.held import Held
from nmm.runs.clearance import Guarded
from nmm.runs.closed_loop import Leaving, record, sample_times
from nmm.runs.compiled_loop import FLY, fly
from nmm.runs.joining import Leg, join
from nmm.runs.judgement import Ended, Verdict, blocked, judge, reached_or_not
from nmm.runs.promise import write_step_errors
from nmm.runs.recording import Recorder
from nmm.runs.stability import LINEARISE, linearise
from nmm.runs.trajectory import Outcome, Trajectory

#: The most samples that a run may have; beyond it the numbers do not fit in memory.
MOST_SAMPLES = 20_000_000


def compile_ahead_of_a_run() -> None:
    """Have other processes compile what every run needs, where the cache lacks it: its loop, and the step in
    it, then what looks over it afterwards. The resolver and the tasks' functions are left to this process."""
    compile_ahead(
        *((fly, FLY), step, (place, PLACE), follow),
        *(write_step_errors, (linearise, LINEARISE), (write_spectra, WRITE_SPECTRA)),
    )


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
    watch: Callable[[Recorder], None] | None = None,
) -> Trajectory:
    """Integrate q_dot = S(q) u(t, q) from q0 over `duration`, sampled every dt.

    What a resolver decides from call to call (the reduced gradient's partition) is decided at the samples
    and kept between them, as a sampled controller does, so that an integration step sees one smooth
    right-hand side. A step on which that does not hold is taken again, decided anew at its beginning.

    Parameters
    ----------
    controller : the controller
    q0 : (n,) or by name, m and rad
    duration : s, above 0
    dt : s, above 0; the last step is shorter when it does not divide the duration
    method : "rk4", "midpoint", "euler", "zoh" (inputs held over dt) or "adaptive" (SciPy's DOP853)
    tolerance : of the adaptive method, local error in m and rad
    progress : called with the fraction done, about a hundred times
    until : a target to reach: the run ends where the error is within its tolerances
    watch : called with what records the samples, before the first one; of tasks that come and go, at each
        event. Another thread may read the samples in it, all but the last, which may be taken again

    Returns
    -------
    Trajectory, whose `outcome` says whether it is complete; a singular, diverged or interrupted
    run returns what it has.

    Raises
    ------
    InputError : wrong q0 (also one outside limits that the controller does not keep, or with a joint that is
        not where the one that it follows has it), duration, dt, method; an `until` that is no Goal

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
    if until is not None and not isinstance(until, Goal):
        raise InputError(f"until: expected a Goal, as Goal(m=0.005, rad=0.02), got {until!r}")
    duration = positive(duration, "duration")
    dt = positive(dt, "dt")
    steps = max(1, math.ceil(duration / dt - 1e-9))
    if steps > MOST_SAMPLES:
        raise InputError(
            f"dt: {duration:g} s in steps of {dt:g} s are {steps} samples; expected at most {MOST_SAMPLES}"
        )
    if method == "adaptive" and controller.samples:
        raise InputError(
            "method: limits, distances, a retreat and a step by Armijo's rule are kept from sample to "
            "sample: expected rk4, midpoint, euler or zoh"
        )
    advance = integrator(method, robot, positive(tolerance, "tolerance"))
    if controller.setting is not None:
        controller.setting.check_start(0.0, q)
    times = sample_times(0.0, dt, steps, duration)
    if isinstance(controller, SequencedController):
        legs = _legs(controller, advance, times, q, progress, until, watch)
        for leg in legs:
            kept = guarded(advance, leg.controller)
            goal = until if leg is legs[-1] else None
            leg.verdict = _judged(leg.controller, leg.recorder, leg.ended, kept, method, dt, leg.end, goal)
        return join(controller, legs, until, dt, method)
    advance = guarded(advance, controller)
    recorder, ended = record(controller, advance, times, q, progress, until, watch=watch)
    verdict = _judged(controller, recorder, ended, advance, method, dt, duration, until)
    if until is not None:
        verdict = reached_or_not(verdict, recorder, until, controller.rows)
    verdict = blocked(verdict, recorder.blocking)
    recorder.warnings += verdict.warnings
    return recorder.trajectory(verdict.outcome, verdict.message, dt, method)


def guarded(advance: Integrator, controller: Controller) -> Integrator:
    """The integrator, between samples at which a controller keeps distances, too."""
    return advance if controller.guard is None else Guarded(advance, controller.guard, Held(controller.robot))


def _judged(
    controller: Controller,
    recorder: Recorder,
    ended: Ended,
    advance: Integrator,
    method: str,
    dt: float,
    end: float,
    until: Goal | None,
) -> Verdict:
    """What the run, or the leg of one, until `end` (s) amounts to; parts of it are tried again."""

    def retry(first: int, dt: float, most: int) -> tuple[Recorder, Outcome]:
        start = float(recorder.t[first])
        steps = min(most, max(1, math.ceil((end - start) / dt - 1e-9)))
        tried, ended = record(
            controller, advance, sample_times(start, dt, steps, end), recorder.q[first], None
        )
        if ended.outcome is Outcome.INTERRUPTED:
            raise KeyboardInterrupt
        return tried, ended.outcome

    try:
        return judge(controller, recorder, advance, method, dt, ended, retry, until)
    except KeyboardInterrupt:  # the motion is there; what is lost is what to say of it
        if ended.outcome is Outcome.COMPLETED:
            ended = ended._replace(
                outcome=Outcome.INTERRUPTED, message="interrupted while the run was judged"
            )
        return Verdict(ended.outcome, ended.message, [])


def _legs(
    controller: SequencedController,
    advance: Integrator,
    times: Array,
    q: Array,
    progress: Callable[[float], None] | None,
    until: Goal | None,
    watch: Callable[[Recorder], None] | None,
) -> list[Leg]:
    """The run from event to event, each leg with the controller of the tasks then active.

    The sample at an event is the next leg's. The last leg is one whose end is no event.
    """
    legs: list[Leg] = []
    controller.reset()
    controller.changes(float(times[0]), q)
    first, steps = 0, max(1, len(times) - 1)
    while True:
        try:
            inner = controller.switch()
        except RunError as error:
            if not legs:
                raise InputError(str(error)) from None
            legs[-1].ended = legs[-1].ended._replace(outcome=Outcome.FAILED, message=str(error))
            return legs
        leaving = Leaving(
            controller, inner.sample.snapshot(), float(times[first - 1]) if first else -math.inf
        )
        waiting = controller.sequence.waiting(controller.moment)
        active = controller.moment.active
        recorder, ended = record(
            *(inner, guarded(advance, inner), times[first:], q),
            None if progress is None else _from(first / steps, progress),
            until if any(active) and not waiting else None,
            leaving,
            watch,
        )
        end = float(times[-1]) if leaving.q is None else float(times[first + len(recorder)])
        recorder.goes_on = leaving.q is not None
        legs.append(Leg(inner, active, recorder, ended, end))
        if leaving.q is None:
            return legs
        first, q = first + len(recorder), leaving.q


def _from(done: float, progress: Callable[[float], None]) -> Callable[[float], None]:
    """Progress of a leg that begins where that share of the run is done."""
    return lambda share: progress(done + share * (1.0 - done))
