"""The unicycle: it rolls forward and turns on the spot, and never slides sideways."""

from __future__ import annotations

import math

import numpy as np

from nmm.arrays import Array
from nmm.kernels.compiled import PLATFORM, Kernel, kernel
from nmm.platforms.base import Platform, of_many
from nmm.platforms.layout import Layout
from nmm.platforms.measuring import steered_too_little


@kernel(PLATFORM)
def unicycle(qp: Array, parameters: Array, G: Array, G_q: Array) -> None:
    """G = [[cos θ, 0], [sin θ, 0], [0, 1]] (paper, section V-A)."""
    cosine = math.cos(qp[2])
    sine = math.sin(qp[2])
    G[0, 0] = cosine
    G[1, 0] = sine
    G[2, 1] = 1.0
    G_q[0, 0, 2] = -sine
    G_q[1, 0, 2] = cosine


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

    def compared(self, layout: Layout) -> tuple[str, ...]:
        return steered_too_little(layout, self.name)

    @property
    def velocity_map(self) -> Kernel:
        return unicycle

    @of_many
    def pfaffian(self, qp: Array) -> Array:
        """No sideways motion of the axle: -sin θ x_dot + cos θ y_dot = 0."""
        return across(qp)
