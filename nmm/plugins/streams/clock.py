"""Times of a stream: the clock's, never ahead of it, whatever the run's own time does."""

from __future__ import annotations

import time


class WallClock:
    """The time since 1970, ns, as it was at first and has gone on since: it never goes back."""

    def __init__(self) -> None:
        self.began = time.time_ns()
        self._at = time.monotonic_ns()

    def now(self) -> int:
        return self.began + time.monotonic_ns() - self._at


class RunClock:
    """A run's own time, s, on the clock: its begin is put off where the run comes late."""

    def __init__(self, wall: WallClock, t: float) -> None:
        self._wall = wall
        self._zero = wall.now() - round(1e9 * t)

    def wait(self, t: float) -> float:
        """How long it is until t, s; 0 when it has come."""
        return max(0.0, 1e-9 * (self.stamp(t) - self._wall.now()))

    def stamp(self, t: float) -> int:
        """The clock's time at t, ns."""
        return self._zero + round(1e9 * t)

    def late(self, t: float) -> None:
        """t is now: what was to come until now comes later."""
        self._zero = max(self._zero, self._wall.now() - round(1e9 * t))
