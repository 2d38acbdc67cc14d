"""Groups of options that several commands take: a parameter of a command may be such a group."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, fields, is_dataclass
from functools import partial, wraps
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, get_origin, get_type_hints

import typer
from typer.models import ParameterInfo

from nmm.base.errors import InputError, expect_known
from nmm.base.kinds import PLATFORMS
from nmm.base.plugins import OptionGroup, complain, groups_of_options
from nmm.base.text_format import listed
from nmm.base.trust import trusting
from nmm.cli.beside import GuardedBeside, guarded
from nmm.cli.options import (
    AT,
    SUBJECT_SET,
    axle_of,
    flag,
    names_of,
    option,
    task_option,
    values_of,
    wheels_of,
)

if TYPE_CHECKING:
    from nmm.base.ellipsoid_options import Wanted
    from nmm.base.figure_options import FigureOptions


@dataclass(frozen=True)
class AddedOptions:
    """The groups of options that plugins have at one place of a command, as they were used."""

    groups: tuple[OptionGroup, ...]

    @property
    def answers(self) -> list[str]:
        return [option for group in self.groups for option in group.answers]

    def asked(self) -> str:
        return next((option for group in self.groups if (option := group.asked())), "")

    def check(self) -> None:
        for group in self.groups:
            group.check()

    def refuse(self) -> None:
        for group in self.groups:
            group.refuse()

    def answer(self, *subject: Any) -> int | None:
        """The exit status of the first that answers, those before that were asked; None where none does."""
        for group in sorted(self.groups, key=lambda group: not group.asked()):
            if (status := group.answer(*subject)) is not None:
                return status
        return None

    @contextmanager
    def beside(self, scenario: Any, controller: Any) -> Iterator[list[GuardedBeside]]:
        """What each has to go on beside a run."""
        with ExitStack() as stack:
            yield [stack.enter_context(guarded(group.beside(scenario, controller))) for group in self.groups]


@dataclass(frozen=True)
class PlaceOfOptions:
    """Of a parameter `AddedOptions`: the place in a command where plugins add options, by its name."""

    name: str

    def groups(self, taken: set[str]) -> list[type[OptionGroup]]:
        """Plugins' groups; one is left out that has an option which the command or another group has."""
        groups: list[type[OptionGroup]] = []
        for addition in groups_of_options(self.name):
            group = addition.load()
            if group is None:
                continue
            fits = isinstance(group, type) and issubclass(group, OptionGroup) and is_dataclass(group)
            names = {field.name for field in fields(group)} if fits else set()
            if not fits or names & taken:
                what = (
                    f"options that are there: {listed(sorted(names & taken))}" if fits else "no OptionGroup"
                )
                complain(addition.plugin, f"{addition.entry}: {what}; it is left out")
                continue
            taken |= names
            groups.append(group)
        return groups


def command(function: Callable[..., int | None], opens: bool = False) -> Callable[..., int | None]:
    """The function as typer takes it: options in the place of each parameter that is a group of them. One
    that `opens` runs or scenarios has --trust behind its own.

    From Python it is called with the options: `redundancy("unicycle_2r", task=["position"])`.
    """
    own = _typed(function)
    hints = {name: parameter.annotation for name, parameter in own.items()}
    places = {name: place for name, hint in hints.items() if (place := _place_of(hint)) is not None}
    groups: dict[str, Sequence[type[Any]]] = {
        name: [hint] for name, hint in hints.items() if isinstance(hint, type) and is_dataclass(hint)
    }
    taken = own.keys() - groups.keys() - places.keys()
    taken |= {field.name for (group,) in groups.values() for field in fields(group)}
    groups |= {name: place.groups(taken) for name, place in places.items()}
    parameters = [
        parameter
        for name, own_parameter in own.items()
        for parameter in ([own_parameter] if name not in groups else _options(groups[name]))
    ]
    parameters += _options([Trust] if opens else [])
    signature = inspect.Signature(
        [
            parameter.replace(
                kind=parameter.POSITIONAL_OR_KEYWORD
                if parameter.default is parameter.empty
                else parameter.KEYWORD_ONLY
            )
            for parameter in parameters
        ]
    )

    @wraps(function)
    def whole(*arguments: Any, **options: Any) -> int | None:
        bound = signature.bind(*arguments, **options)
        bound.apply_defaults()
        values = {
            name: value.default if isinstance(value, ParameterInfo) else value
            for name, value in bound.arguments.items()
        }
        for name, several in groups.items():
            filled = tuple(
                group(**{field.name: values.pop(field.name) for field in fields(group)}) for group in several
            )
            values[name] = AddedOptions(filled) if name in places else filled[0]
        trust = values.pop(_TRUST, False) or any(getattr(value, _TRUST, False) for value in values.values())
        with trusting(trust):  # of a scenario's robots, too, which no key of a scenario can trust
            return function(**values)

    del whole.__wrapped__
    whole.__signature__ = signature  # type: ignore[attr-defined]  # what typer reads
    whole.__annotations__ = {parameter.name: parameter.annotation for parameter in parameters}
    return whole


def _place_of(hint: Any) -> PlaceOfOptions | None:
    note = hint.__metadata__[0] if get_origin(hint) is Annotated else None
    return note if isinstance(note, PlaceOfOptions) else None


def _options(groups: Sequence[type]) -> list[inspect.Parameter]:
    return [parameter for group in groups for parameter in _typed(group).values()]


def _typed(made: Callable[..., Any]) -> dict[str, inspect.Parameter]:
    hints = get_type_hints(made, include_extras=True)
    return {
        name: parameter.replace(annotation=hints[name])
        for name, parameter in inspect.signature(made).parameters.items()
    }


@dataclass(frozen=True)
class Trust:
    trust: bool = flag(
        "--trust",
        "Let xacro files run programs of their authors, and read environment variables and any file.",
    )


#: Of a command that opens a run or a scenario, and has no options of a robot.
opening_command = partial(command, opens=True)
_TRUST = fields(Trust)[0].name


@dataclass(frozen=True)
class OfRobot(Trust):
    """What is made of a robot's joints and meshes, of a scenario's robot too."""

    lock: list[str] | None = option(
        "JOINT=VALUE",
        "Fix a joint at a value, rad or m; arithmetic with pi will do. '*finger*=0' fixes all that "
        "match. May be repeated.",
    )
    wheels: str | None = option(
        "JOINT[=RADIUS],...",
        "The joints that only roll, each with its radius in m or all without; none for no wheels.",
        show="those named so",
    )
    calibration: str | None = option(
        "FILE",
        "A calibration.yaml: wheels, lengths and steered joints as they were learned of this robot.",
        show="the scenario's; none of a robot",
    )
    missing_meshes: str | None = option(
        "error|skip",
        "What to do about meshes that are not there: refuse the robot, or leave their shapes out.",
        show="the scenario's; skip to look at a robot, else error",
    )

    def keywords(self) -> dict[str, Any]:
        """As `nmm.load` takes them, without those not given."""
        given = {
            "lock": values_of(self.lock, "--lock", "JOINT=VALUE, as in torso=0.2") or None,
            "wheels": wheels_of(self.wheels),
            "calibration": self.calibration,
            "missing_meshes": self.missing_meshes,
        }
        return {name: value for name, value in given.items() if value is not None}


@dataclass(frozen=True)
class Loading(OfRobot):
    platform: str | None = option(
        "NAME",
        f"How the base moves: {listed(list(PLATFORMS), 'or')}.",
        show="what the file says, or its wheels allow",
    )
    axle: str | None = option(
        "FRAME|X,Y[,Z[,YAW]]",
        "Where the platform's reference point is in the root link: a frame, or x, y and z in m and its "
        "heading in rad (pi/2).",
        show="amid the wheels that do not steer",
    )
    steer: str | None = option(
        "JOINT,...",
        "The upright joints that steer.",
        show="those called so, and those that end on both sides right above their wheels",
    )
    package_dir: list[Path] | None = option(
        "[NAME=]DIR",
        "A folder that is, or holds, the packages of package:// and $(find ...); NAME=DIR is that of one "
        "package. May be repeated.",
        "--package-dir",
    )
    srdf: str | None = option(
        "FILE",
        "An SRDF with named postures and groups.",
        show="the one beside the robot's file, if there is one",
    )

    def keywords(self) -> dict[str, Any]:
        return super().keywords() | {
            "platform": self.platform,
            "axle": axle_of(self.axle),
            **({} if self.steer is None else {"steer": names_of(self.steer, "--steer", "JOINT,JOINT,...")}),
            "package_dirs": list(self.package_dir or ()),
            "srdf": self.srdf,
        }


@dataclass(frozen=True)
class Subject:
    subject: Annotated[
        str,
        typer.Argument(
            metavar="SUBJECT",
            help="A robot (a bundled name, a .urdf, .xacro or .xml file, package://PACKAGE/PATH) with "
            "--task; a scenario; or a run's folder.",
            show_default=False,
        ),
    ]
    task: list[str] | None = task_option("the scenario's")
    at: list[str] | None = AT
    settings: list[str] | None = SUBJECT_SET

    def keywords(self) -> dict[str, Any]:
        return {"tasks": self.task, "at": self.at, "settings": self.settings}


@dataclass(frozen=True)
class Browser:
    port: int | None = option("N", "Port on this machine.", show="a free one")
    no_open: bool = flag("--no-open", "Print the address, open no browser.")

    def keywords(self) -> dict[str, Any]:
        return {"port": self.port, "open_browser": not self.no_open}

    def refuse(self, needed: str) -> None:
        """`InputError` where something is asked of a page that only the option `needed` shows."""
        asked = ["--port"] * (self.port is not None) + ["--no-open"] * self.no_open
        if asked:
            raise InputError(f"there is a page only with {needed}, which is not given", where=asked[0])


@dataclass(frozen=True)
class EllipsoidGroup:
    ellipsoids: bool = flag(
        "--ellipsoids",
        "Draw the manipulability ellipsoids: how fast the robot, and its arm alone, can move the "
        "end-effector in each direction.",
    )
    ellipsoid_scale: float | None = option(
        "M", "Draw the ellipsoids, with M metres for each m/s.", show="a readable one"
    )

    def wanted(self) -> Wanted:
        """What they ask for; a scale alone asks for ellipsoids too; `InputError` for one not above zero."""
        if self.ellipsoid_scale is None:
            return self.ellipsoids
        from nmm.base.ellipsoid_options import EllipsoidOptions

        return EllipsoidOptions(scale=self.ellipsoid_scale)


@dataclass(frozen=True)
class Figures:
    format: str = option(
        "KIND,KIND,...", "Formats of the figures: some of png, pdf, svg.", "--format", default="png"
    )
    width: str | None = option(
        "IN",
        "Width of the figures, in; or column (3.5 in) or page (7.16 in), as journals have them.",
        show="as reads well on a screen",
    )

    def options(self) -> FigureOptions:
        from nmm.base.figure_options import FORMATS, FigureOptions

        formats = tuple(dict.fromkeys(names_of(self.format, "--format")))
        for name in formats:
            expect_known("format", name, FORMATS, "--format")
        width: float | str | None = self.width
        with suppress(ValueError, TypeError):
            width = float(self.width or "")
        return FigureOptions(formats, width)
