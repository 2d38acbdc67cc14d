"""Posture: coordinates as they are, by default all of the manipulator's that follow no other."""

from __future__ import annotations

from nmm.errors import InputError
from nmm.functions.function import Function, Row, Stage
from nmm.functions.tasks.coordinates import Coordinates
from nmm.robots.robot import Robot


class Posture(Function):
    """The values of given coordinates, rad and m, a row each; angles are not wrapped.

    Parameters
    ----------
    names : names of coordinates; all of the manipulator's, but those that follow others, when none is given

    Examples
    --------
    >>> robot = nmm.load("unicycle_2r")
    >>> here = nmm.Configuration(robot, robot.q({"q1": 0.2, "q2": 0.4}))
    >>> nmm.evaluate(nmm.Posture("q1", "q2"), 0.0, here).value
    array([0.2, 0.4])
    """

    def __init__(self, *names: str) -> None:
        for name in names:
            if not isinstance(name, str):
                raise InputError(
                    f"posture: expected names of coordinates, got {name!r} (Coordinates takes combinations)"
                )
        if len(set(names)) != len(names):
            raise InputError(f"posture: expected each coordinate once, got {', '.join(names)}")
        self.names = names

    def rows(self, robot: Robot) -> tuple[Row, ...]:
        return self._coordinates(robot).rows(robot)

    def stages(self, robot: Robot) -> tuple[Stage, ...]:
        return self._coordinates(robot).stages(robot)

    def _coordinates(self, robot: Robot) -> Coordinates:
        names = self.names or robot.u_names[robot.platform.p :]
        if not names:
            raise InputError(f"posture: expected names of coordinates, {robot.name} has no manipulator")
        return Coordinates(*names)
