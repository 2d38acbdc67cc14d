"""What tells a simulated robot where it is: noisy encoders, a gyro, fixes that come late, and a filter."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from nmm.base.arrays import positive, scalar, vector
from nmm.base.errors import expect
from nmm.base.lazy_call import lazy_call
from nmm.control.plant import Believing
from nmm.model.robots.robot import Robot


@dataclass(frozen=True)
class Localisation:
    """What a simulated robot has beside its wheels to know where it is: a `PoseFilter`, with what it gets.

    The controller sees the platform where the filter has it, recorded as `believed`. Encoders count what the
    inputs turn, without slip and creep; the platform's own joints are measured as they are. Noise is drawn
    by the seed of the `Disturbances`. Nothing is an outlier, and the filter has no gate.

    Parameters
    ----------
    every : s, between two fixes of the pose
    late : s, by which each comes late
    deviation : standard deviations of a fix, x, y and theta, or x and y alone, m and rad
    start : those of x, y, theta at first, m and rad, by which it is believed elsewhere
    spread : variance of what an input's encoder counts, for each m or rad of it, m or rad
    slip_noise : what the filter takes slip for, as of `PoseFilter`: along and across, m/√m, and in heading,
        rad/√rad; slip itself is that of the `Disturbances`
    gyro_noise : density of a gyro's noise, rad/s/√Hz; no gyro when not given
    bias : of the gyro, rad/s, which the filter expects to be about so large

    Raises
    ------
    InputError : numbers out of their range, a bias without a gyro

    Examples
    --------
    >>> scenario = nmm.Scenario.load("unicycle_2r_position")
    >>> seen = nmm.Localisation(every=0.5, late=0.1, deviation=[0.01, 0.01, 0.01])
    >>> worn = nmm.Disturbances(slip={"v": 0.95}, creep=-0.01, localisation=seen)
    >>> lost = nmm.Disturbances(slip={"v": 0.95}, creep=-0.01, odometry=True)
    >>> start = scenario.parts.q0
    >>> runs = [
    ...     nmm.simulate(scenario.controller(), start, 5.0, 0.01, "zoh", disturbances=robot)
    ...     for robot in (worn, lost)
    ... ]
    >>> bool(5 * runs[0]["drift"][-1] < runs[1]["drift"][-1])
    True
    """

    every: float = 0.5
    late: float = 0.0
    deviation: ArrayLike = (0.02, 0.02, 0.02)
    start: ArrayLike = (0.0, 0.0, 0.0)
    spread: float = 1e-4
    slip_noise: ArrayLike = (0.02, 0.02, 0.02)
    gyro_noise: float | None = None
    bias: float = 0.0

    def __post_init__(self) -> None:
        positive(self.every, "every")
        for name in ("late", "spread"):
            scalar(getattr(self, name), name, least=0.0)
        scalar(self.bias, "bias")
        of_fix = vector(self.deviation, (2, 3), "deviation")
        expect(bool((of_fix > 0.0).all()), "deviation", "numbers above 0", of_fix)
        for name in ("start", "slip_noise"):
            numbers = vector(getattr(self, name), 3, name)
            expect(bool((numbers >= 0.0).all()), name, "numbers from 0", numbers)
        if self.gyro_noise is not None:
            positive(self.gyro_noise, "gyro_noise")
        expect(self.gyro_noise is not None or not self.bias, "bias", "0 without gyro_noise", self.bias)

    def on(self, robot: Robot, dt: float, seed: Sequence[int]) -> Believing:
        """What believes one run of the robot, sampled every dt, s."""
        believing: Believing = lazy_call("nmm.plugins.robot.simulated_filter:SimulatedFilter")(
            self, robot, dt, np.array(seed)
        )
        return believing
