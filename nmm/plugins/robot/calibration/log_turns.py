"""Counters that begin anew are counted on: angles within one turn, ticks modulo a power of two."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping
from typing import Any

import numpy as np

from nmm.base.arrays import Array, Flags, positive
from nmm.base.errors import InputError, no_such
from nmm.plugins.robot.calibration.drive_log import Wrapped
from nmm.plugins.robot.calibration.log_units import Unit
from nmm.plugins.robot.encoders import MOST, SLACK

#: A counter of ticks begins anew after so many bits.
BITS = range(8, 33)
#: The part of what it counts to that no step may exceed: where its file says that it begins anew, and where
#: only the readings do.
STATED, SEEN = MOST / (2.0 * math.pi), 0.25
#: By itself a log of fewer readings says nothing of it.
FEWEST = 6
#: A step so much larger than all others is none of the wheel's.
UNLIKE = 10.0


def stated_for(wrapped: Wrapped, names: Collection[str], where: str) -> dict[str, bool | float | None]:
    """What `wrapped` says of each counter: None where nothing, True for a turn, False, or a number."""
    if wrapped is None or isinstance(wrapped, bool):
        return dict.fromkeys(names, wrapped)
    some = [wrapped] if isinstance(wrapped, str) else wrapped
    asked: dict[str, Any] = dict(some) if isinstance(some, Mapping) else dict.fromkeys(some, True)
    for name, value in asked.items():
        if name not in names:
            raise no_such("counter", name, names, f"{where}: wrapped")
        if not isinstance(value, bool):
            asked[name] = positive(value, f"{where}: wrapped: {name}")
    rest = None if isinstance(some, Mapping) else False
    return {name: asked.get(name, rest) for name in names}


def counted_on(
    values: Array, unit: Unit, stated: bool | float | None, name: str, where: str, at: Callable[[int], str]
) -> tuple[Array, float | None]:
    """Readings (N,), in their unit, without the leaps of a counter that begins anew, and after how many of
    them it does, None where it does not.

    stated : as of `stated_for`; None: as the readings show, which a caller then tells
    at : what a row is called

    Raises
    ------
    InputError : by the counter's name and `wrapped=`: a step that may be more than half of what it counts
        to, readings beyond that, leaps that are no turn's
    """
    if stated is False or len(values) < 2:
        return values, None
    steps = np.diff(values)
    if stated is None:
        span = _seen(values, steps, unit, name, where, at)
        return (values, None) if span is None else (_short(values, steps, span), span)
    span = unit.turn if stated is True else float(stated)
    if span is None:
        expected = f"after how many {unit.text} it begins anew, as wrapped={{{name!r}: 100}}"
        raise InputError(where=f"{where}: wrapped: {name}", expected=expected, got=stated)
    slack = SLACK * span
    if not _within(values, span, slack):
        expected = f"readings within {span:.6g} {unit.text.partition(':')[0]}, as wrapped= says"
        got = f"{values.min():.6g} to {values.max():.6g}"
        raise InputError(where=f"{where}: {name}", expected=expected, got=got)
    far = np.abs(steps - span * np.round(steps / span))
    if (worst := int(np.argmax(far))) is not None and far[worst] > STATED * span:
        what = f"{name} may have moved by more than half of what it counts to, at {at(worst + 1)}"
        raise InputError(what, where=where, expected="readings in shorter intervals", got=float(far[worst]))
    return _short(values, steps, span), span


def _seen(
    values: Array, steps: Array, unit: Unit, name: str, where: str, at: Callable[[int], str]
) -> float | None:
    """After how many it begins anew, as the readings show."""
    spans = [] if unit.turn is None else [unit.turn]
    if unit.counts:
        spans += [float(2**bits) for bits in BITS]
    large = np.abs(steps)
    for span in spans:
        leaps = large > 0.5 * span
        if not leaps.any() or not _within(values, span, SLACK * span):
            continue
        short = np.abs(steps - span * np.round(steps / span))
        if short.max() <= SEEN * span and len(values) >= FEWEST:
            return span
        if span == unit.turn or _unlike(large, leaps):
            raise _doubtful(name, where, at, large, leaps, unit)
    leaps = large > 0.5 * np.ptp(values)
    if _unlike(large, leaps):
        raise _doubtful(name, where, at, large, leaps, unit)
    return None


def _unlike(large: Array, leaps: Flags) -> bool:
    """Whether leaps are far larger than all other steps."""
    others = large[~leaps]
    others = others[others > 0.0]
    return bool(leaps.any() and len(others) >= FEWEST and large[leaps].min() > UNLIKE * others.max())


def _doubtful(
    name: str, where: str, at: Callable[[int], str], large: Array, leaps: Flags, unit: Unit
) -> InputError:
    """The error for steps that are leaps, and after how many units it begins anew if they are."""
    first, others = int(np.argmax(leaps)), large[~leaps & (large > 0.0)]
    span = float(np.median(large[leaps])) + float(np.median(others) if len(others) else 0.0)
    turn = unit.turn is not None and abs(span - unit.turn) < 0.5 * unit.turn
    plain = unit.text.partition(":")[0]
    anew = "True}" if turn else f"NUMBER}}, about {span:.6g} {plain}"
    what = f"{name} leaps at {at(first + 1)}: it begins anew, or went so far"
    expected = f"wrapped={{{name!r}: {anew}, or wrapped={{{name!r}: False}}"
    return InputError(what, where=where, expected=expected, got=float(large[first]))


def _within(values: Array, span: float, slack: float) -> bool:
    least, largest = float(values.min()), float(values.max())
    return (least >= -0.5 * span - slack and largest <= 0.5 * span + slack) or (
        least >= -slack and largest <= span + slack
    )


def _short(values: Array, steps: Array, span: float) -> Array:
    """The readings, each step the short way."""
    leaps = np.round(steps / span)
    return values - span * np.concatenate([[0.0], np.cumsum(leaps)])
