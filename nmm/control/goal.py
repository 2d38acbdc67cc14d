"""When a held target is reached: tolerances of a task's error."""

from __future__ import annotations

import math
from collections.abc import Sequence

from nmm.arrays import Array, positive
from nmm.functions.function import Row


class Goal:
    """Reached where the error's norm over rows of one unit is within its tolerance.

    Parameters
    ----------
    m, rad : tolerances of rows in metres and of rows in radians; rows of other units are not looked at

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
        metres, radians = sizes(error, [row.unit for row in rows])
        return metres <= self.m and radians <= self.rad


def sizes(error: Array, units: Sequence[str]) -> tuple[float, float]:
    """The error's norms over rows in metres and over rows in radians."""
    squares = {"m": 0.0, "rad": 0.0}
    for value, unit in zip(error.tolist(), units, strict=True):
        if unit in squares:
            squares[unit] += value * value
    return math.sqrt(squares["m"]), math.sqrt(squares["rad"])
