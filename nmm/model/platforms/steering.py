"""What steers a body where no task does: an axle, and the wheels that turn it; Ackermann steering."""

from __future__ import annotations

import math
from dataclasses import dataclass

from nmm.model.platforms.wheel_layout import NEAR, Layout, Pivot, stands_below, steering_pivots, wheels_on


@dataclass(frozen=True)
class SteeringPivot:
    """An angle c that turns an axle's body, and the input with which c is moved.

    Attributes
    ----------
    coordinate : name of the angle c, rad
    input : name of the input that sets its rate
    x, y : the pivot, seen from the middle of the axle along the body's direction and to its left, m
    zero : the direction in which its wheel rolls at c = 0, from the body's direction, rad, in ±90 degrees
    sign : -1 where c grows as the wheel turns to the right (a hitch, whose angle is the body's), else 1
    widest : the direction to either side up to which it is steered, where its limits are wider, rad

    Examples
    --------
    >>> (pivot,) = nmm.load("car_base").platform.steered_axle("theta").pivots
    >>> isinstance(pivot, nmm.extending.SteeringPivot), pivot.coordinate, pivot.input
    (True, 'steering', 'steering_rate')
    """

    coordinate: str
    input: str
    x: float
    y: float = 0.0
    zero: float = 0.0
    sign: float = 1.0
    widest: float = math.pi / 3


@dataclass(frozen=True)
class SteeredAxle:
    """The axle that follows a body's direction, and what steers it.

    Attributes
    ----------
    x, y : its middle, in the frame of the body that carries it, m
    heading : the direction in which it rolls, from that body's x axis, rad
    pivots : what steers it

    Examples
    --------
    >>> axle = nmm.extending.SteeredAxle((nmm.extending.SteeringPivot("steering", "steering_rate", x=1.0),))
    >>> round(axle.least_radius(((-np.pi / 4, np.pi / 4),)), 6)
    1.0
    """

    pivots: tuple[SteeringPivot, ...]
    x: float = 0.0
    y: float = 0.0
    heading: float = 0.0

    def least_radius(self, limits: tuple[tuple[float, float], ...]) -> float:
        """The smallest radius on which the axle's middle can turn to both sides, m; `limits` are (lower,
        upper) of each pivot's angle, rad, as narrow as `widest` at least."""
        radius = 0.0
        for pivot, (lower, upper) in zip(self.pivots, limits, strict=True):
            for stop in (lower, upper):
                angle = pivot.zero + pivot.sign * stop
                # Its wheel's direction is that of (1 - κ y, κ x): κ x cos = (1 - κ y) sin.
                across = pivot.x * math.cos(angle) + pivot.y * math.sin(angle)
                radius = max(radius, abs(across / math.sin(angle)) if math.sin(angle) else math.inf)
        return radius


@dataclass(frozen=True)
class SteeredPair:
    """Two wheels on pivots at (L, ±y) whose angles follow from δ, that of a wheel midway between (Ackermann):

    tan δ_i = L sin δ / (L cos δ - y sin δ),   cot δ_right - cot δ_left = track / L.

    Their axes pass the point (0, L / tan δ) about which the car turns."""

    pivots: tuple[Pivot, Pivot]

    @property
    def x(self) -> float:
        """The wheelbase L, from the reference point to their axle, m."""
        return 0.5 * (self.pivots[0].x + self.pivots[1].x)

    def range(self, widest: float) -> tuple[float, float]:
        """The steering angles, rad, within -widest and widest, that both joints' limits allow."""
        lower, upper = -widest, widest
        for pivot in self.pivots:
            if pivot.lower > -math.pi:
                lower = max(lower, self._middle(pivot, pivot.lower))
            if pivot.upper < math.pi:
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
            slopes = [1.0 / (math.sin(a) ** 2 + (math.cos(a) - aside * math.sin(a)) ** 2) for a in at]
            slowest = min(slowest, pivot.velocity / max(slopes))
        return slowest

    def _middle(self, pivot: Pivot, angle: float) -> float:
        """The steering angle at which a pivot is at an angle, rad."""
        sine, cosine = math.sin(angle), math.cos(angle)
        return math.atan2(self.x * sine, self.x * cosine + pivot.y * sine)


def steered_pair(layout: Layout) -> SteeredPair | None:
    """The two steered pivots beside the x axis, if there are just two, on one axle ahead of the reference
    point, with wheels that roll ahead on their axes; those without wheels count where none has any."""
    pivots = steering_pivots(layout)
    steering = [pivot for pivot in pivots if wheels_on(layout, pivot.joint)] or pivots
    beside = [pivot for pivot in steering if abs(pivot.y) > NEAR]
    if len(beside) != 2:
        return None
    first, second = beside
    together = abs(first.x - second.x) <= NEAR and abs(first.y + second.y) <= NEAR
    below = all(stands_below(wheel) for pivot in beside for wheel in wheels_on(layout, pivot.joint))
    return SteeredPair((first, second)) if together and first.x > NEAR and below else None
