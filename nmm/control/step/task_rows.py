"""Tasks as a control step reads them: their rows in a program, gains, bounds of the approach."""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np

from nmm.base.arrays import Array, Integers
from nmm.control.functions.function import Function, Row
from nmm.control.functions.tasks.task import Comparison, Stack, Task
from nmm.control.step.equations import PLAIN, WRAPPED, TaskRows
from nmm.model.robots.robot import Robot


def task_functions(stack: Stack) -> list[Function]:
    """f, g and e of each task."""
    return [function for task in stack for function in (task.function, task.reference, Comparison(task))]


def gain_rows(stack: Stack, robot: Robot) -> tuple[Array, Array, Array, Integers]:
    """Feedback of a stack: K (s, s), block by block; speed, braking and group (s,), see `TaskRows`."""
    blocks = [task.gain_matrix(robot) for task in stack]
    K = np.zeros((sum(map(len, blocks)),) * 2)
    first = 0
    for block in blocks:  # block_diag would load SciPy's linear algebra for this alone
        after = first + len(block)
        K[first:after, first:after] = block
        first = after
    rows = [(k, row.unit) for k, task in enumerate(stack) for row in task.rows(robot)]
    group = np.array([rows.index(row) for row in rows], dtype=np.int64)
    speed, braking = np.hstack([np.zeros((2, 0)), *(np.array(task.approach(robot)) for task in stack)])
    return K, speed, braking, group


def task_rows(stack: Stack, robot: Robot, first: Sequence[int], bounded: Collection[str] = ()) -> TaskRows:
    """A stack's rows, with zeros for what a step writes; first: where each of `task_functions` begins;
    bounded: coordinates within limits, which cannot go round."""
    listed = [
        (first[3 * i] + j, first[3 * i + 1] + j, error_row(task, first[3 * i + 2] + j, row, bounded))
        for i, task in enumerate(stack)
        for j, row in enumerate(task.rows(robot))
    ]
    table = np.array(listed, dtype=np.int64).reshape(-1, 3)
    K, speed, braking, group = gain_rows(stack, robot)
    return TaskRows(table, K, speed, braking, group, *np.zeros((4, len(table))))


def error_row(task: Task, computed: int, row: Row, bounded: Collection[str] = ()) -> int:
    """The program's row of a component's error: that of a computed one, else PLAIN or WRAPPED."""
    if task.function.comparison is not None:
        return computed
    return WRAPPED if row.angular and row.name not in bounded else PLAIN
