"""Options that several commands have, and how their texts are read: resolvers among them, a kind, a kind with
settings of its own, or one in a Python file."""

from __future__ import annotations

import re
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from nmm.base.errors import InputError, NmmError, Setting, expect, no_such
from nmm.base.kinds import RESOLVERS, TASKS
from nmm.base.text_format import listed, split_outside_brackets

if TYPE_CHECKING:
    from nmm.control.resolvers.base import Resolver
    from nmm.scenario import Scenario

ROBOT_HELP = "A bundled name (see `nmm robots`), a .urdf, .xacro or .xml file, or package://PACKAGE/PATH."


def option(metavar: str, text: str, *names: str, default: Any = None, show: str | bool = True) -> Any:
    """An option with a value, and its help; `show` is what the help gives as its default."""
    return typer.Option(default, *names, metavar=metavar, help=text, show_default=show)


def flag(name: str, text: str, default: bool | None = False, show: str | bool = True) -> Any:
    """An option that is given or not, or in both forms (--limits/--no-limits)."""
    return typer.Option(default, name, help=text, show_default=show)


def task_option(show: str) -> Any:
    """The `--task` of a command; `show` says which task stands where none is given."""
    return option(
        "KIND[:FRAME[:AXES]]",
        f"The task, of KIND {listed(list(TASKS), 'or')}: position:ee:xy, pose, coordinates:q1,q2; or "
        "a mapping as in a scenario, '{kind: pointing, frame: ee, at: [2, 0, 1]}'. Without FRAME the end of "
        "the arm. May be repeated: tasks stand above each other.",
        "--task",
        show=show,
    )


def out_option(default: str) -> Any:
    """The `--out` of a command that writes a folder; `default` says which."""
    return typer.Option(
        metavar="DIR",
        help="Where to write. What this command wrote there before is replaced; a folder of anything else "
        "is refused.",
        show_default=default,
    )


ScenarioArgument = Annotated[
    str, typer.Argument(metavar="SCENARIO", help="A bundled name (see `nmm scenarios`) or a YAML file.")
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
ResolversOption = Annotated[
    str,
    typer.Option(metavar="KIND,KIND,...", help=f"The resolvers: some of {', '.join(RESOLVERS)}."),
]
#: Kept here: `nmm --help` imports no table.
_FORMS = ("latex", "csv", "markdown")
TableOption = Annotated[
    str | None,
    typer.Option(
        "--table",
        metavar="|".join(_FORMS),
        help="Print the numbers as a paper takes them, with units, and nothing else on standard output.",
        show_default="a table for the terminal",
    ),
]
#: `--set` of a robot's file, and of a file or a scenario.
ARGUMENT = option("ARG=VALUE", "Set an argument of a xacro file. May be repeated.", "--set", "-a")
SUBJECT_SET = option(
    "KEY=VALUE",
    "Set an argument of a robot's xacro file (d=0), or a key of a scenario "
    "(robot.arguments.d=0). May be repeated.",
    "--set",
)
ARM = option("ARM", "A file or bundled name of an arm, to be mounted on the robot.")
AT = option(
    "COORDINATE=VALUE",
    "Where, m or rad; arithmetic with pi will do; posture=NAME: one of the SRDF's. May be repeated.",
    "--at",
    show="a scenario's start; 0, or the nearest within the limits",
)
LENGTH = option("M", "Characteristic length: so many m count as 1 rad; such as the arm's reach.", show="1")
LIMITS = flag(
    "--limits/--no-limits",
    "Keep the robot's own limits where the scenario says none, or keep none at all.",
    default=None,
    show="as the scenario says",
)


def names_of(value: str, option: str, expected: str = "names with commas between them") -> list[str]:
    names = [name.strip() for name in value.split(",") if name.strip()]
    expect(names, option, expected, value)
    return names


def form_of(value: str | None) -> str | None:
    expect(value is None or value in _FORMS, "--table", listed(list(_FORMS), "or"), value)
    return value


def settings_of(texts: Sequence[str] | None) -> dict[str, object]:
    return dict(_pairs(texts, "--set", "KEY=VALUE, as in resolver.alpha=5"))


def arguments_of(texts: Sequence[str] | None) -> dict[str, object]:
    return dict(_pairs(texts, "--set", "ARG=VALUE, as in d=0.5"))


def values_of(
    texts: Sequence[str] | None, option: str, expected: str, read: Callable[[str], Any] | None = None
) -> dict[str, Any]:
    """Values of a repeatable option NAME=VALUE by name, numbers unless `read` is given; or `InputError`."""
    from nmm.scenario.numbers import evaluate

    values: dict[str, Any] = {}
    for name, text in _pairs(texts, option, expected):
        if name in values:
            raise InputError(f"{name} is given twice", where=option)
        try:
            values[name] = (read or evaluate)(text)
        except InputError as error:
            raise error.at(f"{option}: {name}") from None
    return values


def wheels_of(value: str | None) -> list[str] | dict[str, float] | None:
    """The `--wheels` option: joints, or the radius (m) of each; none of them for "none"."""
    if value is None:
        return None
    names = names_of(value, "--wheels", "JOINT,JOINT,... or JOINT=RADIUS,...")
    if names == ["none"]:
        return []
    if not any("=" in name for name in names):
        return names
    return values_of(names, "--wheels", "a radius for each, as in left=0.1,right=0.1, or for none")


def axle_of(value: str | None) -> str | list[float] | None:
    """The `--axle` option: a frame, or x, y (and z), m, and a yaw, rad."""
    if value is None or ("," not in value and any(letter.isalpha() for letter in value)):
        return value
    expected = "a frame, or X,Y[,Z[,YAW]] in m and rad with commas between"
    expect("," in value, "--axle", expected, value)
    from nmm.scenario.numbers import evaluate

    try:
        return [evaluate(part) for part in value.strip("([ ])").split(",")]
    except InputError as error:
        raise InputError(error.what, where="--axle", expected=expected, got=value) from None


def _pairs(texts: Sequence[str] | None, option: str, expected: str) -> list[tuple[str, str]]:
    pairs = []
    for text in texts or ():
        key, equals, value = text.partition("=")
        expect(equals and key.strip(), option, expected, text)
        pairs.append((key.strip(), value))
    return pairs


EXPECTED = (
    "kinds with commas between them, with settings or a Python file's, as in rg,pg:alpha=50,laws.py:law"
)


@dataclass(frozen=True)
class ChosenResolver:
    text: str  #: as it was given
    kind: str  #: rg, pg, ...; "own" for a Python file's
    settings: tuple[tuple[str, str], ...] = ()  #: of its own, by key, as text
    own: Resolver | None = None  #: the file's

    @property
    def label(self) -> str:
        from nmm.base.resolver_style import pretty

        if self.own is not None:
            return Path(self.text).name
        own = [f"{pretty(key)}={value}" for key, value in self.settings]
        return " ".join([self.kind.upper(), *own]) if own else ""

    def scenario(self, scenario: Scenario) -> Scenario:
        """The scenario with this resolver, which keeps those keys that the kind knows."""
        if self.own is not None:
            file, _, name = self.text.rpartition(":")
            return scenario.with_resolver(self.own, f"{Path(file).resolve()}:{name}")
        settings = {f"resolver.{key}": value for key, value in self.settings}
        return scenario.with_resolver(self.kind).with_settings(settings)


def chosen(text: str, option: str) -> ChosenResolver:
    """One resolver; `InputError` for a text that names none, and for a file without it."""
    kind, *rest = split_outside_brackets(text, ":")
    if kind.endswith(".py"):
        expect(len(rest) == 1 and rest[0], option, "FILE.py:NAME", text)
        return ChosenResolver(f"{kind}:{rest[0]}", "own", own=_from_file(Path(kind), rest[0], option))
    settings = []
    for setting in rest:
        key, equals, value = (part.strip() for part in setting.partition("="))
        expect(key and equals and value, option, "KIND:KEY=VALUE, as in pg:alpha=50", text)
        settings.append((key, value))
    return ChosenResolver(text, kind, tuple(settings))


def size_of(value: str) -> tuple[int, int]:
    """Width and height, px; `InputError` for what is no such size."""
    match = re.fullmatch(r"(\d{1,5})x(\d{1,5})", value)
    if match is None:
        raise InputError(where="--size", expected="WIDTHxHEIGHT, as in 1280x720", got=value)
    return int(match[1]), int(match[2])


def named(value: str, option: str, expected: str = EXPECTED) -> list[str]:
    """The texts between the commas; `InputError` for none, and for one that is given twice."""
    texts = [text for text in split_outside_brackets(value, ",") if text]
    expect(texts, option, expected, value)
    for k, text in enumerate(texts):
        if text in texts[:k]:
            raise _twice(option, text, text)
    return texts


def check_different(resolvers: Sequence[ChosenResolver], scenarios: Sequence[Scenario], option: str) -> None:
    """`InputError` for two that come to the same settings."""
    settings: list[dict[str, Any]] = [scenario.parts.resolver.explicit() for scenario in scenarios]
    for k, values in enumerate(settings):
        if values in settings[:k]:
            raise _twice(option, resolvers[settings.index(values)].text, resolvers[k].text)


@contextmanager
def of_several(
    several: Sequence[ChosenResolver], choice: ChosenResolver, settings: Mapping[str, object]
) -> Iterator[None]:
    """In the block, an error that is about a key of one resolver says it as `--resolvers` takes it."""
    try:
        yield
    except InputError as error:
        from nmm.scenario.resolvers import kinds_with

        key = str(error.got)
        kinds = kinds_with(key) if error.unknown == "key" and f"resolver.{key}" in settings else []
        if kinds:
            what = f"{key} is a key of {listed(kinds)}: {kinds[0]}:{key}=… in --resolvers"
            raise InputError(what, where=error.where) from None
        match error.mend:
            case Setting(("resolver", key), value):
                others = dict.fromkeys(other.text for other in several if other is not choice)
                pasted = ",".join([*others, f"{choice.text}:{key}={value}"])
                raise error.placed(error.where, mend=f"--resolvers '{pasted}'") from None
        raise


def _twice(option: str, first: str, second: str) -> InputError:
    what = f"{first} is given twice" if first == second else f"{first} and {second} are the same here"
    return InputError(what, where=option, expected="resolvers or settings that differ, as in rg,rg:alpha=5")


def _from_file(file: Path, name: str, option: str) -> Resolver:
    """A `Resolver`, a class of such, or a function problem -> u of a Python file, which is run."""
    from nmm.control.resolvers import CallableResolver, Resolver

    where = f"{option}: {file}"
    spec = spec_from_file_location(f"nmm_own_{file.stem}", file)
    if spec is None or spec.loader is None or not file.is_file():
        raise InputError(where=where, expected="a Python file, there is none")
    module = module_from_spec(spec)
    sys.modules[module.__name__] = module  # dataclasses look for theirs there
    try:
        spec.loader.exec_module(module)
        names = [key for key, value in vars(module).items() if callable(value) and not key.startswith("_")]
        if name not in vars(module):
            raise no_such("name", name, names)
        attribute = getattr(module, name)
        made = attribute() if isinstance(attribute, type) and issubclass(attribute, Resolver) else attribute
    except NmmError as error:
        raise error.at(where, InputError) from None
    except Exception as error:  # whatever someone's file does
        raise InputError(f"{type(error).__name__}: {error}", where=where) from error
    if isinstance(made, Resolver):
        return made
    expect(callable(made), f"{where}: {name}", "a function problem -> u or a Resolver", made)
    return CallableResolver(made)
