"""Position of a frame's origin (paper, eq. 14) or of the centre of mass; distance of a frame from a point."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from nmm.base.arrays import Array, vector
from nmm.base.errors import InputError, expect
from nmm.base.kernels.compiled import kernel, scratch
from nmm.base.kernels.linear_algebra import copied
from nmm.base.kernels.records import FUNCTION, At, Frames, Rows
from nmm.control.functions.function import Function, Row, Stage, named
from nmm.control.functions.references.polynomial import Constant
from nmm.control.functions.tasks.pose import PartsOfPose, frame_pose
from nmm.model.robots.robot import CENTER_OF_MASS, Robot

AXES = {"x": 0, "y": 1, "z": 2}


@kernel(FUNCTION)
def position(at: At, frames: Frames, numbers: Array, rows: Rows) -> None:
    """p(q) and its Jacobian, rows picked by `numbers` (0, 1, 2 for x, y, z)."""
    frame = frames.slots[0]
    for i in range(numbers.shape[0]):
        axis = int(numbers[i])
        rows.value[i] = frames.placements[frame, axis, 3]
        copied(frames.jacobians[frame, axis], rows.value_q[i])


def picked_axes(axes: str | Sequence[str]) -> tuple[str, ...]:
    picked = tuple(axes)
    once = picked and len(set(picked)) == len(picked) and set(picked) <= set(AXES)
    expect(once, "axes", "some of x, y, z, each once (as in 'xy')", axes)
    return picked


class Position(PartsOfPose):
    """Position (m) of the origin of `frame`, in world axes or as another frame sees it.

    Parameters
    ----------
    frame : a frame of the robot
    axes : some of x, y, z in the order wanted: "xy", "xyz", "z"
    relative_to : a frame of the robot from which, in its axes, it is measured; the world when not given

    Examples
    --------
    >>> robot = nmm.load("unicycle_2r")
    >>> here = nmm.Configuration(robot, robot.q({"q1": np.pi / 2}))
    >>> nmm.evaluate(nmm.Position("ee", "xy"), 0.0, here).value.round(3)
    array([0.3, 0.8])
    """

    def __init__(self, frame: str, axes: str | Sequence[str] = "xyz", relative_to: str | None = None) -> None:
        super().__init__(frame, relative_to)
        self.axes = self.parts = picked_axes(axes)

    def stages(self, robot: Robot) -> tuple[Stage, ...]:
        if self.relative_to is not None:
            return super().stages(robot)
        picked = np.array([float(AXES[axis]) for axis in self.axes])
        return (Stage(position, len(self.axes), (self.frame,), picked),)


def as_point(value: Function | str | ArrayLike, name: str) -> Function:
    """The function of a point: one with 3 rows as it is, a frame's origin by name, three numbers (m)."""
    if isinstance(value, Function):
        return value
    if isinstance(value, str):
        return Position(value)
    return Constant(vector(value, 3, name))


def check_point(point: Function, frame: str, robot: Robot, name: str) -> None:
    """`InputError` unless the function has x, y and z in world axes and is not the origin of `frame`."""
    rows = point.rows(robot)
    spatial = len(rows) == 3 and all(row.unit != "rad" for row in rows)
    expect(spatial, name, "a point with x, y and z in m", named(rows))
    seen_from = getattr(point, "relative_to", None)
    if seen_from is not None:
        raise InputError(f"it is in the axes of {seen_from}", where=name, expected="a point in world axes")
    if isinstance(point, Position) and robot.frame_id(point.frame) == robot.frame_id(frame):
        raise InputError(where=name, expected=f"another point than the origin of {frame} itself")


class CenterOfMass(Function):
    """Position (m) of the centre of mass of the whole robot, platform included.

    Parameters
    ----------
    axes : some of x, y, z in the order wanted: "xy", "xyz", "z"
    relative_to : a frame of the robot from which, in its axes, it is measured; the world when not given

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
        mass = sum(inertia.mass for inertia in robot.model.inertias)
        expected = f"a robot with mass, {robot.name} has none (its file states no <inertial>)"
        expect(mass > 0.0, "centre of mass", expected)
        where = ""
        if self.relative_to is not None:
            robot.frame_id(self.relative_to)
            where = f" in {self.relative_to}"
        return tuple(Row(f"com.{axis}{where}", "m") for axis in self.axes)

    def stages(self, robot: Robot) -> tuple[Stage, ...]:
        self.rows(robot)
        picked = np.array([float(AXES[axis]) for axis in self.axes])
        if self.relative_to is None:
            return (Stage(position, len(picked), (CENTER_OF_MASS,), picked),)
        return (Stage(frame_pose, len(picked), (CENTER_OF_MASS, self.relative_to), picked),)


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

    Its derivative is set to zero at 0, where none exists, so that resolvers report a singular matrix. To make
    two points meet, use `Position`.

    Parameters
    ----------
    frame : a frame of the robot
    to : a point: three numbers (world axes, m), a frame's name (its origin), or a function of three rows
        (circle, spline, position, ...)

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
