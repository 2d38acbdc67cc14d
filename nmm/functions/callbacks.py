"""A user's own Python function as a stage: evaluated before the kernels, handed to them as numbers."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from nmm.arrays import Array
from nmm.errors import InputError
from nmm.functions.function import Callback, Evaluation, Stage
from nmm.kernels.compiled import kernel
from nmm.kernels.records import FUNCTION, At, Frames, Rows
from nmm.robots.configuration import Configuration
from nmm.robots.robot import Robot

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
) -> tuple[Stage, ...]:
    """The stage of a user's function of the configuration alone."""
    callback = differentiated(
        lambda t, configuration: value(configuration),
        None,
        None if value_q is None else lambda t, configuration: value_q(configuration),
        rows,
        name,
        depends_on_time=False,
    )
    return (stage(rows, robot.n, callback),)


def differentiated(
    value: TimeConfigurationFunction,
    value_t: TimeConfigurationFunction | None,
    value_q: TimeConfigurationFunction | None,
    rows: int,
    name: str,
    *,
    depends_on_time: bool = True,
    depends_on_configuration: bool = True,
) -> Callback:
    """A callback that takes the derivatives the user gives, and central differences for the rest."""

    def checked(result: ArrayLike, shape: tuple[int, ...], what: str) -> Array:
        try:
            array = np.asarray(result, dtype=np.float64)
        except (TypeError, ValueError):
            raise InputError(f"{name}: expected {what} of shape {shape}, got {result!r}") from None
        # Axes of length 1 come and go, but a transposed Jacobian is not one.
        if [k for k in array.shape if k != 1] != [k for k in shape if k != 1]:
            raise InputError(f"{name}: expected {what} of shape {shape}, got shape {array.shape}")
        return array.reshape(shape)

    def callback(t: float, configuration: Configuration) -> Evaluation:
        robot, q = configuration.robot, configuration.q

        def at(t: float, q: Array) -> Array:
            return checked(value(t, Configuration(robot, q)), (rows,), "a value")

        y = checked(value(t, configuration), (rows,), "a value")
        y_t, y_q = np.zeros(rows), np.zeros((rows, robot.n))
        if value_t is not None:
            y_t = checked(value_t(t, configuration), (rows,), "a time derivative")
        elif depends_on_time:
            y_t = (at(t + STEP, q) - at(t - STEP, q)) / ((t + STEP) - (t - STEP))
        if value_q is not None:
            y_q = checked(value_q(t, configuration), (rows, robot.n), "a Jacobian")
        elif depends_on_configuration:
            for j in range(robot.n):
                ahead, behind = q.copy(), q.copy()
                ahead[j] += STEP
                behind[j] -= STEP
                y_q[:, j] = (at(t, ahead) - at(t, behind)) / (ahead[j] - behind[j])
        return Evaluation(y, y_t, y_q)

    return callback
