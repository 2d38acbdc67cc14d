"""What drives say of a robot's numbers, over the noise that is taken for theirs."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from nmm.base.arrays import Array
from nmm.plugins.robot.calibration.sides import SideRows


class DriveNoise(NamedTuple):
    """Standard deviations: of the reference's place, m, and heading, rad; of each counter for a rad (or m) of
    it, rad; across for a metre of the way, m; of the turn for a rad of it, rad; of how counters that are more
    than inputs agree, for a rad (or m) of them, rad; of what hitches turn by themselves from look to look,
    rad; of the times of looks beside the counters', s.

    Examples
    --------
    >>> nmm.extending.DriveNoise(0.003, 0.003, 0.01, 1e-4, 2e-3, 2e-3, 1e-4, 1e-3).place
    0.003
    """

    place: float
    heading: float
    counters: float
    across: float
    turns: float
    agreement: float
    following: float
    jitter: float


@dataclass(eq=False)
class Filtered:
    """Of a drive: w (M, r) and W (M, r, n), S (M, r), poses (M, 3) as `innovations` tells; the rows taken;
    what counters say beyond motions, and hitches beyond what they tell of them."""

    w: Array
    W: Array
    S: Array
    poses: Array
    taken: Array
    agreement: SideRows
    following: SideRows

    @property
    def log_likelihood(self) -> float:
        w, S = self.w[self.taken], self.S[self.taken]
        total = np.sum(w * w + np.log(S))
        for part in (self.agreement, self.following):
            total += part.over @ part.over + part.logarithms
        return float(-0.5 * total)

    def without_slopes(self) -> Filtered:
        """The same, with less memory."""
        sides = [
            part._replace(slopes=np.zeros((0, 0)), weights=np.zeros(0))
            for part in (self.agreement, self.following)
        ]
        return replace(self, W=np.zeros((0, 0, 0)), agreement=sides[0], following=sides[1])

    @property
    def count(self) -> int:
        """How many numbers are free to be off."""
        looks = int(np.count_nonzero(self.taken)) * self.w.shape[1]
        return looks + self.agreement.free + self.following.free
