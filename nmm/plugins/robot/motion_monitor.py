"""How far a robot is measured to have moved beside how far its inputs asked it to, over the last second."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from nmm.base.arrays import Array

#: Motions are compared over so long, s, and contradict each other at so many measurements in a row.
WINDOW, CONFIRM = 1.0, 3


class Contradiction(NamedTuple):
    """A coordinate that moved by `apart` more or less than its inputs asked for on the `way`, m or rad."""

    coordinate: int
    apart: float
    way: float


class MotionMonitor:
    """Compares sums over measurements: of how far each is off the inputs since the one before, (n,), and of
    the ways (n,) that these asked for. Of constant size.

    A robot that slips moves a share `slip` (n,) less or more; one that lags is behind by its way within the
    lag, at both ends of the window; a measurement may be off by `off` (n,), m or rad. Positions that are old,
    but have new stamps, agree with neither once the speed has changed.
    """

    def __init__(self, slip: Array, off: Array, period: float) -> None:
        self._slip, self._off = slip, off
        size = math.ceil(WINDOW / period) + 2
        self._at = np.zeros(size)
        self._apart, self._way, self._lagging = np.zeros((3, size, len(off)))
        self._first = self._count = self._in_a_row = 0

    def begin(self) -> None:
        """From now on: what was before does not count."""
        self._first = self._count = self._in_a_row = 0

    def add(self, at: float, apart: Array, way: Array, lagging: Array) -> Contradiction | None:
        """A measurement at a time, s, `apart` (n,) from where the inputs bring the robot since the last one;
        they asked for the way (n,) meanwhile, and for `lagging` (n,) within the lag."""
        size = len(self._at)
        last = (self._first + self._count - 1) % size
        k = (last + 1) % size
        self._at[k], self._lagging[k] = at, lagging
        if self._count:
            apart, way = self._apart[last] + apart, self._way[last] + way
        self._apart[k], self._way[k] = apart, way
        self._count += 1
        while self._count == size or (self._count > 2 and self._at[(self._first + 1) % size] <= at - WINDOW):
            self._first, self._count = (self._first + 1) % size, self._count - 1
        first = self._first
        gone, asked = np.abs(apart - self._apart[first]), way - self._way[first]
        beyond = gone - (self._off + lagging + self._lagging[first] + self._slip * asked)
        worst = int(np.argmax(beyond))
        self._in_a_row = self._in_a_row + 1 if beyond[worst] > 0.0 else 0
        if self._in_a_row < CONFIRM:
            return None
        return Contradiction(worst, float(gone[worst]), float(asked[worst]))
