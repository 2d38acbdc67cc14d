"""What a robot's loop found (`nmm.Loop`)."""

from typing import Any

from nmm.base.findings.finding import Words
from nmm.base.text_format import apart, counted

_REASONS = {
    "lost": "did not come",
    "not_finite": "had values or a time that are not finite, or another number of them",
    "from_the_future": "were made later than now",
    "repeated": "came twice",
    "out_of_order": "were older than one before",
    "old": "were older than the watchdog allows",
    "frozen": "stayed the same to the bit while the inputs moved the robot",
    "jump": "were where the inputs cannot have brought the robot",
}


def _refused(reason: str, samples: int, t: float, end: float) -> str:
    return f"{counted(samples, 'measurement')} {_REASONS[reason]}, from t = {t:.4g} to {end:.4g} s"


def _outside(name: str, value: float, unit: str, lower: Any, upper: Any, t: float, **_: Any) -> str:
    known = {word: bound for word, bound in (("from", lower), ("to", upper)) if bound is not None}
    at, *ends = apart(value, *known.values())
    sides = [f"{word} {end}" for word, end in zip(known, ends, strict=True)]
    return (
        f"{name} is measured at {at} {unit}, outside its limits ({' '.join(sides)}), "
        f"at t = {t:.4g} s: another unit, or not homed?"
    )


WORDS: dict[str, Words] = {
    "measurement_refused": _refused,
    "measurements_ended": "no measurement that can be used for {silent:.3g} s at t = {t:.4g} s: stops",
    "relocated": "the localisation has the platform {m:.3g} m and {rad:.3g} rad from where it was, from t = "
    "{t:.4g} s on",
    "off_task": "the task error is {m:.3g} m and {rad:.3g} rad at t = {t:.4g} s, more than allowed: stops",
    "outside_limits": _outside,
    "not_following": "in the second before t = {t:.4g} s {name} is measured {apart:.3g} {unit} off the way "
    "of {way:.3g} {unit} that its inputs asked for (held, old positions with new times, or later than "
    "`lag` and `slip` allow): stops",
    "call_late": "{samples:count call} late, from t = {t:.4g} to {end:.4g} s; at most {gap:.3g} s after the "
    "one before",
    "clock_jumped": "the clock jumped by {by:.4g} s at t = {t:.4g} s",
    "not_called": "not called for {gap:.3g} s before t = {t:.4g} s, or the clock jumped: stops",
    "resolver_silent": "no inputs in {samples:count call} from t = {t:.4g} to {end:.4g} s ({why})",
    "stop_asked": "asked to stop at t = {t:.4g} s ({why})",
    "stopped": "at rest at t = {t:.4g} s, {lasted:.3g} s after it began to stop ({why})",
}
