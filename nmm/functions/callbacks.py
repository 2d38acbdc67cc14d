"""A user's own Python function as a stage: evaluated before the kernels, handed to them as numbers."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import PurePath

import numpy as np
from numpy.typing import ArrayLike

from nmm.arrays import Array
from nmm.errors import InputError
from nmm.functions.function import Callback, Evaluation, Stage
from nmm.kernels.compiled import kernel
from nmm.kernels.records import FUNCTION, At, Frames, Rows
from nmm.robots.configuration import Configuration
from nmm.robots.robot import Robot
from nmm.words import listed

#: Step of the central differences: the cube root of the machine's precision balances truncation and rounding
#: where the values change over distances near 1. It does not grow with t or q: nor does a sine's period.
STEP = float(np.cbrt(np.finfo(float).eps))

TimeConfigurationFunction = Callable[[float, Configuration], ArrayLike]


@kernel(FUNCTION)
def provided(at: At, frames: Frames, numbers: Array, rows: Rows) -> None:
    """What the callback found: numbers = [value, value_t, value_q row after row]."""
    s, n = rows.value_q.shape
    for i in range(s):
        rows.value[i] = numbers[i]
        rows.value_t[i] = numbers[s + i]
        for j in range(n):
            rows.value_q[i, j] = numbers[2 * s + i * n + j]


def stage(rows: int, n: int, callback: Callback) -> Stage:
    """The stage of a user's function with that many rows."""
    return Stage(provided, rows, (), np.zeros(rows * (2 + n)), callback=callback)


def of_configuration(
    value: Callable[[Configuration], ArrayLike],
    value_q: Callable[[Configuration], ArrayLike] | None,
    rows: int,
    name: str,
    robot: Robot,
    derivative: str = "jacobian",
) -> tuple[Stage, ...]:
    """The stage of a user's function of the configuration alone; `derivative` is what users call ∂/∂q."""
    callback = Differentiated(
        lambda t, configuration: value(configuration),
        None,
        None if value_q is None else lambda t, configuration: value_q(configuration),
        rows,
        f"{name} {called(value)}",
        depends_on_time=False,
        derivative=derivative,
    )
    return (stage(rows, robot.n, callback),)


def called(function: Callable[..., object]) -> str:
    """What a user's function is called; of a lambda, where it stands."""
    name = getattr(function, "__name__", type(function).__name__)
    code = getattr(function, "__code__", None)
    if name != "<lambda>" or code is None:
        return name
    return f"<lambda> ({PurePath(code.co_filename).name}:{code.co_firstlineno})"


class Differentiated:
    """A callback that takes the derivatives the user gives, and central differences for the rest.

    Parameters
    ----------
    value, value_t, value_q : the user's, of (t, configuration); None for derivatives that are not given
    rows : how many numbers a value has
    name : for messages
    derivative : what users call value_q

    Attributes
    ----------
    costs : what the differences cost, a sentence; "" where there are none
    """

    def __init__(
        self,
        value: TimeConfigurationFunction,
        value_t: TimeConfigurationFunction | None,
        value_q: TimeConfigurationFunction | None,
        rows: int,
        name: str,
        *,
        depends_on_time: bool = True,
        depends_on_configuration: bool = True,
        derivative: str = "jacobian",
    ) -> None:
        self._value, self._value_t, self._value_q = value, value_t, value_q
        self._rows, self._name = rows, name
        self._differs_t = depends_on_time and value_t is None
        self._differs_q = depends_on_configuration and value_q is None
        lacks = ["rate"] * self._differs_t + [derivative] * self._differs_q
        calls = ["twice"] * self._differs_t + ["twice a coordinate"] * self._differs_q
        self.costs = (
            f"{name} has no {listed(lacks, 'and no')}: each time it is called once for its value and, for "
            f"differences, {listed(calls)}; {listed([f'{lack}=' for lack in lacks])} would spare that"
            if lacks
            else ""
        )

    def __call__(self, t: float, configuration: Configuration) -> Evaluation:
        rows, n = self._rows, configuration.robot.n
        y, y_t, y_q = np.empty(rows), np.zeros(rows), np.zeros((rows, n))
        y[:] = self._at(t, configuration)
        if self._value_t is not None:
            y_t[:] = self._checked(self._value_t(t, configuration), (rows,), "a time derivative")
        elif self._differs_t:
            y_t[:] = self._at(t + STEP, configuration)
            y_t -= self._at(t - STEP, configuration)
            y_t /= (t + STEP) - (t - STEP)
        if self._value_q is not None:
            y_q[:] = self._checked(self._value_q(t, configuration), (rows, n), "a Jacobian")
        elif self._differs_q:
            for j, (ahead, behind) in enumerate(configuration.neighbours(STEP)):
                column = y_q[:, j]
                column[:] = self._at(t, ahead)  # copied: the next value may be the same array
                column -= self._at(t, behind)
                column /= ahead.q[j] - behind.q[j]
        return Evaluation(y, y_t, y_q)

    def _at(self, t: float, configuration: Configuration) -> Array | float:
        value = self._value(t, configuration)
        if self._rows == 1 and isinstance(value, float):
            return value
        return self._checked(value, (self._rows,), "a value")

    def _checked(self, result: ArrayLike, shape: tuple[int, ...], what: str) -> Array:
        if type(result) is np.ndarray and result.shape == shape and result.dtype == np.float64:
            return result
        try:
            array = np.asarray(result, dtype=np.float64)
        except (TypeError, ValueError):
            raise InputError(f"{self._name}: expected {what} of shape {shape}, got {result!r}") from None
        # Axes of length 1 come and go, but a transposed Jacobian is not one.
        if [k for k in array.shape if k != 1] != [k for k in shape if k != 1]:
            raise InputError(f"{self._name}: expected {what} of shape {shape}, got shape {array.shape}")
        return array.reshape(shape)
