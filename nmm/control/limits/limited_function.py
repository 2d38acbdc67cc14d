"""A limited function of the robot: lower <= c(t, q) <= upper."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from nmm.base.arrays import counted, infinite, positive
from nmm.base.errors import InputError, expect, expect_kind, few
from nmm.control.functions.function import Function
from nmm.control.limits.limit import RowLimit
from nmm.model.robots.robot import Robot


class Bound:
    """lower <= c(t, q) <= upper for the values of a function: a corridor, a height, a distance.

    It is kept as a damper: c approaches a limit no faster than it can be braked. On wheels the direction of c
    turns, so this may contradict the other limits: then it is violated as little as possible, and the run
    reports it.

    Parameters
    ----------
    function : c(t, q), a task's function, a frame's position, ...
    lower, upper : (rows,) or a number for all, in the units of the rows; infinite for none
    braking : deceleration to rely on, units of the rows per s²; None for a quarter of what the accelerations
        of the inputs give in the current configuration
    name : for messages; the function's rows when not given
    priority : None for a limit that is kept before any task; 1, 2, ... for one that is kept if possible: as
        far as tasks of a lower number allow, before those of this number and higher ones

    Raises
    ------
    InputError : no limit, one that is not a number, lower above upper

    Examples
    --------
    >>> robot = nmm.load("unicycle_2r")
    >>> corridor = nmm.Bound(nmm.Position("base_footprint", "y"), -0.2, 0.2, name="corridor")
    >>> task = nmm.Task(nmm.Position("ee", "xy"), nmm.Line([1.1, 0], [3, 0.8], duration=5))
    >>> limits = nmm.Limits(bounds=corridor)
    >>> controller = nmm.Controller(robot, task, nmm.ProjectedGradient(), limits=limits, dt=0.01)
    >>> nmm.simulate(controller, robot.q({"q2": 0.5}), 5.0, 0.01).q[:, 1:2].max(axis=0).round(3)
    array([0.2])
    """

    def __init__(
        self,
        function: Function,
        lower: ArrayLike = -np.inf,
        upper: ArrayLike = np.inf,
        braking: float | None = None,
        name: str = "",
        priority: int | None = None,
    ) -> None:
        expect_kind(function, Function, "bound", "a function")
        self.function = function
        self.lower = infinite(lower, "bound: lower", "numbers (infinite for none)")
        self.upper = infinite(upper, "bound: upper", "numbers (infinite for none)")
        self.braking = None if braking is None else positive(braking, "braking")
        self.name = name
        self.priority = None if priority is None else counted(priority, "priority")
        ends = (self.lower, self.upper)
        bounded = np.isfinite(self.lower).any() or np.isfinite(self.upper).any()
        expect(bounded, self._who, "lower, upper or both", ends)
        if self.lower.size in (1, self.upper.size) or self.upper.size == 1:
            if np.any(self.lower > self.upper):
                raise InputError(where=self._who, expected="lower below upper", got=ends)
        else:
            raise InputError(where=self._who, expected="as many numbers in lower as in upper", got=ends)

    @property
    def _who(self) -> str:
        return f"bound {self.name}" if self.name else "bound"

    def rows(self, robot: Robot) -> list[RowLimit]:
        """Name, unit, lower and upper limit of each component."""
        rows = self.function.rows(robot)
        try:
            lower, upper = (np.broadcast_to(ends, (len(rows),)) for ends in (self.lower, self.upper))
        except ValueError:
            raise InputError(
                where=self._who,
                expected=f"a number or {len(rows)} ({few([row.name for row in rows])})",
                got=(self.lower, self.upper),
            ) from None
        return [
            RowLimit(
                f"{self.name}.{row.name}" if self.name and len(rows) > 1 else self.name or row.name,
                *(row.unit, float(lower[i]), float(upper[i])),
            )
            for i, row in enumerate(rows)
        ]
