"""The speed of a frame's origin, as a limit: near people a robot's hand is slow."""

from __future__ import annotations

import math

import numpy as np

from nmm.base.arrays import Array, positive
from nmm.base.errors import expect_kind
from nmm.base.kernels.compiled import clear, kernel, scratch
from nmm.base.kernels.linear_algebra import dot
from nmm.base.kernels.records import Frames
from nmm.control.limits.limit import (
    LIMIT_ROWS,
    LIMIT_VALUES,
    Limit,
    LimitRows,
    LimitSample,
    LimitStage,
    RowLimit,
    by_inputs,
    checked_priority,
)
from nmm.model.robots.robot import Robot

#: Half the length of the box, as a share of the speed, where the frame keeps its velocity.
ALONG = 0.99
#: Below this share of the speed the previous velocity has no direction.
SLOW = 1e-3


@kernel(LIMIT_ROWS)
def hand_speed(sample: LimitSample, frames: Frames, numbers: Array, rows: LimitRows) -> None:
    """A box of velocities within the sphere |J u| <= v, its axis along the previous velocity; numbers = [v].

    The faster the frame is, the longer and narrower is the box: steady motion loses 1 - ALONG, and motion
    from rest or around a corner reaches v in a few samples."""
    v, n = numbers[0], sample.q.shape[0]
    J, axes, p = frames.jacobians[frames.slots[0]], scratch((3, 3)), scratch(3)
    clear(axes)
    for i in range(3):
        p[i] = dot(J[i], sample.q_dot)
    speed = math.sqrt(p[0] * p[0] + p[1] * p[1] + p[2] * p[2])
    share = min(speed / v, 1.0)
    along = max(math.sqrt(1.0 / 3.0), min(0.5 * (1.0 + share), ALONG), 0.5 * (ALONG + share))
    if share < SLOW:
        p[0], p[1], p[2], speed = 1.0, 0.0, 0.0, 1.0
    k = 0  # the world's axis that is farthest from p
    for i in range(3):
        axes[0, i] = p[i] / speed
        if abs(p[i]) < abs(p[k]):
            k = i
    length = math.sqrt(1.0 - axes[0, k] * axes[0, k])
    for i in range(3):
        axes[1, i] = ((1.0 if i == k else 0.0) - axes[0, k] * axes[0, i]) / length
    for i in range(3):
        a, b = (i + 1) % 3, (i + 2) % 3
        axes[2, i] = axes[0, a] * axes[1, b] - axes[0, b] * axes[1, a]
    gradient = scratch((1, n))
    for row in range(3):
        for j in range(n):
            gradient[0, j] = axes[row, 0] * J[0, j] + axes[row, 1] * J[1, j] + axes[row, 2] * J[2, j]
        by_inputs(sample, gradient, rows.A[row])
        half = along if row == 0 else math.sqrt(0.5 * (1.0 - along * along))
        rows.lower[row], rows.upper[row] = -v * half, v * half


@kernel(LIMIT_VALUES)
def frame_speed(sample: LimitSample, frames: Frames, numbers: Array, u_dot: Array, values: Array) -> None:
    """The speed |J u| of the frame's origin."""
    square = 0.0
    for i in range(3):
        square += dot(frames.jacobians[frames.slots[0], i], sample.q_dot) ** 2
    values[0] = math.sqrt(square)


class HandSpeed(Limit):
    """The speed of a frame's origin in the world is at most `speed`: |J u| <= v.

    ISO 10218-1:2011, 5.6.2, has 0.25 m/s as the reduced speed near people. The limit is a sphere in the
    velocities; kept is a box within it, so that the speed is never above v at a sample: its axis follows the
    velocity, and a steady motion goes at 0.99 v.

    Parameters
    ----------
    frame : a frame of the robot
    speed : the largest speed v of its origin, in world axes, m/s
    priority : None for a limit that is kept before any task; 1, 2, ... for one that is kept as far as tasks
        of a lower number allow

    Raises
    ------
    InputError : a speed that is not above 0; on a robot, an unknown frame

    Examples
    --------
    >>> robot = nmm.load("unicycle_2r")
    >>> task = nmm.Task(nmm.Position("ee", "xy"), [3.0, 1.0])
    >>> limits = nmm.Limits(bounds=nmm.HandSpeed("ee", 0.25))
    >>> controller = nmm.Controller(robot, task, nmm.ProjectedGradient(), limits=limits, dt=0.01)
    >>> run = nmm.simulate(controller, robot.q({"q2": 0.5}), 2.0, 0.01)
    >>> run.limit_names[-1], bool(run.margin.min() > 0.0)
    ('speed of ee', True)
    """

    def __init__(self, frame: str, speed: float, priority: int | None = None) -> None:
        expect_kind(frame, str, "hand speed: frame", "a frame's name")
        self.frame, self.speed = frame, positive(speed, "hand speed: speed, m/s")
        self.priority = checked_priority(priority)

    def rows(self, robot: Robot) -> tuple[RowLimit, ...]:
        robot.frame_id(self.frame)
        return (RowLimit(f"speed of {self.frame}", "m/s", -np.inf, self.speed),)

    def stage(self, robot: Robot) -> LimitStage:
        v = self.speed
        return LimitStage(
            *(hand_speed, frame_speed, 3, "m/s", (self.frame,), np.array([v])),
            sizes=(2.0 * v,),
            losses=((1.0 - ALONG) * v,),
            rates=True,
        )
