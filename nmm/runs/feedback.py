"""Feedback as a run judges it: K e, bounded where a task states a speed or a braking."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from nmm.arrays import Array, Flags, Integers
from nmm.control.task_rows import gain_rows
from nmm.functions.tasks.task import Stack
from nmm.robots.robot import Robot


class Feedback(NamedTuple):
    """K e of s rows, with ‖K e‖ <= speed and ‖K e‖² <= 2 braking ‖e‖ over the rows of a group.

    Attributes
    ----------
    K (s, s) : gains, 1/s
    speed, braking (s,) : infinite for none
    group (s,) : which group each row is in
    """

    K: Array
    speed: Array
    braking: Array
    group: Integers

    @classmethod
    def of(cls, stack: Stack, robot: Robot) -> Feedback:
        """Of the tasks on a robot."""
        return cls(*gain_rows(stack, robot))

    @property
    def has_bounds(self) -> bool:
        """Whether there is a speed or a braking."""
        return bool(np.any(np.isfinite(self.speed)) or np.any(np.isfinite(self.braking)))

    def rates(self, error: Array) -> Array:
        """What is asked at errors (N, s), per second, (N, s)."""
        fed = error @ self.K.T
        return fed * self._shares(error, fed) if self.has_bounds else fed

    def bound(self, error: Array) -> Flags:
        """At which errors (N, s) a bound binds, (N,)."""
        if not self.has_bounds:
            return np.zeros(len(error), dtype=bool)
        return np.asarray(np.any(self._shares(error, error @ self.K.T) < 1.0, axis=1))

    def _shares(self, error: Array, fed: Array) -> Array:
        same = (self.group[:, np.newaxis] == self.group).astype(np.float64)
        size, far = np.sqrt(fed**2 @ same), np.sqrt(error**2 @ same)
        with np.errstate(invalid="ignore"):  # ∞ times 0 at the target: no bound there
            most = np.fmin(self.speed, np.sqrt(2.0 * self.braking * far))
        return np.where(size > most, most / np.where(size > 0.0, size, 1.0), 1.0)
