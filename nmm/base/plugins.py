"""Plugins: what packages add to nmm's core, which imports none of them.

A `Plugin` names what it adds as "package.module:name"; it is imported when it is first used. Shipped plugins
are SHIPPED; strangers' are the entry points of the group `nmm.plugins`, read when a name is asked for that
neither the core nor a shipped plugin has, and where all names are listed. What fails is one line of the log.
"""

from __future__ import annotations

import logging
import re
from collections.abc import Collection, Iterable, Iterator, Mapping
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field
from functools import cache
from pkgutil import resolve_name
from types import MappingProxyType
from typing import Any, ClassVar, NamedTuple

from nmm.base.errors import InputError, expect, expect_kind, expect_known
from nmm.base.text_format import one_line

#: The entry points of strangers' plugins.
GROUP = "nmm.plugins"
#: The description of each shipped plugin.
SHIPPED = (
    "nmm.plugins.planning.plugin:PLUGIN",
    "nmm.plugins.symbolic.plugin:PLUGIN",
    "nmm.plugins.live.plugin:PLUGIN",
    "nmm.plugins.robot.plugin:PLUGIN",
    "nmm.plugins.sweeps.plugin:PLUGIN",
    "nmm.plugins.streams.plugin:PLUGIN",
)
#: What errors call the kinds that a plugin can add.
KINDS = ("platform", "task", "reference", "objective", "resolver", "limit")
#: Longest line about a plugin that fails, in characters.
LONGEST = 300
_ENTRY = re.compile(r"[A-Za-z_][\w.]*:[A-Za-z_]\w*")


@dataclass(frozen=True)
class Plugin:
    """What a package adds to nmm; each entry is "package.module:name", imported when it is first used.

    Parameters
    ----------
    name : letters, digits and _; messages call it so
    kinds : classes by kind, of "platform", "task", "reference", "objective", "resolver" and "limit"
    commands : functions that typer takes, by the command's name
    after : the command behind which one of these is listed; the last where none is named
    options : `OptionGroup` classes by the place in one of nmm's commands: "compare", "singularities.formulas"
    sections : `Section` classes by the key of a scenario's file
    folders : functions of a path that recognise a folder's format, by what the folder is called
    findings : tables from a finding's code to its words
    front : what `nmm` has by another name: `nmm.name`
    """

    name: str
    kinds: Mapping[str, Mapping[str, str]] = field(default_factory=dict)
    commands: Mapping[str, str] = field(default_factory=dict)
    after: Mapping[str, str] = field(default_factory=dict)
    options: Mapping[str, str] = field(default_factory=dict)
    sections: Mapping[str, str] = field(default_factory=dict)
    folders: Mapping[str, str] = field(default_factory=dict)
    findings: tuple[str, ...] = ()
    front: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        expect(re.fullmatch(r"\w+", str(self.name)), "name", "letters, digits and _", self.name)
        expect_kind(self.kinds, Mapping, "kinds", "classes by kind and name")
        for kind in self.kinds:
            expect_known("kind", kind, KINDS, "kinds")
        expect_kind(self.after, Mapping, "after", "commands by name")
        kinds = {kind: _entries(classes, f"kinds: {kind}") for kind, classes in self.kinds.items()}
        checked: dict[str, Mapping[str, Any]] = {"kinds": kinds, "after": dict(self.after)}
        for door in ("commands", "options", "sections", "folders", "front"):
            checked[door] = _entries(getattr(self, door), door)
        for door, table in checked.items():
            object.__setattr__(self, door, MappingProxyType(table))
        expect_kind(self.findings, tuple | list, "findings", "a tuple of tables")
        object.__setattr__(self, "findings", tuple(_checked(entry, "findings") for entry in self.findings))

    def entries(self, door: str) -> Mapping[str, str]:
        """What it adds by a door, by name: "resolver", "commands", "sections"."""
        entries: Mapping[str, str] = self.kinds.get(door, {}) if door in KINDS else getattr(self, door)
        return entries


def _entries(table: object, where: str) -> dict[str, str]:
    expect_kind(table, Mapping, where, '"package.module:name" by name')
    return {str(name): _checked(entry, f"{where}: {name}") for name, entry in dict(table).items()}  # type: ignore[call-overload]  # a mapping


def _checked(entry: object, where: str) -> str:
    expect(isinstance(entry, str) and _ENTRY.fullmatch(entry), where, "package.module:name", entry)
    return str(entry)


class Beside:
    """What goes on beside a run, and cannot end it: what it raises is told when the run is written, and then
    the exit status is 1."""

    def watch(self, recorder: Any) -> None:
        """Called with what records the samples, as `simulate` does it."""

    def end(self, run: Any, asked: bool) -> None:
        """Called with the run when it is over and written; `asked` to end soon, by Ctrl-C."""


class OptionGroup:
    """Options that a plugin adds to a command: a dataclass, each field's default a `typer.Option`."""

    #: The options that ask for its answer in place of the command's: "--search".
    answers: ClassVar[tuple[str, ...]] = ()

    def asked(self) -> str:
        """The option that asks for its answer; "" where none was used."""
        return ""

    def check(self) -> None:
        """`InputError` for options that do not go together."""

    def refuse(self) -> None:
        """`InputError` for an option that was used where the command has nothing that it is of."""

    def answer(self, *subject: Any) -> int | None:
        """Answer for what the command is about: its exit status; None where the command goes on."""
        return None

    def beside(self, scenario: Any, controller: Any) -> AbstractContextManager[Beside]:
        """What goes on beside a run of `nmm run`, and is over with the block."""
        return nullcontext(Beside())


class Addition(NamedTuple):
    """What a plugin adds by one name."""

    plugin: str
    entry: str

    def load(self) -> Any:
        """The object, imported now; None, and a line of the log, where that fails."""
        return _loaded(self.plugin, self.entry)


@cache
def _loaded(plugin: str, entry: str) -> Any:
    try:
        return resolve_name(entry)
    except (Exception, SystemExit) as error:  # whatever a stranger's module does
        complain(plugin, f"{type(error).__name__}: {error}; {entry} is left out")
        return None


@cache
def complain(plugin: str, text: str) -> None:
    """One line of the log about a plugin, once."""
    logging.getLogger("nmm").warning("%s", one_line(f"plugin {plugin}: {text}", LONGEST))


@cache
def shipped_plugins() -> tuple[Plugin, ...]:
    return tuple(_described((entry, entry) for entry in SHIPPED))


def foreign_plugins() -> tuple[Plugin, ...]:
    """Strangers' plugins, in the order of their entry points' names; none for a module of theirs that asks
    while it is imported."""
    return () if _reading else _foreign_plugins()


#: Something is in it while strangers' descriptions are imported.
_reading: list[str] = []


@cache
def _foreign_plugins() -> tuple[Plugin, ...]:
    from importlib.metadata import entry_points  # here: most starts do without

    points = sorted({(point.name, point.value) for point in entry_points(group=GROUP)})
    _reading.append(GROUP)
    try:
        return tuple(_described(points, {plugin.name for plugin in shipped_plugins()}))
    finally:
        _reading.clear()


def _described(points: Iterable[tuple[str, str]], names: Collection[str] = ()) -> Iterator[Plugin]:
    taken = set(names)
    for name, entry in points:
        try:
            plugin = resolve_name(entry)
            if not isinstance(plugin, Plugin):
                raise InputError(where=entry, expected="an nmm.extending.Plugin", got=type(plugin).__name__)
        except (Exception, SystemExit) as error:  # whatever a stranger's module does
            complain(name, f"{type(error).__name__}: {error}; it is left out")
            continue
        if plugin.name in taken:
            complain(name, f"another plugin is called {plugin.name}; this one is left out")
            continue
        taken.add(plugin.name)
        yield plugin


def plugins(foreign: bool = True) -> tuple[Plugin, ...]:
    return (*shipped_plugins(), *(foreign_plugins() if foreign else ()))


def additions(door: str, core: Collection[str] = (), foreign: bool = True) -> dict[str, Addition]:
    """What plugins add by a door, by name; a name that the core or an earlier plugin has stays theirs."""
    by_name: dict[str, Addition] = {}
    for plugin in plugins(foreign):
        for name, entry in plugin.entries(door).items():
            if name in core or name in by_name:
                owner = "nmm" if name in core else f"plugin {by_name[name].plugin}"
                what = door.removesuffix("s")
                complain(plugin.name, f"{what} {name} is {owner}'s already; this one is left out")
            else:
                by_name[name] = Addition(plugin.name, entry)
    return by_name


def tables_of_findings(foreign: bool = True) -> Iterator[Addition]:
    return (Addition(plugin.name, entry) for plugin in plugins(foreign) for entry in plugin.findings)


def groups_of_options(place: str) -> list[Addition]:
    """The groups of options that plugins add at a place of one of nmm's commands."""
    every = plugins()
    return [Addition(plugin.name, plugin.options[place]) for plugin in every if place in plugin.options]
