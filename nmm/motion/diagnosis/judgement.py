"""Judges a run, or a leg of one: its error against its expected decay, its inputs against the task.

Examined at its end, as controller and targets may change later; only a shorter dt, which takes as long as
several runs, is tried when the verdict is read (`LegJudgement.trials`).
"""

import copy
import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from nmm.base.findings import Finding
from nmm.control.controller import Controller
from nmm.control.goal import Goal
from nmm.control.plant import Plant
from nmm.model.robots.wheel_slip import sideways_speeds
from nmm.motion.diagnosis import reasons
from nmm.motion.diagnosis.assessment import Assessment, Instability, assess
from nmm.motion.diagnosis.error_bound import Departure, TaskSamples
from nmm.motion.diagnosis.jumps import chattering, crossings, moving_otherwise
from nmm.motion.leg import Leg
from nmm.motion.recorded_run import record_run, sample_times
from nmm.motion.recording import Recorder
from nmm.motion.residuals import residuals, run_up
from nmm.motion.verdict import FindingLine, Outcome, Verdict

#: A finding that no shorter dt helps against.
HOPELESS = "out_of_reach"
#: So many steps a trial takes at most: half a second,
MOST_STEPS = 6_000
#: and so many trials are made;
MOST_TRIALS = 6
#: all of them together, where Python makes the samples (distances, an adaptive method), at most so many steps
#: for each sample of the run, or as many as the second number says if that is more.
PER_SAMPLE, FEW_STEPS = 20, 800
#: A trial over a shorter stretch than this says nothing, in steps of the run's own dt.
LEAST = 20
#: A limit of stability is tried at this share of it; the next dt is between these shares of the last one.
BELOW, LEAST_SHARE, MOST_SHARE = 0.98, 0.125, 0.6
#: Errors are as recorded if they differ by no more than this share of 1 + their size.
SAME = 1e-6


class Advice(NamedTuple):
    """The dt, s, with which a trial behaved, and its start and end, s."""

    dt: float
    start: float
    end: float


class Trials:
    """Trials of a run in steps of dt, s, with a copy of its controller. Nothing is tried if the errors differ
    from those recorded, as a target that is set, or what a function reads, may have changed since."""

    def __init__(self, leg: Leg, dt: float, assessment: Assessment) -> None:
        recorder = leg.recorder
        self._controller: Controller = copy.copy(leg.controller)
        self._integrator, self._dt, self._end = leg.integrator, dt, leg.end
        self._t, self._q = recorder.t, recorder.q[: len(recorder)]
        self._error, self._duration = recorder.so_far.error, recorder.duration
        solver, own = leg.controller.solver, max(FEW_STEPS, PER_SAMPLE * len(self._t))
        compiled = solver.compiles_runs and solver.scene is None and not leg.integrator.tolerance
        self._steps = MOST_TRIALS * MOST_STEPS if compiled else own
        self._unstable = assessment.unstable
        troubles = [int(np.searchsorted(self._t, mode.t)) for mode in assessment.unstable]
        if assessment.departure is not None:
            troubles.append(assessment.departure.first)
        self._before = min(troubles, default=0)

    def advice(self) -> Advice | None:
        """A shorter dt with which the run behaves, if one of a few does."""
        if not self._same():
            return None
        dt = most = self._dt
        left = self._steps
        unstable = self._unstable
        for _ in range(MOST_TRIALS):
            # Where a run went astray its modes grow ever faster: the slowest of them is believed.
            limit = max((mode.limit for mode in unstable), default=0.0)
            dt = min(max(BELOW * limit, LEAST_SHARE * dt), most)
            steps = min(MOST_STEPS, left, int(self._duration / dt) + 1)
            left -= steps
            if steps * dt < min(self._duration, LEAST * self._dt):
                return None
            advice, unstable = self._try(dt, steps)
            if advice is not None:
                return advice
            most = MOST_SHARE * dt
        return None

    def _same(self) -> bool:
        """Whether the first, middle and last samples have the errors recorded."""
        some = np.unique([0, len(self._t) // 2, len(self._t) - 1])
        try:
            error, _ = self._controller.solver.errors(self._t[some], self._q[some])
        except Exception:  # a user's function may raise anything, where it was not made for
            return False
        off = np.abs(error - self._error[some])
        return bool(np.all(~(off > SAME * (1.0 + np.abs(error)))))

    def _try(self, dt: float, most: int) -> tuple[Advice | None, list[Instability]]:
        """Run at most `most` steps of dt, s: the advice if the run behaves, and the instabilities left."""
        # The whole run where it fits, else from a little before it went wrong.
        t, controller = self._t, self._controller
        fits = t[-1] - t[0] <= most * dt
        first = 0 if fits else max(0, self._before - int(0.1 * most * dt / self._dt))
        start = float(t[first])
        steps = min(most, max(1, math.ceil((self._end - start) / dt - 1e-9)))
        times = sample_times(start, dt, steps, self._end)
        try:
            tried, ended = record_run(controller, Plant(self._integrator), times, self._q[first])
            again = assess(controller, tried, self._integrator, dt)
        except Exception:  # a user's function may raise anything, where it was not made for
            return None, []
        if ended.outcome is Outcome.INTERRUPTED:
            raise KeyboardInterrupt
        behaves = ended.outcome is Outcome.COMPLETED and not again.unstable and again.departure is None
        behaves = behaves and passed(tried) is None
        return Advice(dt, start, tried.reached) if behaves else None, again.unstable


def passed(recorder: Recorder) -> Finding | None:
    robot, recorded = recorder.controller.robot, recorder.so_far
    return crossings(recorder.t, recorded.u, recorded.side, recorded.J, robot.u_names, robot.u_units)


@dataclass(frozen=True)
class LegJudgement:
    """The judgement of a leg that ended, with outcome and reasons of its integration.

    lost : what nothing moves, at a singular end
    assessment : the assessment, if it was made
    left : the finding that the error exceeds its expected decay
    seen : possible causes
    moved : the finding that the target moved otherwise than its rate says, though the error decayed
    trials : shorter dt to be tried; method, dt, s : the run's
    """

    outcome: Outcome
    reasons: FindingLine
    warnings: tuple[FindingLine, ...] = ()
    lost: FindingLine = ()
    assessment: Assessment | None = None
    left: FindingLine = ()
    seen: FindingLine = ()
    moved: FindingLine = ()
    trials: Trials | None = None
    method: str = ""
    dt: float = 0.0

    @property
    def open(self) -> bool:
        undecided = self.assessment is not None and self.assessment.missed and bool(self.assessment.unstable)
        return self.trials is not None and self.outcome is Outcome.COMPLETED and undecided

    def verdict(self, advice: Advice | None) -> Verdict:
        """The verdict, given a dt with which the run behaves, or None if none was found."""
        assessment, seen, warnings = self.assessment, self.seen, self.warnings
        if assessment is None:
            return Verdict(self.outcome, (*self.reasons, *self.lost), warnings)
        unstable = self._unstable(assessment, advice)
        tried = (Finding("shorter_dt", {"shorter": advice.dt, "dt": self.dt}),) if advice else ()
        if self.outcome is not Outcome.COMPLETED:
            why = (unstable or tried) if advice else (*self.lost, *seen)
            return Verdict(self.outcome, (*self.reasons, *why), warnings)
        if assessment.missed:
            if unstable and advice:
                return Verdict(Outcome.UNSTABLE, (*unstable, *seen), warnings)
            # What is read first is short: what chatters, or follows from a target out of reach, comes apart.
            far = any(finding.code == HOPELESS for finding in seen)
            also = tuple(
                finding for finding in seen if finding.code == "chattering" or (far and finding != seen[0])
            )
            why = tuple(finding for finding in seen if finding not in also)
            return Verdict(Outcome.MISSED, (*self.left, *why, *tried), (*warnings, *([also] if also else [])))
        if 2 * len(assessment.unstable) > assessment.examined:
            return Verdict(Outcome.UNSTABLE, unstable, warnings)
        if any(finding.code == "extended_jacobian_crossed" and "name" in finding.values for finding in seen):
            return Verdict(Outcome.MISSED, (*self.left, *seen), warnings)  # inputs jumped over it
        more = [(*self.left, *seen)] if self.left else [(finding,) for finding in (*seen, *self.moved)]
        part = tuple(
            Finding(finding.code, {**finding.values, "part": True}, finding.where) for finding in unstable
        )
        return Verdict(self.outcome, self.reasons, (*warnings, *more, *([part] if part else [])))

    def _unstable(self, assessment: Assessment, advice: Advice | None) -> FindingLine:
        if not assessment.unstable:
            return ()
        # Of a run that went astray the last modes are monstrous: the one that the advice answers is told.
        answered = [mode for mode in assessment.unstable if advice is not None and mode.limit >= advice.dt]
        mode = max(answered or assessment.unstable, key=lambda mode: mode.rate)
        tried = {} if advice is None else {"tried": advice._asdict()}
        values = {"rate": mode.rate, "method": self.method, "dt": self.dt, "part": False, **tried}
        return (Finding("dt_too_long", values, {"t": mode.t}),)


def judge(leg: Leg, dt: float, method: str, goal: Goal | None) -> LegJudgement:
    """Judge a leg; one that reached its goal may be above its decay. An interrupt only loses findings."""
    ended = leg.ended
    try:
        with leg.controller.solver.sample.preserve_state():  # the controller stays as the run left it
            return _judged(leg, dt, method, goal)
    except KeyboardInterrupt:
        if ended.outcome is Outcome.COMPLETED:
            return LegJudgement(Outcome.INTERRUPTED, (Finding("interrupted_judging"),))
        return LegJudgement(ended.outcome, ended.reasons)


def _judged(leg: Leg, dt: float, method: str, goal: Goal | None) -> LegJudgement:
    controller, recorder, (outcome, ended, _, _) = leg.controller, leg.recorder, leg.ended
    lost = tuple(_lost(leg))
    if not len(recorder):
        return LegJudgement(outcome, ended, lost=lost)
    samples = TaskSamples.of(recorder)
    warnings = tuple((finding,) for finding in _unmet(controller, recorder, samples, dt))
    if outcome is Outcome.INTERRUPTED or recorder.disturbed:  # no decay is expected of a disturbed robot
        return LegJudgement(outcome, ended, warnings, lost)
    at_goal = goal is not None and goal.reached(samples.error[-1], controller.rows)
    assessment = assess(controller, recorder, leg.integrator, dt, held=not at_goal)
    left = assessment.departure
    measured = any(renewal.jumps for renewal in controller.solver.program.renewals)
    moved = (
        (Finding("target_jumps", {"steps": assessment.target}),) if assessment.target and not measured else ()
    )
    why = *_seen(controller, recorder, samples, left), *(moved if left else ()), passed(recorder)
    seen = tuple(finding for finding in why if finding is not None)
    troubled = bool(assessment.unstable) or assessment.missed or outcome is Outcome.DIVERGED
    # A task that distances hold back departs from its decay with any dt, and to try costs many runs.
    held_back = bool(recorder.blocking) or recorder.avoided
    hopeless = outcome is Outcome.SINGULAR or any(finding.code == HOPELESS for finding in seen)
    return LegJudgement(
        outcome,
        ended,
        warnings,
        lost,
        assessment,
        left=() if left is None else (_above_decay(samples, left),),
        seen=seen,
        moved=() if left else moved,
        trials=Trials(leg, dt, assessment)
        if troubled and not (hopeless or held_back or samples.servo)
        else None,
        method=method,
        dt=dt,
    )


def _unmet(controller: Controller, recorder: Recorder, samples: TaskSamples, dt: float) -> Iterator[Finding]:
    """Findings where inputs fell short of the task, and where the motion differs from its recorded rates."""
    residual = samples.residual.copy()
    if controller.limits is not None:  # of a start from rest λ says it
        residual[: run_up(samples.t, samples.u, controller.solver.limits_on.changes, dt)] = 0.0
    unmet = residuals(samples.t, residual, samples.rate)
    if unmet.samples:
        constraints = {"limits": controller.limits, "distances": controller.solver.scene}
        names = [name for name, constraint in constraints.items() if constraint is not None]
        more = {"rows": len(controller.rows), "inputs": controller.robot.n_u}
        if more["rows"] <= more["inputs"] or len(controller.solver.dimensions.levels) > 1:
            more = {}
        yield unmet.finding(scale=float(recorder.so_far.scale.min(initial=1.0)), kept=names, **more)
    if recorder.disturbed:
        return
    robot, recorded = controller.robot, recorder.so_far
    otherwise = moving_otherwise(samples.t, recorded.q, recorded.q_dot, robot.q_names, robot.q_units)
    if otherwise is not None:
        yield otherwise
    sliding = sideways_speeds(robot, recorded.q, recorded.q_dot)
    if sliding:
        fastest = max(sliding, key=lambda name: sliding[name][1])
        speeds = {name: speed for name, (_, speed) in sliding.items()}
        yield Finding("wheels_slid", {"speeds": speeds}, {"t": float(samples.t[sliding[fastest][0]])})


def _above_decay(samples: TaskSamples, departure: Departure) -> Finding:
    """The error and its bound: at the worst, and at the end if the error is above the bound there."""
    norm = np.linalg.norm(samples.error, axis=1)
    last = len(norm) - 1
    missed = norm[last] > departure.bound[last]
    stays = missed and f"{norm[last]:.3g}" == f"{norm[departure.worst]:.3g}"
    reported = [last] if stays or departure.worst == last else [departure.worst, *([last] if missed else [])]
    errors = [
        {"t": float(samples.t[k]), "error": float(norm[k]), "promised": float(departure.bound[k])}
        for k in reported
    ]
    values = {"initial": float(norm[0]), "errors": errors, "end": float(samples.t[last])}
    return Finding("promise_left", values, {"t": float(samples.t[departure.first])})


def _seen(
    controller: Controller, recorder: Recorder, samples: TaskSamples, left: Departure | None
) -> Iterator[Finding | None]:
    """Possible causes where the error exceeds its expected decay, or at the end of an unfinished run."""
    chatter = chattering(samples.t, samples.u, controller.robot.u_names)
    if left is None:
        yield chatter
        return
    q, target = recorder.so_far.q, recorder.so_far.r_d
    with controller.without_limits():
        why = [
            reasons.out_of_reach(controller, q[left.worst], target[left.worst]),
            reasons.inputs_fell_short(controller, samples, left),
            reasons.still_moving(controller, samples),
            *reasons.singularity(controller, samples, q, left),
            reasons.switching(samples, left),
            chatter,
        ]
        controller.reset()
    yield from why if any(why) else [reasons.unresolved(samples, left)]


def _lost(leg: Leg) -> Iterator[Finding]:
    """Findings at a singular end: task directions that no input moves, a target out of reach."""
    controller, recorder, ended = leg.controller, leg.recorder, leg.ended
    if ended.outcome is not Outcome.SINGULAR:
        return
    lost = reasons.lost_words(controller, ended.q, ended.J)
    if lost and not any(lost[0] in reason.values.get("lost", ()) for reason in ended.reasons):
        yield Finding("nothing_gives", {"lost": lost})
    if len(recorder):
        far = reasons.out_of_reach(controller, ended.q, recorder.so_far.r_d[-1])
        if far is not None:
            yield far
