"""When a scenario's task is done: the conditions of tasks that come and go."""

from __future__ import annotations

import math
from abc import abstractmethod
from typing import TYPE_CHECKING, Literal

from pydantic import Field

from nmm.errors import expect_known
from nmm.functions.tasks.conditions import After, Between, Condition, While
from nmm.robots.robot import Robot
from nmm.scenario.function_part import FunctionPart
from nmm.scenario.functions import FUNCTION_PARTS
from nmm.scenario.keys import Part, at, one_of
from nmm.scenario.numbers import Number, Numbers, Positive, Speeds

if TYPE_CHECKING:
    AnyFunction = FunctionPart
else:
    AnyFunction = one_of(FUNCTION_PARTS)


class ConditionPart(Part):
    """A condition."""

    @abstractmethod
    def build(self, robot: Robot) -> Condition:
        """The condition; errors know their key."""


class BetweenPart(ConditionPart):
    """From one time to another."""

    kind: Literal["between"]
    start: Number = Field(0.0, description="s")
    end: Positive | None = Field(None, description="s, after the start; the end of the run when not given")

    def build(self, robot: Robot) -> Condition:
        with self.own_keys():
            return Between(self.start, math.inf if self.end is None else self.end)


class WhilePart(ConditionPart):
    """While a function of the robot is within bounds."""

    kind: Literal["while"]
    function: AnyFunction = Field(description="a mapping with the kind of a task's function, and its keys")
    lower: Numbers | None = Field(None, description="least value, or one a row; none when not given; m, rad")
    upper: Numbers | None = Field(
        None, description="largest value, or one a row; none when not given; m, rad"
    )
    margin: Number = Field(
        0.01,
        description="once it holds, it does so until a row is beyond its bound by more than this; m, rad",
    )

    def build(self, robot: Robot) -> Condition:
        with at("function"):
            function = self.function.build(robot)
        none = math.inf
        with self.own_keys():
            return While(
                function,
                -none if self.lower is None else self.lower,
                none if self.upper is None else self.upper,
                self.margin,
            )


class AfterPart(ConditionPart):
    """Once the error of another task has stayed within a tolerance; from then on for good."""

    kind: Literal["after"]
    task: str = Field(description="that task's name")
    within: Speeds = Field(
        0.01,
        description="of its error's norm over rows of one unit: a number, or numbers by unit ({m: 0.005})",
    )
    hold: Number = Field(0.1, description="how long the error has to stay there, s")
    instead: bool = Field(False, description="whether that task ends when this one begins")

    def build(self, robot: Robot) -> Condition:
        with self.own_keys():
            return After(self.task, 0.01 if self.within is None else self.within, self.hold, self.instead)


#: The conditions, by kind.
CONDITION_PARTS: dict[str, type[ConditionPart]] = {
    "between": BetweenPart,
    "while": WhilePart,
    "after": AfterPart,
}
if TYPE_CHECKING:
    ConditionList = list[ConditionPart]
else:
    ConditionList = list[one_of(CONDITION_PARTS)]


def build_conditions(parts: list[ConditionPart], names: list[str], robot: Robot) -> list[Condition]:
    """The conditions of a task among others of these names; errors know their key."""
    found = []
    for i, part in enumerate(parts):
        with at("when", i):
            if isinstance(part, AfterPart):
                with at("task"):
                    expect_known("task name", part.task, names)
            found.append(part.build(robot))
    return found
