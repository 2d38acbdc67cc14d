"""A circle driven at constant speed (paper, eq. 16)."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from nmm.arrays import Array, positive, scalar, vector
from nmm.errors import InputError
from nmm.functions.function import Function, Row, Stage
from nmm.kernels.compiled import FUNCTION, kernel
from nmm.robots.robot import Robot

AXES = {"x": 0, "y": 1, "z": 2}


@kernel(FUNCTION)
def circle(
    t: float, q: Array, placements: Array, jacobians: Array, hessians: Array, G: Array, G_q: Array,
    slots: Array, parameters: Array, value: Array, value_t: Array, value_q: Array,
) -> None:  # fmt: skip
    """c + ρ (cos φ e1 + sin φ e2), φ = φ0 + rate t; parameters = [ρ, rate, φ0, i1, i2, c...]."""
    radius = parameters[0]
    rate = parameters[1]
    phase = parameters[2] + rate * t
    first = int(parameters[3])
    second = int(parameters[4])
    for i in range(value.shape[0]):
        value[i] = parameters[5 + i]
    value[first] += radius * math.cos(phase)
    value[second] += radius * math.sin(phase)
    value_t[first] = -radius * rate * math.sin(phase)
    value_t[second] = radius * rate * math.cos(phase)


class Circle(Function):
    """A point on a circle: center + radius (cos φ, sin φ), φ = phase + rate t.

    Parameters
    ----------
    center : (2,) in the plane or (3,) in space, m
    radius : m, above 0
    rate : angular speed, rad/s; negative runs clockwise
    phase : φ at t = 0, rad
    plane : "xy", "yz" or "zx" for a centre in space: the axes along which φ is 0 and π/2
    """

    def __init__(
        self, center: ArrayLike, radius: float, rate: float, phase: float = 0.0, plane: str = "xy"
    ) -> None:
        self.center = vector(center, None, "center")
        if self.center.size not in (2, 3):
            raise InputError(f"center: expected 2 or 3 numbers, got {self.center.size}")
        if plane not in ("xy", "yz", "zx") or (plane != "xy" and self.center.size == 2):
            raise InputError(f"plane: expected xy, or yz or zx with a center of 3 numbers, got {plane!r}")
        self.radius = positive(radius, "radius")
        self.rate = scalar(rate, "rate")
        self.phase = scalar(phase, "phase")
        self.plane = plane

    def rows(self, robot: Robot) -> tuple[Row, ...]:
        return tuple(Row(axis, "m") for axis in "xyz"[: self.center.size])

    def stages(self, robot: Robot) -> tuple[Stage, ...]:
        first, second = (AXES[axis] for axis in self.plane)
        numbers = np.array([self.radius, self.rate, self.phase, first, second, *self.center])
        return (Stage(circle, self.center.size, (), numbers),)
