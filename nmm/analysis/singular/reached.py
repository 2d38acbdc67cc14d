"""A target that the task has already reached: what J_bar is taken with when a function has no reference."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeAlias

from nmm.arrays import Array
from nmm.errors import InputError
from nmm.functions.function import Function, Row, Stage
from nmm.functions.tasks.task import Stack, Task
from nmm.kernels.compiled import kernel
from nmm.kernels.records import FUNCTION, At, Frames, Rows
from nmm.robots.robot import Robot

#: What an analysis takes as the task: functions f(q) are enough, it needs no targets.
Tasks: TypeAlias = Task | Function | Stack | Sequence[Task | Function]


@kernel(FUNCTION)
def stand_still(at: At, frames: Frames, numbers: Array, rows: Rows) -> None:
    """The value stays, its derivatives are 0."""
    for i in range(rows.value.shape[0]):
        rows.value_t[i] = 0.0
        for j in range(rows.value_q.shape[1]):
            rows.value_q[i, j] = 0.0


class Reached(Function):
    """g = f(q) at the very q, as a constant: the error is 0 and J_bar = (∂f/∂q) S.

    For an orientation or a pose, whose rows are those of its error, J is the one in the frame's own axes.
    """

    def __init__(self, function: Function) -> None:
        self.function = function

    def rows(self, robot: Robot) -> tuple[Row, ...]:
        return self.function.rows(robot)

    def stages(self, robot: Robot) -> tuple[Stage, ...]:
        return (*self.function.stages(robot), Stage(stand_still, len(self.rows(robot))))


def stacked(given: Tasks) -> Stack:
    """Tasks as they are, each bare function with the target that it has reached.

    Raises
    ------
    InputError : neither a task nor a function
    """
    if isinstance(given, Stack):
        return given
    items = [given] if isinstance(given, Task | Function) else given
    if not isinstance(items, Sequence) or not all(isinstance(item, Task | Function) for item in items):
        raise InputError(
            "task: expected a task, a function of the robot as Position('ee'), or a list of these, "
            f"got {given!r}"
        )
    return Stack(tuple(item if isinstance(item, Task) else Task(item, Reached(item)) for item in items))
