"""Where an arm stands in a recording: of each stretch one posture."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy.ndimage import maximum_filter1d, minimum_filter1d, uniform_filter1d

from nmm.base.arrays import Array, Flags
from nmm.base.errors import InputError

#: A joint stands at a time where it moves by no more, rad or m, in so long around it, s. So nothing is taken
#: that is nearer to a motion than half of it: clocks may be as far apart, and arms swing after they stop.
STANDS = {"rad": 0.01, "m": 0.002}
WINDOW = 0.5
#: It stands for so long at least, s, half of WINDOW on both sides not counted.
SHORTEST = 0.25
#: One that goes on by more than so much a second, and than it scatters, creeps.
CREEPS = {"rad": 0.002, "m": 0.0004}
#: Readings are compared so far apart, s, as means over so long: encoders flicker.
STEP, MEAN = 0.01, 0.1
#: Longer recordings, s, are none of a robot: another clock's stamps are among them.
LONGEST = 100_000.0

Series = Mapping[str, tuple[Array, Array]]


def standing(joints: Series, units: Mapping[str, str]) -> tuple[Array, Array, int]:
    """Spans (K, 2), s, in which all joints stand, their mean readings in each (K, c), and how many spans more
    there are in which a joint creeps on.

    joints : by name, stamps that increase, s, and readings, rad or m; units : "rad" or "m"

    Raises
    ------
    InputError : joints that are never known together, or do not stand, with the one that stands least
    """
    first, last = max(t[0] for t, _ in joints.values()), min(t[-1] for t, _ in joints.values())
    if not 0.0 < last - first <= LONGEST:
        what = "joints are at no time known together" if last <= first else f"last {last - first:.3g} s"
        raise InputError(what, where="joint states", expected=f"some seconds of all, up to {LONGEST:g}")
    grid = np.arange(first, last, STEP)
    still, share = np.ones(len(grid), dtype=bool), {}
    for name, series in joints.items():
        own = _stands(grid, *series, STANDS[units[name]])
        share[name], still = float(own.mean()), still & own
    steps = np.diff(still.astype(np.int8), prepend=0, append=0)
    runs = np.column_stack([np.flatnonzero(steps > 0), np.flatnonzero(steps < 0)])
    runs = runs[(runs[:, 1] - runs[:, 0]) * STEP >= SHORTEST]
    if not len(runs):
        raise _nowhere(joints, share)
    rows, creeps = [], np.zeros(len(runs), dtype=bool)
    for k, (begin, end) in enumerate(runs.tolist()):
        row = []
        for name, series in joints.items():
            values = np.interp(grid[begin:end], *series)
            parts = [(part.mean(), part) for part in np.array_split(values, 3)]
            scatters = np.mean([np.abs(part - mean).mean() for mean, part in parts])
            far = CREEPS[units[name]] * STEP * (end - begin) + 2.0 * scatters
            creeps[k] |= np.ptp([mean for mean, _ in parts]) > far
            row.append(values.mean())
        rows.append(row)
    spans = np.column_stack([grid[runs[:, 0]], grid[runs[:, 1] - 1]])
    return spans[~creeps], np.array(rows)[~creeps], int(creeps.sum())


def _stands(grid: Array, stamps: Array, readings: Array, by: float) -> Flags:
    """Where on the grid a joint stands; where it is not told for as long as WINDOW, nobody knows."""
    rows = uniform_filter1d(np.interp(grid, stamps, readings), round(MEAN / STEP), mode="nearest")
    size = round(WINDOW / STEP) + 1
    moved = maximum_filter1d(rows, size, mode="nearest") - minimum_filter1d(rows, size, mode="nearest")
    stands: Flags = moved <= by
    for k in np.flatnonzero(np.diff(stamps) > WINDOW):
        begin, end = np.searchsorted(grid, [stamps[k] - 0.5 * WINDOW, stamps[k + 1] + 0.5 * WINDOW])
        stands[begin:end] = False
    return stands


def _nowhere(joints: Series, share: Mapping[str, float]) -> InputError:
    apart = max(float(np.median(np.diff(t))) for t, _ in joints.values())
    name = min(share, key=lambda joint: share[joint])
    what = f"the arm stands nowhere: {name} moves in {100.0 * (1.0 - share[name]):.0f} % of the time"
    if apart > WINDOW:
        what = f"they come every {apart:.3g} s: whether the arm stands is not to be seen"
    expected = f"all joints still for a second in each posture, told every {0.5 * WINDOW:g} s or oftener"
    return InputError(what, where="joint states", expected=expected)
