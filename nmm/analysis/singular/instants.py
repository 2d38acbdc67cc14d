"""Instants of a motion: where a quantity changes its sign, and where it has a low local minimum."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from nmm.arrays import Array

#: Two minima count as one unless the value rises between them by this fraction of the threshold.
RISE = 1e-3
#: A refined minimum must be lower than its sample by this fraction of the threshold: else it is rounding.
ROUNDING = 1e-9


@dataclass(frozen=True)
class Crossing:
    """A minor changes its sign at time `t` (s), between the samples `before` and `after`.

    sign : of the minor afterwards, 1 or -1

    Examples
    --------
    >>> scenario = nmm.Scenario.load("unicycle_2r_switching")
    >>> history = nmm.analysis.analyse_along(scenario.controller(), scenario.run())
    >>> crossing = history.crossings[0]
    >>> crossing.columns, round(crossing.t, 2), crossing.sign
    (('v', 'q1'), 1.83, -1)
    """

    t: float
    columns: tuple[str, ...]
    sign: int
    before: int
    after: int


@dataclass(frozen=True)
class Dip:
    """A local minimum `value` at `t` (s), near sample `index`; `at_end`: at the motion's first or last.

    Examples
    --------
    >>> arm = nmm.load("unicycle_2r", platform="fixed")
    >>> q = np.array([[0.0, q2] for q2 in np.linspace(-1, 1, 21)])
    >>> history = nmm.analysis.analyse_along((arm, nmm.Position("ee", "xy")), np.linspace(0, 2, 21), q)
    >>> [(round(dip.t, 3), round(dip.value, 6)) for dip in history.dips]
    [(1.0, 0.0)]
    """

    t: float
    value: float
    index: int
    at_end: bool


def crossings(t: Array, values: Array, names: tuple[tuple[str, ...], ...]) -> tuple[Crossing, ...]:
    """Changes of sign of the columns of values (N, count); zeros have no sign and are passed over.

    Between neighbouring samples the instant is that of linear interpolation; where samples that are zero lie
    between, their middle.
    """
    found = []
    for column, name in zip(values.T, names, strict=True):
        signed = np.flatnonzero(column)
        changes = np.flatnonzero(np.sign(column[signed[1:]]) != np.sign(column[signed[:-1]]))
        for k in changes:
            before, after = int(signed[k]), int(signed[k + 1])
            if after == before + 1:
                share = column[before] / (column[before] - column[after])
                time = t[before] + share * (t[after] - t[before])
            else:
                time = (t[before + 1] + t[after - 1]) / 2.0
            found.append(Crossing(float(time), name, int(np.sign(column[after])), before, after))
    return tuple(sorted(found, key=lambda crossing: crossing.t))


def dips(t: Array, values: Array, threshold: float, value_at: Callable[[float], float]) -> tuple[Dip, ...]:
    """Local minima of values (N,) below the threshold, each refined between its neighbours by `value_at(t)`.

    A minimum at an end of the motion counts. One above the threshold at its sample is looked at too
    where a neighbour's slope lets it reach below: a singularity that is passed between two samples.
    """
    from scipy.optimize import minimize_scalar  # a tenth of a second that other analyses need not spend

    found = []
    for index in _minima(values, RISE * threshold):
        first, last = max(index - 1, 0), min(index + 1, len(t) - 1)
        time, value = float(t[index]), float(values[index])
        steepest = max(abs(values[index] - values[k]) for k in (first, last))
        if value - steepest > threshold:
            continue
        for a, b in ((first, index), (index, last)):
            # On each side of the sample by itself: across it the interpolated motion has a kink.
            if a < b:
                refined = minimize_scalar(
                    value_at, bounds=(t[a], t[b]), method="bounded", options={"xatol": 1e-9 * (t[b] - t[a])}
                )
                if refined.fun < value - ROUNDING * threshold:
                    time, value = float(refined.x), float(refined.fun)
        if value < threshold:
            found.append(Dip(time, value, index, time in (t[0], t[-1])))
    return tuple(found)


def _minima(values: Array, rise: float) -> list[int]:
    """Samples of local minima between which the value rises by `rise` or more; both ends may be one."""
    found: list[int] = []
    lowest, highest, falling = 0, 0, True
    for k in range(len(values)):
        if falling:
            if values[k] < values[lowest]:
                lowest = k
            elif values[k] >= values[lowest] + rise:
                found.append(lowest)
                highest, falling = k, False
        elif values[k] > values[highest]:
            highest = k
        elif values[k] <= values[highest] - rise:
            lowest, falling = k, True
    if falling:
        found.append(lowest)
    return found
