"""A target that is set from outside, between two steps: what a person drags or a camera sees."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from nmm.base.arrays import Array, array, scalar, vector
from nmm.base.kernels.compiled import compiled, kernel
from nmm.base.kernels.records import FUNCTION, At, Frames, Rows
from nmm.control.functions.function import Function, LiveNumbers, Row, Stage
from nmm.model.robots.robot import Robot


@compiled
def live_value(t: float, numbers: Array, i: int, s: int) -> float:
    """Number i of s at t: value + rate (t - t0), or value; numbers = [1 or 0, t0, value..., rate...]."""
    return numbers[2 + i] + numbers[2 + s + i] * (numbers[0] * (t - numbers[1]))


@kernel(FUNCTION)
def signal(at: At, frames: Frames, numbers: Array, rows: Rows) -> None:
    """g = what `live_value` says."""
    s = rows.value.shape[0]
    for i in range(s):
        rows.value[i] = live_value(at.t, numbers, i, s)
        rows.value_t[i] = numbers[2 + s + i]


@kernel(FUNCTION)
def displaced(at: At, frames: Frames, numbers: Array, rows: Rows) -> None:
    """Adds g of `signal` to the rows, in place."""
    s = rows.value.shape[0]
    for i in range(s):
        rows.value[i] += live_value(at.t, numbers, i, s)
        rows.value_t[i] += numbers[2 + s + i]


class LiveTarget(Function):
    """A target that `set` moves, in controllers that are built too: all follow it from their next step on.

    It can be used wherever a function of as many rows can: two for `Bearing(of=...)`, three for `Orientation`
    (a rotation vector) or `Pointing(at=...)`, six for `Pose`, or three each in a `PoseReference`.

    Deep copies and pickles, of a target or of a controller, have a target of their own, which begins as this
    one is and is set by itself; shallow copies follow this one.

    From another thread: a step sees a value with its own rate, before or after a `set`, never a part of it. A
    target used in several places reaches them one after the other: a step in between may see old and new.

    Parameters
    ----------
    value : s numbers, or a number: where it begins, at rest
    unit : unit of the values, for tables and plots, and to tell points from angles

    Examples
    --------
    >>> robot = nmm.load("unicycle_2r")
    >>> target = nmm.LiveTarget([1.0, 0.0])
    >>> task = nmm.Task(nmm.Position("ee", "xy"), target)
    >>> controller = nmm.Controller(robot, task, nmm.ProjectedGradient())
    >>> target.set([2.0, 0.5], rate=[0.1, 0.0])
    >>> controller.evaluate(0.0, robot.rest).r_d
    array([2. , 0.5])
    """

    def __init__(self, value: ArrayLike, unit: str = "m") -> None:
        first = vector(np.atleast_1d(array(value, "signal value")), None, "signal value")
        self.unit = unit
        self._size = first.size
        self._live = LiveNumbers(np.concatenate([np.zeros(2), first, np.zeros(first.size)]))

    @property
    def value(self) -> Array:
        """(s,) as it was last set."""
        return self._live.numbers[2 : 2 + self._size].copy()

    @property
    def rate(self) -> Array:
        """(s,) as it was last set, in the unit of the values per s."""
        return self._live.numbers[2 + self._size :].copy()

    def set(self, value: ArrayLike, rate: ArrayLike | None = None, t: float | None = None) -> None:
        """Another target, from the next step on.

        Parameters
        ----------
        value : s numbers
        rate : s numbers, ∂g/∂t, in their unit per s (of a rotation vector: the rate of its numbers, not the
            angular velocity); zero when None
        t : when the target was there, s, in the controller's time: at t' it is then at value + rate (t' - t),
            until it is set again; None for a target that stays at `value`, whatever its rate

        Raises
        ------
        InputError : another number of numbers, or one that is not finite; the target is then as before
        """
        s = self._size
        numbers = np.zeros(2 + 2 * s)
        numbers[2 : 2 + s] = vector(np.atleast_1d(array(value, "signal value")), s, "signal value")
        if rate is not None:
            numbers[2 + s :] = vector(np.atleast_1d(array(rate, "signal rate")), s, "signal rate")
        if t is not None:
            numbers[:2] = 1.0, scalar(t, "signal t")
        self._live.set(numbers)

    def rows(self, robot: Robot) -> tuple[Row, ...]:
        return tuple(Row(f"r{i}", self.unit) for i in range(self._size))

    def stages(self, robot: Robot) -> tuple[Stage, ...]:
        return (Stage(signal, self._size, (), self._live.numbers, live=self._live),)


class Displaced(Function):
    """Another function, plus a live target of as many rows.

    Examples
    --------
    >>> robot = nmm.load("unicycle_2r")
    >>> away = nmm.LiveTarget([0.0, 0.0])
    >>> there = nmm.extending.Displaced(nmm.Circle([1.0, 0.0], 0.5, 1.0), away)
    >>> away.set([0.0, 2.0])
    >>> nmm.evaluate(there, 0.0, nmm.Configuration(robot, robot.rest)).value
    array([1.5, 2. ])
    """

    def __init__(self, function: Function, by: LiveTarget) -> None:
        self.function, self.by = function, by

    def rows(self, robot: Robot) -> tuple[Row, ...]:
        return self.function.rows(robot)

    def stages(self, robot: Robot) -> tuple[Stage, ...]:
        (live,) = self.by.stages(robot)
        return (*self.function.stages(robot), replace(live, kernel=displaced))
