"""Bearing of a moving point towards a fixed one (paper, section VI, cases 2 and 3)."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from nmm.arrays import Array, vector
from nmm.errors import InputError
from nmm.functions.function import Function, Row, Shown, Stage
from nmm.kernels.compiled import kernel
from nmm.kernels.records import FUNCTION, At, Frames, Rows
from nmm.robots.robot import Robot


@kernel(FUNCTION)
def bearing(at: At, frames: Frames, numbers: Array, rows: Rows) -> None:
    """atan2(T - p) by the chain rule, in place: the first two rows hold p and its derivatives."""
    dx = numbers[0] - rows.value[0]
    dy = numbers[1] - rows.value[1]
    square = dx * dx + dy * dy
    rows.value_t[0] = (dy * rows.value_t[0] - dx * rows.value_t[1]) / square
    for j in range(at.q.shape[0]):
        rows.value_q[0, j] = (dy * rows.value_q[0, j] - dx * rows.value_q[1, j]) / square
    rows.value[0] = math.atan2(dy, dx)


class Bearing(Function):
    """Angle (rad) from the world's x axis at which a fixed point is seen from a moving one.

    Parameters
    ----------
    of : the moving point, its first two components x and y: a reference of time (circle, spline, ...;
        case 2), or a point of the robot (position; case 3), which makes the bearing a function of the
        configuration
    towards : the fixed point, 2 numbers, m (a third, z, is only drawn)

    Examples
    --------
    >>> robot = nmm.load("unicycle_2r")
    >>> looks = nmm.Bearing(of=nmm.Position("ee", "xy"), towards=[5.0, 5.0])
    >>> float(nmm.evaluate(looks, 0.0, nmm.Configuration(robot, robot.rest)).value[0].round(3))
    0.908
    """

    def __init__(self, of: Function, towards: ArrayLike) -> None:
        self.of = of
        self.towards = vector(towards, None, "towards")
        if self.towards.size not in (2, 3):
            raise InputError(
                f"towards: expected 2 numbers (or 3, of which z is not read), got {self.towards.size}"
            )

    def rows(self, robot: Robot) -> tuple[Row, ...]:
        seen_from = self.of.rows(robot)
        if len(seen_from) < 2 or any(row.unit != "m" for row in seen_from[:2]):
            raise InputError(
                f"bearing: expected the point it is taken from to have x and y in m, got "
                f"{', '.join(f'{row.name} ({row.unit})' for row in seen_from)}"
            )
        return (Row("bearing", "rad", angular=True),)

    def stages(self, robot: Robot) -> tuple[Stage, ...]:
        self.rows(robot)
        return (*self.of.stages(robot), Stage(bearing, 2, (), np.array(self.towards[:2])))

    def shown(self) -> Shown:
        return Shown(looks_at=self.towards)
