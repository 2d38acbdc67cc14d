"""Cars, as one steered wheel ahead of an axle (a bicycle): driven at the rear, and driven at the front."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from nmm.base.arrays import Array, positive
from nmm.base.errors import expect
from nmm.base.findings import Finding
from nmm.base.kernels.compiled import PLATFORM, kernel
from nmm.model.platforms.base import Platform, coordinates_with, of_many
from nmm.model.platforms.steering import SteeredAxle, SteeringPivot, steered_pair
from nmm.model.platforms.unicycle import across, roll_ahead
from nmm.model.platforms.wheel_layout import (
    NEAR,
    AddedJoint,
    Layout,
    Pivot,
    check_axle,
    misfit,
    stands_below,
    steering_pivots,
    symmetric_limit,
    wheels_on,
)

#: The coordinate of a car whose two wheels steer without a joint midway between them.
STEER = "steer"
#: |cos δ| below which a steering angle counts as 90 degrees.
_ACROSS = 1e-6


@kernel(PLATFORM)
def rear_drive(qp: Array, parameters: Array, G: Array, G_q: Array) -> None:
    """G = [[cos θ, 0], [sin θ, 0], [tan δ / L, 0], [0, 1]]; parameters = [L]."""
    tangent = math.tan(qp[3])
    roll_ahead(qp, G, G_q)
    G[2, 0] = tangent / parameters[0]
    G[3, 1] = 1.0
    G_q[2, 0, 3] = (1.0 + tangent * tangent) / parameters[0]


@kernel(PLATFORM)
def front_drive(qp: Array, parameters: Array, G: Array, G_q: Array) -> None:
    """G = [[cos δ cos θ, 0], [cos δ sin θ, 0], [sin δ / L, 0], [0, 1]]; parameters = [L]."""
    cosine = math.cos(qp[2])
    sine = math.sin(qp[2])
    along = math.cos(qp[3])
    across = math.sin(qp[3])
    G[0, 0] = along * cosine
    G[1, 0] = along * sine
    G[2, 0] = across / parameters[0]
    G[3, 1] = 1.0
    G_q[0, 0, 2] = -along * sine
    G_q[1, 0, 2] = along * cosine
    G_q[0, 0, 3] = -across * cosine
    G_q[1, 0, 3] = -across * sine
    G_q[2, 0, 3] = along / parameters[0]


class _Bicycle(Platform):
    """What both cars share: where the wheels stand, and that none of them slides."""

    inputs = ("v", "steering_rate")
    input_units = ("m/s", "rad/s")
    parameter_names: Mapping[str, str] = {"L": ""}
    _fitted = ("wheelbase",)
    #: The widest steering angle that it may be limited to, rad, and to which it is steered by itself.
    _widest: float
    _steered_to = math.radians(60.0)

    def __init__(
        self,
        wheelbase: ArrayLike,
        *,
        steering: str = "steering",
        max_steering: ArrayLike | None = None,
        limits: Mapping[str, float] | None = None,
    ) -> None:
        self.wheelbase = positive(wheelbase, f"{self.name}: wheelbase")
        self.steering = steering
        self.coordinates = coordinates_with(self.name, [steering])
        self.max_steering = None
        if max_steering is not None:
            where = f"{self.name}: max_steering"
            self.max_steering = limit = positive(max_steering, where)
            most = f"at most {self._widest:.6g} rad ({math.degrees(self._widest):.6g} degrees)"
            expect(limit <= self._widest, where, most, limit)
        super().__init__(limits=limits)

    @classmethod
    def fit(cls, layout: Layout) -> Self:
        """Wheelbase and steering joint of the file; the joint's limits when they are symmetric.

        The steering joint is upright, on the root's body, on the x axis ahead of the reference point; or two
        such joints, equally far beside the x axis, count as one midway, `steer`. `InputError` for none,
        several, or rear wheels that are not at the reference point."""
        named = [pivot for pivot in steering_pivots(layout) if abs(pivot.y) <= NEAR < pivot.x]
        pair = steered_pair(layout)
        if pair is not None:  # a joint on the axis speaks for the wheels only where it is midway between them
            named = [pivot for pivot in named if abs(pivot.x - pair.x) <= NEAR]
            pair = None if named else pair
        if len(named) != 1 and pair is None:
            expected = "one steering joint (--steer NAME): upright, on the x axis of the root, x > 0"
            expected += "; or two, equally far beside it"
            wrong = f"there are {len(named)}" if named else "there is none"
            raise misfit(layout, cls.name, expected, wrong, layout.pivots)
        check_axle(layout, cls.name)
        if pair is not None:
            lower, upper = pair.range(cls._widest)
            even = upper < cls._widest and abs(lower + upper) <= NEAR
            return cls(pair.x, steering=STEER, max_steering=upper if even else None)
        for wheel in wheels_on(layout, named[0].joint):
            if not stands_below(wheel):
                expected = "the steered wheel below its steering axis, rolling ahead (see platform wheeled)"
                raise misfit(layout, cls.name, expected, "it is off it or turned", [wheel])
        limit = symmetric_limit(named[0])
        within = limit is None or limit <= cls._widest
        return cls(named[0].x, steering=named[0].joint, max_steering=limit if within else None)

    def measured(self, layout: Layout) -> Mapping[str, float]:
        own = self._pivot(layout)
        if own is None:
            return super().measured(layout)
        check_axle(layout, self.name)
        return {"wheelbase": own.x}

    def compared(self, layout: Layout) -> tuple[Finding, ...]:
        own = self._pivot(layout)
        if own is not None and abs(own.y) > NEAR:
            expected = "its steering joint on the x axis: its angle is that of a wheel there"
            wrong = f"{own.joint} is beside it: leave it out, and two such joints make the coordinate {STEER}"
            raise misfit(layout, self.name, expected, wrong, layout.pivots)
        return super().compared(layout)

    def added_joint(self, layout: Layout) -> AddedJoint | None:
        """Midway between two steered wheels, within what their joints allow of angle and rate."""
        pair, own = steered_pair(layout), self._pivot(layout)
        if pair is None:
            return None
        lower, upper = pair.range(self._widest)
        for lowest, highest in (*([(own.lower, own.upper)] if own else []), self.coordinate_limits[3]):
            lower, upper = max(lower, float(lowest)), min(upper, float(highest))
        return AddedJoint(self.steering, pair.x, 0.0, lower, upper, pair.rate(lower, upper))

    def _pivot(self, layout: Layout) -> Pivot | None:
        return next((pivot for pivot in layout.pivots if pivot.joint == self.steering), None)

    @property
    def parameters(self) -> Array:
        return np.array([self.wheelbase])

    def described(self) -> dict[str, str]:
        widest = "its joint's" if self.max_steering is None else f"{math.degrees(self.max_steering):.4g}°"
        return super().described() | {"steering": self.steering, "max_steering": widest}

    @property
    def coordinate_limits(self) -> Array:
        """Those of the steering angle are ±max_steering or, with rear drive, where it ceases to steer."""
        limits = super().coordinate_limits
        widest = self._widest if self.max_steering is None else self.max_steering
        if self.max_steering is not None or widest < math.pi:
            limits[3] = [-widest, widest]
        return limits

    def steered_axle(self, body: str) -> SteeredAxle | None:
        if body != "theta":
            return None
        pivot = SteeringPivot(self.steering, "steering_rate", self.wheelbase, widest=self._steered_to)
        return SteeredAxle((pivot,))

    @of_many
    def pfaffian(self, qp: Array) -> Array:
        """Neither the rear axle nor the steered wheel, at (x + L cos θ, y + L sin θ), slides sideways:

        -sin θ x_dot + cos θ y_dot = 0,  -sin(θ + δ) x_dot + cos(θ + δ) y_dot + L cos δ θ_dot = 0."""
        turned = np.exp(1j * qp[..., 3])
        steered = np.exp(1j * qp[..., 2]) * turned
        front = np.zeros((*qp.shape[:-1], 1, 4))
        front[..., 0, 0], front[..., 0, 1] = -steered.imag, steered.real
        front[..., 0, 2] = self.wheelbase * turned.real
        return np.concatenate([across(qp), front], axis=-2)


class Car(_Bicycle):
    """qp = [x, y, theta, steering] (m, m, rad, rad), up = [v, steering_rate] (m/s, rad/s); rear drive.

    x, y is the midpoint of the rear axle, which moves at v along the heading theta. The steering angle δ is
    the front wheel's, from the car's x axis, positive to the left; with two front wheels (Ackermann) it is
    that of the wheel which would stand midway between them.

    Parameters
    ----------
    wheelbase : distance L from the rear axle to the steered wheel, m
    steering : name of the steering joint, which is the coordinate's
    max_steering : largest steering angle to either side, rad, below π/2
    limits : largest absolute value of each input by name, m/s and rad/s

    Raises
    ------
    InputError : a wheelbase or steering angle out of range, a steering joint named x, y or theta, a limit of
        an input that does not exist

    Examples
    --------
    >>> car = nmm.Car(wheelbase=0.7, max_steering=0.6)
    >>> (car.G([0, 0, 0, 0.3]) @ [1.0, 0.0]).round(3)
    array([1.   , 0.   , 0.442, 0.   ])
    """

    name = "car"
    velocity_map = rear_drive
    _widest = math.acos(_ACROSS)

    def problem(self, qp: ArrayLike) -> str | None:
        """That the steered wheel stands across the car, where v would drag it sideways."""
        angle = float(np.asarray(qp)[3])
        if abs(math.cos(angle)) >= _ACROSS:
            return None
        return (
            f"{self.steering} is at {math.degrees(angle):.6g} degrees, where the wheels' axes contradict v: "
            "the steered wheel's axis is parallel to the car and meets the rear axle at its midpoint, which "
            "could only stand still; driven, the rear wheels would have to slip"
        )


class FrontDriveCar(_Bicycle):
    """qp = [x, y, theta, steering] (m, m, rad, rad), up = [v, steering_rate] (m/s, rad/s); front drive.

    As `Car`, but v is the speed of the steered wheel in its own direction: the car can steer to 90 degrees,
    where it turns about the midpoint of its rear axle, and beyond.

    Parameters
    ----------
    wheelbase : distance L from the rear axle to the steered wheel, m
    steering : name of the steering joint, which is the coordinate's
    max_steering : largest steering angle to either side, rad, at most π
    limits : largest absolute value of each input by name, m/s and rad/s

    Raises
    ------
    InputError : as `Car`

    Examples
    --------
    >>> car = nmm.FrontDriveCar(wheelbase=0.7)
    >>> (car.G([0, 0, 0, 0.3]) @ [1.0, 0.0]).round(3)
    array([0.955, 0.   , 0.422, 0.   ])
    """

    name = "front_drive_car"
    velocity_map = front_drive
    _widest = math.pi
    _steered_to = math.radians(85.0)
