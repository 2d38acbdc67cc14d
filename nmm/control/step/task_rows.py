"""Tasks as a control step reads them: their rows in a program, gains, bounds of the approach."""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np

from nmm.base.arrays import Array, Integers
from nmm.control.functions.function import Function, Row
from nmm.control.functions.tasks.task import Comparison, Stack, Task, TasksOn
from nmm.control.step.equations import PLAIN, WRAPPED, TaskRows
from nmm.model.robots.robot import Robot


def task_functions(stack: Stack) -> list[Function]:
    """f, g and e of each task."""
    return [function for task in stack for function in (task.function, task.reference, Comparison(task))]


def gain_rows(stack: Stack, robot: Robot) -> tuple[Array, Array, Array, Integers]:
    """Feedback of a stack, see `TasksOn.feedback`."""
    return stack.on(robot).feedback()


def task_rows(tasks: TasksOn, first: Sequence[int], bounded: Collection[str]) -> TaskRows:
    """The tasks' rows, with zeros for what a step writes; first: where each of `task_functions` begins;
    bounded: coordinates within limits, which cannot go round."""
    listed = [
        (first[3 * i] + j, first[3 * i + 1] + j, error_row(task, first[3 * i + 2] + j, row, bounded))
        for i, (task, rows) in enumerate(zip(tasks.stack, tasks.each, strict=True))
        for j, row in enumerate(rows)
    ]
    table = np.array(listed, dtype=np.int64).reshape(-1, 3)
    return TaskRows(table, *tasks.feedback(), *np.zeros((4, len(table))))


def error_row(task: Task, computed: int, row: Row, bounded: Collection[str] = ()) -> int:
    """The program's row of a component's error: that of a computed one, else PLAIN or WRAPPED."""
    if task.function.comparison is not None:
        return computed
    return WRAPPED if row.angular and row.name not in bounded else PLAIN
