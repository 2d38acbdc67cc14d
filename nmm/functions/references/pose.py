"""A pose as a reference, from a position and an orientation."""

from __future__ import annotations

from numpy.typing import ArrayLike

from nmm.arrays import vector
from nmm.errors import InputError
from nmm.functions.function import Function, Row, Stage
from nmm.functions.references.orientation import RotationVector
from nmm.functions.references.polynomial import Constant
from nmm.functions.stacking import stacked
from nmm.robots.robot import Robot


class PoseReference(Function):
    """A position over an orientation, (6,): the target of a pose.

    Parameters
    ----------
    position : three numbers (world axes, m), or a function with three rows, of time or the configuration
    orientation : a rotation vector, rad, or a function with three rows, read as one (slerp, turn, orientation
        of another frame, ...)

    Examples
    --------
    >>> robot = nmm.load("unicycle_3r")
    >>> target = nmm.PoseReference(nmm.Line([0, 0, 1], [1, 0, 1], duration=2), [0, 0, 0.5])
    >>> nmm.evaluate(target, 1.0, nmm.Configuration(robot, robot.rest)).value
    array([0.5, 0. , 1. , 0. , 0. , 0.5])
    """

    def __init__(self, position: Function | ArrayLike, orientation: Function | RotationVector) -> None:
        self.position = _three(position, "position", "m")
        self.orientation = _three(orientation, "orientation", "rad")

    def rows(self, robot: Robot) -> tuple[Row, ...]:
        rows = []
        for name, unit in (("position", "m"), ("orientation", "rad")):
            found = getattr(self, name).rows(robot)
            if len(found) != 3:
                came = ", ".join(f"{row.name} ({row.unit})" for row in found)
                raise InputError(f"{name}: expected three components, {unit}, got {came}")
            rows += [Row(row.name, unit) for row in found]
        return tuple(rows)

    def stages(self, robot: Robot) -> tuple[Stage, ...]:
        self.rows(robot)
        return stacked((self.position, self.orientation), robot)


def _three(given: Function | ArrayLike, name: str, unit: str) -> Function:
    return given if isinstance(given, Function) else Constant(vector(given, 3, name), unit)
