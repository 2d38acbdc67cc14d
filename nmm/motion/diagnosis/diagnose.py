"""The verdict on a run that has ended: its legs where tasks come and go, its goal, its limits."""

from collections import defaultdict
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from nmm.base.findings import Finding
from nmm.control.controller import Controller
from nmm.control.functions.function import row_scales
from nmm.control.goal import Goal, error_sizes
from nmm.control.sequencing.sequence import Schedule
from nmm.motion.clearance import Swept
from nmm.motion.diagnosis.judgement import LegJudgement, judge
from nmm.motion.diagnosis.limits import (
    binding,
    broken_limits,
    broken_rows,
    distances_short,
    not_kept,
    ran_into,
)
from nmm.motion.diagnosis.reasons import near_singularity
from nmm.motion.leg import Leg
from nmm.motion.recording import Recorder
from nmm.motion.trajectory import Trajectory
from nmm.motion.verdict import Awaited, FindingLine, Outcome, Verdict

#: Below this ratio of smallest to largest singular value a run is warned about.
NEARLY_SINGULAR = 1e-3
#: Outcomes of runs that reached their end, and those that a goal or a collision decides anew.
ENDED = (Outcome.COMPLETED, Outcome.MISSED, Outcome.UNSTABLE)
DECIDED = (Outcome.COMPLETED, Outcome.MISSED)


def diagnose(leg: Leg, trajectory: Trajectory, until: Goal | None) -> Verdict | Awaited:
    before, after = tuple((finding,) for finding in leg.recorder.findings), [*noticed(leg.recorder)]
    into = _into(leg.controller, leg.recorder.swept, trajectory)
    held = tuple(binding(trajectory, leg.controller.solver.limits_on)) if trajectory.limited else ()

    def finish(verdicts: Sequence[Verdict]) -> Verdict:
        verdict = _blocked(_at_end(_reached(verdicts[0], leg, until), leg, until), leg.recorder)
        warnings = (*before, *verdict.warnings, *lines(after, verdict.outcome))
        verdict = _collided(_explained(replace(verdict, warnings=warnings)), into)
        if verdict.outcome is Outcome.MISSED:
            verdict = replace(verdict, reasons=(*verdict.reasons, *held))
        return verdict

    return _when_read([judge(leg, trajectory.dt, trajectory.method, until)], finish)


def diagnose_legs(
    controller: Controller,
    schedule: Schedule,
    legs: Sequence[Leg],
    trajectory: Trajectory,
    swept: Swept | None,
    until: Goal | None,
) -> Verdict | Awaited:
    """The verdict on a run of tasks that come and go: the first leg above its expected decay decides."""
    last = legs[-1]
    judged = [judge(leg, trajectory.dt, trajectory.method, until if leg is last else None) for leg in legs]
    before = [tuple((finding,) for finding in leg.recorder.findings) for leg in legs]
    after = [[*noticed(leg.recorder)] for leg in legs]
    moment = schedule.settle()
    never = tuple(schedule.sequence.never_began(moment))
    into = _into(controller, swept, trajectory)
    places = [_place(schedule, leg) if len(legs) > 1 else None for leg in legs]

    def finish(verdicts: Sequence[Verdict]) -> Verdict:
        of_legs = zip(places, legs, before, after, verdicts, strict=True)
        leg_warnings = told_once(
            [
                (place, leg.recorder.start, (*first, *lines(then, verdict.outcome), *verdict.warnings))
                for place, leg, first, then, verdict in of_legs
            ]
        )
        verdict = verdicts[-1]
        if verdict.outcome in ENDED:
            missed = (
                replace(verdict, reasons=_at(place, verdict.reasons))
                for place, verdict in zip(places, verdicts, strict=True)
                if verdict.outcome in (Outcome.MISSED, Outcome.UNSTABLE)
            )
            verdict = next(missed, verdict)
        ended, verdict = verdict.outcome in ENDED, replace(verdict, warnings=())
        if until is not None and ended and (never or not any(last.active)):
            reason = Finding("nothing_to_reach", {"never": [finding.values["task"] for finding in never]})
            verdict = Verdict(Outcome.MISSED, (reason, *never))
        elif ended:
            verdict = _at_end(_reached(verdict, last, until), last, until)
        verdict = _collided(_blocked(verdict, last.recorder), into)
        every = (*leg_warnings, *verdict.warnings, *((finding,) for finding in never))
        every = tuple(line for i, line in enumerate(every) if line not in every[:i])
        return _explained(replace(verdict, warnings=every))

    return _when_read(judged, finish)


def _when_read(
    judged: Sequence[LegJudgement], finish: Callable[[Sequence[Verdict]], Verdict]
) -> Verdict | Awaited:
    """`finish` of the legs' verdicts; deferred if some need trials of another dt."""
    if not any(leg.trials for leg in judged):
        return finish([leg.verdict(None) for leg in judged])
    known = None if any(leg.open for leg in judged) else finish([leg.verdict(None) for leg in judged]).outcome
    return Awaited(
        lambda: finish([leg.verdict(leg.trials.advice() if leg.trials else None) for leg in judged]), known
    )


def noticed(recorder: Recorder) -> Iterator[tuple[Finding, Collection[Outcome]]]:
    """Warnings independent of the error, once the trajectory is made, each with the outcomes that show it."""
    controller, recorded, t = recorder.controller, recorder.so_far, recorder.t
    every, setting = tuple(Outcome), controller.solver.scene
    yield from ((finding, every) for finding in not_kept(recorder, controller))
    yield from ((finding, {*every} - {Outcome.SINGULAR}) for finding in _nearly_singular(recorder))
    of_tasks = (finding for task in controller.task for finding in task.function.noticed(t, recorded.q))
    yield from ((finding, every) for finding in of_tasks)
    broken = (
        *broken_limits(controller.robot, t, recorded.q, recorded.u),
        *broken_rows(controller.solver.limits_on, t, recorded.limited),
    )
    yield from ((finding, (*DECIDED, Outcome.INTERRUPTED)) for finding in broken)
    if setting is not None and recorder.swept is not None:
        yield from (
            (finding, every) for finding in distances_short(setting, recorder.swept, t, recorder.counts)
        )


def lines(found: Iterable[tuple[Finding, Collection[Outcome]]], outcome: Outcome) -> tuple[FindingLine, ...]:
    return tuple((finding,) for finding, outcomes in found if outcome in outcomes)


def _nearly_singular(recorder: Recorder) -> Iterator[Finding]:
    values, rows = recorder.singular_values, recorder.controller.rows
    if not len(values):
        return
    if any(row.unit == "px" for row in rows):  # in numbers hundreds of times those of other rows
        scales = row_scales(rows, recorder.controller.robot)[:, np.newaxis]
        values = np.linalg.svd(recorder.so_far.J / scales, compute_uv=False)
    largest = values[:, 0]
    ratio = np.divide(values[:, -1], largest, out=np.ones(len(largest)), where=largest > 0.0)
    k = int(np.argmin(ratio))
    if ratio[k] < NEARLY_SINGULAR:
        recorded, t = recorder.so_far, float(recorder.t[k])
        inputs = float(np.abs(recorded.u).max())
        at_sample = recorder.controller, t, recorded.q[k], recorded.J[k], float(ratio[k])
        yield near_singularity("nearly_singular", *at_sample, largest=inputs)


def _reached(verdict: Verdict, leg: Leg, goal: Goal | None) -> Verdict:
    """The verdict with a goal: by its tolerances, whatever decay the gain asks for."""
    recorder, rows = leg.recorder, leg.controller.rows
    if goal is None or verdict.outcome not in ENDED or not len(recorder):
        return verdict
    error = recorder.so_far.error[-1]
    if goal.reached(error, rows):
        earlier = (verdict.reasons,) if verdict.reasons else ()
        reason = Finding("reached", {}, {"t": recorder.reached})
        return Verdict(Outcome.COMPLETED, (reason,), (*earlier, *verdict.warnings))
    if verdict.outcome is Outcome.UNSTABLE:
        return verdict
    m, rad = error_sizes(error, rows)
    reason = Finding("not_reached", {"within": recorder.duration, "m": float(m), "rad": float(rad)})
    return replace(verdict, outcome=Outcome.MISSED, reasons=(reason, *verdict.reasons))


def _at_end(verdict: Verdict, leg: Leg, goal: Goal | None) -> Verdict:
    """The verdict, missed where a first task leads to an end, as a plan's, that is not reached."""
    recorder, controller = leg.recorder, leg.controller
    if goal is not None or verdict.outcome not in DECIDED or not len(recorder):
        return verdict
    at_end = float(recorder.t[-1]), recorder.so_far.q[-1], recorder.disturbed
    first = min((task.priority for task in controller.task), default=0)
    ways = [task.function.left(*at_end) for task in controller.task if task.priority == first]
    ways += [renewal.left(*at_end) for renewal in controller.solver.program.renewals]
    for left in filter(None, ways):
        reason = Finding("not_reached", {"within": recorder.duration, "m": left[0], "rad": left[1]})
        return replace(verdict, outcome=Outcome.MISSED, reasons=(reason, *verdict.reasons))
    return verdict


def _blocked(verdict: Verdict, recorder: Recorder) -> Verdict:
    """The verdict with the distances that held the robot back at the end of a run that missed its target."""
    if verdict.outcome is not Outcome.MISSED or not recorder.blocking:
        return verdict
    reason = Finding("blocked", {"pairs": list(recorder.blocking)})
    return replace(verdict, reasons=(reason, *verdict.reasons))


def _explained(verdict: Verdict) -> Verdict:
    """The verdict on a run that missed its target, with the reason first that no feedback can reach it."""
    why = [line for line in verdict.warnings if line[0].code == "pose_without_feedback"]
    if not why or verdict.outcome not in (Outcome.MISSED, Outcome.SINGULAR):
        return verdict
    warnings = tuple(line for line in verdict.warnings if line not in why)
    return replace(verdict, reasons=(*verdict.reasons[:1], *why[0], *verdict.reasons[1:]), warnings=warnings)


def _into(controller: Controller, swept: Swept | None, trajectory: Trajectory) -> Finding | None:
    """The collision of a run that keeps distances, if any."""
    setting = controller.solver.scene
    return None if setting is None or swept is None else ran_into(setting, swept, trajectory.t)


def _collided(verdict: Verdict, into: Finding | None) -> Verdict:
    """The verdict, not completed if the robot ran into something."""
    if into is None or verdict.outcome not in DECIDED:
        return verdict
    before = () if verdict.outcome is Outcome.COMPLETED else verdict.reasons
    return replace(verdict, outcome=Outcome.MISSED, reasons=(into, *before))


def _place(schedule: Schedule, leg: Leg) -> dict[str, object]:
    """The leg's tasks, start and end, s."""
    names = [name for name, on in zip(schedule.sequence.names, leg.active, strict=True) if on]
    end = leg.end if leg.recorder.goes_on else leg.recorder.reached
    return {"tasks": names, "start": leg.recorder.start, "end": end}


def _at(place: dict[str, object] | None, findings: FindingLine) -> FindingLine:
    """A leg's findings; those of the only leg have no place."""
    if place is None:
        return findings
    return tuple(replace(finding, where={**finding.where, "leg": place}) for finding in findings)


def told_once(
    legs: Sequence[tuple[dict[str, object] | None, float, Sequence[FindingLine]]],
) -> list[FindingLine]:
    """Warnings of all legs (place, start in s, warnings), alike ones once, with the later legs' starts."""
    alike = defaultdict(list)
    for place, begins, warnings in legs:
        for warning in warnings:
            first = warning[0]
            kind = first.code, first.values.get("name"), first.values.get("text")
            alike[kind].append((place, begins, warning))
    merged = []
    for occurrences in alike.values():
        place, begins, warning = occurrences[0]
        others = list(dict.fromkeys(later for _, later, _ in occurrences if later != begins))
        whole = all(other == warning for *_, other in occurrences) and len(others) + 1 == len(legs)
        merged.append(warning if whole or place is None else _at({**place, "also": others}, warning))
    return merged
