"""Resolvers as people name them: a kind, a kind with settings of its own, or one in a Python file."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from typing import TYPE_CHECKING, Any

from nmm.errors import InputError, NmmError, unknown
from nmm.words import split_outside_brackets

if TYPE_CHECKING:
    from nmm.resolvers.base import Resolver
    from nmm.scenario import Scenario

EXPECTED = (
    "kinds with commas between them, with settings or a Python file's, as in rg,pg:alpha=50,laws.py:law"
)


@dataclass(frozen=True)
class Chosen:
    """A resolver that is named on the command line.

    Attributes
    ----------
    text : as it was given
    kind : rg, pg, ...; "own" for a Python file's
    settings : of its own, by key, as text
    own : the file's
    """

    text: str
    kind: str
    settings: tuple[tuple[str, str], ...] = ()
    own: Resolver | None = None

    @property
    def label(self) -> str:
        """What a run with it is called, where that is more than its kind."""
        from nmm.looks import pretty

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


def chosen(text: str, option: str) -> Chosen:
    """One resolver; `InputError` for a text that names none, and for a file without it."""
    kind, *rest = split_outside_brackets(text, ":")
    if kind.endswith(".py"):
        if len(rest) != 1 or not rest[0]:
            raise InputError(f"{option}: expected FILE.py:NAME, got {text!r}")
        return Chosen(f"{kind}:{rest[0]}", "own", own=_from_file(Path(kind), rest[0], option))
    settings = []
    for setting in rest:
        key, equals, value = (part.strip() for part in setting.partition("="))
        if not (key and equals and value):
            raise InputError(f"{option}: expected KIND:KEY=VALUE, as in pg:alpha=50, got {text!r}")
        settings.append((key, value))
    return Chosen(text, kind, tuple(settings))


def several(given: str, option: str) -> list[Chosen]:
    """Those with commas between them; `InputError` for none, and for one that is given twice."""
    return [chosen(text, option) for text in named(given, option)]


def named(given: str, option: str, expected: str = EXPECTED) -> list[str]:
    """As they are given; `InputError` for none, and for one that is given twice."""
    texts = [text for text in split_outside_brackets(given, ",") if text]
    if not texts:
        raise InputError(f"{option}: expected {expected}, got {given!r}")
    for k, text in enumerate(texts):
        if text in texts[:k]:
            raise _twice(option, text, text)
    return texts


def check_different(resolvers: Sequence[Chosen], scenarios: Sequence[Scenario], option: str) -> None:
    """`InputError` for two that come to the same settings."""
    found: list[dict[str, Any]] = [scenario.parts.resolver.explicit() for scenario in scenarios]
    for k, one in enumerate(found):
        if one in found[:k]:
            raise _twice(option, resolvers[found.index(one)].text, resolvers[k].text)


def _twice(option: str, first: str, second: str) -> InputError:
    what = f"{first} is given twice" if first == second else f"{first} and {second} are the same here"
    return InputError(f"{option}: {what}; expected resolvers or settings that differ, as in rg,rg:alpha=5")


def _from_file(file: Path, name: str, option: str) -> Resolver:
    """A `Resolver`, a class of such, or a function problem -> u of a Python file, which is run."""
    from nmm.resolvers import CallableResolver, Resolver

    where = f"{option}: {file}"
    spec = spec_from_file_location(f"nmm_own_{file.stem}", file)
    if spec is None or spec.loader is None or not file.is_file():
        raise InputError(f"{where}: expected a Python file, there is none")
    module = module_from_spec(spec)
    sys.modules[module.__name__] = module  # dataclasses look for theirs there
    try:
        spec.loader.exec_module(module)
        names = [key for key, value in vars(module).items() if callable(value) and not key.startswith("_")]
        if name not in vars(module):
            raise InputError(unknown("name", name, names))
        found = getattr(module, name)
        made = found() if isinstance(found, type) and issubclass(found, Resolver) else found
    except NmmError as error:
        raise InputError(f"{where}: {error}") from None
    except Exception as error:  # whatever someone's file does
        raise InputError(f"{where}: {type(error).__name__}: {' '.join(str(error).split())}") from error
    if isinstance(made, Resolver):
        return made
    if not callable(made):
        raise InputError(f"{where}: {name}: expected a function problem -> u or a Resolver, got {made!r}")
    return CallableResolver(made)
