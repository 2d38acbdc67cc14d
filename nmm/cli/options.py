"""Options that several commands have, and what their texts mean."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

import typer

from nmm.errors import InputError
from nmm.kinds import PLATFORMS, RESOLVERS, TASKS
from nmm.words import listed, quoted

ROBOT_HELP = "A bundled name (see `nmm robots`), a .urdf or .xacro file, or package://PACKAGE/PATH."

ScenarioArgument = Annotated[
    str, typer.Argument(metavar="SCENARIO", help="A bundled name (see `nmm scenarios`) or a YAML file.")
]
SubjectArgument = Annotated[
    str,
    typer.Argument(
        metavar="SUBJECT",
        help="A robot (a bundled name, a .urdf or .xacro file, package://PACKAGE/PATH) with --task; a "
        "scenario; or a run's folder.",
        show_default=False,
    ),
]
SetOption = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="KEY=VALUE",
        help="Change a key of the scenario, by its dotted path; lists count from 0. Numbers may be "
        "arithmetic with pi, lists and mappings are written as in YAML. May be repeated.",
    ),
]
ArgumentOption = Annotated[
    list[str] | None,
    typer.Option(
        "--set", "-a", metavar="ARG=VALUE", help="Set an argument of a xacro file. May be repeated."
    ),
]
PlatformOption = Annotated[
    str | None,
    typer.Option(
        metavar="NAME",
        help=f"How the base moves: {listed(list(PLATFORMS), 'or')}.",
        show_default="what the file says, or a car or a unicycle, as its wheels steer",
    ),
]
LockOption = Annotated[
    list[str] | None,
    typer.Option(
        metavar="JOINT=VALUE",
        help="Fix a joint at a value, rad or m; arithmetic with pi will do. '*finger*=0' fixes all that "
        "match. May be repeated.",
    ),
]
WheelsOption = Annotated[
    str | None,
    typer.Option(
        metavar="JOINT[=RADIUS],...",
        help="The joints that only roll, each with its radius in m or all without; none for no wheels.",
        show_default="those named so",
    ),
]
MissingMeshesOption = Annotated[
    str | None,
    typer.Option(
        metavar="error|skip",
        help="What to do about meshes that are not there: refuse the robot, or leave their shapes out.",
        show_default="the scenario's; skip to look at a robot, else error",
    ),
]
AxleOption = Annotated[
    str | None,
    typer.Option(
        metavar="FRAME|X,Y",
        help="Where the platform's reference point is in the root link: a frame, or x and y in m.",
        show_default="the root link's origin",
    ),
]
ArmOption = Annotated[
    str | None,
    typer.Option(metavar="ARM", help="A file or bundled name of an arm, to be mounted on the robot."),
]
_TASK_HELP = (
    f"The task, of KIND {listed(list(TASKS), 'or')}: position:ee:xy, pose, coordinates:q1,q2; or "
    "a mapping as in a scenario, '{kind: pointing, frame: ee, at: [2, 0, 1]}'. Without FRAME the end of "
    "the arm. May be repeated: tasks stand above each other."
)
TaskOption = Annotated[
    list[str] | None,
    typer.Option("--task", metavar="KIND[:FRAME[:AXES]]", help=_TASK_HELP, show_default="the scenario's"),
]
ViewedTaskOption = Annotated[
    list[str] | None,
    typer.Option("--task", metavar="KIND[:FRAME[:AXES]]", help=_TASK_HELP, show_default="none"),
]
AtOption = Annotated[
    list[str] | None,
    typer.Option(
        "--at",
        metavar="COORDINATE=VALUE",
        help="Where, m or rad; arithmetic with pi will do; posture=NAME: one of the SRDF's. May be repeated.",
        show_default="a scenario's start; 0, or the nearest within the limits",
    ),
]
SubjectSetOption = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="KEY=VALUE",
        help="Set an argument of a robot's xacro file (d=0), or a key of a scenario "
        "(robot.arguments.d=0). May be repeated.",
    ),
]
PackageOption = Annotated[
    list[Path] | None,
    typer.Option(
        "--package-dir",
        metavar="DIR",
        help="A folder that is, or holds, the packages of package:// and $(find ...). May be repeated.",
    ),
]
SrdfOption = Annotated[
    str | None,
    typer.Option(
        metavar="FILE",
        help="An SRDF with named postures and groups.",
        show_default="the one beside the robot's file, if there is one",
    ),
]
PortOption = Annotated[
    int | None, typer.Option(metavar="N", help="Port on this machine.", show_default="a free one")
]
NoOpenOption = Annotated[bool, typer.Option("--no-open", help="Print the address, open no browser.")]
ResolverOption = Annotated[
    str | None,
    typer.Option(
        metavar="|".join(RESOLVERS),
        help=f"Resolve the redundancy with the "
        f"{listed([f'{RESOLVERS.words(name)} ({name})' for name in RESOLVERS], 'or')}, "
        "with those of the scenario's settings that it knows; or as in --resolvers of `nmm compare`.",
    ),
]
ResolversOption = Annotated[
    str,
    typer.Option(metavar="KIND,KIND,...", help=f"The resolvers: some of {', '.join(RESOLVERS)}."),
]
LengthOption = Annotated[
    float | None,
    typer.Option(
        metavar="M",
        help="Characteristic length: so many m count as 1 rad; such as the arm's reach.",
        show_default="1",
    ),
]
EllipsoidsOption = Annotated[
    bool,
    typer.Option(
        "--ellipsoids",
        help="Draw the manipulability ellipsoids: how fast the robot, and its arm alone, can move the "
        "end-effector in each direction.",
    ),
]
EllipsoidScaleOption = Annotated[
    float | None,
    typer.Option(
        metavar="M",
        help="Draw the ellipsoids, with M metres for each m/s.",
        show_default="a readable one",
    ),
]
FormatOption = Annotated[
    str,
    typer.Option("--format", metavar="KIND,KIND,...", help="Formats of the figures: some of png, pdf, svg."),
]
WidthOption = Annotated[
    str | None,
    typer.Option(
        metavar="IN",
        help="Width of the figures, in; or column (3.5 in) or page (7.16 in), as journals have them.",
        show_default="as reads well on a screen",
    ),
]
LimitsOption = Annotated[
    bool | None,
    typer.Option(
        "--limits/--no-limits",
        help="Keep the robot's own limits where the scenario says none, or keep none at all.",
        show_default="as the scenario says",
    ),
]


def out_option(default: str) -> Any:
    """The `--out` of a command that writes a folder; `default` says which."""
    return typer.Option(
        metavar="DIR",
        help="Where to write. What this command wrote there before is replaced; a folder of anything else "
        "is refused.",
        show_default=default,
    )


def names_of(given: str, option: str, expected: str = "names with commas between them") -> list[str]:
    """Names with commas between them; `InputError` where there is none."""
    names = [name.strip() for name in given.split(",") if name.strip()]
    if not names:
        raise InputError(f"{option}: expected {expected}, got {given!r}")
    return names


def settings_of(given: Sequence[str] | None) -> dict[str, object]:
    """The `--set` options of a scenario: values by dotted key."""
    return dict(_pairs(given, "--set", "KEY=VALUE, as in resolver.alpha=5"))


def arguments_of(given: Sequence[str] | None) -> dict[str, object]:
    """The `--set` options of a robot's file: xacro arguments by name."""
    return dict(_pairs(given, "--set", "ARG=VALUE, as in d=0.5"))


def lock_of(given: Sequence[str] | None) -> dict[str, float]:
    """The `--lock` options: values (rad or m) by joint."""
    return values_of(given, "--lock", "JOINT=VALUE, as in torso=0.2")


def values_of(given: Sequence[str] | None, option: str, expected: str) -> dict[str, float]:
    """Numbers by name, of an option NAME=VALUE that may be repeated; arithmetic with pi will do.

    Raises
    ------
    InputError : no NAME=VALUE, not a number, or a name given twice
    """
    from nmm.scenario.numbers import evaluate

    values: dict[str, float] = {}
    for name, text in _pairs(given, option, expected):
        if name in values:
            raise InputError(f"{option}: {name} is given twice")
        try:
            values[name] = evaluate(text)
        except ValueError as error:
            raise InputError(f"{option}: {name}: {error}") from None
    return values


def wheels_of(given: str | None) -> list[str] | dict[str, float] | None:
    """The `--wheels` option: joints, or the radius (m) of each; none of them for "none"."""
    if given is None:
        return None
    names = names_of(given, "--wheels", "JOINT,JOINT,... or JOINT=RADIUS,...")
    if names == ["none"]:
        return []
    if not any("=" in name for name in names):
        return names
    return values_of(names, "--wheels", "a radius for each, as in left=0.1,right=0.1, or for none")


def axle_of(given: str | None) -> str | list[float] | None:
    """The `--axle` option: a frame, or x, y (and z), m."""
    if given is None or ("," not in given and any(letter.isalpha() for letter in given)):
        return given
    if "," not in given:
        raise InputError(
            f"--axle: expected a frame, or X,Y (or X,Y,Z) in m with commas between, got {quoted(given)}"
        )
    from nmm.scenario.numbers import evaluate

    try:
        return [evaluate(part) for part in given.strip("([ ])").split(",")]
    except ValueError as error:
        raise InputError(f"--axle: expected a frame or X,Y in m, got {given!r}: {error}") from None


def _pairs(given: Sequence[str] | None, option: str, expected: str) -> list[tuple[str, str]]:
    pairs = []
    for text in given or ():
        key, equals, value = text.partition("=")
        if not equals or not key.strip():
            raise InputError(f"{option}: expected {expected}, got {quoted(text)}")
        pairs.append((key.strip(), value))
    return pairs
