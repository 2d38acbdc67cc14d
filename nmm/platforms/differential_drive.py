"""Differential drive: a unicycle whose inputs are the speeds of its two wheels."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from nmm.arrays import Array, positive
from nmm.kernels.compiled import PLATFORM, Kernel, kernel
from nmm.platforms.base import Platform, of_many
from nmm.platforms.layout import Layout, RollingJoint
from nmm.platforms.measuring import (
    NEAR,
    ahead,
    misfit,
    rolls_forward,
    same,
    say_wheels,
    steered_too_little,
    wheels_on,
)
from nmm.platforms.unicycle import across


@kernel(PLATFORM)
def differential_drive(qp: Array, parameters: Array, G: Array, G_q: Array) -> None:
    """v = r (ω_l + ω_r) / 2 along the heading, ω = r (ω_r - ω_l) / b; parameters = [r, b]."""
    half = 0.5 * parameters[0]
    turn = parameters[0] / parameters[1]
    cosine = math.cos(qp[2])
    sine = math.sin(qp[2])
    for wheel in range(2):
        G[0, wheel] = half * cosine
        G[1, wheel] = half * sine
        G_q[0, wheel, 2] = -half * sine
        G_q[1, wheel, 2] = half * cosine
    G[2, 0] = -turn
    G[2, 1] = turn


class DifferentialDrive(Platform):
    """qp = [x, y, theta] (m, m, rad), up = [omega_left, omega_right] (rad/s, positive rolls forward).

    x, y is the midpoint of the wheels' axle, theta its heading from the world's x axis.

    Parameters
    ----------
    radius : of both wheels, m
    track : distance between the points where they touch the ground, m
    limits : largest speed of each wheel by name, rad/s

    Raises
    ------
    InputError : a length that is not above zero; a limit of an input that does not exist

    Examples
    --------
    >>> drive = nmm.DifferentialDrive(radius=0.1, track=0.5)
    >>> (drive.G([0, 0, 0]) @ [9, 10]).round(3)
    array([0.95, 0.  , 0.2 ])
    """

    name = "differential"
    inputs = ("omega_left", "omega_right")
    input_units = ("rad/s", "rad/s")

    def __init__(
        self, radius: ArrayLike, track: ArrayLike, *, limits: Mapping[str, float] | None = None
    ) -> None:
        self.radius = positive(radius, f"{self.name}: radius")
        self.track = positive(track, f"{self.name}: track")
        super().__init__(limits=limits)

    @classmethod
    def fit(cls, layout: Layout) -> Self:
        """Radius and track of the file's two wheels.

        Raises
        ------
        InputError : the root's body does not carry exactly two wheels, of one radius, that roll forward on
            an axle through the reference point
        """
        wheels = wheels_on(layout, "theta")
        wrong = _misfit(wheels)
        if wrong is not None:
            expected = "two wheels of one radius that roll forward on an axle through the reference point"
            raise misfit(layout, cls.name, expected, wrong, say_wheels(wheels))
        return cls(wheels[0].radius, abs(wheels[0].y - wheels[1].y))

    @property
    def lengths(self) -> Mapping[str, float]:
        return {"radius": self.radius, "track": self.track}

    def compared(self, layout: Layout) -> tuple[str, ...]:
        return (*steered_too_little(layout, self.name), *super().compared(layout))

    @property
    def parameters(self) -> Array:
        return np.array([self.radius, self.track])

    @property
    def parameter_names(self) -> Mapping[str, str]:
        return {"r": "", "b": ""}

    def described(self) -> dict[str, str]:
        return {"radius": f"{self.radius:g} m", "track": f"{self.track:g} m"}

    @property
    def velocity_map(self) -> Kernel:
        return differential_drive

    @of_many
    def pfaffian(self, qp: Array) -> Array:
        """Neither wheel slides along the axle, on which both lie: -sin θ x_dot + cos θ y_dot = 0."""
        return across(qp)


def _misfit(wheels: tuple[RollingJoint, ...]) -> str | None:
    """What is wrong with them, or None."""
    if len(wheels) != 2:
        return f"the root's body carries {len(wheels)}"
    one, other = wheels
    for wheel in wheels:
        if not rolls_forward(wheel):
            return f"{wheel.joint} does not roll forward"
    if not same([one.x, other.x]):
        return "they are not on one axle"
    if abs(one.x) > NEAR:
        return f"their axle is {ahead(one.x)}: give axle (--axle X,Y)"
    if one.y * other.y >= 0.0 or abs(one.y + other.y) > NEAR:
        return "they are not equally far to the left and right of the reference point: give axle (--axle X,Y)"
    if not same([one.radius, other.radius]):
        return "their radii differ"
    return None
