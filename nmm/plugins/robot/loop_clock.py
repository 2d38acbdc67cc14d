"""The time of a robot's loop, whatever the clock does that it is told."""

from __future__ import annotations

import math

from nmm.plugins.robot.loop_log import LoopFindings

#: A call so many periods after the one before is late.
LATE = 1.5


class LoopClock:
    """t, s since the first call, and how many `calls` and `late_calls` there were. So long as `longest`, s,
    between two calls the clock is believed."""

    def __init__(self, period: float, longest: float, found: LoopFindings) -> None:
        self._period, self._longest, self._found = period, longest, found
        self.t = 0.0
        self.calls = self.late_calls = 0
        self._now, self._offset = math.nan, 0.0

    def time_of(self, stamp: float) -> float:
        """A time of the clock that is told as t."""
        return stamp - self._offset

    def tell(self, now: float) -> float:
        """Advance t: by what the clock says, but by a period where it stands, jumps, or nobody called; then
        for how long nobody did, s, else 0."""
        self.calls += 1
        if math.isnan(self._now):
            if math.isfinite(now):
                self._now, self._offset = float(now), float(now) - self.t
            return 0.0
        gap = float(now) - self._now
        if 0.0 < gap <= self._longest:
            if gap > LATE * self._period:
                self.late_calls += 1
                self._found.add("call_late", self.t + gap, math.inf, gap=gap)
            self.t, self._now = now - self._offset, float(now)
            return 0.0
        self.t += self._period
        if not math.isfinite(gap):
            self._now += self._period
            self._found.add("clock_jumped", self.t, by=math.inf)
            return 0.0
        self._now, self._offset = float(now), float(now) - self.t
        if gap <= 0.0:
            self._found.add("clock_jumped", self.t, by=gap - self._period)
            return 0.0
        self.late_calls += 1
        return gap
