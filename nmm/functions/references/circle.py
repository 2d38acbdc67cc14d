"""A circle driven at constant speed (paper, eq. 16)."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from nmm.arrays import Array, positive, scalar, vector
from nmm.errors import InputError
from nmm.functions.function import Function, Row, Stage
from nmm.kernels.compiled import kernel
from nmm.kernels.records import FUNCTION, At, Frames, Rows
from nmm.robots.robot import Robot

AXES = {"x": 0, "y": 1, "z": 2}


@kernel(FUNCTION)
def circle(at: At, frames: Frames, numbers: Array, rows: Rows) -> None:
    """c + ρ (cos φ e1 + sin φ e2), φ = φ0 + rate t; numbers = [ρ, rate, φ0, i1, i2, c...]."""
    radius = numbers[0]
    rate = numbers[1]
    phase = numbers[2] + rate * at.t
    first = int(numbers[3])
    second = int(numbers[4])
    for i in range(rows.value.shape[0]):
        rows.value[i] = numbers[5 + i]
    rows.value[first] += radius * math.cos(phase)
    rows.value[second] += radius * math.sin(phase)
    rows.value_t[first] = -radius * rate * math.sin(phase)
    rows.value_t[second] = radius * rate * math.cos(phase)


class Circle(Function):
    """A point on a circle: center + radius (cos φ, sin φ), φ = phase + rate t.

    Parameters
    ----------
    center : 2 numbers in the plane or 3 in space, m
    radius : m, above 0
    rate : angular speed, rad/s; negative runs clockwise
    phase : φ at t = 0, rad
    plane : xy, yz or zx, for a centre in space: the axes along which φ is 0 and π/2

    Examples
    --------
    >>> robot = nmm.load("unicycle_2r")
    >>> circle = nmm.Circle([2, 2], radius=3, rate=0.25)
    >>> nmm.evaluate(circle, 0.0, nmm.Configuration(robot, robot.rest)).value
    array([5., 2.])
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
