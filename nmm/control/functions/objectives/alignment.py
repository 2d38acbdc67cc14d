"""Alignment of the platform's heading with a direction, a motion or a point."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from nmm.base.arrays import Array, array, scalar
from nmm.base.errors import InputError, expect
from nmm.base.kernels.compiled import kernel
from nmm.base.kernels.records import FUNCTION, At, Frames, Rows
from nmm.control.functions.function import Function, Stage, named
from nmm.control.functions.objectives.base import Objective
from nmm.control.functions.references.polynomial import Constant
from nmm.control.functions.tasks.linear_coordinates import Combination, coefficients
from nmm.control.functions.tasks.position import Position
from nmm.model.robots.robot import Robot

#: What the rows before the kernel hold: an angle, a direction, a point.
ANGLE, DIRECTION, POINT = 0.0, 1.0, 2.0


@kernel(FUNCTION)
def alignment(at: At, frames: Frames, numbers: Array, rows: Rows) -> None:
    """H = 1 - cos(ψ - ψ_d), ψ = a·q + offset, in place; numbers = [what the rows hold, offset, a...]. A
    direction (or point less the platform's place) d has ψ_d = atan2(d_y, d_x); d = 0 has H = 0, H_q = 0."""
    n = at.q.shape[0]
    heading = numbers[1]
    for k in range(n):
        heading += numbers[2 + k] * at.q[k]
    dx, dy, square = 0.0, 0.0, 1.0
    if numbers[0] == ANGLE:
        desired = rows.value[0]
    else:
        dx, dy = rows.value[0], rows.value[1]
        if numbers[0] == POINT:
            dx -= at.q[0]
            dy -= at.q[1]
        square = dx * dx + dy * dy
        desired = math.atan2(dy, dx)
    apart = square > 0.0
    half = math.sin(0.5 * (heading - desired)) if apart else 0.0  # 1 - cos x without cancellation
    slope = math.sin(heading - desired) if apart else 0.0
    rows.value[0] = 2.0 * half * half
    for k in range(-1, n):  # -1: the time
        first = rows.value_t[0] if k < 0 else rows.value_q[0, k]
        turn = first
        if numbers[0] != ANGLE:
            second = rows.value_t[1] if k < 0 else rows.value_q[1, k]
            if numbers[0] == POINT:
                first -= 1.0 if k == 0 else 0.0
                second -= 1.0 if k == 1 else 0.0
            turn = (dx * second - dy * first) / square if apart else 0.0
        if k < 0:
            rows.value_t[0] = -slope * turn
        else:
            rows.value_q[0, k] = slope * (numbers[2 + k] - turn)


class Alignment(Objective):
    """Alignment of a heading ψ with a desired one: H = 1 - cos(ψ - ψ_d), from 0 (aligned) to 2 (opposite).

    It is smooth on the whole circle, at any number of turns. Exactly opposite the gradient is 0 too.

    Parameters
    ----------
    along : the desired direction: an angle from the world's x axis, rad, two numbers (x, y), or a function of
        one row (an angle) or more (a direction, as velocity)
    at : in place of along, a point to head for: two or three numbers, m, a frame's name (its origin), or a
        function with so many rows
    of : the heading: theta, the platform's, or a combination of coordinates ({theta: 1, hitch1: 1})
    offset : added to the heading, rad: π for a platform that backs, π/2 for one whose left side counts

    Examples
    --------
    >>> robot = nmm.load("unicycle_2r")
    >>> H = nmm.Alignment(at=[0.0, 5.0])
    >>> round(H.value(nmm.Configuration(robot, robot.rest)), 3)
    1.0
    """

    def __init__(
        self,
        along: Function | ArrayLike | None = None,
        at: Function | str | ArrayLike | None = None,
        of: Combination = "theta",
        offset: float = 0.0,
    ) -> None:
        if (along is None) == (at is None):
            raise InputError(where="alignment", expected="either along, a direction, or at, a point")
        self.along, self.at = along, at
        self.of = of
        self.offset = scalar(offset, "offset")
        if along is not None:
            self._desired = direction = _function(along, "along")
            if isinstance(direction, Constant) and direction.value.size > 1 and not direction.value[:2].any():
                raise InputError(where="along", expected="a direction with x or y other than 0")
        elif at is not None:
            self._desired = Position(at, "xy") if isinstance(at, str) else _function(at, "at")

    def stages(self, robot: Robot) -> tuple[Stage, ...]:
        A = coefficients([self.of], robot)
        rows = self._desired.rows(robot)
        if self.along is None:
            kind = POINT
            point = len(rows) in (2, 3) and all(row.unit != "rad" for row in rows)
            expect(point, "at", "a point with x and y in m", named(rows))
            planar = robot.q_names[:2] == ("x", "y")
            expect(planar, "at", f"a platform with x and y, {robot.name} has none")
        else:
            kind = ANGLE if len(rows) == 1 else DIRECTION
            expect(len(rows) <= 3, "along", "an angle in rad, or a direction in x and y", named(rows))
        numbers = np.concatenate([[kind, self.offset], A[0]])
        return (*self._desired.stages(robot), Stage(alignment, min(2, len(rows)), (), numbers))


def _function(value: Function | ArrayLike, name: str) -> Function:
    if isinstance(value, Function):
        return value
    return Constant(np.atleast_1d(array(value, name)), "rad" if np.ndim(value) == 0 else "1")
