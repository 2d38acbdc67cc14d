"""What reading a robot's log found (`nmm.read_bag`)."""

from collections.abc import Sequence
from typing import Any

from nmm.base.findings.finding import Words
from nmm.base.text_format import counted, listed

_STAMPS = {
    "zero": "has stamps of 0",
    "standing": "has stamps that stand still",
    "another clock": "is stamped by another clock than the recorder's",
}


def _jumps(edge: str, count: int, m: float, rad: float, t: float) -> str:
    return (
        f"{edge} jumps {counted(count, 'time')}, by up to {m:.3g} m and {rad:.3g} rad, first at "
        f"t = {t:.4g} s: it stays until then, and no input is made of it"
    )


def _contradict(names: Sequence[str], zero: bool) -> str:
    one = len(names) == 1
    what = f"{'is' if one else 'are'} all 0 while q moves" if zero else f"contradict{'s' * one} q"
    return f"{listed(list(names))} {what}: differences of q are taken"


def _held(name: str, t: float, last: float, **_: Any) -> str:
    return f"{name} comes no more after t = {t:.4g} s: it stays where it was until {last:.4g} s"


WORDS: dict[str, Words] = {
    "bag_cut": "{file} is read as far as it goes ({reason}); to mend it: {mend}",
    "stamps_of_recording": lambda topic, why: f"{topic} {_STAMPS[why]}: it goes by the times of recording",
    "stamps_missing": lambda topic, count: f"{counted(count, 'message')} of {topic} without a stamp left out",
    "pose_jumps": _jumps,
    "parents_differ": "{frame} has several parents in TF: {parents}; read is {edge}",
    "rates_contradict": _contradict,
    "joint_silent": _held,
    "values_not_finite": lambda name, count: f"{name} is no number in {counted(count, 'message')}, left out",
    "child_unnamed": "{topic} does not say whose pose it is: taken for the reference point's",
    "platform_silent": "no pose of the platform from t = {t:.4g} to {end:.4g} s: a straight line in between",
    "platform_unknown": "{s:.4g} s of joint states, in which the platform's pose is not known, are left out",
}
