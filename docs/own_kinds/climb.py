"""How fast a frame rises and sinks, as a limit."""

import numpy as np

from nmm import Limit, Robot
from nmm.extending import (
    LIMIT_ROWS,
    LIMIT_VALUES,
    Array,
    Frames,
    LimitRows,
    LimitSample,
    LimitStage,
    RowLimit,
    by_inputs,
    kernel,
    positive,
    scratch,
)


@kernel(LIMIT_ROWS)
def climb(sample: LimitSample, frames: Frames, numbers: Array, rows: LimitRows) -> None:
    """-v <= J_z u <= v, the row of the frame's Jacobian by the coordinates times S."""
    gradient = scratch((1, sample.q.shape[0]))
    for k in range(sample.q.shape[0]):
        gradient[0, k] = frames.jacobians[frames.slots[0], 2, k]
    by_inputs(sample, gradient, rows.A[0])
    rows.lower[0], rows.upper[0] = -numbers[0], numbers[0]


@kernel(LIMIT_VALUES)
def climbing(sample: LimitSample, frames: Frames, numbers: Array, u_dot: Array, values: Array) -> None:
    """J_z q_dot, what margins and figures show."""
    values[0] = 0.0
    for k in range(sample.q.shape[0]):
        values[0] += frames.jacobians[frames.slots[0], 2, k] * sample.q_dot[k]


class Climb(Limit):
    """A frame rises and sinks at most at `speed`.

    Parameters
    ----------
    frame : a frame of the robot
    speed : m/s
    """

    def __init__(self, frame: str, speed: float) -> None:
        self.frame, self.speed = frame, positive(speed, "climb: speed, m/s")

    def rows(self, robot: Robot) -> tuple[RowLimit, ...]:
        robot.frame_id(self.frame)  # refused by name where there is no such frame
        return (RowLimit(f"climb of {self.frame}", "m/s", -self.speed, self.speed),)

    def stage(self, robot: Robot) -> LimitStage:
        numbers = np.array([self.speed])
        return LimitStage(climb, climbing, 1, "m/s", (self.frame,), numbers, rates=True)
