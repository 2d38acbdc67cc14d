"""When a task is done: between two times, while a function of q is within bounds, after another task."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from nmm.base.arrays import infinite, positive, scalar
from nmm.base.errors import InputError, expect, expect_kind
from nmm.control.functions.function import Function


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
        expect(self.end > self.start, "end", f"a time after the start, {self.start:g} s", self.end)


class While:
    """lower <= φ(t, q) <= upper, with hysteresis.

    Parameters
    ----------
    function : φ; each of its rows has to be within
    lower, upper : a number for all rows, or one a row; infinite for none; in the rows' units
    margin : hysteresis: it holds until a row is beyond its bound by this; in the rows' units

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
        expect_kind(function, Function, "while", "a function of the robot, as Position('ee')")
        self.function = function
        self.lower = infinite(lower, "lower", "a number, or one a row")
        self.upper = infinite(upper, "upper", "a number, or one a row")
        self.margin = scalar(margin, "margin", least=0.0)
        bounds = (self.lower, self.upper)
        try:
            above = bool(np.any(self.lower > self.upper))
        except ValueError:
            raise InputError(where="lower", expected="as many numbers as in upper", got=bounds) from None
        expect(not above, "lower", "lower below upper", bounds)
        bound = np.any(np.isfinite(self.lower)) or np.any(np.isfinite(self.upper))
        expect(bound, "lower", "a bound, lower or upper: without one it always holds")


def by_unit(tolerance: float | Mapping[str, float] | None, name: str) -> dict[str, float]:
    """Numbers above 0 by unit; one for all has the unit ""."""
    numbers = tolerance if isinstance(tolerance, Mapping) else {} if tolerance is None else {"": tolerance}
    return {unit: positive(value, f"{name} {unit}".strip()) for unit, value in numbers.items()}


class After:
    """The error of another task has once stayed within a tolerance; from then on it holds for good.

    Parameters
    ----------
    task : that task's name
    within : bound of ‖e‖ over rows of one unit: a number, or numbers by unit ({"m": 0.005}, others are
        ignored)
    hold : how long the error has to stay there, s
    instead : whether that task then ends

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
        expect(isinstance(task, str) and task, "after", "the name of a task", task)
        self.task = task
        self.within = by_unit(within, "within")
        self.hold = scalar(hold, "hold", least=0.0)
        self.instead = bool(instead)


Condition: TypeAlias = Between | While | After
