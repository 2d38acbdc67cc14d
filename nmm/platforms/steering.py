"""What steers a body of a platform whose steering no task feels: an axle, and the wheels that turn it."""

from __future__ import annotations

import math
from dataclasses import dataclass


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
    >>> isinstance(pivot, nmm.SteeringPivot), pivot.coordinate, pivot.input
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
    >>> axle = nmm.SteeredAxle((nmm.SteeringPivot("steering", "steering_rate", x=1.0),))
    >>> round(axle.least_radius(((-np.pi / 4, np.pi / 4),)), 6)
    1.0
    """

    pivots: tuple[SteeringPivot, ...]
    x: float = 0.0
    y: float = 0.0
    heading: float = 0.0

    def least_radius(self, limits: tuple[tuple[float, float], ...]) -> float:
        """The smallest radius on which the axle's middle can turn to both sides, m.

        Parameters
        ----------
        limits : (lower, upper) of each pivot's angle, rad, as narrow as `widest` at least
        """
        radius = 0.0
        for pivot, (lower, upper) in zip(self.pivots, limits, strict=True):
            for stop in (lower, upper):
                angle = pivot.zero + pivot.sign * stop
                # Its wheel's direction is that of (1 - κ y, κ x): κ x cos = (1 - κ y) sin.
                across = pivot.x * math.cos(angle) + pivot.y * math.sin(angle)
                radius = max(radius, abs(across / math.sin(angle)) if math.sin(angle) else math.inf)
        return radius
