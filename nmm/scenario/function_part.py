"""What the functions of a scenario have in common, and combinations of coordinates."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, Literal

from pydantic import BeforeValidator

from nmm.scenario.keys import Part
from nmm.scenario.numbers import numbers_by_name, shown

if TYPE_CHECKING:
    from nmm.functions.function import Function
    from nmm.robots.robot import Robot

Unit = Literal["m", "rad", "1"]


def combination(value: object) -> str | dict[str, float]:
    """A coordinate's name, or coefficients by name."""
    if isinstance(value, str):
        return value
    if isinstance(value, Mapping) and value:
        return numbers_by_name(value, "coefficient of ")
    raise ValueError(
        f"expected a coordinate's name, or coefficients by name ({{theta: 1, q1: 1}}), got {shown(value)}"
    )


Combination = Annotated[str | dict[str, float], BeforeValidator(combination)]


def check_combination(combination: str | dict[str, float], robot: Robot) -> None:
    """`InputError` for a coordinate that the robot does not have."""
    for name in [combination] if isinstance(combination, str) else combination:
        robot.coordinate(name)


class FunctionPart(Part):
    """A function phi(t, q) of the library."""

    @abstractmethod
    def make(self, robot: Robot, unit: str) -> Function:
        """The function; `unit` is that of values whose unit the file leaves open."""

    def build(self, robot: Robot, unit: str = "m") -> Function:
        """`make`, with the robot's word on it: errors know their key."""
        with self.own_keys():
            function = self.make(robot, unit)
            function.rows(robot)
            function.stages(robot)
        return function
