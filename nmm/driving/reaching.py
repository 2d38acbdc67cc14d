"""Whether a driven robot gets to its targets, in words; "" where nothing is known against it."""

from __future__ import annotations

from collections import deque

import numpy as np

from nmm.arrays import Array
from nmm.control.controller import Controller
from nmm.control.step import Step
from nmm.runs.reasons import out_of_reach, stretched

#: An error that falls within so long, s of the robot's time, by less than both of these stands: m or rad, and
#: a share of itself.
LONG, FALL, SHARE = 1.0, 1e-3, 0.01
#: A smaller one is near enough, m or rad.
NEAR = 5e-3


class Reaching:
    """What is known of a robot on its way to targets that somebody moves."""

    def __init__(self) -> None:
        self._target = np.zeros(0)
        self._norms: deque[tuple[float, float]] = deque()

    def words(self, controller: Controller, t: float, step: Step, target: Array) -> str:
        """Why it does not get there: a target that its arm is too short for, or an error that stands.

        Parameters
        ----------
        t : s; earlier than at the last call after a new beginning
        step : what the controller found at t
        target (s,) : of all tasks
        """
        norm = float(np.linalg.norm(step.error))
        if not np.array_equal(target, self._target) or (self._norms and t < self._norms[-1][0]):
            self._target, self._norms = target, deque()
        if not self._norms or t > self._norms[-1][0]:  # it may be paused
            self._norms.append((t, norm))
        while len(self._norms) > 1 and self._norms[1][0] <= t - LONG:
            self._norms.popleft()
        far = out_of_reach(controller, step.q, target)
        if far:
            return far
        before, at_first = self._norms[0]
        if t - before < LONG or norm < NEAR or at_first - norm >= max(FALL, SHARE * norm):
            return ""
        return f"the error does not fall: ‖e‖ stays at {norm:.3g}{_seen(controller, step)}"


def _seen(controller: Controller, step: Step) -> str:
    """What may be why."""
    if step.scale.min(initial=1.0) < 1.0:
        kept = "limits and distances" if controller.setting is not None else "limits"
        return f"; {kept} leave {float(step.scale.min()):.2g} of the task's rate"
    known = bool(np.all(np.isfinite(step.J)))
    far = stretched(controller, step.q, step.J) if known else ""
    return f"; {far}" if far else ""
