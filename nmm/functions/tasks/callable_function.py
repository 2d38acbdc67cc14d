"""A user's own f(q), written in Python."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from numpy.typing import ArrayLike

from nmm.arrays import positive
from nmm.errors import InputError
from nmm.functions.callbacks import of_configuration
from nmm.functions.function import Function, Row, Stage
from nmm.robots.configuration import Configuration
from nmm.robots.robot import Robot
from nmm.words import listed


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
        given = {"units": len(units), "angular flags": len(angular)}
        sizes: Sequence[float | None] = [None] * len(names)
        if scales is not None:
            given["scales"] = len(scales)
            sizes = [positive(scale, "callable function: scale") for scale in scales]
        if not names or any(count != len(names) for count in given.values()):
            wanted, came = listed(list(given)), listed([f"{count} {what}" for what, count in given.items()])
            raise InputError(
                f"callable function: expected as many {wanted} as names ({len(names)}), got {came}"
            )
        self._rows = tuple(Row(*row) for row in zip(names, units, angular, sizes, strict=True))

    def rows(self, robot: Robot) -> tuple[Row, ...]:
        return self._rows

    def stages(self, robot: Robot) -> tuple[Stage, ...]:
        return of_configuration(self.function, self.jacobian, len(self._rows), "callable function", robot)
