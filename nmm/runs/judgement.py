"""What a run amounts to: its error against what the gain promises, its inputs against what the task asked.

A run that reached its end is `completed` when the error went as promised, `unstable` when dt was too long for
it (a shorter one was tried), and `missed` otherwise. Whatever the outcome, the message says what was seen
where it went wrong.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from nmm.arrays import Array
from nmm.control.controller import Controller
from nmm.control.goal import Goal, sizes
from nmm.control.integrators import Integrator
from nmm.functions.function import Row
from nmm.runs import reasons
from nmm.runs.advice import Trial, advised
from nmm.runs.assessment import Assessment, assess
from nmm.runs.chattering import Chattering, chattering, moving_otherwise
from nmm.runs.crossings import Crossings, crossings
from nmm.runs.promise import Departure, Samples
from nmm.runs.recording import Recorder
from nmm.runs.residuals import residuals, run_up
from nmm.runs.stability import Advice, Instability
from nmm.runs.trajectory import Outcome

#: (first sample, dt, most steps) -> the part of the run that was tried from there on, and how it ended.
Retry = Callable[[int, float, int], tuple[Recorder, Outcome]]


class Ended(NamedTuple):
    """How integrating a run ended.

    Attributes
    ----------
    outcome, message : as far as integrating it told
    q (n,) : the last configuration recorded, or the start
    J (s, m) : the task's matrix in the controller's last call, made at q or a step from it
    """

    outcome: Outcome
    message: str
    q: Array
    J: Array


class Verdict(NamedTuple):
    """An outcome, the message that belongs to it, and what else is worth a warning."""

    outcome: Outcome
    message: str
    warnings: list[str]


def judge(
    controller: Controller,
    recorder: Recorder,
    advance: Integrator,
    method: str,
    dt: float,
    ended: Ended,
    retry: Retry,
    goal: Goal | None = None,
) -> Verdict:
    """Judge a run.

    Parameters
    ----------
    controller, recorder, advance, method, dt : the run
    ended : how integrating it ended
    retry : to try parts of it again with another dt
    goal : what it was to reach; one that has reached it is not held to what its gain promised on the way
    """
    outcome, message = ended.outcome, ended.message
    samples = recorder.samples
    if not len(recorder):
        return Verdict(outcome, _joined(message, *_lost(controller, recorder, ended)), [])
    residual = samples.residual.copy()
    if controller.limits is not None:  # of a start from rest λ says it
        residual[: run_up(samples.t, samples.u, controller.kept.accelerations, dt)] = 0.0
    unmet = residuals(samples.t, residual, samples.rate)
    warnings = [_joined(unmet.sentence, _relaxed(recorder.scale, controller))] if unmet.samples else []
    otherwise = moving_otherwise(
        samples.t,
        recorder.so_far.q,
        recorder.so_far.q_dot,
        controller.robot.q_names,
        controller.robot.q_units,
    )
    warnings += [otherwise] if otherwise else []
    if outcome is Outcome.INTERRUPTED:
        return Verdict(outcome, message, warnings)
    there = goal is not None and goal.reached(samples.error[-1], controller.rows)
    found = assess(controller, recorder, advance, dt, held=not there)
    chatter = chattering(samples.t, samples.u, controller.robot.u_names)
    passed = _passed(controller, recorder)
    seen = _seen(controller, recorder, samples, found, chatter)
    seen += [passed.sentence] if passed else []
    troubled = found.unstable or found.missed or outcome is Outcome.DIVERGED
    advice = None
    # A task that distances hold back departs from its promise with any dt, and to try costs many runs.
    held_back = bool(recorder.blocking) or recorder.avoided
    if troubled and outcome is not Outcome.SINGULAR and not _hopeless(seen) and not held_back:
        advice = _advice(controller, recorder, advance, dt, found, retry)
    stability = _stability(found.unstable, advice, method, dt)
    if outcome is not Outcome.COMPLETED:
        if advice is None:
            also = [*_lost(controller, recorder, ended), *seen]
        else:
            also = [stability or _tried(advice, dt)]
        return Verdict(outcome, _joined(message, *also), warnings)
    if found.missed and found.departure is not None:
        if stability and advice:
            return Verdict(Outcome.UNSTABLE, _joined(stability, *seen), warnings)
        told = _told(samples, found.departure)
        # What is read first is short; what chatters, or follows from a target out of reach, is told apart.
        chatters = "" if chatter is None else chatter.sentence
        also = [one for one in seen if one == chatters or (_hopeless(seen) and one != seen[0])]
        why = [one for one in seen if one not in also]
        apart = [_joined(*also)] if also else []
        return Verdict(Outcome.MISSED, _joined(told, *why, _tried(advice, dt)), [*warnings, *apart])
    if 2 * len(found.unstable) > found.examined:
        return Verdict(Outcome.UNSTABLE, stability, warnings)
    if passed is not None and passed.jumped:
        told = _told(samples, found.departure) if found.departure else ""
        return Verdict(Outcome.MISSED, _joined(told, *seen), warnings)
    if found.departure is not None:
        warnings.append(_joined(_told(samples, found.departure), *seen))
    else:
        warnings += seen
    if found.target and found.departure is None:
        warnings.append(_moved(found.target))
    if stability:
        warnings.append(f"for part of the run {stability}")
    return Verdict(outcome, message, warnings)


def reached_or_not(verdict: Verdict, recorder: Recorder, goal: Goal, rows: Sequence[Row]) -> Verdict:
    """The verdict on a run that was to reach a target: by its tolerances, whatever its gain promised."""
    if verdict.outcome not in (Outcome.COMPLETED, Outcome.MISSED) or not len(recorder):
        return verdict
    error = recorder.samples.error[-1]
    if goal.reached(error, rows):
        said = [verdict.message] if verdict.message else []
        return Verdict(
            Outcome.COMPLETED, f"reached at t = {recorder.reached:.4g} s", [*said, *verdict.warnings]
        )
    metres, radians = sizes(error, [row.unit for row in rows])
    missed = f"not reached in {recorder.duration:.4g} s: {metres:.3g} m and {radians:.3g} rad are left"
    return Verdict(Outcome.MISSED, _joined(missed, verdict.message), verdict.warnings)


def blocked(verdict: Verdict, blocking: Sequence[str]) -> Verdict:
    """The verdict on a run that ends without its target, with the distances that held it back at its end."""
    if verdict.outcome is not Outcome.MISSED or not blocking:
        return verdict
    return verdict._replace(
        message=_joined(f"blocked by the distance of {', '.join(blocking)}", verdict.message)
    )


def _advice(
    controller: Controller,
    recorder: Recorder,
    advance: Integrator,
    dt: float,
    found: Assessment,
    retry: Retry,
) -> Advice | None:
    """A shorter dt with which the run behaves."""
    samples = recorder.samples
    troubles = [int(np.searchsorted(samples.t, one.t)) for one in found.unstable]
    if found.departure is not None:
        troubles.append(found.departure.first)
    before = min(troubles, default=0)

    def try_with(shorter: float, most: int) -> Trial:
        # The whole run where it fits, else from a little before it went wrong.
        fits = samples.t[-1] - samples.t[0] <= most * shorter
        start = 0 if fits else max(0, before - int(0.1 * most * shorter / dt))
        try:
            tried, outcome = retry(start, shorter, most)
            again = assess(controller, tried, advance, shorter)
        except Exception:  # a user's function may raise anything, where it was not made for
            return Trial(False, [], float(samples.t[start]), float(samples.t[start]))
        behaves = outcome is Outcome.COMPLETED and not again.unstable and again.departure is None
        behaves = behaves and _passed(controller, tried) is None
        return Trial(behaves, again.unstable, float(samples.t[start]), tried.reached)

    return advised(try_with, dt, recorder.duration, found.unstable)


def _passed(controller: Controller, recorder: Recorder) -> Crossings | None:
    """The singularities of J_e that lie between samples."""
    robot, found = controller.robot, recorder.so_far
    return crossings(recorder.t, found.u, found.side, robot.u_names, robot.u_units)


def _stability(unstable: list[Instability], advice: Advice | None, method: str, dt: float) -> str:
    if not unstable:
        return ""
    # Of a run that went astray the last modes are monstrous: the one that the advice answers is told.
    answered = [one for one in unstable if advice is not None and one.limit >= advice.dt]
    return max(answered or unstable, key=lambda one: one.rate).describe(method, dt, advice)


def _tried(advice: Advice | None, dt: float) -> str:
    if advice is None:
        return ""
    return f"with dt = {advice.dt:.3g} s in place of {dt:g} s it kept its promise when tried"


def _told(samples: Samples, found: Departure) -> str:
    """What was promised and was: where it was the worst, and at the end, where that is not as promised."""
    norm = np.linalg.norm(samples.error, axis=1)
    last = len(norm) - 1

    def at(k: int) -> str:
        where = "at the end" if k == last else f"at t = {samples.t[k]:.4g} s"
        return f"{norm[k]:.3g} {where} (promised {found.bound[k]:.2g})"

    missed = norm[last] > found.bound[last]
    stays = missed and f"{norm[last]:.3g}" == f"{norm[found.worst]:.3g}"
    told = [at(last)] if stays or found.worst == last else [at(found.worst), *([at(last)] if missed else [])]
    first = f"the error left its gain's promise at t = {samples.t[found.first]:.4g} s"
    return f"{first}: {', '.join([f'{norm[0]:.3g} at first', *told])}"


def _seen(
    controller: Controller,
    recorder: Recorder,
    samples: Samples,
    found: Assessment,
    chatter: Chattering | None,
) -> list[str]:
    """What there is to see where the error left its promise; of a run that did not end, at its end."""
    left = found.departure
    if left is None:
        return [chatter.sentence] if chatter else []
    q = recorder.q[: len(recorder)]
    target = recorder.target
    with controller.without_limits():
        sentences = [
            reasons.out_of_reach(controller, q[left.worst], target[left.worst]),
            reasons.inputs_unmet(samples, left),
            reasons.still_moving(controller, samples),
            reasons.singularity(controller, samples, q, left),
            reasons.switching(samples, left),
            "" if chatter is None else chatter.sentence,
        ]
        controller.reset()
    if not any(sentences):
        sentences.append(reasons.unresolved(samples, left))
    if found.target:
        sentences.append(_moved(found.target))
    return [sentence for sentence in sentences if sentence]


def _moved(steps: int) -> str:
    return f"the target moved otherwise than its rate says in {steps} steps, and the error with it"


def _lost(controller: Controller, recorder: Recorder, ended: Ended) -> list[str]:
    """What nothing moves where a run became singular, and whether the target is out of reach."""
    if ended.outcome is not Outcome.SINGULAR:
        return []
    words = reasons.lost_words(controller, ended.q, ended.J)
    sentences = [f"no input gives: {', '.join(words)}"] if words and words[0] not in ended.message else []
    if len(recorder):
        sentences.append(reasons.out_of_reach(controller, ended.q, recorder.target[-1]))
    return [sentence for sentence in sentences if sentence]


def _relaxed(scale: Array, controller: Controller) -> str:
    least = float(scale.min(initial=1.0))
    if least >= 1.0:
        return ""
    limits = ["limits"] if controller.limits is not None else []
    kept = [*limits, "distances"] if controller.setting is not None else limits
    if kept:
        return f"under its {' and '.join(kept)} λ falls to {least:.3g}"
    return f"its resolver scales the rate on purpose, down to {least:.3g} of it"


def _hopeless(seen: list[str]) -> bool:
    """Whether no dt helps: the target is out of reach."""
    return any("out of reach" in sentence for sentence in seen)


def _joined(*sentences: str) -> str:
    return "; ".join(sentence for sentence in sentences if sentence)
