"""The tasks of a scenario: a function, the reference that it follows, and the gain."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

from pydantic import Field

from nmm.errors import InputError
from nmm.scenario.functions import CoordinatesPart, FunctionPart, HeadingPart, PositionPart, Reference
from nmm.scenario.keys import KeyedError, at, kind_of
from nmm.scenario.numbers import Numbers, shown

if TYPE_CHECKING:
    from nmm.function import Row
    from nmm.robot import Robot
    from nmm.tasks import Task


class TaskPart(FunctionPart):
    """A function of the robot that follows a reference."""

    reference: Reference = Field(
        description="the target: a number, numbers, or a mapping with a kind of reference (or position, "
        "heading, coordinates: another point of the robot)"
    )
    gain: Numbers | None = Field(
        1.0,
        description="K on the task's error, 1/s: a number, a number a row, or a matrix (its symmetric part "
        "positive definite); null for planning mode, which follows the reference without feedback",
    )

    def build_task(self, robot: Robot) -> Task:
        """The task; errors know their key."""
        from nmm.tasks import Task

        function = self.build(robot)
        rows = function.rows(robot)
        units = {row.unit for row in rows}
        with at("reference"):
            reference = self.reference.build(robot, units.pop() if len(units) == 1 else "1")
            _check_rows(rows, reference.rows(robot))
        task = Task(function, reference, self.gain)
        with at("gain"):
            try:
                task.gain_matrix(robot)
            except ValueError as error:
                raise KeyedError((), str(error).partition(": ")[2]) from None
        return task


def _check_rows(rows: tuple[Row, ...], targets: tuple[Row, ...]) -> None:
    """`InputError` when a reference has not the number of components, or the units, of its task."""
    if len(targets) != len(rows):
        names = ", ".join(row.name for row in rows)
        raise InputError(f"expected {len(rows)} components, as the task has ({names}), got {len(targets)}")
    for row, target in zip(rows, targets, strict=True):
        if row.unit != target.unit and "1" not in (row.unit, target.unit):
            raise InputError(f"expected {row.unit} as {row.name} of the task, got {target.unit}")


class PositionTask(TaskPart, PositionPart):
    """Position of a frame's origin along world axes, m."""


class HeadingTask(TaskPart, HeadingPart):
    """Absolute angle of a direction fixed in a frame, about a world axis, rad; differences wrap."""


class CoordinatesTask(TaskPart, CoordinatesPart):
    """Linear combinations of coordinates, a row each; angles are not wrapped."""


def listed(value: object) -> object:
    """A mapping without its list."""
    if isinstance(value, list | tuple):
        return value
    if isinstance(value, dict):
        return [value]
    raise ValueError(f"expected a mapping with a kind, or a list of such, got {shown(value)}")


TASKS: tuple[type[TaskPart], ...] = (PositionTask, HeadingTask, CoordinatesTask)
#: One task, or several done together, one above the other.
TaskList = list[
    Annotated[
        Annotated[PositionTask | HeadingTask | CoordinatesTask, Field(discriminator="kind")],
        kind_of(*TASKS),
    ]
]


def build_tasks(parts: list[Any], robot: Robot) -> list[Task]:
    """The tasks; errors know their key."""
    tasks = []
    for i, part in enumerate(parts):
        with at(i):
            tasks.append(part.build_task(robot))
    return tasks
