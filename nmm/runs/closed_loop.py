"""The closed loop from sample to sample, recorded, ending cleanly whatever happens."""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import nullcontext

import numpy as np

from nmm.arrays import Array
from nmm.control.controller import Controller
from nmm.control.goal import Goal
from nmm.control.idle_inputs import idle_inputs
from nmm.control.integrators import Integrator
from nmm.control.sample import Snapshot
from nmm.control.sequenced import SequencedController
from nmm.control.step import Step
from nmm.errors import DivergedError, RunError, SingularError
from nmm.robots.loading.provenance import platform_warnings
from nmm.runs.broken_limits import outside_at_start
from nmm.runs.compiled_loop import BOUND, CompiledLoop, compiled_loop
from nmm.runs.judgement import Ended
from nmm.runs.recording import Recorder
from nmm.runs.trajectory import Outcome


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

    def stays(self, times: Array, q: Array, first: int, last: int) -> int:
        """The last of the samples from `first` to `last` before one that is another leg's."""
        return first - 1 + self._controller.stays(times[first : last + 1], q[first : last + 1])


def sample_times(start: float, dt: float, steps: int, end: float) -> Array:
    """start, start + dt, ... of that many steps, none beyond the end, which rounding does not miss."""
    times = np.minimum(start + np.arange(steps + 1) * dt, end)
    if end - times[-1] < 1e-6 * dt:
        times[-1] = end
    return times


def record(
    controller: Controller,
    advance: Integrator,
    times: Array,
    q: Array,
    progress: Callable[[float], None] | None,
    until: Goal | None = None,
    leg: Leaving | None = None,
    watch: Callable[[Recorder], None] | None = None,
) -> tuple[Recorder, Ended]:
    """Integrate over the times (N,) from q, and say how that ended; `watch` gets the recorder before."""
    recorder = Recorder(controller, times)
    if watch is not None:
        watch(recorder)
    if len(times) > 1 and not advance.tolerance:  # adaptive steps are shorter than the samples
        controller.dt = float(times[1] - times[0])
    recorder.warnings += [*platform_warnings(controller.robot), *controller.costs]
    if controller.limits is not None:
        recorder.warnings += outside_at_start(controller.robot, controller.kept, q)
    idle = idle_inputs(controller, q)
    if idle:
        recorder.warnings.append(
            f"without effect on task and objective: {', '.join(idle)}; at first order nothing moves "
            f"{'it' if len(idle) == 1 else 'them'} (an objective can)"
        )
    outcome, message = driven(controller, advance, recorder, times, q, progress, until, leg)
    recorder.guarded(controller)
    last = recorder.q[len(recorder) - 1] if len(recorder) else q
    return recorder, Ended(outcome, message, last, controller.derivatives[0].copy())


def driven(
    controller: Controller,
    advance: Integrator,
    recorder: Recorder,
    times: Array,
    q: Array,
    progress: Callable[[float], None] | None = None,
    until: Goal | None = None,
    leg: Leaving | None = None,
) -> tuple[Outcome, str]:
    """Integrate and record; how that ended, and why."""
    outcome, message = Outcome.COMPLETED, ""
    controller.reset()
    if leg is not None:
        controller.sample.restore(leg.handed)
        recorder.backed_off = 0 if controller.backing is None else controller.backing.count
    try:
        fly = compiled_loop(controller, advance, until)
        # What is taken in Python, too: otherwise digits would depend on where compiled code stops.
        with nullcontext() if fly is None else controller.compiled_kinematics():
            _integrate(controller, advance, recorder, times, q, progress, until, leg, fly)
    except SingularError as error:
        outcome, message = Outcome.SINGULAR, str(error)
    except DivergedError as error:
        outcome, message = Outcome.DIVERGED, str(error)
    except RunError as error:
        outcome, message = Outcome.FAILED, str(error)
    except KeyboardInterrupt:
        outcome = Outcome.INTERRUPTED
        message = f"interrupted after {recorder.reached:g} s of {times[-1]:g} s"
    return outcome, message


def _integrate(
    controller: Controller,
    advance: Integrator,
    recorder: Recorder,
    times: Array,
    q: Array,
    progress: Callable[[float], None] | None,
    until: Goal | None,
    leg: Leaving | None,
    fly: CompiledLoop | None,
) -> None:
    """From sample to sample, recording each; to the event that ends a leg, whose sample is the next leg's.

    A step that the resolver's state does not let stand is taken again, decided anew at its beginning; if
    that may not stand either, it is taken with the decisions free at its stages.
    """
    steps = len(times) - 1
    earlier = controller.sample.snapshot()
    sample = _sample(controller, float(times[0]), q, -math.inf if leg is None else leg.earlier)
    recorder.add(sample)
    k, there = 0, False
    a_share = steps if progress is None else max(1, steps // 100)
    while k < steps and not there:
        if progress is not None and k % a_share == 0:
            progress(k / steps)
        whole, backing = False, controller.backing
        if fly is not None and not (backing is not None and backing.now):
            decided = controller.state.snapshot()
            reached, whole = fly(times, k, min(steps, (k // a_share + 1) * a_share), recorder.found)
            stays = reached
            if backing is not None:
                stays = k + backing.quiet(recorder.found.error[k + 1 : reached + 1], controller.dt or 0.0)
            if leg is not None:
                stays = leg.stays(times, recorder.found.q, k + 1, stays)
            if stays < reached:  # begin again, and fly to the sample before the event
                whole, reached = False, stays
                before = float(times[k - 1]) if k else -math.inf if leg is None else leg.earlier
                controller.sample.restore(earlier)
                _sample(controller, sample.t, sample.q, before)
                controller.state.restore(decided)
                if stays > k:
                    fly(times, k, stays, recorder.found)
            if reached > k:
                recorder.flown(reached)
                if backing is not None:
                    backing.pass_over(recorder.found.error[k + 1 : reached], controller.dt or 0.0)
                k, earlier = reached, controller.sample.snapshot()
                sample = _sample(controller, float(times[k]), recorder.q[k].copy(), float(times[k - 1]))
                recorder.replace_last(sample)
                there = until is not None and until.reached(sample.error, controller.rows)
        if not (whole or there or k == steps):
            ahead, here = _next(controller, advance, recorder, sample, float(times[k + 1]), earlier, leg)
            if isinstance(ahead, Leaving):
                return
            k, earlier, sample = k + 1, here, ahead
            recorder.add(sample)
            there = until is not None and until.reached(sample.error, controller.rows)
    if progress is not None:
        progress(1.0)


def _next(
    controller: Controller,
    advance: Integrator,
    recorder: Recorder,
    sample: Step,
    t: float,
    earlier: Snapshot,
    leg: Leaving | None,
) -> tuple[Step | Leaving, Snapshot]:
    """The sample at t, or the event there, and what `sample` left to it; `earlier` is what that one found."""
    state, here = controller.state, controller.sample.snapshot()
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
    return ahead, here


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
    controller.pace.forget()  # compiled code has made those between
    try:
        controller(t, q)
    finally:
        elapsed[()] = dt
    sample = controller.last(t, q)
    if not sample.u.dot(sample.u) < BOUND**2:
        raise DivergedError(f"at t = {t:g} s the motion has diverged: the inputs are beyond {BOUND:g}")
    return sample
