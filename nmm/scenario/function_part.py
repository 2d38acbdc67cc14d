"""Functions phi(t, q) of the library, as parts of a scenario."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, Self

from pydantic import PrivateAttr, SerializerFunctionWrapHandler, model_serializer

from nmm.functions.function import Function
from nmm.robots.robot import Robot
from nmm.scenario.keys import at
from nmm.scenario.made_part import MadePart

#: Keys whose text is a frame of the robot, and keys whose list names coordinates.
FRAMES, COORDINATES = ("frame", "relative_to"), ("of", "joints")


class FunctionPart(MadePart):
    """A function phi(t, q)."""

    _path: str = PrivateAttr("")

    def named(self, path: str) -> Self:
        """The same function, which the file names by this path; plain data name it so again."""
        part = self.model_copy()
        part._path = path
        return part

    @model_serializer(mode="wrap")
    def _as_named(self, plain: SerializerFunctionWrapHandler) -> Any:
        return self._path or plain(self)

    def build(self, robot: Robot, unit: str = "m") -> Function:
        """The function, with the robot's word on it: errors know their key."""
        check_names(self, robot)
        check_functions(self, robot)
        function: Function = self.make(unit)
        with self.own_keys():
            function.rows(robot)
            function.stages(robot)
        return function


def check_functions(part: MadePart, robot: Robot) -> None:
    """`InputError`, at its key, for a function in a part that the robot has not."""
    for key in type(part).model_fields:
        value = getattr(part, key)
        for place, inner in (
            {(key, name): one for name, one in value.items()}.items()
            if isinstance(value, dict)
            else [((key,), value)]
        ):
            if isinstance(inner, FunctionPart):
                with at(*place):
                    inner.build(robot)


def check_names(part: MadePart, robot: Robot) -> None:
    """`InputError`, at its key, for a frame or a coordinate that the robot does not have."""
    for key in type(part).model_fields:
        value = getattr(part, key)
        with at(key):
            if key in FRAMES and value is not None:
                robot.frame_id(value)
            elif key in COORDINATES and isinstance(value, list):
                check_coordinates(value, robot)


def check_coordinates(combinations: Iterable[Any], robot: Robot) -> None:
    """`InputError` for a coordinate that the robot does not have, in names or in coefficients by name."""
    for combination in combinations:
        for name in [combination] if isinstance(combination, str) else combination:
            robot.coordinate(name)
