"""The closed loop from sample to sample, recorded, ending cleanly whatever happens."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import nullcontext
from dataclasses import dataclass
from typing import NamedTuple, TypeAlias

import numpy as np

from nmm.arrays import Array
from nmm.control.controller import Controller
from nmm.control.goal import Goal
from nmm.control.idle_inputs import idle_inputs
from nmm.control.integrators import Accelerated, Integrator
from nmm.control.sample import Snapshot
from nmm.control.sequence import Schedule
from nmm.control.standing_pose import standing_pose
from nmm.control.step import Step
from nmm.errors import DivergedError, RunError, SingularError
from nmm.findings import Finding
from nmm.robots.loading.ground import slip_warnings
from nmm.robots.loading.provenance import provenance_of
from nmm.runs.clearance import guarded
from nmm.runs.compiled_loop import DIVERGED_BEYOND, CompiledLoop, compiled_loop
from nmm.runs.recording import Recorder
from nmm.runs.verdict import FindingLine, Outcome

#: Records a run over the times (N,) from q (n,), with progress and goal; returns how it ended.
Drive: TypeAlias = Callable[
    [Recorder, Array, Array, Callable[[float], None] | None, Goal | None], tuple[Outcome, FindingLine]
]


class Ended(NamedTuple):
    """How a run ended: q (n,) is the last configuration recorded, or the start; J (s, m) the task's matrix in
    the controller's last call, at q or a step from it."""

    outcome: Outcome
    reasons: FindingLine
    q: Array
    J: Array


@dataclass
class Leg:
    """The samples of a run, or those between two events: the controller of the active tasks, which tasks
    these are, the integrator without the safety filter, and the latest end, s."""

    controller: Controller
    active: tuple[bool, ...]
    integrator: Integrator
    recorder: Recorder
    ended: Ended
    end: float


@dataclass
class Leaving:
    """The start of a leg, after a sample at `earlier`, s, and its end: q (n,) at the event, if any."""

    schedule: Schedule
    earlier: float
    q: Array | None = None

    def stays(self, times: Array, q: Array) -> int:
        """How many samples at times (N,), s, and q (N, n) belong to this leg."""
        return self.schedule.stays(times, q)

    def changes(self, t: float, q: Array) -> bool:
        """Whether the sample at t and q belongs to another leg."""
        if self.schedule.changes(t, q):
            self.q = q
        return self.q is not None


def sample_times(start: float, dt: float, steps: int, end: float) -> Array:
    """start, start + dt, ... for `steps` steps, up to the end, which is hit despite rounding."""
    times = np.minimum(start + np.arange(steps + 1) * dt, end)
    if end - times[-1] < 1e-6 * dt:
        times[-1] = end
    return times


def record_run(
    controller: Controller,
    advance: Integrator,
    times: Array,
    q: Array,
    progress: Callable[[float], None] | None,
    until: Goal | None = None,
    leg: Leaving | None = None,
    watch: Callable[[Recorder], None] | None = None,
    disturbed: Drive | None = None,
) -> tuple[Recorder, Ended]:
    """Integrate over the times (N,) from q; `watch` gets the recorder first. `disturbed` drives a robot that
    does not do as it is told."""
    recorder = Recorder(controller, times)
    recorder.at_middle = advance.at_middle
    if watch is not None:
        watch(recorder)
    if len(times) > 1 and not advance.tolerance:  # adaptive steps are shorter than the samples
        controller.dt = float(times[1] - times[0])
    recorder.findings += _at_start(controller, q, times)
    guarded_advance = guarded(advance, controller)
    if controller.solver.second:
        own = controller.solver
        guarded_advance = Accelerated(advance, controller.robot, own.before, own.found.second.u_dot)
    if disturbed is None:
        outcome, reasons = drive_loop(controller, guarded_advance, recorder, times, q, progress, until, leg)
    else:
        outcome, reasons = disturbed(recorder, times, q, progress, until)
    if controller.solver.second:
        recorder.findings += rate_jumps(recorder, follows=leg is not None and math.isfinite(leg.earlier))
    recorder.blocking = controller.report.blocking()
    recorder.findings += recorder.noticed()
    if controller.safety_filter is not None:
        recorder.counts = controller.safety_filter.counts
    last = recorder.q[len(recorder) - 1] if len(recorder) else q
    return recorder, Ended(outcome, reasons, last, controller.solver.derivatives[0].copy())


#: A task's rate has jumped that changes by so many times what it changes by before and after,
JUMP = 10.0
#: if by more than this share of its largest size.
SMALL = 1e-2


def rate_jumps(recorder: Recorder, *, follows: bool) -> Iterator[Finding]:
    """Where the rate that tasks ask for jumps, which inputs of second order follow with bounded
    accelerations; `follows`: other tasks were active before."""
    found, t, k = recorder.so_far, recorder.t, float(recorder.controller.given.servo)
    if not len(t):
        return
    short = np.linalg.norm(found.rate - np.einsum("kij,kj->ki", found.J, found.u), axis=1)
    least = SMALL * max(1.0, float(np.linalg.norm(found.rate, axis=1).max()))
    where = []
    if follows and short[0] > least:
        where.append(0)
    if len(t) > 3:
        size = np.linalg.norm(np.diff(found.rate, axis=0), axis=1)
        beside = np.maximum(np.append(size[1:], np.inf), np.append(np.inf, size[:-1]))
        where += (1 + np.flatnonzero((size > JUMP * beside) & (size > least))).tolist()
    if where:
        times = [float(t[i]) for i in where]
        size_of = float(max(short[i] for i in where))
        yield Finding("rate_jumps", {"jumps": len(times), "size": size_of, "servo": k}, {"t": times[0]})


def in_degrees(angle: float) -> bool:
    """Whether an angle, rad, was probably meant in degrees: a whole number beyond a turn."""
    return abs(angle) >= 7.0 and float(angle).is_integer()


def _at_start(controller: Controller, q: Array, times: Array) -> Iterator[Finding]:
    """Findings about a run over the times (N,), s, before its first sample at q (n,)."""
    robot, solver = controller.robot, controller.solver
    yield from provenance_of(robot).contradictions
    yield from slip_warnings(robot)
    yield from (Finding("python_costs", {"text": one}) for one in solver.program.costs)
    angles = (i for i in robot.following.independent if robot.q_units[i] == "rad")
    if degrees := {robot.q_names[i]: float(q[i]) for i in angles if in_degrees(q[i])}:
        yield Finding("start_in_degrees", {"angles": degrees})
    if controller.limits is not None:
        outside = robot.outside(q, solver.limits_on.coordinates)
        if outside:
            recovery = solver.limits_on.recovery
            yield Finding("start_outside_limits", {"outside": [*outside.values()], "recovery": recovery})
    if idle := idle_inputs(solver, q):
        yield Finding("idle_inputs", {"inputs": list(idle)})
    if held := standing_pose(solver, q, times[:: max(1, len(times) // 4)]):
        yield held


def drive_loop(
    controller: Controller,
    advance: Integrator,
    recorder: Recorder,
    times: Array,
    q: Array,
    progress: Callable[[float], None] | None = None,
    until: Goal | None = None,
    leg: Leaving | None = None,
) -> tuple[Outcome, FindingLine]:
    if leg is None:
        controller.solver.begin_run()
    elif controller.solver.retreat_state is not None:  # what the leg before leaves to this one is there
        recorder.backed_off = controller.solver.retreat_state.count
    try:
        pass_over = compiled_loop(controller, advance, until)
        # What is taken in Python, too: otherwise digits would depend on where compiled code stops.
        with nullcontext() if pass_over is None else controller.solver.program.compiled_kinematics():
            _Loop(controller, advance, recorder, times, until, leg, pass_over).run(q, progress)
    except SingularError as error:
        return Outcome.SINGULAR, (finding_in(error),)
    except DivergedError as error:
        return Outcome.DIVERGED, (finding_in(error),)
    except RunError as error:
        return Outcome.FAILED, (finding_in(error),)
    except KeyboardInterrupt:
        found = Finding("interrupted", {"end": float(times[-1])}, {"t": recorder.reached})
        return Outcome.INTERRUPTED, (found,)
    return Outcome.COMPLETED, ()


def finding_in(error: RunError) -> Finding:
    """The finding that an error was raised with, or its sentence where there is no more."""
    found = error.finding
    return found if isinstance(found, Finding) else Finding("failed", {"text": str(error)})


@dataclass
class _Loop:
    """From sample to sample, recording each, up to the event that ends a leg, whose sample is the next leg's.

    A step that the resolver's state rejects is repeated with a new decision at its start; if that is
    rejected, too, with decisions free at its stages.

    This is the loop of all controllers. Its second form, `pass_over`, skips samples with purely numerical
    decisions. Python handles what is not compiled: users' functions and `State` subclasses, distances (Coal's
    queries, and the ways that are looked along), a retreat's inputs, adaptive and repeated steps, findings.
    """

    controller: Controller
    advance: Integrator
    recorder: Recorder
    times: Array
    until: Goal | None
    leg: Leaving | None
    pass_over: CompiledLoop | None

    def __post_init__(self) -> None:
        solver = self.controller.solver
        self.state, self.kept, self.renewals = solver.state, solver.sample, solver.program.renewals

    def run(self, q: Array, progress: Callable[[float], None] | None) -> None:
        recorder, times, steps = self.recorder, self.times, len(self.times) - 1
        earlier = self.kept.snapshot()
        sample = self._sample(float(times[0]), q, -math.inf if self.leg is None else self.leg.earlier)
        recorder.add(sample)
        k, there = 0, False
        a_share = steps if progress is None else max(1, steps // 100)
        while k < steps and not there:
            if progress is not None and k % a_share == 0:
                progress(k / steps)
            reached, whole = self._pass_over(k, min(steps, (k // a_share + 1) * a_share))
            if reached > k:
                recorder.passed_over(reached)
                k, earlier = reached, self.kept.snapshot()
                sample = self._sample(float(times[k]), recorder.q[k].copy(), float(times[k - 1]))
                recorder.replace_last(sample)
                there = self._there(sample)
            if not (whole or there or k == steps):
                following, here = self._next(sample, float(times[k + 1]), earlier)
                if following is None:
                    return
                k, earlier, sample = k + 1, here, following
                recorder.add(sample)
                there = self._there(sample)
        if progress is not None:
            progress(1.0)

    def _there(self, sample: Step) -> bool:
        return self.until is not None and self.until.reached(sample.error, self.controller.rows)

    def _pass_over(self, k: int, last: int) -> tuple[int, bool]:
        """The sample that compiled code reaches from sample k, at most an event's, and whether it is
        `last`."""
        retreat_state, found = self.controller.solver.retreat_state, self.recorder.found
        if self.pass_over is None or (retreat_state is not None and retreat_state.now):
            return k, False
        for one in self.renewals:
            last = min(last, int(np.searchsorted(self.times, one.due)) - 1)
        if last <= k:
            return k, False
        left = self.kept.snapshot()
        reached, whole = self.pass_over(self.times, k, last, found)
        for one in (*self.renewals, *(() if self.leg is None else (self.leg,))):
            those = slice(k + 1, reached + 1)
            stays = k + one.stays(self.times[those], found.q[those])
            if stays < reached:  # begin again, up to the sample before the event
                whole, reached = False, stays
                self.kept.restore(left)
                if stays > k:
                    self.pass_over(self.times, k, stays, found)
        return reached, whole

    def _next(self, sample: Step, t: float, earlier: Snapshot) -> tuple[Step | None, Snapshot]:
        """The sample at t (None: another leg's), the state before it; `earlier`: that before `sample`."""
        here = self.kept.snapshot()
        stands, following, here = self._advanced(sample, t, here)
        if not stands:
            self.kept.restore(earlier)
            self.state.reset()
            if self.controller.solver.second:
                self.controller.solver.before[:] = sample.u
            sample = self._sample(sample.t, sample.q)
            self.recorder.replace_last(sample)
            before, here = self.state.memory.copy(), self.kept.snapshot()
            stands, following, here = self._advanced(sample, t, here)
            if not stands:
                self.kept.restore(here)
                q, held = self._integrated(sample, t)
                here = self._hold(sample, held, here)
                following = self._next_sample(t, q, sample.t)
                reserved = self.state.reservation(before, self.controller.robot.u_names, sample.t)
                self.recorder.find_once(reserved)
        return following, here

    def _advanced(self, sample: Step, t: float, here: Snapshot) -> tuple[bool, Step | None, Snapshot]:
        """Whether the step to t stands, the sample there (None: another leg's), and the state before
        it: `here` where the sample's own inputs are held."""
        left, before = self.kept.snapshot(), self.state.memory.copy()
        try:
            with self.state.held():
                q, held = self._integrated(sample, t)
        except SingularError:
            if self.state.may_stand(before):
                raise
            return False, None, here
        if not self.state.may_stand(before):
            return False, None, here
        self.kept.end_stages(left)
        before_next = self._hold(sample, held, here)
        following = self._next_sample(t, q, sample.t)
        stands = following is None or self.state.may_stand(before)
        return stands, following, before_next if stands else here

    def _hold(self, sample: Step, held: Array, here: Snapshot) -> Snapshot:
        """The state `here` where the sample's own inputs are held, else that with those that are: they are
        recorded, and accelerations count from them."""
        if held is sample.u:
            return here
        self.recorder.hold(held)
        now = self.kept.snapshot()
        self.kept.restore(here)
        self.controller.solver.count_from(held)
        here = self.kept.snapshot()
        self.kept.restore(now)
        self.controller.solver.count_from(held)
        return here

    def _next_sample(self, t: float, q: Array, earlier: float) -> Step | None:
        """The sample at t; None if an event ends the leg there."""
        changes = self.leg is not None and self.leg.changes(t, q)
        return None if changes else self._sample(t, q, earlier)

    def _integrated(self, sample: Step, t: float) -> tuple[Array, Array]:
        """q at t, and the inputs of the step."""
        at, dt = (sample.t, sample.q, sample.q_dot), t - sample.t
        held = self.advance.inputs(self.controller.solver.inputs_at, *at, sample.u, dt)
        return self.advance.advance(self.controller.velocity, *at, held, dt), held

    def _sample(self, t: float, q: Array, earlier: float = -math.inf) -> Step:
        """The sample at t; accelerations count from the one at `earlier`, finally less than dt before."""
        controller = self.controller
        _within_bound(q, "coordinates", t)
        if t - earlier < (controller.dt or math.nan) * (1.0 - 1e-9):
            self.kept.elapsed = t - earlier
        for one in self.renewals:
            one.renew(t, q)
        controller.period_monitor.forget()  # compiled code has made those between
        try:
            controller(t, q)
        finally:
            self.kept.elapsed = None
        sample = controller.last(t, q)
        _within_bound(sample.u, "inputs", t)
        return sample


def _within_bound(x: Array, what: str, t: float) -> None:
    if not x.dot(x) < DIVERGED_BEYOND**2:  # a NaN compares false
        raise DivergedError(Finding("diverged", {"what": what, "bound": DIVERGED_BEYOND}, {"t": t}))
