"""The tasks of a scenario: a function, the reference that it follows, and the gain."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

from pydantic import Field

from nmm.errors import InputError
from nmm.scenario.function_part import FunctionPart
from nmm.scenario.functions import DistancePart, PointingPart, Reference
from nmm.scenario.keys import KeyedError, at, kind_of
from nmm.scenario.numbers import Numbers, shown
from nmm.scenario.robot_functions import (
    CenterOfMassPart,
    CoordinatesPart,
    HeadingPart,
    OrientationPart,
    PosePart,
    PositionPart,
    PosturePart,
)

if TYPE_CHECKING:
    from nmm.functions.function import Row
    from nmm.functions.tasks import Task
    from nmm.robots.robot import Robot


class TaskPart(FunctionPart):
    """A function of the robot that follows a reference."""

    reference: Reference = Field(
        description="the target: a number, numbers, or a mapping with a kind of reference, among them "
        "functions of the configuration (position, orientation, heading, coordinates, ...)"
    )
    gain: Numbers | None = Field(
        1.0,
        description="K on the task's error, 1/s: a number, a number a row, or a matrix (its symmetric part "
        "positive definite); null for planning mode, which follows the reference without feedback",
    )

    def build_task(self, robot: Robot) -> Task:
        """The task; errors know their key."""
        from nmm.functions.tasks import Task

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
    """Position of a frame's origin along world axes, or along another frame's, m."""


class OrientationTask(TaskPart, OrientationPart):
    """Orientation of a frame as its rotation vector (axis times angle), three rows, rad. Its error is the
    rotation vector of the turn that is left, in the frame's own axes."""


class PoseTask(TaskPart, PosePart):
    """Pose of a frame, six rows: position, m, over rotation vector, rad. Its error is the motion that is left
    (the logarithm of SE(3), in the frame's own axes), so that the frame moves along a screw."""


class PointingTask(TaskPart, PointingPart):
    """How far an axis of a frame points past a point: two rows, rad, both 0 when it points at it. The turn
    about the axis is free."""


class HeadingTask(TaskPart, HeadingPart):
    """Absolute angle of a direction fixed in a frame, about a world axis, rad; differences wrap."""


class DistanceTask(TaskPart, DistancePart):
    """Distance of a frame's origin from a point, m."""


class CenterOfMassTask(TaskPart, CenterOfMassPart):
    """Position of the whole robot's centre of mass along world axes, m."""


class CoordinatesTask(TaskPart, CoordinatesPart):
    """Linear combinations of coordinates, a row each (a joint coupling is one); angles are not wrapped."""


class PostureTask(TaskPart, PosturePart):
    """Coordinates as they are, a row each; angles are not wrapped."""


def listed(value: object) -> object:
    """A mapping without its list."""
    if isinstance(value, list | tuple):
        return value
    if isinstance(value, dict):
        return [value]
    raise ValueError(f"expected a mapping with a kind, or a list of such, got {shown(value)}")


TASKS: tuple[type[TaskPart], ...] = (
    PositionTask,
    OrientationTask,
    PoseTask,
    PointingTask,
    HeadingTask,
    DistanceTask,
    CenterOfMassTask,
    CoordinatesTask,
    PostureTask,
)
#: One task, or several done together, one above the other.
TaskList = list[
    Annotated[
        Annotated[
            PositionTask
            | OrientationTask
            | PoseTask
            | PointingTask
            | HeadingTask
            | DistanceTask
            | CenterOfMassTask
            | CoordinatesTask
            | PostureTask,
            Field(discriminator="kind"),
        ],
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
