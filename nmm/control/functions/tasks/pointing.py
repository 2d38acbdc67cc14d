"""Directions fixed in a frame: their heading about a world axis, and their deviation from a point."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from nmm.base.arrays import Array, nonzero_vector
from nmm.base.errors import expect_known
from nmm.base.kernels.compiled import kernel, scratch
from nmm.base.kernels.records import FUNCTION, At, Frames, Rows
from nmm.base.kernels.rotations import transposed_times3
from nmm.control.functions.function import Function, Row, Shown, Stage
from nmm.control.functions.references.polynomial import Constant
from nmm.control.functions.tasks.position import as_point, check_point
from nmm.model.robots.robot import Robot

UNIT = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}
#: For each world axis, the two that span the plane in which the angle is measured, right-handed.
PLANES = {"x": ("y", "z"), "y": ("z", "x"), "z": ("x", "y")}


@kernel(FUNCTION)
def heading(at: At, frames: Frames, numbers: Array, rows: Rows) -> None:
    """ψ = atan2(e2·d, e1·d), d = R a, with d_dot = ω × d; numbers = [a, e1, e2]."""
    frame = frames.slots[0]
    d = scratch(3)
    for i in range(3):
        d[i] = 0.0
        for j in range(3):
            d[i] += frames.placements[frame, i, j] * numbers[j]
    c = 0.0
    s = 0.0
    for i in range(3):
        c += numbers[3 + i] * d[i]
        s += numbers[6 + i] * d[i]
    rows.value[0] = math.atan2(s, c)
    square = c * c + s * s
    for k in range(at.q.shape[0]):
        wx = frames.jacobians[frame, 3, k]
        wy = frames.jacobians[frame, 4, k]
        wz = frames.jacobians[frame, 5, k]
        dx = wy * d[2] - wz * d[1]
        dy = wz * d[0] - wx * d[2]
        dz = wx * d[1] - wy * d[0]
        c_q = numbers[3] * dx + numbers[4] * dy + numbers[5] * dz
        s_q = numbers[6] * dx + numbers[7] * dy + numbers[8] * dz
        rows.value_q[0, k] = (c * s_q - s * c_q) / square


def unit_vector(value: str | ArrayLike, name: str) -> Array:
    """An axis by its name, x, y or z, or three numbers, as a unit vector (3,)."""
    if isinstance(value, str):
        expect_known(name, value, UNIT, name)
        value = UNIT[value]
    direction = nonzero_vector(value, 3, name)
    return np.asarray(direction / float(np.linalg.norm(direction)))


class Heading(Function):
    """Angle ψ (rad, in (-π, π]) of a direction fixed in `frame`, about a world axis.

    For a planar robot's link it is θ + q1 + ... , the link's absolute orientation.

    Parameters
    ----------
    frame : a frame of the robot
    direction : x, y, z or three numbers, in the frame's axes
    about : world axis x, y or z of the angle, which counts from the next axis (about z: from x towards y)

    Examples
    --------
    >>> robot = nmm.load("unicycle_2r")
    >>> here = nmm.Configuration(robot, robot.q({"theta": 0.5, "q1": 0.2}))
    >>> nmm.evaluate(nmm.Heading("ee"), 0.0, here).value.round(3)
    array([0.7])
    """

    def __init__(self, frame: str, direction: str | ArrayLike = "x", about: str = "z") -> None:
        self.frame = frame
        self.direction = unit_vector(direction, "direction")
        expect_known("axis", about, PLANES, "about")
        self.about = about

    def rows(self, robot: Robot) -> tuple[Row, ...]:
        robot.frame_id(self.frame)
        return (Row(f"{self.frame}.heading", "rad", angular=True),)

    def stages(self, robot: Robot) -> tuple[Stage, ...]:
        e1, e2 = (UNIT[axis] for axis in PLANES[self.about])
        return (Stage(heading, 1, (self.frame,), np.concatenate([self.direction, e1, e2])),)


@kernel(FUNCTION)
def pointing(at: At, frames: Frames, numbers: Array, rows: Rows) -> None:
    """y_i = (α / s) s_i by the chain rule, in place: the first three rows hold the point and its derivatives.
    With l, the point as the frame sees it: s_i = b_i·l, s² = s_1² + s_2², c = a·l, α = atan2(s, c); numbers =
    [a, b_1, b_2]. With k = α/s and r² = s² + c²:
    dy_i = k ds_i + s_i (m (s_1 ds_1 + s_2 ds_2) - dc / r²), m = (c / r² - k) / s²."""
    frame = frames.placements[frames.slots[0]]
    d, seen, x = scratch(3), scratch(3), scratch(3)
    for i in range(3):
        d[i] = rows.value[i] - frame[i, 3]
    transposed_times3(frame, d, seen)
    c, s1, s2 = 0.0, 0.0, 0.0
    for i in range(3):
        c += numbers[i] * seen[i]
        s1 += numbers[3 + i] * seen[i]
        s2 += numbers[6 + i] * seen[i]
    square = s1 * s1 + s2 * s2
    s = math.sqrt(square)
    r2 = square + c * c
    nowhere = s == 0.0 and c <= 0.0  # straight behind, or in the frame's origin: no derivative exists
    if c > 0.0 and square < 1e-10 * c * c:  # α / s by its series in s / c
        k = (1.0 - square / (3.0 * c * c)) / c
        m = (-2.0 / 3.0 + 0.8 * square / (c * c)) / (c * c * c)
    elif nowhere:
        k, m = 0.0, 0.0
    else:
        k = math.atan2(s, c) / s
        m = (c / r2 - k) / square
    rows.value[0] = math.pi if nowhere else k * s1
    rows.value[1] = k * s2
    for column in range(-1, at.q.shape[0]):  # -1: the time
        if column < 0:
            for i in range(3):
                x[i] = rows.value_t[i]
        else:
            j = frames.jacobians[frames.slots[0]]
            wx, wy, wz = j[3, column], j[4, column], j[5, column]
            x[0] = rows.value_q[0, column] - j[0, column] - (wy * d[2] - wz * d[1])
            x[1] = rows.value_q[1, column] - j[1, column] - (wz * d[0] - wx * d[2])
            x[2] = rows.value_q[2, column] - j[2, column] - (wx * d[1] - wy * d[0])
        transposed_times3(frame, x, seen)
        dc, ds1, ds2 = 0.0, 0.0, 0.0
        for i in range(3):
            dc += numbers[i] * seen[i]
            ds1 += numbers[3 + i] * seen[i]
            ds2 += numbers[6 + i] * seen[i]
        common = 0.0 if nowhere else m * (s1 * ds1 + s2 * ds2) - dc / r2
        if column < 0:
            rows.value_t[0] = k * ds1 + s1 * common
            rows.value_t[1] = k * ds2 + s2 * common
        else:
            rows.value_q[0, column] = k * ds1 + s1 * common
            rows.value_q[1, column] = k * ds2 + s2 * common


class Pointing(Function):
    """Deviation of a frame's axis from a point: y (2,), rad, 0 where the axis points at it.

    |y| is the angle α between the axis a and the direction from the frame's origin to the point; the
    components of y are along b_1 and b_2, which complete a to right-handed axes of the frame (x and y for a =
    z). The turn about a is free. As a task: `Task(Pointing(...), [0, 0])`. y is smooth for α < π. With the
    point straight behind, y = (π, 0); there, and with the point in the frame's origin, no derivative exists:
    it is set to zero, so that resolvers report a singular matrix.

    Parameters
    ----------
    frame : a frame of the robot
    at : a point: three numbers (world axes, m), a frame's name (its origin), or a function of three rows
        (circle, spline, position, ...)
    axis : x, y, z or three numbers, in the frame's axes

    Examples
    --------
    >>> robot = nmm.load("unicycle_3r")
    >>> here = nmm.Configuration(robot, robot.rest)
    >>> nmm.evaluate(nmm.Pointing("base_footprint", at=[2, 1, 0], axis="x"), 0.0, here).value.round(3)
    array([0.464, 0.   ])
    """

    def __init__(self, frame: str, at: Function | str | ArrayLike, axis: str | ArrayLike = "z") -> None:
        self.frame = frame
        self.at = as_point(at, "at")
        self.axis = unit_vector(axis, "axis")

    def rows(self, robot: Robot) -> tuple[Row, ...]:
        robot.frame_id(self.frame)
        check_point(self.at, self.frame, robot, "at")
        return (Row(f"{self.frame}.pointing_1", "rad"), Row(f"{self.frame}.pointing_2", "rad"))

    def stages(self, robot: Robot) -> tuple[Stage, ...]:
        self.rows(robot)
        b1 = np.eye(3)[np.argmin(np.abs(self.axis))]
        b1 = b1 - (b1 @ self.axis) * self.axis
        b1 /= np.linalg.norm(b1)
        axes = np.concatenate([self.axis, b1, np.cross(self.axis, b1)])
        return (*self.at.stages(robot), Stage(pointing, 3, (self.frame,), axes))

    def shown(self) -> Shown:
        return Shown(turns=self.frame, looks_at=self.at.value if isinstance(self.at, Constant) else None)
