"""A limited function of the robot: lower <= c(t, q) <= upper."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from nmm.arrays import Array, counted, positive
from nmm.errors import InputError
from nmm.functions.function import Function
from nmm.robots.robot import Robot


class Kept(NamedTuple):
    """A limited quantity: its name, its unit, and its limits."""

    name: str
    unit: str
    lower: float
    upper: float


class Bound:
    """lower <= c(t, q) <= upper for the values of a function: a corridor, a height, a distance.

    Kept as a damper: c may approach a limit no faster than it can be slowed down to it. On wheels c's
    direction turns, so that it cannot always be kept with the other limits: then it is broken as little as
    can be, and the run says so.

    Parameters
    ----------
    function : c(t, q), a task's function, a frame's position, ...
    lower, upper : (rows,) or a number for all, in the units of the rows; infinite for none
    braking : deceleration to count on, units of the rows per s²; None for a quarter of what the accelerations
        of the inputs give where the robot is
    name : for messages; the function's rows when not given
    priority : None for a limit that is kept before any task; 1, 2, ... for one that is kept if possible: as
        far as tasks of a lower number leave it, before those of this number and higher ones

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
        if not isinstance(function, Function):
            raise InputError(f"bound: expected a function, got {function!r}")
        self.function = function
        self.lower = _numbers(lower, "lower")
        self.upper = _numbers(upper, "upper")
        self.braking = None if braking is None else positive(braking, "braking")
        self.name = name
        self.priority = None if priority is None else counted(priority, "priority")
        given = f"lower {_said(self.lower)} and upper {_said(self.upper)}"
        if not (np.isfinite(self.lower).any() or np.isfinite(self.upper).any()):
            raise InputError(f"{self._who}: expected lower, upper or both, got {given}")
        if self.lower.size in (1, self.upper.size) or self.upper.size == 1:
            if np.any(self.lower > self.upper):
                raise InputError(f"{self._who}: lower {_said(self.lower)} is above upper {_said(self.upper)}")
        else:
            raise InputError(f"{self._who}: expected as many of lower as of upper, got {given}")

    @property
    def _who(self) -> str:
        return f"bound {self.name}" if self.name else "bound"

    def rows(self, robot: Robot) -> list[Kept]:
        """Name, unit, lower and upper limit of each component."""
        rows = self.function.rows(robot)
        try:
            lower, upper = (np.broadcast_to(ends, (len(rows),)) for ends in (self.lower, self.upper))
        except ValueError:
            raise InputError(
                f"{self._who}: expected a number or {len(rows)} ({', '.join(row.name for row in rows)}), "
                f"got lower {_said(self.lower)} and upper {_said(self.upper)}"
            ) from None
        return [
            Kept(
                f"{self.name}.{row.name}" if self.name and len(rows) > 1 else self.name or row.name,
                *(row.unit, float(lower[i]), float(upper[i])),
            )
            for i, row in enumerate(rows)
        ]


def _numbers(value: ArrayLike, name: str) -> Array:
    try:
        found = np.atleast_1d(np.array(value, dtype=np.float64))
    except (TypeError, ValueError):
        found = np.array([np.nan])
    if found.ndim != 1 or np.any(np.isnan(found)):
        raise InputError(f"bound: {name}: expected numbers (infinite for none), got {value!r}")
    return found


def _said(numbers: Array) -> str:
    """A number, or [numbers]."""
    said = ", ".join(f"{number:g}" for number in numbers)
    return said if numbers.size == 1 else f"[{said}]"
