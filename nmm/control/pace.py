"""Whether a loop calls its controller at the period that limits of position count on."""

from __future__ import annotations

import math
import warnings

#: Calls that are farther apart than this many dt are late.
LATE = 1.1
#: So many late calls in a row are a loop at another period; fewer are a loop that was held up.
IN_A_ROW = 10


class Pace:
    """The times of a controller's calls.

    Attributes
    ----------
    called : time of the last call, s; not a number before the first one
    latest : the longest time between two calls that are not late, s
    """

    def __init__(self) -> None:
        self.keep(None)

    def keep(self, dt: float | None) -> None:
        """Expect calls that are dt apart, s; None for any."""
        self.latest = math.inf if dt is None else LATE * dt
        self._told = False
        self.forget()

    def forget(self) -> None:
        """The next call is the first one."""
        self.called = self._late_at = math.nan
        self._since, self._count = math.nan, 0

    @property
    def period(self) -> float | None:
        """How far the last calls are apart, s, where ten or more of them in a row were late; else None."""
        if self._count < IN_A_ROW or self._late_at != self.called:
            return None
        return (self._late_at - self._since) / self._count

    def late(self, t: float, stacklevel: int = 3) -> None:
        """A call at t, s, that is late: warns once where the loop has another period."""
        if self._late_at != self.called:
            self._since, self._count = self.called, 0
        self._late_at = t
        self._count += 1
        if self._count < IN_A_ROW or self._told:
            return
        self._told = True
        period, dt = (t - self._since) / self._count, self.latest / LATE
        warnings.warn(
            f"controller: the last {self._count} calls are {period:.3g} s apart, but dt is {dt:.3g} s: "
            "limits of position, of functions and distances may be passed at that period; set "
            f"controller.dt = {period:.3g}",
            RuntimeWarning,
            stacklevel=stacklevel,
        )
