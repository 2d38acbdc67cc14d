"""The tasks of a scenario: a function, the reference that it follows, and the gain."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated, cast

from pydantic import BeforeValidator, Field, create_model

from nmm.errors import InputError
from nmm.functions.function import Row
from nmm.functions.tasks.task import Task
from nmm.robots.robot import Robot
from nmm.scenario.conditions import ConditionList, build_conditions
from nmm.scenario.function_part import FunctionPart
from nmm.scenario.functions import FUNCTION_PARTS, Reference
from nmm.scenario.keys import KeyedError, at, one_of
from nmm.scenario.numbers import Numbers, Speeds, Whole, shown


def listed(value: object) -> object:
    """A mapping without its list."""
    if isinstance(value, list | tuple):
        return value
    if isinstance(value, dict):
        return [value]
    raise ValueError(f"expected a mapping with a kind, or a list of such, got {shown(value)}")


class TaskPart(FunctionPart):
    """A function of the robot that follows a reference."""

    reference: Reference = Field(
        description="the target: a number, numbers, or a mapping with a kind of reference, among them "
        "functions of the configuration (position, orientation, heading, coordinates, ...); or another "
        "task's, by its path (task.0.reference)"
    )
    gain: Numbers | None = Field(
        1.0,
        description="K on the task's error, 1/s: a number, a number a row, or a matrix (its symmetric part "
        "positive definite); null for planning mode, which follows the reference without feedback",
    )

    priority: Whole = Field(
        1,
        description="1, 2, ...: a task gets what those of lower numbers leave, and takes nothing from them",
    )
    speed: Speeds | None = Field(
        None,
        description="how fast feedback may approach the target: ‖K e‖ at most, a number or numbers by unit "
        "({m: 1, rad: 2})",
    )
    braking: Speeds | None = Field(
        None,
        description="deceleration b with which it may come to rest there: ‖K e‖ at most √(2 b ‖e‖), "
        "a number or numbers by unit",
    )
    name: str = Field("", description="for messages, and for tasks that come after it")
    when: Annotated[ConditionList, BeforeValidator(listed)] = Field(
        default_factory=list,
        description="a condition of kind between, while or after, or a list of such, which all have to hold, "
        "for a task that comes and goes; none for one that is always there",
    )

    def build_task(self, robot: Robot, names: Sequence[str] = ()) -> Task:
        """The task, among others of these names; errors know their key."""
        function = self.build(robot)
        rows = function.rows(robot)
        units = {row.unit for row in rows}
        with at("reference"):
            reference = self.reference.build(robot, units.pop() if len(units) == 1 else "1")
            _check_rows(rows, reference.rows(robot))
        when = build_conditions(self.when, list(names), robot)
        with self.own_keys():
            task = Task(
                function, reference, self.gain, self.priority, self.speed, self.braking, self.name, when
            )
            task.approach(robot)
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


#: By kind: the function's part, with a reference and a gain.
TASK_PARTS: dict[str, type[TaskPart]] = {
    kind: cast(
        type[TaskPart],
        create_model(
            f"{part.makes.__name__}Task", __base__=(TaskPart, part), __module__=__name__, __doc__=part.__doc__
        ),
    )
    for kind, part in FUNCTION_PARTS.items()
}
if TYPE_CHECKING:
    TaskList = list[TaskPart]
else:
    #: One task, or several done together, one above the other.
    TaskList = list[one_of(TASK_PARTS)]


def build_tasks(parts: list[TaskPart], robot: Robot) -> list[Task]:
    """The tasks; errors know their key."""
    tasks, names = [], [part.name for part in parts if part.name]
    for i, part in enumerate(parts):
        with at(i):
            tasks.append(part.build_task(robot, names))
    return tasks
