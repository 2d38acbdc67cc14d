"""Distance of a frame's origin from a point that rests, moves, or is a part of the robot."""

from __future__ import annotations

import math

from numpy.typing import ArrayLike

from nmm.arrays import Array
from nmm.functions.function import Function, Row, Stage
from nmm.functions.tasks.position import as_point, check_point
from nmm.kernels.compiled import kernel, scratch
from nmm.kernels.records import FUNCTION, At, Frames, Rows
from nmm.robots.robot import Robot


@kernel(FUNCTION)
def distance(at: At, frames: Frames, numbers: Array, rows: Rows) -> None:
    """|d|, d = point - p, by the chain rule, in place: the first three rows hold the point."""
    d = scratch(3)
    for i in range(3):
        d[i] = rows.value[i] - frames.placements[frames.slots[0], i, 3]
    length = math.sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2])
    for i in range(3):  # at 0 no derivative exists
        d[i] = d[i] / length if length > 0.0 else 0.0
    rows.value[0] = length
    rows.value_t[0] = d[0] * rows.value_t[0] + d[1] * rows.value_t[1] + d[2] * rows.value_t[2]
    for k in range(at.q.shape[0]):
        rate = 0.0
        for i in range(3):
            rate += d[i] * (rows.value_q[i, k] - frames.jacobians[frames.slots[0], i, k])
        rows.value_q[0, k] = rate


class Distance(Function):
    """Distance (m) of a frame's origin from another frame's, or from a point.

    At 0 no derivative exists; zeros stand for it, so that resolvers report a singular matrix. For two points
    that shall meet, use `Position`.

    Parameters
    ----------
    frame : a frame of the robot
    to : the point: the name of another frame (its origin), three numbers (world axes, m), or a function with
        three rows, of time (circle, spline, ...) or of the configuration (center_of_mass)

    Examples
    --------
    >>> robot = nmm.load("unicycle_2r")
    >>> here = nmm.Configuration(robot, robot.rest)
    >>> nmm.evaluate(nmm.Distance("base_footprint", to=[3, 4, 0]), 0.0, here).value
    array([5.])
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
