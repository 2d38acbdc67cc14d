"""The inputs that a robot was given of late, and how far they can have moved it since."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from nmm.base.arrays import Array
from nmm.model.robots.robot import Robot
from nmm.model.robots.zero_order_hold import HeldInputs


class HeldHistory:
    """The last `count` inputs u (m,), each held from its time until the next; a ring, so of constant size."""

    def __init__(self, robot: Robot, count: int) -> None:
        self.robot = robot
        self._held = HeldInputs(robot)
        self._planar = robot.platform.n_p >= 3
        self._t, self._u = np.full(count, -np.inf), np.zeros((count, robot.n_u))
        self._speed = np.zeros((count, robot.n))
        self._newest = count - 1

    def clear(self) -> None:
        self._t.fill(-np.inf)
        self._u.fill(0.0)
        self._speed.fill(0.0)

    def give(self, t: float, u: Array, q_dot: Array) -> None:
        """From t, s, on the inputs are u (m,), which move the coordinates by q_dot (n,) at first."""
        self._newest = k = (self._newest + 1) % len(self._t)
        self._t[k], self._u[k] = t, u
        np.abs(q_dot, out=self._speed[k])
        if self._planar:  # x and y are one way, whose direction is not known to rounding
            self._speed[k, :2] = np.hypot(q_dot[0], q_dot[1])

    def _between(self, since: float, until: float) -> Iterator[tuple[int, float]]:
        """Places of the inputs that were held between two times, the newest first, and how long each was."""
        end = until
        for back in range(len(self._t)):
            k = (self._newest - back) % len(self._t)
            begin = max(float(self._t[k]), since)
            if begin < end:
                yield k, end - begin
                end = begin
            if self._t[k] <= since:
                return

    def moved(self, q: Array, since: float, until: float) -> Array:
        """q (n,) of a time, moved on to a later one."""
        for k, lasts in reversed([*self._between(since, until)]):
            q = self._held(q, self._u[k], lasts)
        return q

    def way(self, since: float, until: float) -> Array:
        """How far each coordinate can have moved meanwhile, (n,), to and fro; of x and y together."""
        total = np.zeros(self.robot.n)
        for k, lasts in self._between(since, until):
            total += lasts * self._speed[k]
        return total
