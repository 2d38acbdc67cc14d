"""The tasks of a scenario: a function, the reference that it follows, the gain, and when it is done."""

from collections.abc import Callable, Sequence
from typing import Annotated, ClassVar, Literal

from pydantic import BeforeValidator, Field

from nmm.base.errors import InputError, expect_known, few
from nmm.control.functions.function import Row
from nmm.control.functions.tasks.conditions import After, Between, Condition, While
from nmm.control.functions.tasks.task import Task
from nmm.model.robots.robot import Robot
from nmm.scenario.constructors import FunctionPart, keys_of
from nmm.scenario.functions import FUNCTION_PARTS, Reference, with_functions
from nmm.scenario.keys import KeyedPart, OneOf, at, each
from nmm.scenario.numbers import Number, Numbers, Positive, Speeds


class ConditionPart(KeyedPart):
    """A condition of the class `makes`, of whose constructor its keys are the arguments."""

    makes: ClassVar[Callable[..., Condition]]

    def build(self, robot: Robot) -> Condition:
        """The condition; errors know their key."""
        values = self.given()
        with self.own_keys():
            return self.makes(**{key: value for key, value in values.items() if key != "kind"})


class BetweenPart(ConditionPart):
    """From one time to another."""

    makes = Between
    kind: Literal["between"]
    start: Number = Field(0.0, description="s")
    end: Positive | None = Field(None, description="s, after the start; the end of the run when not given")


class WhilePart(ConditionPart):
    """While a function of the robot is within bounds."""

    kind: Literal["while"]
    function: Annotated[FunctionPart, OneOf(FUNCTION_PARTS)] = Field(
        description="a mapping with the kind of a task's function, and its keys"
    )
    lower: Numbers | None = Field(None, description="least value, or one a row; none when not given; m, rad")
    upper: Numbers | None = Field(
        None, description="largest value, or one a row; none when not given; m, rad"
    )
    margin: Number = Field(
        0.01,
        description="hysteresis: it holds until a row is beyond its bound by this; m, rad",
    )

    def build(self, robot: Robot) -> Condition:
        with at("function"):
            function = self.function.build(robot)
        with self.own_keys():
            return While(function, **self.given("lower", "upper", "margin"))


class AfterPart(keys_of(After, ConditionPart, within=Speeds)):  # type: ignore[misc]  # made
    """Once the error of another task has stayed within a tolerance; from then on for good."""

    makes = After
    kind: Literal["after"]


#: The conditions, by kind.
CONDITION_PARTS: dict[str, type[ConditionPart]] = {
    "between": BetweenPart,
    "while": WhilePart,
    "after": AfterPart,
}


def build_conditions(parts: list[ConditionPart], names: list[str], robot: Robot) -> list[Condition]:
    """The conditions of a task among others of these names; errors know their key."""

    def condition(part: ConditionPart) -> Condition:
        if isinstance(part, AfterPart):
            with at("task"):
                expect_known("task name", part.task, names)
        return part.build(robot)

    return each(parts, condition, "when")


def listed(value: object) -> object:
    """A mapping without its list."""
    if isinstance(value, list | tuple):
        return value
    if isinstance(value, dict):
        return [value]
    raise InputError(expected="a mapping with a kind, or a list of such", got=value)


_GAIN = (
    Numbers | None,
    "K, 1/s: a number, a number a row, or a matrix (symmetric part positive definite); null for planning "
    "mode, without feedback",
)


class TaskPart(
    keys_of(Task, FunctionPart, "function", "reference", "when", gain=_GAIN, speed=Speeds, braking=Speeds)  # type: ignore[misc]  # made
):
    """A function of the robot that follows a reference."""

    reference: Reference = Field(
        description="the target: numbers, a kind of reference or of task (a function of q), or "
        "another task's by its path (task.0.reference)"
    )
    when: Annotated[list[Annotated[ConditionPart, OneOf(CONDITION_PARTS)]], BeforeValidator(listed)] = Field(
        default_factory=list,
        description="conditions (between, while, after), which all have to hold; none for a task "
        "that is always active",
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
        named = {key: getattr(self, key) for key in ("gain", "priority", "speed", "braking", "name")}
        with self.own_keys():
            task = Task(function, reference, **named, when=when)
            task.approach(robot)
        with at("gain"):
            try:
                task.gain_matrix(robot)
            except InputError as error:
                raise error.placed("") from None
        return task


def _check_rows(rows: tuple[Row, ...], targets: tuple[Row, ...]) -> None:
    """`InputError` when a reference has not the number of components, or the units, of its task."""
    if len(targets) != len(rows):
        names = few([row.name for row in rows])
        raise InputError(expected=f"{len(rows)} components, as the task has ({names})", got=len(targets))
    for row, target in zip(rows, targets, strict=True):
        if row.unit != target.unit and "1" not in (row.unit, target.unit):
            raise InputError(expected=f"{row.unit} as {row.name} of the task", got=target.unit)


#: By kind: the function's part, with a reference and a gain.
TASK_PARTS = with_functions(TaskPart)
#: One task, or several done together, one above the other.
TaskList = list[Annotated[TaskPart, OneOf(TASK_PARTS)]]


def build_tasks(parts: list[TaskPart], robot: Robot) -> list[Task]:
    """The tasks; errors know their key."""
    names = [part.name for part in parts if part.name]
    return each(parts, lambda part: part.build_task(robot, names))
