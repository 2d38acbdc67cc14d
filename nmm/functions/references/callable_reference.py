"""A user's own g(t) or g(t, q), written in Python."""

from __future__ import annotations

from collections.abc import Callable

from numpy.typing import ArrayLike

from nmm.errors import InputError
from nmm.functions.callbacks import Differentiated, TimeConfigurationFunction, called, stage
from nmm.functions.function import Function, Row, Stage
from nmm.robots.configuration import Configuration
from nmm.robots.robot import Robot


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
        if dimension < 1:
            raise InputError(f"dimension: expected at least 1, got {dimension}")
        if jacobian is not None and not of_configuration:
            raise InputError(
                "callable reference: a jacobian was given, expected of_configuration=True with it"
            )
        self.dimension = dimension
        self.unit = unit
        self.of_configuration = of_configuration
        self._called = called(function)
        self._function = self._with_configuration(function)
        self._rate = None if rate is None else self._with_configuration(rate)
        self._jacobian = jacobian

    def _with_configuration(self, function: Callable[..., ArrayLike]) -> TimeConfigurationFunction:
        if self.of_configuration:
            return function

        def of_time(t: float, configuration: Configuration) -> ArrayLike:
            return function(t)

        return of_time

    def rows(self, robot: Robot) -> tuple[Row, ...]:
        return tuple(Row(f"g{i}", self.unit) for i in range(self.dimension))

    def stages(self, robot: Robot) -> tuple[Stage, ...]:
        callback = Differentiated(
            self._function,
            self._rate,
            self._jacobian,
            self.dimension,
            f"callable reference {self._called}",
            depends_on_configuration=self.of_configuration,
        )
        return (stage(self.dimension, robot.n, callback),)
