"""Functions one below the other in the rows of one: how a function is made of several."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from nmm.arrays import Array
from nmm.functions.function import Function, Stage
from nmm.kernels.compiled import kernel
from nmm.kernels.records import FUNCTION, At, Frames, Rows
from nmm.robots.robot import Robot


@kernel(FUNCTION)
def move_rows(at: At, frames: Frames, numbers: Array, rows: Rows) -> None:
    """The rows from `source` on become those from `target` on; then the first rows are zero.

    numbers = [source, target, number of rows, number of first rows to clear].
    """
    source, target, count = int(numbers[0]), int(numbers[1]), int(numbers[2])
    n = at.q.shape[0]
    step = 1 if target < source else -1  # so that none is overwritten before it is read
    for moved in range(count):
        i = moved if step > 0 else count - 1 - moved
        rows.value[target + i] = rows.value[source + i]
        rows.value_t[target + i] = rows.value_t[source + i]
        for k in range(n):
            rows.value_q[target + i, k] = rows.value_q[source + i, k]
    for i in range(int(numbers[3])):
        rows.value[i] = 0.0
        rows.value_t[i] = 0.0
        for k in range(n):
            rows.value_q[i, k] = 0.0


def stacked(functions: Sequence[Function], robot: Robot) -> tuple[Stage, ...]:
    """Stages that leave the rows of all functions, one below the other, for a stage that comes after them.

    The last function first: what is there is moved out of the way of the next, which begins on clean rows.
    """
    stages: tuple[Stage, ...] = ()
    count = 0
    for function in reversed(functions):
        own, rows = function.stages(robot), len(function.rows(robot))
        if count:
            used, aside = max(stage.rows for stage in stages), max(stage.rows for stage in own)
            away = Stage(move_rows, max(used, aside + count), (), np.array([0.0, aside, count, aside]))
            stages = (*stages, away, *own)
            if aside != rows:
                back = np.array([aside, rows, count, 0.0], dtype=float)
                stages = (*stages, Stage(move_rows, aside + count, (), back))
        else:
            stages = own
        count += rows
    return stages
