"""The unicycle, and the differential drive: a unicycle whose inputs are the speeds of its two wheels."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from nmm.base.arrays import Array, positive
from nmm.base.findings import Finding
from nmm.base.kernels.compiled import PLATFORM, compiled, kernel
from nmm.model.platforms.base import Platform, of_many
from nmm.model.platforms.wheel_layout import (
    NEAR,
    Layout,
    RollingJoint,
    ahead,
    common_radius,
    main_wheels,
    same,
    steered_too_little,
)


@compiled
def roll_ahead(qp: Array, G: Array, G_q: Array) -> None:
    """The first input moves x and y along the heading θ."""
    cosine = math.cos(qp[2])
    sine = math.sin(qp[2])
    G[0, 0] = cosine
    G[1, 0] = sine
    G_q[0, 0, 2] = -sine
    G_q[1, 0, 2] = cosine


@kernel(PLATFORM)
def unicycle(qp: Array, parameters: Array, G: Array, G_q: Array) -> None:
    """G = [[cos θ, 0], [sin θ, 0], [0, 1]] (paper, section V-A)."""
    roll_ahead(qp, G, G_q)
    G[2, 1] = 1.0


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


def across(qp: Array) -> Array:
    """The row (..., 1, n_p) that gives the speed of (x, y) across the heading theta, at qp (..., n_p)."""
    ahead = np.exp(1j * qp[..., 2])
    row = np.zeros((*qp.shape[:-1], 1, qp.shape[-1]))
    row[..., 0, 0], row[..., 0, 1] = -ahead.imag, ahead.real
    return row


class Unicycle(Platform):
    """qp = [x, y, theta] (m, m, rad), up = [v, omega] (m/s, rad/s).

    x, y is the midpoint of the wheels' axle, theta its heading from the world's x axis.

    Examples
    --------
    >>> nmm.Unicycle().G([0, 0, np.pi / 2]).round(3)
    array([[0., 0.],
           [1., 0.],
           [0., 1.]])
    """

    name = "unicycle"
    inputs = ("v", "omega")
    input_units = ("m/s", "rad/s")
    velocity_map = unicycle

    def compared(self, layout: Layout) -> tuple[Finding, ...]:
        return (*steered_too_little(layout, self.name), *super().compared(layout))

    @of_many
    def pfaffian(self, qp: Array) -> Array:
        """No sideways motion of the axle: -sin θ x_dot + cos θ y_dot = 0."""
        return across(qp)


class DifferentialDrive(Unicycle):
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
    parameter_names: Mapping[str, str] = {"r": "", "b": ""}
    velocity_map = differential_drive
    _fitted = ("radius", "track")

    def __init__(
        self, radius: ArrayLike, track: ArrayLike, *, limits: Mapping[str, float] | None = None
    ) -> None:
        self.radius = positive(radius, f"{self.name}: radius")
        self.track = positive(track, f"{self.name}: track")
        super().__init__(limits=limits)

    @classmethod
    def fit(cls, layout: Layout) -> Self:
        """Radius and track of the file's wheels; `InputError` unless the root's body carries exactly two, of
        one radius, that roll forward on an axle through the reference point."""
        expected = "two wheels of one radius that roll forward on an axle through the reference point"
        wheels = main_wheels(layout, cls.name, expected, _why_no_axle, 2, 2)
        return cls(common_radius(cls.name, wheels), abs(wheels[0].y - wheels[1].y))

    @property
    def parameters(self) -> Array:
        return np.array([self.radius, self.track])


def _why_no_axle(wheels: Sequence[RollingJoint]) -> str | None:
    first, second = wheels
    if not same([first.x, second.x]):
        return "they are not on one axle"
    if abs(first.x) > NEAR:
        return f"their axle is {ahead(first.x)}: give axle (--axle X,Y)"
    if first.y * second.y >= 0.0 or abs(first.y + second.y) > NEAR:
        return "they are not equally far to the left and right of the reference point: give axle (--axle X,Y)"
    return None
