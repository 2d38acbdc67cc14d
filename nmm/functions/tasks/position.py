"""Position of a frame's origin along any of the world's axes (paper, eq. 14), or of another frame's."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from nmm.arrays import Array, vector
from nmm.errors import InputError
from nmm.functions.function import Function, Stage
from nmm.functions.references.polynomial import Constant
from nmm.functions.tasks.frame_pose import PartsOfPose
from nmm.kernels.compiled import kernel
from nmm.kernels.records import FUNCTION, At, Frames, Rows
from nmm.robots.robot import Robot

AXES = {"x": 0, "y": 1, "z": 2}


@kernel(FUNCTION)
def position(at: At, frames: Frames, numbers: Array, rows: Rows) -> None:
    """p(q) and its Jacobian, rows picked by `numbers` (0, 1, 2 for x, y, z)."""
    frame = frames.slots[0]
    for i in range(numbers.shape[0]):
        axis = int(numbers[i])
        rows.value[i] = frames.placements[frame, axis, 3]
        for j in range(at.q.shape[0]):
            rows.value_q[i, j] = frames.jacobians[frame, axis, j]


def picked_axes(axes: str | Sequence[str]) -> tuple[str, ...]:
    """Some of x, y, z, each once."""
    picked = tuple(axes)
    if not picked or len(set(picked)) != len(picked) or not set(picked) <= set(AXES):
        raise InputError(f"axes: expected some of x, y, z, each once (as in 'xy'), got {axes!r}")
    return picked


class Position(PartsOfPose):
    """Position (m) of the origin of `frame`, in world axes or as another frame sees it.

    Parameters
    ----------
    frame : a frame of the robot
    axes : some of x, y, z in the order wanted: "xy", "xyz", "z"
    relative_to : a frame of the robot that sees it, from its origin and in its axes (two arms that hold one
        thing); the world when not given

    Examples
    --------
    >>> robot = nmm.load("unicycle_2r")
    >>> here = nmm.Configuration(robot, robot.q({"q1": np.pi / 2}))
    >>> nmm.evaluate(nmm.Position("ee", "xy"), 0.0, here).value.round(3)
    array([0.3, 0.8])
    """

    def __init__(self, frame: str, axes: str | Sequence[str] = "xyz", relative_to: str | None = None) -> None:
        self.frame = frame
        self.axes = self.parts = picked_axes(axes)
        self.relative_to = relative_to

    def stages(self, robot: Robot) -> tuple[Stage, ...]:
        if self.relative_to is not None:
            return super().stages(robot)
        picked = np.array([float(AXES[axis]) for axis in self.axes])
        return (Stage(position, len(self.axes), (self.frame,), picked),)


def as_point(given: Function | str | ArrayLike, name: str) -> Function:
    """A point of space: a function with 3 rows as it is, a frame's origin by its name, three numbers, m."""
    if isinstance(given, Function):
        return given
    if isinstance(given, str):
        return Position(given)
    return Constant(vector(given, 3, name))


def check_point(point: Function, frame: str, robot: Robot, name: str) -> None:
    """`InputError` when the function has not x, y and z in world axes, or is the origin of `frame` itself."""
    rows = point.rows(robot)
    if len(rows) != 3 or any(row.unit == "rad" for row in rows):
        came = ", ".join(f"{row.name} ({row.unit})" for row in rows)
        raise InputError(f"{name}: expected a point with x, y and z in m, got {came}")
    seen_from = getattr(point, "relative_to", None)
    if seen_from is not None:
        raise InputError(f"{name}: expected a point in world axes, got one in {seen_from}'s")
    if isinstance(point, Position) and robot.frame_id(point.frame) == robot.frame_id(frame):
        raise InputError(f"{name}: expected another point than the origin of {frame} itself")
