"""When a constant target is reached: tolerances of a task's error."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from nmm.base.arrays import Array, Integers, positive
from nmm.base.kernels.compiled import inlined
from nmm.control.functions.function import Row


class Goal:
    """Reached where the error's norm over the rows of each unit is within its tolerance.

    Parameters
    ----------
    m, rad : tolerances of rows in metres and in radians; rows without a unit, and pixels over the focal
        length, count as radians; others are ignored

    Examples
    --------
    >>> robot = nmm.load("unicycle_2r")
    >>> task = nmm.Task(nmm.Position("ee", "xy"), [2.0, 1.0])
    >>> controller = nmm.Controller(robot, task, nmm.ProjectedGradient())
    >>> run = nmm.simulate(controller, robot.q({"q2": 0.5}), 20, until=nmm.Goal(m=0.01))
    >>> bool(run.t[-1] < 6), bool(run.error_norm[-1] <= 0.01)
    (True, True)
    """

    def __init__(self, m: float = 0.005, rad: float = 0.02) -> None:
        self.m = positive(m, "goal: m")
        self.rad = positive(rad, "goal: rad")

    def reached(self, error: Array, rows: Sequence[Row]) -> bool:
        """Whether an error (s,) is within the tolerances."""
        metres, radians = error_sizes(error, rows)
        return metres <= self.m and radians <= self.rad


#: Codes of units; that of pixels is the focal length.
METRES, RADIANS, ANOTHER = 0, 1, -1


def unit_codes(rows: Sequence[Row | str]) -> Integers:
    """The units of rows, or units by name, (s,) as codes for `norms`."""
    codes = {"m": METRES, "rad": RADIANS, "1": RADIANS}

    def code(row: Row | str) -> int:
        if isinstance(row, Row) and row.unit == "px":
            return max(RADIANS, round(row.scale or 0.0))
        return codes.get(row.unit if isinstance(row, Row) else row, ANOTHER)

    return np.array([code(row) for row in rows], dtype=np.int64)


@inlined
def norms(error: Array, units: Integers) -> tuple[float, float]:
    """The error's norms over rows in metres and over those in radians; units (s,) of `unit_codes`."""
    metres, radians = 0.0, 0.0
    for i in range(error.shape[0]):
        if units[i] == METRES:
            metres += error[i] * error[i]
        elif units[i] >= RADIANS:
            angle = error[i] / units[i]
            radians += angle * angle
    return math.sqrt(metres), math.sqrt(radians)


def error_sizes(error: Array, rows: Sequence[Row | str]) -> tuple[float, float]:
    """`norms` for rows, or units by name."""
    return norms(error, unit_codes(rows))
