"""Simulation: the closed loop integrated in time, sampled every dt, ending cleanly whatever happens."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import ArrayLike

from nmm.arrays import Array, positive
from nmm.control.controller import Controller
from nmm.control.goal import Goal
from nmm.control.idle_inputs import idle_inputs
from nmm.control.integrators import Integrator, integrator
from nmm.control.sample import Snapshot
from nmm.control.sequenced import SequencedController
from nmm.control.step import Step
from nmm.errors import DivergedError, InputError, RunError, SingularError
from nmm.robots.held import Held
from nmm.robots.slip import slip_warnings
from nmm.runs.broken_limits import outside_at_start
from nmm.runs.clearance import Guarded
from nmm.runs.joining import Leg, join
from nmm.runs.judgement import Ended, Verdict, blocked, judge, reached_or_not
from nmm.runs.recording import Recorder
from nmm.runs.trajectory import Outcome, Trajectory

#: Coordinates or inputs whose norm is beyond this have diverged, m, rad, m/s or rad/s.
BOUND = 1e6
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

    Returns
    -------
    Trajectory, whose `outcome` says whether it is complete; a singular, diverged or interrupted
    run returns what it has.

    Raises
    ------
    InputError : wrong q0 (also one outside limits that the controller does not keep, or with a joint that is
        not where the one that it follows has it), duration, dt, method; an `until` that is no Goal
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
    times = _times(0.0, dt, steps, duration)
    if isinstance(controller, SequencedController):
        legs = _legs(controller, advance, times, q, progress, until)
        for leg in legs:
            kept = _guarded(advance, leg.controller)
            goal = until if leg is legs[-1] else None
            leg.verdict = _judged(leg.controller, leg.recorder, leg.ended, kept, method, dt, leg.end, goal)
        return join(controller, legs, until, dt, method)
    advance = _guarded(advance, controller)
    recorder, ended = _record(controller, advance, times, q, progress, until)
    verdict = _judged(controller, recorder, ended, advance, method, dt, duration, until)
    if until is not None:
        verdict = reached_or_not(verdict, recorder, until, controller.rows)
    verdict = blocked(verdict, recorder.blocking)
    recorder.warnings += verdict.warnings
    return recorder.trajectory(verdict.outcome, verdict.message, dt, method)


def _guarded(advance: Integrator, controller: Controller) -> Integrator:
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
        tried, ended = _record(controller, advance, _times(start, dt, steps, end), recorder.q[first], None)
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
        recorder, ended = _record(
            *(inner, _guarded(advance, inner), times[first:], q),
            None if progress is None else _from(first / steps, progress),
            until if any(active) and not waiting else None,
            leaving,
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


class Leaving:
    """The beginning of a leg and its end, where other tasks are active.

    Attributes
    ----------
    handed : what the leg before leaves to its first sample
    earlier : the time of the sample before it, s
    q : (n,) where the event is at which the leg ends; None where it does not end at one
    """

    def __init__(self, controller: SequencedController, handed: Snapshot, earlier: float) -> None:
        self._controller = controller
        self.handed, self.earlier = handed, earlier
        self.q: Array | None = None

    def changes(self, t: float, q: Array) -> bool:
        """Whether the sample at t and q is another leg's."""
        if self._controller.changes(t, q):
            self.q = q
        return self.q is not None


def _times(start: float, dt: float, steps: int, end: float) -> Array:
    """start, start + dt, ... of that many steps, none beyond the end, which rounding does not miss."""
    times = np.minimum(start + np.arange(steps + 1) * dt, end)
    if end - times[-1] < 1e-6 * dt:
        times[-1] = end
    return times


def _record(
    controller: Controller,
    advance: Integrator,
    times: Array,
    q: Array,
    progress: Callable[[float], None] | None,
    until: Goal | None = None,
    leg: Leaving | None = None,
) -> tuple[Recorder, Ended]:
    """Integrate over the times (N,) from q, and say how that ended."""
    recorder = Recorder(controller, times)
    if len(times) > 1 and not advance.tolerance:  # adaptive steps are shorter than the samples
        controller.dt = float(times[1] - times[0])
    recorder.warnings += slip_warnings(controller.robot)
    if controller.limits is not None:
        recorder.warnings += outside_at_start(controller.robot, controller.kept, q)
    idle = idle_inputs(controller, q)
    if idle:
        recorder.warnings.append(
            f"without effect on task and objective: {', '.join(idle)}; at first order nothing moves "
            f"{'it' if len(idle) == 1 else 'them'} (an objective can)"
        )
    outcome, message = Outcome.COMPLETED, ""
    controller.reset()
    if leg is not None:
        controller.sample.restore(leg.handed)
        recorder.backed_off = 0 if controller.backing is None else controller.backing.count
    try:
        _integrate(controller, advance, recorder, times, q, progress, until, leg)
    except SingularError as error:
        outcome, message = Outcome.SINGULAR, str(error)
    except DivergedError as error:
        outcome, message = Outcome.DIVERGED, str(error)
    except RunError as error:
        outcome, message = Outcome.FAILED, str(error)
    except KeyboardInterrupt:
        outcome = Outcome.INTERRUPTED
        message = f"interrupted after {recorder.reached:g} s of {times[-1]:g} s"
    recorder.guarded(controller)
    last = recorder.q[len(recorder) - 1] if len(recorder) else q
    return recorder, Ended(outcome, message, last, controller.derivatives[0].copy())


def _integrate(
    controller: Controller,
    advance: Integrator,
    recorder: Recorder,
    times: Array,
    q: Array,
    progress: Callable[[float], None] | None,
    until: Goal | None,
    leg: Leaving | None,
) -> None:
    """From sample to sample, recording each; to the event that ends a leg, whose sample is the next leg's.

    A step that the resolver's state does not let stand is taken again, decided anew at its beginning; if
    that may not stand either, it is taken with the decisions free at its stages.
    """
    state, steps = controller.state, len(times) - 1
    earlier = controller.sample.snapshot()
    sample = _sample(controller, float(times[0]), q, -math.inf if leg is None else leg.earlier)
    recorder.add(sample)
    for k in range(steps):
        t = float(times[k + 1])
        here = controller.sample.snapshot()
        ahead = _advanced(controller, advance, sample, t, leg)
        if ahead is None:
            state.reset()
            controller.sample.restore(earlier)
            sample = _sample(controller, sample.t, sample.q)
            recorder.replace_last(sample)
            before, here = state.snapshot(), controller.sample.snapshot()
            ahead = _advanced(controller, advance, sample, t, leg)
            if ahead is None:
                controller.sample.restore(here)
                ahead = _ahead(controller, t, _integrated(controller, advance, sample, t), sample.t, leg)
                recorder.warn_once(sample.t, state.reservation(before, controller.robot.u_names))
        if isinstance(ahead, Leaving):
            return
        earlier, sample = here, ahead
        recorder.add(sample)
        if until is not None and until.reached(sample.error, controller.rows):
            break
        if progress is not None and k % max(1, steps // 100) == 0:
            progress(k / steps)
    if progress is not None:
        progress(1.0)


def _advanced(
    controller: Controller, advance: Integrator, sample: Step, t: float, leg: Leaving | None
) -> Step | Leaving | None:
    """The next sample, at t, or the event there; None where the step to it may not stand."""
    state = controller.state
    before = state.snapshot()
    try:
        with state.held():
            q = _integrated(controller, advance, sample, t)
    except SingularError:
        if state.may_stand(before):
            raise
        return None
    if not state.may_stand(before):
        return None
    ahead = _ahead(controller, t, q, sample.t, leg)
    return ahead if isinstance(ahead, Leaving) or state.may_stand(before) else None


def _ahead(controller: Controller, t: float, q: Array, earlier: float, leg: Leaving | None) -> Step | Leaving:
    """The sample at t, or the event that leaves it to other tasks."""
    if leg is not None and leg.changes(t, q):
        return leg
    return _sample(controller, t, q, earlier)


def _integrated(controller: Controller, advance: Integrator, sample: Step, t: float) -> Array:
    return advance.advance(controller.velocity, sample.t, sample.q, sample.q_dot, sample.u, t - sample.t)


def _sample(controller: Controller, t: float, q: Array, earlier: float = -math.inf) -> Step:
    """The sample at t; accelerations count from the one before it, at `earlier`: less than dt in the end."""
    if not q.dot(q) < BOUND**2:  # a NaN compares false
        raise DivergedError(f"at t = {t:g} s the motion has diverged: the coordinates are beyond {BOUND:g}")
    elapsed, dt = controller.sample.elapsed, math.nan if controller.dt is None else controller.dt
    if t - earlier < dt * (1.0 - 1e-9):
        elapsed[()] = t - earlier
    try:
        controller(t, q)
    finally:
        elapsed[()] = dt
    sample = controller.last(t, q)
    if not sample.u.dot(sample.u) < BOUND**2:
        raise DivergedError(f"at t = {t:g} s the motion has diverged: the inputs are beyond {BOUND:g}")
    return sample
