"""The closed loop of a controller and a plant from sample to sample, recorded; it ends cleanly."""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import dataclass

import numpy as np

from nmm.base.arrays import Array
from nmm.base.errors import DivergedError, RunError, SingularError
from nmm.base.findings import Finding
from nmm.control.controller import Controller
from nmm.control.goal import Goal
from nmm.control.integrators import Integrator
from nmm.control.plant import Plant
from nmm.control.step.sample import Snapshot
from nmm.control.step.step import Step
from nmm.motion.compiled_loop import DIVERGED_BEYOND, CompiledLoop, compiled_loop
from nmm.motion.leg import Leaving
from nmm.motion.recording import Recorder
from nmm.motion.verdict import FindingLine, Outcome


def drive_loop(
    controller: Controller,
    plant: Plant | Integrator,
    recorder: Recorder,
    times: Array,
    q: Array,
    progress: Callable[[float], None] | None = None,
    until: Goal | None = None,
    leg: Leaving | None = None,
) -> tuple[Outcome, FindingLine]:
    """Record a run over the times (N,) from q (n,), of a plant, or of the ideal one that an integrator moves.
    A `leg` goes on with what the one before left, up to the event that ends it."""
    if isinstance(plant, Integrator):
        plant = Plant(plant)
    recorder.disturbed = plant.disturbs
    recorder.believed = plant.believed
    if leg is None or leg.earlier == -math.inf:
        plant.begin(q)
    if leg is None:
        controller.solver.begin_run()
    elif controller.solver.retreat_state is not None:  # what the leg before leaves to this one is there
        recorder.backed_off = controller.solver.retreat_state.count
    try:
        pass_over = compiled_loop(controller, plant, until)
        # What is taken in Python, too: otherwise digits would depend on where compiled code stops.
        with nullcontext() if pass_over is None else controller.solver.program.compiled_kinematics():
            _Loop(controller, plant, recorder, times, until, leg, pass_over).run(q, progress)
    except SingularError as error:
        return Outcome.SINGULAR, (finding_in(error),)
    except DivergedError as error:
        return Outcome.DIVERGED, (finding_in(error),)
    except RunError as error:
        return Outcome.FAILED, (finding_in(error),)
    except KeyboardInterrupt:
        finding = Finding("interrupted", {"end": float(times[-1])}, {"t": recorder.reached})
        return Outcome.INTERRUPTED, (finding,)
    return Outcome.COMPLETED, ()


def finding_in(error: RunError) -> Finding:
    """The finding that an error was raised with, or its sentence where there is no more."""
    finding = error.finding
    return finding if isinstance(finding, Finding) else Finding("failed", {"text": str(error)})


@dataclass
class _Loop:
    """From sample to sample, recording each, up to the event that ends a leg, whose sample is the next leg's.

    A step that the resolver's state rejects is repeated with a new decision at its start; if that is
    rejected, too, with decisions free at its stages. A disturbed robot's steps are not repeated.

    This is the loop of all controllers. Its second form, `pass_over`, skips samples with purely numerical
    decisions. Python handles what is not compiled: users' functions and `State` subclasses, distances (Coal's
    queries, and the ways that are looked along), a retreat's inputs, adaptive and repeated steps, findings.
    """

    controller: Controller
    plant: Plant
    recorder: Recorder
    times: Array
    until: Goal | None
    leg: Leaving | None
    pass_over: CompiledLoop | None

    def __post_init__(self) -> None:
        solver = self.controller.solver
        self.state, self.sample_state, self.renewals = solver.state, solver.sample, solver.program.renewals
        self.advance = self.plant.under(self.controller)

    def run(self, q: Array, progress: Callable[[float], None] | None) -> None:
        recorder, times, steps = self.recorder, self.times, len(self.times) - 1
        earlier = self.sample_state.snapshot()
        sample = self._sample(0, q, -math.inf if self.leg is None else self.leg.earlier)
        recorder.add(sample)
        k, at_goal = 0, False
        a_share = steps if progress is None else max(1, steps // 100)
        while k < steps and not at_goal:
            if progress is not None and k % a_share == 0:
                progress(k / steps)
            reached, whole = self._pass_over(k, min(steps, (k // a_share + 1) * a_share))
            if reached > k:
                recorder.passed_over(reached)
                k, earlier = reached, self.sample_state.snapshot()
                sample = self._sample(k, recorder.q[k].copy(), float(times[k - 1]))
                recorder.replace_last(sample)
                at_goal = self._at_goal(sample)
            if not (whole or at_goal or k == steps):
                following, snapshot = self._next(sample, k + 1, earlier)
                if following is None:
                    return
                k, earlier, sample = k + 1, snapshot, following
                recorder.add(sample)
                at_goal = self._at_goal(sample)
        if progress is not None:
            progress(1.0)

    def _at_goal(self, sample: Step) -> bool:
        return self.until is not None and self.until.reached(sample.error, self.controller.rows)

    def _pass_over(self, k: int, last: int) -> tuple[int, bool]:
        """The sample that compiled code reaches from sample k, at most an event's, and whether it is
        `last`."""
        retreat_state, recorded = self.controller.solver.retreat_state, self.recorder.found
        if self.pass_over is None or (retreat_state is not None and retreat_state.now):
            return k, False
        for source in self.renewals:
            last = min(last, int(np.searchsorted(self.times, source.due)) - 1)
        if last <= k:
            return k, False
        left = self.sample_state.snapshot()
        reached, whole = self.pass_over(self.times, k, last, recorded)
        for source in (*self.renewals, *(() if self.leg is None else (self.leg,))):
            passed = slice(k + 1, reached + 1)
            stays = k + source.stays(self.times[passed], self.plant.seen(passed, recorded.q[passed]))
            if stays < reached:  # begin again, up to the sample before the event
                whole, reached = False, stays
                self.sample_state.restore(left)
                if stays > k:
                    self.pass_over(self.times, k, stays, recorded)
        return reached, whole

    def _next(self, sample: Step, k: int, earlier: Snapshot) -> tuple[Step | None, Snapshot]:
        """Sample k (None: another leg's), the state before it; `earlier`: that before `sample`."""
        if self.plant.disturbs:
            dt = float(self.times[k] - self.times[k - 1])
            q = self.plant.act(self.controller.solver, k - 1, sample.q, dt)
            snapshot = self.sample_state.snapshot()
            return self._next_sample(k, q, sample.t), snapshot
        snapshot = self.sample_state.snapshot()
        stands, following, snapshot = self._advanced(sample, k, snapshot)
        if not stands:
            self.sample_state.restore(earlier)
            self.state.reset()
            if self.controller.solver.second:
                self.controller.solver.before[:] = sample.u
            sample = self._sample(k - 1, sample.q)
            self.recorder.replace_last(sample)
            before, snapshot = self.state.memory.copy(), self.sample_state.snapshot()
            stands, following, snapshot = self._advanced(sample, k, snapshot)
            if not stands:
                self.sample_state.restore(snapshot)
                q, held = self._integrated(sample, k)
                snapshot = self._hold(sample, held, snapshot)
                following = self._next_sample(k, q, sample.t)
                reserved = self.state.reservation(before, self.controller.robot.u_names, sample.t)
                self.recorder.find_once(reserved)
        return following, snapshot

    def _advanced(self, sample: Step, k: int, snapshot: Snapshot) -> tuple[bool, Step | None, Snapshot]:
        """Whether the step to sample k stands, that sample (None: another leg's), and the state before
        it: `snapshot` where the sample's own inputs are held."""
        left, before = self.sample_state.snapshot(), self.state.memory.copy()
        try:
            with self.state.held():
                q, held = self._integrated(sample, k)
        except SingularError:
            if self.state.may_stand(before):
                raise
            return False, None, snapshot
        if not self.state.may_stand(before):
            return False, None, snapshot
        self.sample_state.end_stages(left)
        before_next = self._hold(sample, held, snapshot)
        following = self._next_sample(k, q, sample.t)
        stands = following is None or self.state.may_stand(before)
        return stands, following, before_next if stands else snapshot

    def _hold(self, sample: Step, held: Array, snapshot: Snapshot) -> Snapshot:
        """The state `snapshot` where the sample's own inputs are held, else that with those that are: they
        are recorded, and accelerations count from them."""
        if held is sample.u:
            return snapshot
        self.recorder.hold(held)
        now = self.sample_state.snapshot()
        self.sample_state.restore(snapshot)
        self.controller.solver.count_from(held)
        snapshot = self.sample_state.snapshot()
        self.sample_state.restore(now)
        self.controller.solver.count_from(held)
        return snapshot

    def _next_sample(self, k: int, q: Array, earlier: float) -> Step | None:
        """Sample k; None if an event ends the leg there."""
        if self.leg is not None and self.leg.changes(float(self.times[k]), q, self.plant.seen(k, q)):
            return None
        return self._sample(k, q, earlier)

    def _integrated(self, sample: Step, k: int) -> tuple[Array, Array]:
        """q at sample k, and the inputs of the step."""
        at, dt = (sample.t, sample.q, sample.q_dot), float(self.times[k]) - sample.t
        held = self.advance.inputs(self.controller.solver.inputs_at, *at, sample.u, dt)
        return self.advance.advance(self.controller.velocity, *at, held, dt), held

    def _sample(self, k: int, q: Array, earlier: float = -math.inf) -> Step:
        """Sample k, at q; accelerations count from the one at `earlier`, finally less than dt before."""
        controller, t, seen = self.controller, float(self.times[k]), self.plant.seen(k, q)
        _within_bound(q, "coordinates", t)
        if t - earlier < (controller.dt or math.nan) * (1.0 - 1e-9):
            self.sample_state.elapsed = t - earlier
        for renewal in self.renewals:
            renewal.renew(t, seen, q)
        controller.period_monitor.forget()  # compiled code has made those between
        try:
            controller(t, seen)
        finally:
            self.sample_state.elapsed = None
        self.plant.observe(controller.solver, t, q)
        sample = controller.last(t, q)
        _within_bound(sample.u, "inputs", t)
        return sample


def _within_bound(x: Array, what: str, t: float) -> None:
    if not x.dot(x) < DIVERGED_BEYOND**2:  # a NaN compares false
        raise DivergedError(Finding("diverged", {"what": what, "bound": DIVERGED_BEYOND}, {"t": t}))
