"""The velocity of a reference, as a function that others follow or align with."""

from __future__ import annotations

import math

import numpy as np

from nmm.errors import InputError
from nmm.functions.function import Function, Row, Stage
from nmm.functions.references.circle import Circle, circle
from nmm.functions.references.polynomial import PiecewisePolynomial, piecewise_polynomial
from nmm.robots.robot import Robot


class Velocity(Function):
    """∂g/∂t of a reference of time, a row for each of its own; zero where the reference rests.

    Parameters
    ----------
    of : a circle, line, polynomial, spline or constant

    Examples
    --------
    >>> robot = nmm.load("unicycle_2r")
    >>> along = nmm.Velocity(nmm.Circle([0, 0], radius=2, rate=0.5))
    >>> nmm.evaluate(along, 0.0, nmm.Configuration(robot, robot.rest)).value.round(3)
    array([0., 1.])
    """

    def __init__(self, of: Function) -> None:
        if not isinstance(of, Circle | PiecewisePolynomial):
            raise InputError(
                f"of: expected a circle, line, polynomial, spline or constant, got {type(of).__name__}"
            )
        self.of = of

    def rows(self, robot: Robot) -> tuple[Row, ...]:
        return tuple(Row(f"{row.name}_dot", f"{row.unit}/s") for row in self.of.rows(robot))

    def stages(self, robot: Robot) -> tuple[Stage, ...]:
        (stage,) = self.of.stages(robot)
        if isinstance(self.of, Circle):  # another circle, a quarter ahead, about the origin
            numbers = stage.numbers.copy()
            numbers[0] *= self.of.rate
            numbers[2] += math.pi / 2
            numbers[5:] = 0.0
            return (Stage(circle, stage.rows, (), numbers),)
        breaks, c = self.of.breaks, self.of.coefficients
        powers = np.arange(len(c) - 1, 0, -1)[:, None, None]
        slopes = np.zeros((max(1, len(powers)), len(breaks) + 1, stage.rows))  # at rest before and after
        slopes[:, 1:-1] = c[:-1] * powers if len(powers) else 0.0
        around = np.concatenate([[breaks[0] - 1.0], breaks, [breaks[-1] + 1.0]])
        numbers = np.concatenate([[len(breaks) + 1, len(slopes)], around, slopes.transpose(2, 1, 0).ravel()])
        return (Stage(piecewise_polynomial, stage.rows, (), numbers),)
