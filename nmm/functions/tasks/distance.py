"""Distance of a frame's origin from a point that rests, moves, or is a part of the robot."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from nmm.arrays import Array
from nmm.functions.function import Function, Row, Stage
from nmm.functions.tasks.position import as_point, check_point
from nmm.kernels.compiled import FUNCTION, kernel
from nmm.robots.robot import Robot


@kernel(FUNCTION)
def distance(
    t: float, q: Array, placements: Array, jacobians: Array, hessians: Array, G: Array, G_q: Array,
    slots: Array, parameters: Array, value: Array, value_t: Array, value_q: Array,
) -> None:  # fmt: skip
    """|d|, d = point - p, by the chain rule, in place: the first three rows hold the point."""
    d = np.empty(3)
    for i in range(3):
        d[i] = value[i] - placements[slots[0], i, 3]
    length = math.sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2])
    for i in range(3):  # at 0 no derivative exists
        d[i] = d[i] / length if length > 0.0 else 0.0
    value[0] = length
    value_t[0] = d[0] * value_t[0] + d[1] * value_t[1] + d[2] * value_t[2]
    for k in range(q.shape[0]):
        rate = 0.0
        for i in range(3):
            rate += d[i] * (value_q[i, k] - jacobians[slots[0], i, k])
        value_q[0, k] = rate


class Distance(Function):
    """Distance (m) of a frame's origin from another frame's, or from a point.

    At 0 no derivative exists; zeros stand for it, so that resolvers report a singular matrix. For two points
    that shall meet, use `Position`.

    Parameters
    ----------
    frame : a frame of the robot
    to : the name of another (its origin), three numbers (world axes, m), or a function with three rows,
        of time (`Circle`, `Spline`, ...) or of the configuration (`CenterOfMass`)
    """

    def __init__(self, frame: str, to: Function | str | ArrayLike) -> None:
        self.frame = frame
        self.to = as_point(to, "to")

    def rows(self, robot: Robot) -> tuple[Row, ...]:
        robot.frame_id(self.frame)
        check_point(self.to, self.frame, robot, "to")
        return (Row(f"{self.frame}.distance", "m"),)

    def stages(self, robot: Robot) -> tuple[Stage, ...]:
        self.rows(robot)
        return (*self.to.stages(robot), Stage(distance, 3, (self.frame,)))
