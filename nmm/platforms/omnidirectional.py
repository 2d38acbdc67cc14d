"""The omnidirectional platform: it moves and turns in any direction at once."""

from __future__ import annotations

import math

import numpy as np

from nmm.arrays import Array
from nmm.kernels.compiled import PLATFORM, Kernel, kernel
from nmm.platforms.base import Platform
from nmm.platforms.layout import Layout
from nmm.platforms.measuring import say_wheels, wheels_on


@kernel(PLATFORM)
def omnidirectional(qp: Array, parameters: Array, G: Array, G_q: Array) -> None:
    """G = [[cos θ, -sin θ, 0], [sin θ, cos θ, 0], [0, 0, 1]]."""
    cosine = math.cos(qp[2])
    sine = math.sin(qp[2])
    G[0, 0] = cosine
    G[0, 1] = -sine
    G[1, 0] = sine
    G[1, 1] = cosine
    G[2, 2] = 1.0
    G_q[0, 0, 2] = -sine
    G_q[0, 1, 2] = -cosine
    G_q[1, 0, 2] = cosine
    G_q[1, 1, 2] = -sine


class Omnidirectional(Platform):
    """qp = [x, y, theta] (m, m, rad), up = [vx, vy, omega] (m/s, m/s, rad/s).

    vx and vy are the velocity of the point x, y along the platform's own axes, forward and to the left.

    Examples
    --------
    >>> nmm.Omnidirectional().inputs
    ('vx', 'vy', 'omega')
    """

    name = "omnidirectional"
    inputs = ("vx", "vy", "omega")
    input_units = ("m/s", "m/s", "rad/s")

    def compared(self, layout: Layout) -> tuple[str, ...]:
        """That the main body stands on one or two wheels, which have to be plain ones: they roll one way."""
        wheels = wheels_on(layout, "theta")
        if not 0 < len(wheels) < 3:
            return ()
        return (
            f"platform {self.name} moves sideways, which needs three wheels with rollers or more; the file's "
            f"main body stands on {say_wheels(wheels)}",
        )

    @property
    def velocity_map(self) -> Kernel:
        return omnidirectional

    def pfaffian(self, qp: Array) -> Array:
        """No motion is excluded: shape (0, 3)."""
        return np.zeros((0, 3))
