"""The product of two functions: a term of an objective with a weight that changes."""

from __future__ import annotations

from nmm.arrays import Array
from nmm.errors import InputError
from nmm.functions.function import Function, Row, Stage
from nmm.functions.stacking import stacked
from nmm.kernels.compiled import kernel
from nmm.kernels.records import FUNCTION, At, Frames, Rows
from nmm.robots.robot import Robot


@kernel(FUNCTION)
def product(at: At, frames: Frames, numbers: Array, rows: Rows) -> None:
    """The first row times the second, in place."""
    a, b = rows.value[0], rows.value[1]
    rows.value[0] = a * b
    rows.value_t[0] = rows.value_t[0] * b + a * rows.value_t[1]
    for k in range(at.q.shape[0]):
        rows.value_q[0, k] = rows.value_q[0, k] * b + a * rows.value_q[1, k]


class Product(Function):
    """One function of one row times another, with the derivatives of both.

    Parameters
    ----------
    function : a function with one row
    weight : another, of time (line, spline, signal, ...) as a rule; its unit is not read
    """

    def __init__(self, function: Function, weight: Function) -> None:
        self.function = function
        self.weight = weight

    def rows(self, robot: Robot) -> tuple[Row, ...]:
        for what, part in (("function", self.function), ("weight", self.weight)):
            rows = part.rows(robot)
            if len(rows) != 1:
                came = ", ".join(row.name for row in rows)
                raise InputError(f"{what}: expected a function of one row, got one with {len(rows)} ({came})")
        (row,) = self.function.rows(robot)
        return (Row(row.name, "1"),)

    def stages(self, robot: Robot) -> tuple[Stage, ...]:
        self.rows(robot)
        return (*stacked((self.function, self.weight), robot), Stage(product, 2))
