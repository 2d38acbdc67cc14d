"""Groups of options that several commands take: a parameter of a command may be such a group."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, fields, is_dataclass
from functools import wraps
from typing import TYPE_CHECKING, Any, get_type_hints

from nmm.cli.options import (
    AtOption,
    AxleOption,
    EllipsoidScaleOption,
    EllipsoidsOption,
    FormatOption,
    LockOption,
    MissingMeshesOption,
    NoOpenOption,
    PackageOption,
    PlatformOption,
    PortOption,
    SrdfOption,
    SubjectArgument,
    SubjectSetOption,
    TaskOption,
    WheelsOption,
    WidthOption,
    axle_of,
    lock_of,
    names_of,
    wheels_of,
)
from nmm.errors import InputError, expect_known

if TYPE_CHECKING:
    from nmm.runs.ellipsoid_options import Wanted
    from nmm.runs.figure_options import FigureOptions


def command(function: Callable[..., int | None]) -> Callable[..., int | None]:
    """The function as typer takes it: options in the place of each parameter that is a group of them.

    It is called with the options, too, from Python: `redundancy("unicycle_2r", task=["position"])`.
    """
    hints = get_type_hints(function, include_extras=True)
    groups: dict[str, type] = {}
    parameters: list[inspect.Parameter] = []
    for name, parameter in inspect.signature(function).parameters.items():
        hint = hints[name]
        if is_dataclass(hint) and isinstance(hint, type):
            groups[name] = hint
            parameters += _options(hint)
        else:
            parameters.append(_option(parameter, hint))
    signature = inspect.Signature(parameters)

    @wraps(function)
    def whole(*arguments: Any, **options: Any) -> int | None:
        bound = signature.bind(*arguments, **options)
        bound.apply_defaults()
        given = dict(bound.arguments)
        made = {
            name: group(**{field.name: given.pop(field.name) for field in fields(group)})
            for name, group in groups.items()
        }
        return function(**made, **given)

    del whole.__wrapped__
    whole.__signature__ = signature  # type: ignore[attr-defined]  # what typer reads
    whole.__annotations__ = {parameter.name: parameter.annotation for parameter in parameters}
    return whole


def _options(group: type) -> list[inspect.Parameter]:
    hints = get_type_hints(group, include_extras=True)
    given = inspect.signature(group).parameters
    return [_option(parameter, hints[name]) for name, parameter in given.items()]


def _option(parameter: inspect.Parameter, hint: Any) -> inspect.Parameter:
    """Positional where it has no default."""
    required = parameter.default is parameter.empty
    kind = parameter.POSITIONAL_OR_KEYWORD if required else parameter.KEYWORD_ONLY
    return parameter.replace(kind=kind, annotation=hint)


@dataclass(frozen=True)
class OfRobot:
    """What is made of a robot's joints and meshes, of a scenario's robot too."""

    lock: LockOption = None
    wheels: WheelsOption = None
    missing_meshes: MissingMeshesOption = None

    def keywords(self) -> dict[str, Any]:
        """As `nmm.load` takes them, without those not given."""
        given = {
            "lock": lock_of(self.lock) or None,
            "wheels": wheels_of(self.wheels),
            "missing_meshes": self.missing_meshes,
        }
        return {name: value for name, value in given.items() if value is not None}


@dataclass(frozen=True)
class Loading(OfRobot):
    """How a robot's file is loaded."""

    platform: PlatformOption = None
    axle: AxleOption = None
    package_dir: PackageOption = None
    srdf: SrdfOption = None

    def keywords(self) -> dict[str, Any]:
        """As `nmm.load` takes them."""
        return super().keywords() | {
            "platform": self.platform,
            "axle": axle_of(self.axle),
            "package_dirs": list(self.package_dir or ()),
            "srdf": self.srdf,
        }


@dataclass(frozen=True)
class Subject:
    """What a command analyses, and where."""

    subject: SubjectArgument
    task: TaskOption = None
    at: AtOption = None
    settings: SubjectSetOption = None

    def keywords(self) -> dict[str, Any]:
        """All but the subject's name, as `nmm.cli.subjects.studied` takes them."""
        return {"tasks": self.task, "at": self.at, "settings": self.settings}


@dataclass(frozen=True)
class Browser:
    """How a page is served."""

    port: PortOption = None
    no_open: NoOpenOption = False

    def keywords(self) -> dict[str, Any]:
        """As `nmm.playback` takes them."""
        return {"port": self.port, "open_browser": not self.no_open}

    def refuse(self, needed: str) -> None:
        """`InputError` where something is asked of a page that only the option `needed` shows."""
        asked = ["--port"] * (self.port is not None) + ["--no-open"] * self.no_open
        if asked:
            raise InputError(f"{asked[0]}: there is a page only with {needed}, which is not given")


@dataclass(frozen=True)
class Ellipsoids:
    """Whether manipulability ellipsoids are drawn, and how large."""

    ellipsoids: EllipsoidsOption = False
    ellipsoid_scale: EllipsoidScaleOption = None

    def wanted(self) -> Wanted:
        """What they ask for; a scale alone asks for ellipsoids too; `InputError` for one not above zero."""
        if self.ellipsoid_scale is None:
            return self.ellipsoids
        from nmm.runs.ellipsoid_options import EllipsoidOptions

        return EllipsoidOptions(scale=self.ellipsoid_scale)


@dataclass(frozen=True)
class Figures:
    """As what figures are written, and how wide."""

    format: FormatOption = "png"
    width: WidthOption = None

    def options(self) -> FigureOptions:
        """What they ask for; `InputError` for an unknown format or width."""
        from nmm.runs.figure_options import FORMATS, FigureOptions

        formats = tuple(dict.fromkeys(names_of(self.format, "--format")))
        for name in formats:
            expect_known("format", name, FORMATS, "--format")
        width: float | str | None = self.width
        with suppress(ValueError, TypeError):
            width = float(self.width or "")
        return FigureOptions(formats, width)
