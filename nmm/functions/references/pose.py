"""A pose as a reference, from a position and an orientation."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from nmm.arrays import Array, vector
from nmm.errors import InputError
from nmm.functions.function import Function, Row, Stage
from nmm.functions.references.orientation import RotationVector
from nmm.functions.references.polynomial import Constant
from nmm.kernels.compiled import kernel
from nmm.kernels.records import FUNCTION, At, Frames, Rows
from nmm.robots.robot import Robot


@kernel(FUNCTION)
def move_rows(at: At, frames: Frames, numbers: Array, rows: Rows) -> None:
    """The rows from `source` on become those from `target` on; then the first rows are zero.

    numbers = [source, target, number of rows, number of first rows to clear].
    """
    source, target, count = int(numbers[0]), int(numbers[1]), int(numbers[2])
    n = at.q.shape[0]
    step = 1 if target < source else -1  # so that none is overwritten before it is read
    for moved in range(count):
        i = moved if step > 0 else count - 1 - moved
        rows.value[target + i] = rows.value[source + i]
        rows.value_t[target + i] = rows.value_t[source + i]
        for k in range(n):
            rows.value_q[target + i, k] = rows.value_q[source + i, k]
    for i in range(int(numbers[3])):
        rows.value[i] = 0.0
        rows.value_t[i] = 0.0
        for k in range(n):
            rows.value_q[i, k] = 0.0


class PoseReference(Function):
    """A position over an orientation, (6,): the target of a pose.

    Parameters
    ----------
    position : three numbers (world axes, m), or a function with three rows, of time or the configuration
    orientation : a rotation vector, rad, or a function with three rows, read as one (slerp, turn, orientation
        of another frame, ...)
    """

    def __init__(self, position: Function | ArrayLike, orientation: Function | RotationVector) -> None:
        self.position = _three(position, "position", "m")
        self.orientation = _three(orientation, "orientation", "rad")

    def rows(self, robot: Robot) -> tuple[Row, ...]:
        rows = []
        for name, unit in (("position", "m"), ("orientation", "rad")):
            found = getattr(self, name).rows(robot)
            if len(found) != 3:
                came = ", ".join(f"{row.name} ({row.unit})" for row in found)
                raise InputError(f"{name}: expected three components, {unit}, got {came}")
            rows += [Row(row.name, unit) for row in found]
        return tuple(rows)

    def stages(self, robot: Robot) -> tuple[Stage, ...]:
        """The orientation first, moved out of the way of the position, which begins on clean rows."""
        self.rows(robot)
        turn, place = self.orientation.stages(robot), self.position.stages(robot)
        used = max(stage.rows for stage in turn)
        aside = max(stage.rows for stage in place)
        first = Stage(move_rows, max(used, aside + 3), (), np.array([0.0, aside, 3.0, aside]))
        if aside == 3:
            return (*turn, first, *place)
        last = Stage(move_rows, aside + 3, (), np.array([float(aside), 3.0, 3.0, 0.0]))
        return (*turn, first, *place, last)


def _three(given: Function | ArrayLike, name: str, unit: str) -> Function:
    return given if isinstance(given, Function) else Constant(vector(given, 3, name), unit)
