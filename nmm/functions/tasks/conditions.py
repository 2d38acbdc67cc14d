"""When a task is done: between two times, while a function of q is within bounds, after another task."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from nmm.arrays import Array, one_line, positive, scalar
from nmm.errors import InputError
from nmm.functions.function import Function


class Between:
    """start <= t < end.

    Parameters
    ----------
    start, end : s

    Raises
    ------
    InputError : an end that is not after the start

    Examples
    --------
    >>> robot = nmm.load("unicycle_2r")
    >>> aim = nmm.Task(nmm.Posture("q1"), [0.5], name="aim", when=nmm.Between(0.5, 1.0))
    >>> controller = nmm.SequencedController(robot, aim, nmm.ProjectedGradient())
    >>> run = nmm.simulate(controller, robot.rest, 2.0, 0.01)
    >>> [(event.t, event.what) for event in run.events]
    [(0.5, 'begins'), (1.0, 'ends')]
    """

    def __init__(self, start: float = 0.0, end: float = math.inf) -> None:
        self.start = scalar(start, "start")
        self.end = math.inf if np.isposinf(end) else scalar(end, "end")
        if self.end <= self.start:
            raise InputError(f"end: expected a time after the start, {self.start:g} s, got {self.end:g}")


class While:
    """lower <= φ(t, q) <= upper, with hysteresis.

    Parameters
    ----------
    function : φ; each of its rows has to be within
    lower, upper : a number for all rows, or one a row; infinite for none; in the rows' units
    margin : once it holds, it does so until a row is beyond its bound by more than this; in the rows' units

    Raises
    ------
    InputError : what is no function, lower above upper, no bound at all, a margin below 0

    Examples
    --------
    >>> near = nmm.While(nmm.Distance("ee", to=[2, 0, 0.4]), upper=1.5)
    >>> aim = nmm.Task(nmm.Posture("q1"), [0.4], name="aim", when=near)
    >>> go = nmm.Task(nmm.Posture("x"), [1.0], name="go")
    >>> robot = nmm.load("unicycle_2r")
    >>> controller = nmm.SequencedController(robot, [go, aim], nmm.ProjectedGradient())
    >>> run = nmm.simulate(controller, robot.rest - [1, 0, 0, 0, 0], 3.0, 0.01)
    >>> [(event.task, event.what) for event in run.events]
    [('aim', 'begins')]
    """

    def __init__(
        self,
        function: Function,
        lower: ArrayLike = -math.inf,
        upper: ArrayLike = math.inf,
        margin: float = 0.01,
    ) -> None:
        if not isinstance(function, Function):
            raise InputError(f"while: expected a function of the robot, as Position('ee'), got {function!r}")
        self.function = function
        self.lower, self.upper = _bound(lower, "lower"), _bound(upper, "upper")
        self.margin = scalar(margin, "margin")
        if self.margin < 0.0:
            raise InputError(f"margin: expected a number from 0, got {self.margin:g}")
        try:
            above = bool(np.any(self.lower > self.upper))
        except ValueError:
            came = f"{len(self.lower)} and {len(self.upper)}"
            raise InputError(f"lower: expected as many numbers as in upper, got {came}") from None
        if above:
            raise InputError(f"lower: {one_line(self.lower)} is above upper, {one_line(self.upper)}")
        if np.all(np.isinf(self.lower)) and np.all(np.isinf(self.upper)):
            raise InputError("lower: expected a bound, lower or upper: without one it always holds")


class After:
    """The error of another task has once stayed within a tolerance; from then on it holds for good.

    Parameters
    ----------
    task : that task's name
    within : of its error's norm over rows of one unit: a number, or numbers by unit ({"m": 0.005}), of which
        rows of other units are not looked at
    hold : how long the error has to stay there, while that task is active, s
    instead : whether that task ends when the one with this condition begins

    Raises
    ------
    InputError : no name, a tolerance that is not above 0, a time below 0

    Examples
    --------
    >>> robot = nmm.load("unicycle_2r")
    >>> first = nmm.Task(nmm.Posture("q1"), [0.5], gain=5, name="first")
    >>> then = nmm.Task(nmm.Posture("q2"), [0.5], name="then", when=nmm.After("first", within=0.02))
    >>> controller = nmm.SequencedController(robot, [first, then], nmm.ProjectedGradient())
    >>> run = nmm.simulate(controller, robot.rest, 2.0)
    >>> [(event.task, event.what) for event in run.events]
    [('then', 'begins')]
    """

    def __init__(
        self, task: str, within: float | Mapping[str, float] = 0.01, hold: float = 0.1, instead: bool = False
    ) -> None:
        if not isinstance(task, str) or not task:
            raise InputError(f"after: expected the name of a task, got {task!r}")
        self.task = task
        given = within if isinstance(within, Mapping) else {"": within}
        self.within = {unit: positive(value, f"within {unit}".strip()) for unit, value in given.items()}
        self.hold = scalar(hold, "hold")
        if self.hold < 0.0:
            raise InputError(f"hold: expected a time from 0, s, got {self.hold:g}")
        self.instead = bool(instead)


Condition: TypeAlias = Between | While | After


def _bound(value: ArrayLike, name: str) -> Array:
    """(rows,) or (1,), infinite numbers allowed."""
    try:
        found = np.atleast_1d(np.array(value, dtype=np.float64))
    except (TypeError, ValueError):
        found = np.array([[np.nan]])
    if found.ndim != 1 or np.any(np.isnan(found)):
        raise InputError(f"{name}: expected a number, or one a row, got {value!r}")
    return found
