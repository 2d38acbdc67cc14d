"""The robot of a scenario: from one file, or a platform with arms mounted on it."""

from __future__ import annotations

import inspect
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import AfterValidator, BeforeValidator, Field, WrapValidator, model_validator

from nmm.base.errors import InputError, expect_known
from nmm.scenario.files import FileName, NamedFolder, file_or_package, readable
from nmm.scenario.keys import KeyedError, KeyedPart, at
from nmm.scenario.numbers import Number, number, numbers, numbers_by_name
from nmm.scenario.yaml_text import Place

if TYPE_CHECKING:
    from nmm.model.platforms import Platform
    from nmm.model.robots.robot import Robot


def _argument(value: object) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str | int | float):
        return str(value)
    raise InputError(expected="a number or text", got=value)


def _wheels(value: object) -> object:
    if isinstance(value, Mapping):
        return numbers_by_name(value)
    if value is None or isinstance(value, list | tuple):
        return value
    raise InputError(expected="a list of joints, or a radius for each", got=value)


def _source(text: str) -> str:
    return text if not Path(text).suffix and len(Path(text).parts) == 1 else file_or_package(text)


def _point(value: object, sizes: tuple[int, ...], expected: str) -> object:
    point = numbers(value)
    if len(point) not in sizes or not all(isinstance(item, float) for item in point):
        raise InputError(expected=expected, got=value)
    return point


def _axle(value: object) -> object:
    if value is None or isinstance(value, str):
        return value
    return _point(value, (2, 3, 4), "a frame, [x, y], [x, y, z] or [x, y, z, yaw]")


def _kind_of_platform(value: object) -> object:
    if isinstance(value, Mapping):
        if not isinstance(value.get("kind"), str):
            raise KeyedError(("kind",), expected="the kind of platform")
        return {str(key): item if key == "kind" else _plain(item) for key, item in value.items()}
    if value is None or isinstance(value, str):
        return value
    raise InputError(expected="a kind of platform, or a mapping with kind", got=value)


def _plain(value: object) -> Any:
    """Numbers where there are such, text elsewhere, to any depth: the platform's constructor knows which."""
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    try:
        return number(value)
    except ValueError:
        return value


Three = Annotated[list[float], BeforeValidator(lambda value: _point(value, (3,), "3 numbers"))]


class RobotPart(KeyedPart):
    """Which robot. A bare name or path in its place is its source."""

    source: Annotated[str, AfterValidator(_source), BeforeValidator(readable)] = Field(
        description="a bundled name (see `nmm robots`), a .urdf, .xacro or .xml file, relative to the "
        "scenario, or package://PACKAGE/PATH"
    )
    arguments: dict[str, Annotated[str, BeforeValidator(_argument)]] = Field(
        default_factory=dict, description="xacro arguments, as {d: 0.5, l1: 0.6}"
    )
    platform: Annotated[str | dict[str, Any] | None, BeforeValidator(_kind_of_platform)] = Field(
        None,
        description="a kind (car), measured in the file, or {kind: car, wheelbase: 0.5}; by default "
        "what the file declares, else what its wheels allow",
    )
    package_dirs: list[NamedFolder] = Field(
        default_factory=list,
        description="folders of package:// names, or NAME=FOLDER of one package, relative to the scenario",
    )
    wheels: Annotated[list[str] | dict[str, float] | None, BeforeValidator(_wheels)] = Field(
        None,
        description="passive wheels: a list, or with radius, m, {wheel_left: 0.1}; by default found "
        "in the file",
    )
    lock: dict[str, Number] = Field(
        default_factory=dict,
        description="joints to fix, rad or m: {torso: 0.2}, or {'*finger*': 0} for all that match",
    )
    axle: Annotated[str | list[float] | None, BeforeValidator(_axle)] = Field(
        None,
        description="the platform's reference point in the root link: a frame, or [x, y, z, yaw], m and rad, "
        "whose last may be left out; by default amid the wheels that do not steer",
    )
    steer: list[str] = Field(
        default_factory=list,
        description="upright joints that steer; by default those called so, and those that end on both sides "
        "right above their wheels",
    )
    limits: dict[str, Number] = Field(
        default_factory=dict, description="largest absolute values of the platform's inputs: {v: 0.5}"
    )
    srdf: FileName | None = Field(
        None,
        description="MoveIt's file of postures and groups, relative to the scenario, or "
        "package://PACKAGE/PATH; by default the one beside the robot's file",
    )
    calibration: FileName | None = Field(
        None,
        description="a calibration.yaml, the robot's numbers as they were learned, relative to the scenario, "
        "or package://PACKAGE/PATH; by default those of its file",
    )
    missing_meshes: Literal["error", "skip"] = Field(
        "error", description="error, or skip to leave out shapes whose mesh is not there"
    )

    def build(self) -> Robot:
        from nmm.model.robots.loading import load

        data = self.model_dump() | {"platform": _platform(self.platform)}
        return load(data.pop("source"), **data)

    def explicit(self) -> dict[str, Any]:
        return self.model_dump()


def _named(value: object) -> object:
    return {"source": value} if isinstance(value, str) else value


AnyRobotPart = Annotated[RobotPart, BeforeValidator(_named)]


class ArmPart(KeyedPart):
    """An arm, and where it is mounted."""

    arm: AnyRobotPart = Field(description="the arm: a name, a path, or a mapping with the keys of a robot")
    at: str | None = Field(
        None, description="the platform's frame that carries it; by default mount, arm_mount or top"
    )
    xyz: Three = Field([0.0, 0.0, 0.0], description="of the arm's root link in that frame, m")
    rpy: Three = Field([0.0, 0.0, 0.0], description="roll, pitch, yaw about fixed axes, rad")
    prefix: str | None = Field(
        None,
        description="put before the arm's names; by default none, or the arm's name where they clash",
    )

    def mount_on(self, platform: Robot) -> Robot:
        from nmm.model.robots.loading import mount

        with at("arm"):
            arm = self.arm.build()
        with self.own_keys():
            return mount(platform, arm, at=self.at, placement=(self.xyz, self.rpy), prefix=self.prefix)


class MountedPart(KeyedPart):
    """A platform with arms on it: as a robot with `arm`, `at`, `xyz`, `rpy`, `prefix`, or with `arms`."""

    platform: AnyRobotPart = Field(
        description="the platform: a name, a path, or a mapping with the keys of a robot (where "
        "platform is the kind)"
    )
    arms: list[ArmPart] = Field(default_factory=list, description="several arms: a list of such keys")
    arm: AnyRobotPart | None = Field(None, description="one arm: as in the list, beside platform")
    at: str | None = Field(None, description="as in the list")
    xyz: Three | None = Field(None, description="as in the list")
    rpy: Three | None = Field(None, description="as in the list")
    prefix: str | None = Field(None, description="as in the list")
    limits: dict[str, Number] = Field(
        default_factory=dict, description="largest absolute values of the platform's inputs: {v: 0.5}"
    )

    @model_validator(mode="before")
    @classmethod
    def _one_form(cls, data: Any) -> Any:
        if "arms" in data:
            for key in ("arm", "at", "xyz", "rpy", "prefix"):
                if key in data:
                    raise KeyedError((key,), expected="it in the list of arms, where arms is given")
            if not data["arms"]:
                raise KeyedError(("arms",), expected="at least 1")
        return data

    def build(self) -> Robot:
        for name in self.limits.keys() & self.platform.limits.keys():
            raise KeyedError(("limits", name), expected=f"once, it is in platform.limits.{name} too")
        with at("platform"):
            robot = self._limited().build()
        for below, arm in self._mounted():
            with at(*below):
                robot = arm.mount_on(robot)
        return robot

    def explicit(self) -> dict[str, Any]:
        platform, arms = (
            {"platform": self._limited().model_dump()},
            [arm.model_dump() for _, arm in self._mounted()],
        )
        return {**platform, "arms": arms} if self.arm is None else platform | arms[0]

    def _limited(self) -> RobotPart:
        return self.platform.model_copy(update={"limits": self.platform.limits | self.limits})

    def _mounted(self) -> list[tuple[Place, ArmPart]]:
        """The arms, and where in this part each is written: the only one may be written in it."""
        if self.arm is not None:
            return [((), ArmPart(**self.given(*ArmPart.model_fields)))]
        return [(("arms", i), arm) for i, arm in enumerate(self.arms)]


def _chosen(value: Any, _: Any) -> RobotPart | MountedPart:
    """The presence of an arm decides which keys there are."""
    if isinstance(value, RobotPart | MountedPart):
        return value
    value = _named(value)
    mounted = isinstance(value, Mapping) and ("arm" in value or "arms" in value)
    return (MountedPart if mounted else RobotPart).model_validate(value)


RobotChoice = Annotated[RobotPart | MountedPart, WrapValidator(_chosen)]


def _platform(value: str | dict[str, Any] | None) -> Platform | str | None:
    """The platform of a mapping with its kind and parameters; a name stays one."""
    if not isinstance(value, dict):
        return value
    from nmm.model.platforms import platform_by_name

    keywords = {key: item for key, item in value.items() if key != "kind"}
    with at("platform"):
        with at("kind"):
            kind = platform_by_name(value["kind"])
        if not keywords:
            return kind.name
        parameters = inspect.signature(kind).parameters
        for key in keywords:
            with at(key):
                expect_known("key", key, ["kind", *parameters])
        for key, parameter in parameters.items():
            if key not in keywords and parameter.default is inspect.Parameter.empty:
                raise KeyedError((key,), f"this key is missing for platform {kind.name} with parameters")
        try:
            return kind(**keywords)
        except InputError as error:
            where = error.where.removeprefix(kind.name).removeprefix(": ")
            head, _, rest = where.partition(": ")
            if head in keywords:
                raise error.placed(rest, partial(KeyedError, (head,))) from None
            raise error.placed(where) from None
