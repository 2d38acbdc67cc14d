"""Two wheels that steer together (Ackermann): how their angles follow from that of a wheel midway between.

With L the wheelbase and (L, y) a pivot, the axis of its wheel passes the point (0, L / tan δ) about which the
car turns, where δ is the angle of a wheel at (L, 0):

    tan δ_i = L sin δ / (L cos δ - y sin δ),   cot δ_right - cot δ_left = track / L.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from nmm.platforms.layout import Layout, Pivot, RollingJoint
from nmm.platforms.measuring import NEAR, rolls_forward, wheels_on


@dataclass(frozen=True)
class SteeredPair:
    """The pivots of two steered wheels on one axle ahead of the reference point, equally far to its sides."""

    pivots: tuple[Pivot, Pivot]

    @property
    def x(self) -> float:
        """Distance L from the reference point to their axle, m."""
        return 0.5 * (self.pivots[0].x + self.pivots[1].x)

    def range(self, widest: float) -> tuple[float, float]:
        """The steering angles, rad, at which both joints are within their limits, from -widest to widest."""
        lower, upper = -widest, widest
        for pivot in self.pivots:
            if math.isfinite(pivot.lower) and pivot.lower > -math.pi:
                lower = max(lower, self._middle(pivot, pivot.lower))
            if math.isfinite(pivot.upper) and pivot.upper < math.pi:
                upper = min(upper, self._middle(pivot, pivot.upper))
        return lower, upper

    def rate(self, lower: float, upper: float) -> float:
        """The largest steering rate, rad/s, at which both joints keep their velocities, lower to upper."""
        slowest = math.inf
        for pivot in self.pivots:
            aside = pivot.y / self.x
            # dδ_i/dδ = 1 / (1 + b²/2 - (b sin 2δ + b²/2 cos 2δ)), b = y / L, is largest at one angle.
            steepest = 0.5 * math.atan2(aside, 0.5 * aside * aside)
            at = [lower, upper, *([steepest] if lower < steepest < upper else [])]
            slowest = min(slowest, pivot.velocity / max(_slope(aside, angle) for angle in at))
        return slowest

    def _middle(self, pivot: Pivot, angle: float) -> float:
        """The steering angle at which a pivot is at an angle, rad."""
        sine, cosine = math.sin(angle), math.cos(angle)
        return math.atan2(self.x * sine, self.x * cosine + pivot.y * sine)


def _slope(aside: float, angle: float) -> float:
    sine, cosine = math.sin(angle), math.cos(angle)
    return 1.0 / (sine * sine + (cosine - aside * sine) ** 2)


def steered_pair(layout: Layout) -> SteeredPair | None:
    """The two pivots of a robot's file that steer beside the x axis and carry wheels; None where there are
    not just two, on one axle ahead of the reference point, with wheels that roll ahead on their axes."""
    beside = [pivot for pivot in layout.pivots if steers_beside(pivot) and wheels_on(layout, pivot.joint)]
    if len(beside) != 2:
        return None
    one, other = beside
    wheels = [wheel for pivot in beside for wheel in wheels_on(layout, pivot.joint)]
    together = abs(one.x - other.x) <= NEAR and abs(one.y + other.y) <= NEAR
    if not together or one.x <= NEAR or not are_below(wheels):
        return None
    return SteeredPair((one, other))


def steers_beside(pivot: Pivot) -> bool:
    """Whether it steers, on the main body, beside its x axis."""
    return pivot.steers and pivot.carrier == "theta" and abs(pivot.y) > NEAR


def are_below(wheels: Sequence[RollingJoint]) -> bool:
    """Whether wheels on pivots stand on their axes' level lines, and roll ahead."""
    return all(abs(wheel.x) <= NEAR and rolls_forward(wheel) for wheel in wheels)
