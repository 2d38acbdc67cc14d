"""A user's own f(q), written in Python."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from numpy.typing import ArrayLike

from nmm.errors import InputError
from nmm.functions.callbacks import differentiated, stage
from nmm.functions.function import Function, Row, Stage
from nmm.robots.configuration import Configuration
from nmm.robots.robot import Robot


class CallableFunction(Function):
    """f(q) from a Python function of a `Configuration`.

    Parameters
    ----------
    function : configuration -> value, s numbers
    names : names of the s components
    units : their units (1 when not given)
    angular : which of them are angles whose differences wrap (none when not given)
    jacobian : configuration -> df/dq, shape (s, n); central differences when not given
    """

    def __init__(
        self,
        function: Callable[[Configuration], ArrayLike],
        names: Sequence[str],
        *,
        units: Sequence[str] | None = None,
        angular: Sequence[bool] | None = None,
        jacobian: Callable[[Configuration], ArrayLike] | None = None,
    ) -> None:
        self.function = function
        self.jacobian = jacobian
        units = ["1"] * len(names) if units is None else units
        angular = [False] * len(names) if angular is None else angular
        if not names or not len(names) == len(units) == len(angular):
            raise InputError(
                f"callable function: expected as many units and angular flags as names ({len(names)}), "
                f"got {len(units)} and {len(angular)}"
            )
        self._rows = tuple(Row(*row) for row in zip(names, units, angular, strict=True))

    def rows(self, robot: Robot) -> tuple[Row, ...]:
        return self._rows

    def stages(self, robot: Robot) -> tuple[Stage, ...]:
        function, jacobian = self.function, self.jacobian
        callback = differentiated(
            lambda t, configuration: function(configuration),
            None,
            None if jacobian is None else lambda t, configuration: jacobian(configuration),
            len(self._rows),
            "callable function",
            depends_on_time=False,
        )
        return (stage(len(self._rows), robot.n, callback),)
