"""A user's own H(q), written in Python."""

from __future__ import annotations

from collections.abc import Callable

from numpy.typing import ArrayLike

from nmm.functions.callbacks import of_configuration
from nmm.functions.function import Stage
from nmm.functions.objectives.base import Objective
from nmm.robots.configuration import Configuration
from nmm.robots.robot import Robot


class CallableObjective(Objective):
    """H from a Python function of a `Configuration`.

    Parameters
    ----------
    function : configuration -> H
    gradient : configuration -> ∂H/∂q, shape (n,); central differences when not given

    Examples
    --------
    >>> robot = nmm.load("unicycle_2r")
    >>> q2 = robot.coordinate("q2")
    >>> H = nmm.CallableObjective(lambda here: 0.5 * (here.q[q2] - 1) ** 2)
    >>> H.gradient(nmm.Configuration(robot, robot.rest)).round(3)
    array([ 0.,  0.,  0.,  0., -1.])
    """

    def __init__(
        self,
        function: Callable[[Configuration], float],
        gradient: Callable[[Configuration], ArrayLike] | None = None,
    ) -> None:
        self.function = function
        self._gradient = gradient

    def stages(self, robot: Robot) -> tuple[Stage, ...]:
        return of_configuration(self.function, self._gradient, 1, "callable objective", robot, "gradient")
