"""Position of a frame's origin along any of the world's axes (paper, eq. 14)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from nmm.arrays import Array
from nmm.compiled import FUNCTION, kernel
from nmm.errors import InputError
from nmm.function import Function, Row, Stage
from nmm.robot import Robot

AXES = {"x": 0, "y": 1, "z": 2}


@kernel(FUNCTION)
def position(
    t: float, q: Array, placements: Array, jacobians: Array, hessians: Array, G: Array, G_q: Array,
    slots: Array, parameters: Array, value: Array, value_t: Array, value_q: Array,
) -> None:  # fmt: skip
    """p(q) and its Jacobian, rows picked by `parameters` (0, 1, 2 for x, y, z)."""
    frame = slots[0]
    for i in range(parameters.shape[0]):
        axis = int(parameters[i])
        value[i] = placements[frame, axis, 3]
        for j in range(q.shape[0]):
            value_q[i, j] = jacobians[frame, axis, j]


class Position(Function):
    """Position (m, world axes) of the origin of `frame`.

    Parameters
    ----------
    frame : a frame of the robot
    axes : any of "x", "y", "z", in the order wanted: "xy", "xyz", "z", ("x", "z")
    """

    def __init__(self, frame: str, axes: str | Sequence[str] = "xyz") -> None:
        self.frame = frame
        self.axes = tuple(axes)
        if not self.axes or len(set(self.axes)) != len(self.axes) or not set(self.axes) <= set(AXES):
            raise InputError(f"axes: expected some of x, y, z, each once (as in 'xy'), got {axes!r}")

    def rows(self, robot: Robot) -> tuple[Row, ...]:
        robot.frame_id(self.frame)
        return tuple(Row(f"{self.frame}.{axis}", "m") for axis in self.axes)

    def stages(self, robot: Robot) -> tuple[Stage, ...]:
        picked = np.array([float(AXES[axis]) for axis in self.axes])
        return (Stage(position, len(self.axes), (self.frame,), picked),)
