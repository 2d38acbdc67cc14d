"""A dt with which a run behaves: found by trying it, not by a linearisation alone."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

from nmm.runs.stability import Advice, Instability

#: So many steps a trial takes at most: half a second,
MOST_STEPS = 6_000
#: and so many trials are made.
MOST_TRIALS = 6
#: A trial over a shorter stretch than this says nothing, in steps of the run's own dt.
LEAST = 20
#: A limit of stability is tried at this share of it; the next dt is between these shares of the last one.
BELOW, LEAST_SHARE, MOST_SHARE = 0.98, 0.125, 0.6


class Trial(NamedTuple):
    """A run that was tried with another dt.

    Attributes
    ----------
    behaves : it reached its end, stable, with the error promised
    unstable : the instabilities found in it
    start, end : the times it went from and to, s
    """

    behaves: bool
    unstable: list[Instability]
    start: float
    end: float


def advised(
    try_with: Callable[[float, int], Trial], dt: float, duration: float, unstable: Sequence[Instability]
) -> Advice | None:
    """A shorter dt with which the run behaves, if one of a few does.

    Parameters
    ----------
    try_with : (dt, most steps) -> Trial
    dt, duration : of the run, s
    unstable : what was found in it
    """
    own = most = dt
    for _ in range(MOST_TRIALS):
        # Where a run went astray its modes grow ever faster: the slowest of them is believed.
        limit = max((one.limit for one in unstable), default=0.0)
        dt = min(max(BELOW * limit, LEAST_SHARE * dt), most)
        steps = min(MOST_STEPS, int(duration / dt) + 1)
        if steps * dt < min(duration, LEAST * own):
            return None
        trial = try_with(dt, steps)
        if trial.behaves:
            return Advice(dt, trial.start, trial.end)
        unstable, most = trial.unstable, MOST_SHARE * dt
    return None
