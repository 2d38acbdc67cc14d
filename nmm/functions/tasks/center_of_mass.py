"""The robot's centre of mass along any of the world's axes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from nmm.errors import InputError
from nmm.functions.function import Function, Row, Stage
from nmm.functions.tasks.position import AXES, picked_axes, position
from nmm.robots.robot import CENTER_OF_MASS, Robot


class CenterOfMass(Function):
    """Position (m, world axes) of the centre of mass of the whole robot, platform included.

    Parameters
    ----------
    axes : some of x, y, z in the order wanted: "xy", "xyz", "z"
    """

    def __init__(self, axes: str | Sequence[str] = "xyz") -> None:
        self.axes = picked_axes(axes)

    def rows(self, robot: Robot) -> tuple[Row, ...]:
        if not sum(inertia.mass for inertia in robot.model.inertias) > 0.0:
            raise InputError(
                f"centre of mass: expected a robot with mass, {robot.name} has none "
                "(its file states no <inertial>)"
            )
        return tuple(Row(f"com.{axis}", "m") for axis in self.axes)

    def stages(self, robot: Robot) -> tuple[Stage, ...]:
        self.rows(robot)
        picked = np.array([float(AXES[axis]) for axis in self.axes])
        return (Stage(position, len(self.axes), (CENTER_OF_MASS,), picked),)
