"""The robot's centre of mass along any of the world's axes, or of a frame's that sees it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from nmm.errors import InputError
from nmm.functions.function import Function, Row, Stage
from nmm.functions.tasks.frame_pose import frame_pose
from nmm.functions.tasks.position import AXES, picked_axes, position
from nmm.robots.robot import CENTER_OF_MASS, Robot


class CenterOfMass(Function):
    """Position (m) of the centre of mass of the whole robot, platform included.

    Parameters
    ----------
    axes : some of x, y, z in the order wanted: "xy", "xyz", "z"
    relative_to : a frame of the robot that sees it, from its origin and in its axes (the platform's, to keep
        it above the wheels); the world when not given

    Examples
    --------
    >>> robot = nmm.load("unicycle_3r")
    >>> over_the_wheels = nmm.CenterOfMass("xy", relative_to="base_footprint")
    >>> ahead = nmm.Configuration(robot, robot.q({"q2": np.pi / 2}))
    >>> nmm.evaluate(over_the_wheels, 0.0, ahead).value.round(3) + 0.0
    array([0.22, 0.  ])
    """

    def __init__(self, axes: str | Sequence[str] = "xyz", relative_to: str | None = None) -> None:
        self.axes = picked_axes(axes)
        self.relative_to = relative_to

    def rows(self, robot: Robot) -> tuple[Row, ...]:
        if not sum(inertia.mass for inertia in robot.model.inertias) > 0.0:
            raise InputError(
                f"centre of mass: expected a robot with mass, {robot.name} has none "
                "(its file states no <inertial>)"
            )
        where = ""
        if self.relative_to is not None:
            robot.frame_id(self.relative_to)
            where = f" in {self.relative_to}"
        return tuple(Row(f"com.{axis}{where}", "m") for axis in self.axes)

    def stages(self, robot: Robot) -> tuple[Stage, ...]:
        self.rows(robot)
        picked = np.array([float(AXES[axis]) for axis in self.axes])
        if self.relative_to is not None:
            return (Stage(frame_pose, len(self.axes), (CENTER_OF_MASS, self.relative_to), picked),)
        return (Stage(position, len(self.axes), (CENTER_OF_MASS,), picked),)
