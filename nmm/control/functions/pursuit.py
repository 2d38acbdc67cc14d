"""Pursuit: how an axle is steered so that its middle moves, on a circle, towards the end-effector."""

from __future__ import annotations

import math

import numpy as np

from nmm.base.arrays import Array
from nmm.base.kernels.compiled import kernel
from nmm.base.kernels.records import FUNCTION, At, Frames, Rows
from nmm.control.functions.function import Function, Row, Stage
from nmm.model.platforms.steering import SteeredAxle
from nmm.model.robots.robot import Robot

#: Numbers: the axle's x, y, heading, the length that keeps the azimuth's slope finite; then those of a pivot.
AXLE, PIVOT = 4, 6


@kernel(FUNCTION)
def pursuit(at: At, frames: Frames, numbers: Array, rows: Rows) -> None:
    """The angles c* of the pivots (values alone) and ½ β², with the azimuth β's gradient.

    The end-effector is at l (cos β, sin β) from the axle's middle. The circle from there along the axle's
    direction to it has κ = 2 sin β / l and gives a pivot at (x, y) the direction (1 - κ y, κ x); a car has
    tan δ* = 2 L sin β / l. The second frame is the body's, unless it is the main one (in q)."""
    hand, main = frames.slots[0], frames.slots.shape[0] == 1
    body = hand if main else frames.slots[1]
    b_x, b_y = at.q[0], at.q[1]
    along_x, along_y = math.cos(at.q[2]), math.sin(at.q[2])
    if not main:
        b_x, b_y = frames.placements[body, 0, 3], frames.placements[body, 1, 3]
        along_x, along_y = frames.placements[body, 0, 0], frames.placements[body, 1, 0]
    # The axle's middle, from the body's origin, and its direction; the body stands upright.
    a_x = numbers[0] * along_x - numbers[1] * along_y
    a_y = numbers[0] * along_y + numbers[1] * along_x
    c, s = math.cos(numbers[2]), math.sin(numbers[2])
    e_x, e_y = c * along_x - s * along_y, c * along_y + s * along_x
    d_x = frames.placements[hand, 0, 3] - b_x - a_x
    d_y = frames.placements[hand, 1, 3] - b_y - a_y
    forward, left = e_x * d_x + e_y * d_y, e_x * d_y - e_y * d_x
    square = forward * forward + left * left
    count = (numbers.shape[0] - AXLE) // PIVOT
    for i in range(count):
        first = AXLE + i * PIVOT
        x, y = numbers[first], numbers[first + 1]
        angle = math.atan2(2.0 * left * x, square - 2.0 * left * y) - numbers[first + 2]
        rows.value[i] = min(max(numbers[first + 3] * angle, numbers[first + 4]), numbers[first + 5])
    azimuth = math.atan2(left, forward)
    rows.value[count] = 0.5 * azimuth * azimuth
    slope = azimuth / (square + numbers[3] * numbers[3])
    for j in range(at.q.shape[0]):
        if main and j < 3:  # it moves along
            continue
        turn = 0.0 if main else frames.jacobians[body, 5, j]
        v_x = frames.jacobians[hand, 0, j] + a_y * turn
        v_y = frames.jacobians[hand, 1, j] - a_x * turn
        if not main:
            v_x -= frames.jacobians[body, 0, j]
            v_y -= frames.jacobians[body, 1, j]
        rows.value_q[count, j] = slope * (d_x * v_y - d_y * v_x - turn * square)


class Pursuit(Function):
    """The angles c* that steer an axle towards the frame `hand` (usually the end-effector), and ½ β² of its
    azimuth β; c* is within the pivot's limits and `widest`: a c that moves towards it stays there. `body` is
    the coordinate that turns the body with the axle, and its joint's frame."""

    def __init__(self, hand: str, body: str, axle: SteeredAxle) -> None:
        self.hand = hand
        self.body = body
        self.axle = axle

    def rows(self, robot: Robot) -> tuple[Row, ...]:
        return (*(Row(pivot.coordinate, "rad") for pivot in self.axle.pivots), Row("½ β²", "1"))

    def limits(self, robot: Robot) -> tuple[tuple[float, float], ...]:
        """(lower, upper) of each c*, rad."""
        ranges = []
        for pivot in self.axle.pivots:
            lower, upper = robot.q_limits[robot.coordinate(pivot.coordinate)]
            ahead = -pivot.sign * pivot.zero
            ranges.append((max(float(lower), ahead - pivot.widest), min(float(upper), ahead + pivot.widest)))
        return tuple(ranges)

    def stages(self, robot: Robot) -> tuple[Stage, ...]:
        axle = self.axle
        numbers = [axle.x, axle.y, axle.heading, 0.1 * max(abs(complex(p.x, p.y)) for p in axle.pivots)]
        for pivot, (lower, upper) in zip(axle.pivots, self.limits(robot), strict=True):
            numbers += [pivot.x, pivot.y, pivot.zero, pivot.sign, lower, upper]
        frames = (self.hand,) if self.body == "theta" else (self.hand, self.body)
        return (Stage(pursuit, len(axle.pivots) + 1, frames, np.array(numbers)),)
