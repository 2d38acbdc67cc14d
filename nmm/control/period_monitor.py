"""Whether a loop calls its controller at the period that limits of position assume."""

import math
import warnings
from typing import Any, NamedTuple

import numpy as np

from nmm.base.kernels.record_layout import SampledCell, SampledIntegerCell

#: Calls more than this many dt apart are late.
LATE = 1.1
#: This many late calls in a row indicate another period; fewer, a loop that was delayed.
IN_A_ROW = 10


class PeriodNumbers(NamedTuple):
    """Times of calls, s; NaN before the first one: the last call, the last late one, and the call before the
    first of the `late` consecutive late ones."""

    called: SampledCell
    late_at: SampledCell
    since: SampledCell
    late: SampledIntegerCell


#: Before the first call.
NOT_CALLED = PeriodNumbers(np.array(np.nan), np.array(np.nan), np.array(np.nan), np.array(0))


class PeriodMonitor:
    """The times of a controller's calls.

    called () : time of the last call, s; a memoryview, read and set in half the time of an array
    latest : the longest time between two calls that are not late, s
    """

    def __init__(self, numbers: PeriodNumbers) -> None:
        self._numbers = numbers
        self.called: Any = numbers.called.data
        self.keep(None)

    def keep(self, dt: float | None) -> None:
        """Expect calls dt apart, s; None for any period."""
        self.latest = math.inf if dt is None else LATE * dt
        self._told = False
        self.forget()

    def forget(self) -> None:
        for mine, first in zip(self._numbers, NOT_CALLED, strict=True):
            mine[()] = first

    @property
    def period(self) -> float | None:
        """The mean time between the last calls, s, where at least ten in a row were late; else None."""
        p = self._numbers
        if p.late < IN_A_ROW or p.late_at != p.called:
            return None
        return float((p.late_at - p.since) / p.late)

    def late(self, t: float, stacklevel: int = 3) -> None:
        """Note a late call at t, s; warns once that the loop has another period."""
        p = self._numbers
        if p.late_at != p.called:
            p.since[()], p.late[()] = p.called, 0
        p.late_at[()] = t
        p.late[()] += 1
        count = int(p.late)
        if count < IN_A_ROW or self._told:
            return
        self._told = True
        period, dt = (t - float(p.since)) / count, self.latest / LATE
        warnings.warn(
            f"controller: the last {count} calls are {period:.3g} s apart, but dt is {dt:.3g} s: "
            "limits of position, of functions and distances may be passed at that period; set "
            f"controller.dt = {period:.3g}",
            RuntimeWarning,
            stacklevel=stacklevel,
        )
