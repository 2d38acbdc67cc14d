"""Cars, as one steered wheel ahead of an axle (a bicycle): driven at the rear, and driven at the front."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from nmm.arrays import Array, positive
from nmm.errors import InputError
from nmm.kernels.compiled import PLATFORM, Kernel, kernel
from nmm.platforms.ackermann import are_below, steered_pair
from nmm.platforms.base import Platform, of_many
from nmm.platforms.layout import NEAR, AddedJoint, Layout, Pivot
from nmm.platforms.measuring import (
    check_axle,
    misfit,
    say_pivots,
    say_wheels,
    symmetric_limit,
    wheels_on,
)
from nmm.platforms.own_joints import coordinates_with
from nmm.platforms.steering import SteeredAxle, SteeringPivot
from nmm.platforms.unicycle import across

#: The coordinate of a car whose two wheels steer without a joint midway between them.
STEER = "steer"
#: |cos δ| below which a steering angle counts as 90 degrees.
_ACROSS = 1e-6


@kernel(PLATFORM)
def rear_drive(qp: Array, parameters: Array, G: Array, G_q: Array) -> None:
    """G = [[cos θ, 0], [sin θ, 0], [tan δ / L, 0], [0, 1]]; parameters = [L]."""
    cosine = math.cos(qp[2])
    sine = math.sin(qp[2])
    tangent = math.tan(qp[3])
    G[0, 0] = cosine
    G[1, 0] = sine
    G[2, 0] = tangent / parameters[0]
    G[3, 1] = 1.0
    G_q[0, 0, 2] = -sine
    G_q[1, 0, 2] = cosine
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
    """What both cars have: where the wheels stand, and that none of them slides."""

    inputs = ("v", "steering_rate")
    input_units = ("m/s", "rad/s")
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
            self.max_steering = positive(max_steering, f"{self.name}: max_steering")
            if self.max_steering > self._widest:
                raise InputError(
                    f"{self.name}: max_steering: expected at most {math.degrees(self._widest):.6g} degrees, "
                    f"got {math.degrees(self.max_steering):.6g} ({self.max_steering:g} rad)"
                )
        super().__init__(limits=limits)

    @classmethod
    def fit(cls, layout: Layout) -> Self:
        """Wheelbase and steering joint of the file; the joint's limits when they are symmetric.

        The steering joint is the upright joint on the root's body whose name holds "steer" and which stands
        on the x axis, ahead of the reference point. Without one, two such joints with wheels, equally far
        beside the x axis, count as one midway between them, the coordinate `steer`.

        Raises
        ------
        InputError : there is none, or there are several; the rear wheels are not at the reference point
        """
        named = [pivot for pivot in layout.pivots if _may_steer(pivot)]
        pair = None if named else steered_pair(layout)
        if len(named) != 1 and pair is None:
            expected = (
                'one steering joint: upright, "steer" in its name, on the x axis of the root, x > 0; or two '
                "with wheels, equally far beside it"
            )
            wrong = f"there are {len(named)}" if named else "there is none"
            raise misfit(layout, cls.name, expected, wrong, say_pivots(layout.pivots))
        check_axle(layout, cls.name)
        if pair is not None:
            lower, upper = pair.range(cls._widest)
            even = upper < cls._widest and abs(lower + upper) <= NEAR
            return cls(pair.x, steering=STEER, max_steering=upper if even else None)
        for wheel in wheels_on(layout, named[0].joint):
            if not are_below([wheel]):
                expected = "the steered wheel below its steering axis, rolling ahead (see platform wheeled)"
                raise misfit(layout, cls.name, expected, "it is off it or turned", say_wheels([wheel]))
        limit = symmetric_limit(named[0])
        if limit is not None and limit > cls._widest:
            limit = None
        return cls(named[0].x, steering=named[0].joint, max_steering=limit)

    @property
    def lengths(self) -> Mapping[str, float]:
        return {"wheelbase": self.wheelbase}

    def measured(self, layout: Layout) -> Mapping[str, float]:
        own = self._pivot(layout)
        if own is None:
            return super().measured(layout)
        check_axle(layout, self.name)
        return {"wheelbase": own.x}

    def compared(self, layout: Layout) -> tuple[str, ...]:
        own = self._pivot(layout)
        if own is not None and abs(own.y) > NEAR:
            expected = "its steering joint on the x axis: its angle is that of a wheel there"
            wrong = f"{own.joint} is beside it: leave it out, and two such joints make the coordinate {STEER}"
            raise misfit(layout, self.name, expected, wrong, say_pivots(layout.pivots))
        return super().compared(layout)

    def added_joint(self, layout: Layout) -> AddedJoint | None:
        """Midway between two wheels that steer, within what their joints allow of angle and rate."""
        pair, own = steered_pair(layout), self._pivot(layout)
        if pair is None:
            return None
        lower, upper = pair.range(self._widest)
        for lowest, highest in ((own.lower, own.upper) if own else (lower, upper), self.coordinate_limits[3]):
            lower, upper = max(lower, float(lowest)), min(upper, float(highest))
        return AddedJoint(self.steering, pair.x, 0.0, lower, upper, pair.rate(lower, upper))

    def _pivot(self, layout: Layout) -> Pivot | None:
        return next((pivot for pivot in layout.pivots if pivot.joint == self.steering), None)

    @property
    def parameters(self) -> Array:
        return np.array([self.wheelbase])

    @property
    def parameter_names(self) -> Mapping[str, str]:
        return {"L": ""}

    def described(self) -> dict[str, str]:
        widest = "its joint's" if self.max_steering is None else f"{math.degrees(self.max_steering):.4g}°"
        return {"wheelbase": f"{self.wheelbase:g} m", "steering": self.steering, "max_steering": widest}

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
        """Neither the rear axle nor the steered wheel slides sideways.

        The rear axle's midpoint does not move along the axle: -sin θ x_dot + cos θ y_dot = 0. The steered
        wheel, at (x + L cos θ, y + L sin θ), does not move across its direction θ + δ:
        -sin(θ + δ) x_dot + cos(θ + δ) y_dot + L cos δ θ_dot = 0.
        """
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
    _widest = math.acos(_ACROSS)

    @property
    def velocity_map(self) -> Kernel:
        return rear_drive

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
    _widest = math.pi
    _steered_to = math.radians(85.0)

    @property
    def velocity_map(self) -> Kernel:
        return front_drive


def _may_steer(pivot: Pivot) -> bool:
    on_axis = pivot.carrier == "theta" and abs(pivot.y) <= NEAR and pivot.x > NEAR
    return on_axis and pivot.steers
