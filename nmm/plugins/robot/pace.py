"""A loop's pace: read, step and write at the multiples of its period."""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import suppress
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike

from nmm.base.arrays import Array
from nmm.plugins.robot.pose_filter import PoseFilter


class Paced(Protocol):
    """What of a `Loop` its pace needs."""

    period: float
    state: Any

    @property
    def u(self) -> Array: ...

    def step(
        self, now: float, q: ArrayLike | PoseFilter | None = None, measured_at: float | None = None
    ) -> Array: ...

    def stop(self, why: str) -> None: ...


def keep_pace(
    loop: Paced,
    read: Callable[[], tuple[ArrayLike, float] | PoseFilter | None],
    write: Callable[[Array], object],
    each: Callable[[Any], object] | None,
    duration: float,
    clock: Callable[[], float],
    sleep: Callable[[float], object],
) -> None:
    """See `Loop.run`."""
    raised: BaseException | None = None
    sent, until = True, math.inf

    def send(u: Array) -> None:
        nonlocal sent
        sent = False
        write(u)
        sent = True

    def attempt(what: Callable[..., Any], *given: Any) -> Any:
        """What it gives; None where it raises, and the robot stops. Ctrl-C a second time does not wait."""
        nonlocal raised
        try:
            return what(*given)
        except BaseException as error:
            if raised is not None and not isinstance(error, Exception):
                with suppress(Exception):
                    write(np.zeros_like(loop.u))
                raise
            raised = raised or error
            loop.stop(type(error).__name__)
            return None

    began = due = running = clock()
    while loop.state != "stopped" or (not sent and clock() < until):
        measured = attempt(read)
        measurement = (measured,) if isinstance(measured, PoseFilter) else measured or ()
        attempt(send, loop.step(clock(), *measurement))
        if each is not None and raised is None:
            attempt(each, loop)
        if clock() - began >= duration:
            loop.stop("duration")
        if loop.state != "stopped":
            running = clock() if loop.state != "stopping" else running
        elif until == math.inf:  # zeros that were not sent are tried again for as long as the stop took
            until = 2.0 * clock() - running
        due += loop.period * max(1, math.ceil((clock() - due) / loop.period))
        if (wait := due - clock()) > 0.0:
            attempt(sleep, wait)
    if raised is not None:
        raise raised
