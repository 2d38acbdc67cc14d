"""Users' own Python functions as stages: evaluated before the kernels, handed to them as numbers."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import PurePath

import numpy as np
from numpy.typing import ArrayLike

from nmm.base.arrays import Array, positive
from nmm.base.errors import InputError, expect
from nmm.base.kernels.compiled import kernel
from nmm.base.kernels.records import FUNCTION, At, Frames, Rows
from nmm.base.text_format import listed
from nmm.control.functions.function import Callback, Evaluation, Function, Row, Stage
from nmm.model.robots.configuration import Configuration
from nmm.model.robots.robot import Robot

#: Step of the central differences: the cube root of the machine's precision balances truncation and rounding
#: where the values change over distances near 1. It does not grow with t or q: nor does a sine's period.
DIFFERENCE_STEP = float(np.cbrt(np.finfo(float).eps))

TimeConfigurationFunction = Callable[[float, Configuration], ArrayLike]


@kernel(FUNCTION)
def provided(at: At, frames: Frames, numbers: Array, rows: Rows) -> None:
    """The callback's results: numbers = [value, value_t, value_q row after row]."""
    s, n = rows.value_q.shape
    for i in range(s):
        rows.value[i] = numbers[i]
        rows.value_t[i] = numbers[s + i]
        for j in range(n):
            rows.value_q[i, j] = numbers[2 * s + i * n + j]


def stage(rows: int, n: int, callback: Callback) -> Stage:
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
    label = f"{name} {called(value)}"
    callback = Differentiated(value, None, value_q, rows, label, of_time=False, derivative=derivative)
    return (stage(rows, robot.n, callback),)


def called(function: Callable[..., object]) -> str:
    """What a user's function is called; of a lambda, where it stands."""
    name: str = getattr(function, "__name__", type(function).__name__)
    code = getattr(function, "__code__", None)
    if name != "<lambda>" or code is None:
        return name
    return f"<lambda> ({PurePath(code.co_filename).name}:{code.co_firstlineno})"


class Differentiated:
    """A callback of a user's functions of t, the configuration or both; central differences replace missing
    derivatives, and `costs` says at what cost. Messages use `name` and `derivative` (users' value_q)."""

    def __init__(
        self,
        value: Callable[..., ArrayLike],
        value_t: Callable[..., ArrayLike] | None,
        value_q: Callable[..., ArrayLike] | None,
        rows: int,
        name: str,
        *,
        of_time: bool = True,
        of_configuration: bool = True,
        derivative: str = "jacobian",
    ) -> None:
        def of_both(function: Callable[..., ArrayLike]) -> TimeConfigurationFunction:
            if of_time and of_configuration:
                return function
            return (lambda t, _: function(t)) if of_time else (lambda _, at: function(at))

        self._value = of_both(value)
        self._value_t, self._value_q = (
            None if partial is None else of_both(partial) for partial in (value_t, value_q)
        )
        self._rows, self._name = rows, name
        self._differs_t = of_time and value_t is None
        self._differs_q = of_configuration and value_q is None
        lacks = ["rate"] * self._differs_t + [derivative] * self._differs_q
        calls = ["twice"] * self._differs_t + ["twice a coordinate"] * self._differs_q
        self.costs = ""
        if lacks:
            once = f"{name} has no {listed(lacks, 'and no')}: each time it is called once for its value and"
            spared = listed([f"{lack}=" for lack in lacks])
            self.costs = f"{once}, for differences, {listed(calls)}; {spared} would spare that"

    def __call__(self, t: float, configuration: Configuration) -> Evaluation:
        rows, n = self._rows, configuration.robot.n
        y, y_t, y_q = np.empty(rows), np.zeros(rows), np.zeros((rows, n))
        y[:] = self._at(t, configuration)
        if self._value_t is not None:
            y_t[:] = self._checked(self._value_t(t, configuration), (rows,), "a time derivative")
        elif self._differs_t:
            y_t[:] = self._at(t + DIFFERENCE_STEP, configuration)
            y_t -= self._at(t - DIFFERENCE_STEP, configuration)
            y_t /= (t + DIFFERENCE_STEP) - (t - DIFFERENCE_STEP)
        if self._value_q is not None:
            y_q[:] = self._checked(self._value_q(t, configuration), (rows, n), "a Jacobian")
        elif self._differs_q:
            for j, (ahead, behind) in enumerate(configuration.neighbours(DIFFERENCE_STEP)):
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
            raise InputError(where=self._name, expected=f"{what} of shape {shape}", got=result) from None
        # Axes of length 1 come and go, but a transposed Jacobian is not one.
        if [k for k in array.shape if k != 1] != [k for k in shape if k != 1]:
            raise InputError(where=self._name, expected=f"{what} of shape {shape}", got=array)
        return array.reshape(shape)


class CallableFunction(Function):
    """f(q) from a Python function of a `Configuration`.

    Parameters
    ----------
    function : configuration -> value, s numbers
    names : names of the s components
    units : their units (1 when not given)
    angular : which of them are angles whose differences wrap (none when not given)
    jacobian : configuration -> df/dq, shape (s, n); central differences when not given
    scales : the natural size of each component in its unit, by which a lost rank is judged (when not given,
        the robot's reach for metres and 1 for the rest)

    Examples
    --------
    >>> def z(here):
    ...     return here.placement("ee").translation[2:]
    >>> height = nmm.CallableFunction(z, ["height"], units=["m"])
    >>> robot = nmm.load("unicycle_3r")
    >>> found = nmm.evaluate(height, 0.0, nmm.Configuration(robot, robot.q({"q2": np.pi / 4})))
    >>> found.value.round(3)
    array([1.336])
    """

    def __init__(
        self,
        function: Callable[[Configuration], ArrayLike],
        names: Sequence[str],
        *,
        units: Sequence[str] | None = None,
        angular: Sequence[bool] | None = None,
        jacobian: Callable[[Configuration], ArrayLike] | None = None,
        scales: Sequence[float] | None = None,
    ) -> None:
        self.function = function
        self.jacobian = jacobian
        units = ["1"] * len(names) if units is None else units
        angular = [False] * len(names) if angular is None else angular
        counts = {"units": len(units), "angular flags": len(angular)}
        sizes: Sequence[float | None] = [None] * len(names)
        if scales is not None:
            counts["scales"] = len(scales)
            sizes = [positive(scale, "callable function: scale") for scale in scales]
        even = names and all(count == len(names) for count in counts.values())
        expect(even, "callable function", f"as many {listed(list(counts))} as names ({len(names)})", counts)
        self._rows = tuple(Row(*row) for row in zip(names, units, angular, sizes, strict=True))

    def rows(self, robot: Robot) -> tuple[Row, ...]:
        return self._rows

    def stages(self, robot: Robot) -> tuple[Stage, ...]:
        return of_configuration(self.function, self.jacobian, len(self._rows), "callable function", robot)


class CallableReference(Function):
    """g from a Python function: of time, or of time and a `Configuration`.

    Parameters
    ----------
    function : t -> value, or (t, configuration) -> value when `of_configuration`; s numbers
    dimension : s
    rate : ∂g/∂t with the same arguments; central differences when not given
    jacobian : (t, configuration) -> ∂g/∂q, shape (s, n), when `of_configuration`; central
        differences when not given
    of_configuration : whether the functions take the configuration too
    unit : unit of the values

    Examples
    --------
    >>> robot = nmm.load("unicycle_2r")
    >>> eight = nmm.CallableReference(lambda t: [np.sin(t), np.sin(2 * t)], 2)
    >>> nmm.evaluate(eight, 0.0, nmm.Configuration(robot, robot.rest)).value_t.round(3)
    array([1., 2.])
    """

    def __init__(
        self,
        function: Callable[..., ArrayLike],
        dimension: int,
        *,
        rate: Callable[..., ArrayLike] | None = None,
        jacobian: TimeConfigurationFunction | None = None,
        of_configuration: bool = False,
        unit: str = "m",
    ) -> None:
        expect(dimension >= 1, "dimension", "at least 1", dimension)
        expect(jacobian is None or of_configuration, "of_configuration", "True with a jacobian", False)
        self.dimension = dimension
        self.unit = unit
        self.of_configuration = of_configuration
        self._functions = function, rate, jacobian

    def rows(self, robot: Robot) -> tuple[Row, ...]:
        return tuple(Row(f"g{i}", self.unit) for i in range(self.dimension))

    def stages(self, robot: Robot) -> tuple[Stage, ...]:
        name, also_q = f"callable reference {called(self._functions[0])}", self.of_configuration
        callback = Differentiated(*self._functions, self.dimension, name, of_configuration=also_q)
        return (stage(self.dimension, robot.n, callback),)
