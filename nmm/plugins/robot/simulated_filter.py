"""A pose filter in a simulation, with the sensors that it has there."""

from __future__ import annotations

import math
from collections import deque
from typing import NamedTuple

import numpy as np

from nmm.base.arrays import Array, Integers, vector
from nmm.model.robots.robot import Robot
from nmm.motion.localisation import Localisation
from nmm.plugins.robot.pose_filter import PoseFilter

#: What a filter is not sure of at first at least, m and rad: a gain has to be defined.
LEAST = 1e-6


class Fix(NamedTuple):
    """A pose (2,) or (3,) that was measured at t, s, and arrives with the sample `comes`."""

    comes: int
    t: float
    pose: Array


class SimulatedFilter:
    """A `PoseFilter` of a simulated robot, sampled every dt, s; `seed` of the noise.

    What counts are the platform's inputs themselves, whatever wheels they turn; those that turn its own
    joints are read off these.
    """

    def __init__(self, sensors: Localisation, robot: Robot, dt: float, seed: Integers) -> None:
        self._sensors, self._robot, self._seed = sensors, robot, seed
        platform = robot.platform
        moved = robot.rate_coordinates[: platform.p]
        self._counted = np.flatnonzero(moved < 3)
        self._deviation = vector(sensors.deviation, (2, 3), "deviation")
        self._every = max(1, round(sensors.every / dt))
        self._late = round(sensors.late / dt)
        self._dt = dt

    def begin(self, q: Array) -> Array:
        """A run begins at q (n,): where the platform is believed to be, (3,)."""
        sensors, robot = self._sensors, self._robot
        self._rng = np.random.default_rng(self._seed)
        deviation = vector(sensors.start, 3, "start")
        self._filter = PoseFilter(
            robot,
            q,
            self._readings(q),
            0.0,
            covariance=np.diag(np.maximum(deviation, LEAST) ** 2),
            spread=sensors.spread,
            slip_noise=sensors.slip_noise,
            gyro_noise=sensors.gyro_noise,
            bias_deviation=abs(sensors.bias),
            delay=(self._late + 1) * self._dt,
            rate=1.0 / self._dt,
            fixes=self._late // self._every + 2,
            gate=None,  # none is an outlier
            wrapped=False,
        )
        believed = q[:3] + deviation * self._rng.standard_normal(3)
        self._filter.restart(believed, self._filter.covariance)
        self._samples, self._arriving = 0, deque[Fix]()
        return self._filter.pose

    def _readings(self, q: Array) -> dict[str, float]:
        """Of all encoders at first: the inputs', and the joints' with the file's signs."""
        robot = self._robot
        names = robot.q_names[3:]
        joints = {name: robot.reading(name, float(q[robot.coordinate(name)])) for name in names}
        return {robot.platform.inputs[i]: 0.0 for i in self._counted} | joints

    def go_on(self, q: Array, ahead: Array, by: Array, dt: float) -> Array:
        """Where the platform is believed to be, (3,), after dt, s, in which it went from q (n,) to `ahead`
        (n,), and its inputs by (p,) asked for so much, rad or m."""
        sensors, rng, pose_filter = self._sensors, self._rng, self._filter
        counts = by[self._counted]
        counts = counts + np.sqrt(sensors.spread * np.abs(counts)) * rng.standard_normal(len(counts))
        rate = None
        if sensors.gyro_noise is not None:
            noise = sensors.gyro_noise / math.sqrt(dt) * float(rng.standard_normal())
            rate = float(ahead[2] - q[2]) / dt + sensors.bias + noise
        t = pose_filter.t + dt
        pose_filter.step(t, counts, ahead[3 : self._robot.platform.n_p], rate)
        self._samples += 1
        if self._samples % self._every == 0:
            rows = len(self._deviation)
            seen = ahead[:rows] + self._deviation * rng.standard_normal(rows)
            self._arriving.append(Fix(self._samples + self._late, t, seen))
        while self._arriving and self._arriving[0].comes <= self._samples:
            fix = self._arriving.popleft()
            pose_filter.fix(fix.pose, np.diag(self._deviation**2), fix.t)
        return pose_filter.pose
