"""The error of a task whose values cannot be subtracted, as rows of a function."""

from __future__ import annotations

from typing import TYPE_CHECKING

from nmm.errors import InputError
from nmm.functions.function import Function, Row, Stage
from nmm.robots.robot import Robot

if TYPE_CHECKING:
    from nmm.functions.tasks.task import Task


class Comparison(Function):
    """The error e(t, q) of a task by its function's `comparison`; no rows when it has none.

    Its stage sees the 2 s rows before its own: it has to come right after the task's function and reference.
    """

    def __init__(self, task: Task) -> None:
        self.task = task

    def rows(self, robot: Robot) -> tuple[Row, ...]:
        return () if self.task.function.comparison is None else self.task.rows(robot)

    def stages(self, robot: Robot) -> tuple[Stage, ...]:
        kernel, s = self.task.function.comparison, len(self.task.rows(robot))
        if kernel is None:
            return ()
        for part in (self.task.function, self.task.reference):
            if max(stage.rows for stage in part.stages(robot)) != s:
                raise InputError(
                    f"{type(part).__name__}: expected stages of {s} rows, as many as its components, where "
                    f"{type(self.task.function).__name__} compares it"
                )
        return (Stage(kernel, s, before=2 * s),)
