"""Slope of the line from one frame to another."""

import math

from nmm import Robot
from nmm.extending import FUNCTION, Array, At, Frames, Function, Row, Rows, Stage, kernel


@kernel(FUNCTION)
def slope(at: At, frames: Frames, numbers: Array, rows: Rows) -> None:
    """φ = atan2(z, |(x, y)|) of the way d = (x, y, z) from the first frame to the second."""
    a, b = frames.slots[0], frames.slots[1]
    x = frames.placements[b, 0, 3] - frames.placements[a, 0, 3]
    y = frames.placements[b, 1, 3] - frames.placements[a, 1, 3]
    z = frames.placements[b, 2, 3] - frames.placements[a, 2, 3]
    level = math.hypot(x, y)
    square = level * level + z * z
    rows.value[0] = math.atan2(z, level)
    for k in range(at.q.shape[0]):
        dx = frames.jacobians[b, 0, k] - frames.jacobians[a, 0, k]
        dy = frames.jacobians[b, 1, k] - frames.jacobians[a, 1, k]
        dz = frames.jacobians[b, 2, k] - frames.jacobians[a, 2, k]
        rows.value_q[0, k] = (level * dz - z * (x * dx + y * dy) / level) / square


class Slope(Function):
    """Slope (rad) of the line from the origin of `start` to that of `end`, above the horizontal.

    Parameters
    ----------
    start, end : names of frames
    """

    def __init__(self, start: str, end: str) -> None:
        self.start, self.end = start, end

    def rows(self, robot: Robot) -> tuple[Row, ...]:
        robot.frame_id(self.start), robot.frame_id(self.end)  # refused by name where there is no such frame
        return (Row("slope", "rad"),)

    def stages(self, robot: Robot) -> tuple[Stage, ...]:
        return (Stage(slope, 1, frames=(self.start, self.end)),)
