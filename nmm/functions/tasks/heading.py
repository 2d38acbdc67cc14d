"""Heading: the absolute angle of a link about a world axis (paper, sections V-A and VI-3)."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from nmm.arrays import Array, vector
from nmm.errors import InputError, expect_known
from nmm.functions.function import Function, Row, Stage
from nmm.kernels.compiled import kernel, scratch
from nmm.kernels.records import FUNCTION, At, Frames, Rows
from nmm.robots.robot import Robot

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


class Heading(Function):
    """Angle ψ (rad, in (-π, π]) of a direction fixed in `frame`, about a world axis.

    For a planar robot's link it is θ + q1 + ... , the link's absolute orientation.

    Parameters
    ----------
    frame : a frame of the robot
    direction : whose angle is taken: x, y, z or three numbers, in the frame's axes
    about : world axis x, y or z about which the angle is measured, from the next axis in the cyclic order
        x, y, z (about z: from x towards y)

    Examples
    --------
    >>> robot = nmm.load("unicycle_2r")
    >>> here = nmm.Configuration(robot, robot.q({"theta": 0.5, "q1": 0.2}))
    >>> nmm.evaluate(nmm.Heading("ee"), 0.0, here).value.round(3)
    array([0.7])
    """

    def __init__(self, frame: str, direction: str | ArrayLike = "x", about: str = "z") -> None:
        self.frame = frame
        if isinstance(direction, str):
            expect_known("direction", direction, UNIT, "direction")
            direction = UNIT[direction]
        self.direction = vector(direction, 3, "direction")
        length = float(np.linalg.norm(self.direction))
        if length == 0.0:
            raise InputError("direction: expected a vector that is not zero")
        self.direction /= length
        expect_known("axis", about, PLANES, "about")
        self.about = about

    def rows(self, robot: Robot) -> tuple[Row, ...]:
        robot.frame_id(self.frame)
        return (Row(f"{self.frame}.heading", "rad", angular=True),)

    def stages(self, robot: Robot) -> tuple[Stage, ...]:
        e1, e2 = (UNIT[axis] for axis in PLANES[self.about])
        return (Stage(heading, 1, (self.frame,), np.concatenate([self.direction, e1, e2])),)
