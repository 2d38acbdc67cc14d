"""A run of tasks that come and go: its legs, from event to event, joined into one trajectory."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from nmm.arrays import Array
from nmm.control.controller import Controller
from nmm.control.goal import Goal
from nmm.control.sequenced import SequencedController
from nmm.runs.clearance import ran_into, swept
from nmm.runs.judgement import Ended, Verdict, blocked, reached_or_not
from nmm.runs.recording import Recorder
from nmm.runs.repeated import told_once
from nmm.runs.residuals import NONE, Residuals
from nmm.runs.shown_frame import shown
from nmm.runs.trajectory import Outcome, Trajectory
from nmm.words import listed


@dataclass
class Leg:
    """The samples between two events.

    Attributes
    ----------
    controller : of the tasks that are active
    active (tasks,) : which of all are
    recorder, ended, verdict : as of a run
    end : when it was to end at the latest, s
    """

    controller: Controller
    active: tuple[bool, ...]
    recorder: Recorder
    ended: Ended
    end: float
    verdict: Verdict | None = None


def join(
    controller: SequencedController, legs: Sequence[Leg], until: Goal | None, dt: float, method: str
) -> Trajectory:
    """One trajectory of all tasks' rows: not a number where a task is not active."""
    robot, stack = controller.robot, controller.all_tasks
    verdict = _verdict(controller, legs, until)
    parts: list[Trajectory] = []
    for leg in legs:
        one = leg.verdict or Verdict(leg.ended.outcome, leg.ended.message, [])
        parts.append(leg.recorder.trajectory(one.outcome, one.message, dt, method))
    rows = stack.rows(robot)
    levels = sorted({task.priority for task in stack})
    counts = [len(task.rows(robot)) for task in stack]
    first = np.cumsum([0, *counts])
    count = sum(len(part) for part in parts)
    r, r_d, error = np.full((3, count, len(rows)), np.nan)
    partition = np.full((count, len(rows)), -1, dtype=np.int64)
    scale = np.ones((count, len(levels)))
    at = 0
    for leg, part in zip(legs, parts, strict=True):
        here = slice(at, at + len(part))
        at += len(part)
        on = [i for i, active in enumerate(leg.active) if active]
        if not on or not len(part):
            continue
        columns = np.concatenate([np.arange(first[i], first[i + 1]) for i in on])
        for whole, own in ((r, part.r), (r_d, part.r_d), (error, part.error), (partition, part.partition)):
            whole[here, columns] = own
        places = sorted({stack.tasks[i].priority for i in on})
        scale[here, [levels.index(priority) for priority in places]] = part.scale
    # What a leg's recorder has to say is complete only once its trajectory is made.
    warnings = told_once(
        [
            (_called(controller, leg, legs), leg.recorder.start, [*part.warnings, *_judged(leg)])
            for leg, part in zip(legs, parts, strict=True)
        ]
    )
    warnings += verdict.warnings

    def along(name: str) -> Array:
        return np.concatenate([getattr(part, name) for part in parts])

    distances: dict[str, Any] = {}
    if controller.setting is not None:
        where = [place for leg in legs for place in leg.recorder.places]
        found = swept(controller.setting, along("t"), along("q"), along("u"), where)
        into = ran_into(controller.setting, found, along("t"))
        if into and verdict.outcome in (Outcome.COMPLETED, Outcome.MISSED):
            message = into if verdict.outcome is Outcome.COMPLETED else f"{into}; {verdict.message}"
            verdict = verdict._replace(outcome=Outcome.MISSED, message=message)
        distances = {
            "clearance": found.clearance,
            "clearance_pairs": found.pairs,
            "clearance_between": found.between,
            "clearance_points": found.points,
            "obstacles": found.obstacles,
        }
    drawn, q = shown(stack, robot), along("q")
    path = drawn.path(robot, q)
    desired = None if path is None or not drawn.rows else _desired(controller, path, r_d, first, drawn.frame)
    return replace(
        parts[0],
        t=along("t"),
        q=q,
        u=along("u"),
        q_dot=along("q_dot"),
        kinematics_off=float(np.fmax.reduce([part.kinematics_off for part in parts])),
        objective=along("objective"),
        sigma_min=along("sigma_min"),
        residual=along("residual"),
        margin=along("margin"),
        shares=along("shares"),
        step_size=along("step_size"),
        crossed=np.concatenate([part.crossed for part in parts]),
        r=r,
        r_d=r_d,
        error=error,
        partition=partition,
        scale=scale,
        unmet=_unmet([part.unmet for part in parts], count),
        r_names=row_names(controller),
        r_units=tuple(row.unit for row in rows),
        resolver=controller.resolver_name,
        outcome=verdict.outcome,
        message=verdict.message,
        warnings=tuple(dict.fromkeys(warnings)),
        frame=drawn.frame,
        path=path,
        desired=desired,
        target=drawn.mark(path),
        events=tuple(controller.events),
        **distances,
    )


def row_names(controller: SequencedController) -> tuple[str, ...]:
    """Names of all rows; with their task's where two tasks have rows of one name."""
    robot, stack = controller.robot, controller.all_tasks
    names = [row.name for row in stack.rows(robot)]
    if len(set(names)) == len(names):
        return tuple(names)
    return tuple(f"{task.name or i}: {row.name}" for i, task in enumerate(stack) for row in task.rows(robot))


def _verdict(controller: SequencedController, legs: Sequence[Leg], until: Goal | None) -> Verdict:
    """How the run ended; of legs that kept no promise, the first. It warns of what concerns the whole run."""
    sequence, moment = controller.sequence, controller.settle()
    last = legs[-1].verdict or Verdict(legs[-1].ended.outcome, legs[-1].ended.message, [])
    missed = [
        one._replace(message=_called(controller, leg, legs) + one.message)
        for leg in legs
        if (one := leg.verdict) is not None and one.outcome in (Outcome.MISSED, Outcome.UNSTABLE)
    ]
    ended = last.outcome in (Outcome.COMPLETED, Outcome.MISSED, Outcome.UNSTABLE)
    verdict = (missed[0] if ended and missed else last)._replace(warnings=[])
    never = sequence.never_began(moment)
    if until is not None and ended:
        if never or not any(legs[-1].active):
            why = "; ".join(never) or "no task was active at the end"
            verdict = Verdict(Outcome.MISSED, f"not reached: {why}", [])
        else:
            verdict = reached_or_not(verdict, legs[-1].recorder, until, legs[-1].controller.rows)
    verdict = blocked(verdict, legs[-1].recorder.blocking)
    return Verdict(verdict.outcome, verdict.message, [*verdict.warnings, *never])


def _called(controller: SequencedController, leg: Leg, legs: Sequence[Leg]) -> str:
    """Which leg, before what is said of it: "with reach from t = 0 to 2 s: "; "" where it is the run."""
    if len(legs) == 1:
        return ""
    names = [name for name, on in zip(controller.sequence.names, leg.active, strict=True) if on]
    recorder = leg.recorder
    end = leg.end if recorder.goes_on else recorder.reached
    return f"with {listed(names) or 'no task'} from t = {recorder.start:.4g} to {end:.4g} s: "


def _judged(leg: Leg) -> list[str]:
    return [] if leg.verdict is None else leg.verdict.warnings


def _unmet(found: Sequence[Residuals], count: int) -> Residuals:
    some = [one for one in found if one.samples]
    if not some:
        return NONE
    samples = sum(one.samples for one in some)
    return max(some, key=lambda one: one.largest)._replace(samples=samples, share=samples / count)


def _desired(
    controller: SequencedController, path: Array, r_d: Array, first: Array, frame: str | None
) -> Array:
    """Where tasks want the frame, (N, 3); where it is, along axes and at times that none speaks of."""
    desired = path
    for i, task in enumerate(controller.all_tasks):
        alone = shown([task], controller.robot)
        if alone.frame == frame:
            desired = alone.desired(desired, r_d[:, int(first[i]) :])
    return desired
