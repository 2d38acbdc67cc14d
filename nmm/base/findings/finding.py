"""`Finding`: a code, values, and where; its sentence is made on demand."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cache
from importlib import import_module
from typing import Any

from nmm.base.errors import few
from nmm.base.plugins import complain, tables_of_findings

#: A format string over values and where, or a function that takes both as keywords.
Words = str | Callable[..., str]

#: The modules beside this one with `WORDS`, a table from code to words, each code in one of them.
SUBJECTS = ("robot_file", "robot_loading", "run", "singularities", "redundancy")


@dataclass(frozen=True)
class Finding:
    """Something that a run, a check of a file, a search or a draft found; `str(finding)` is its sentence.

    Parameters
    ----------
    code : which finding it is, one of `words()`
    values : its numbers and names, by name, as JSON knows them
    where : the place, likewise: {"t": 0.55} in a run, {"line": 12} in a file, {"key": "dt"} in a scenario

    Examples
    --------
    >>> found = nmm.Finding("said", {"text": "the door is open"}, {"t": 0.5})
    >>> str(found), found.as_json()["where"]
    ('the door is open', {'t': 0.5})
    """

    code: str
    values: Mapping[str, Any] = field(default_factory=dict)
    where: Mapping[str, Any] = field(default_factory=dict)

    def __str__(self) -> str:
        told = words_of(self.code)
        given = {**self.where, **self.values}
        return told.format(**given) if isinstance(told, str) else told(**given)

    def as_json(self) -> dict[str, Any]:
        """The finding for a file: code, values, where, and its sentence as `text`."""
        return {"code": self.code, "values": dict(self.values), "where": dict(self.where), "text": str(self)}

    @classmethod
    def from_json(cls, told: Mapping[str, Any]) -> Finding:
        """The finding that `as_json` wrote."""
        return cls(told["code"], told.get("values", {}), told.get("where", {}))


def words_of(code: str) -> Words:
    """The words of a code; strangers' plugins are read only where it is none of ours. `KeyError` for none."""
    own = _words(foreign=False)
    return own[code] if code in own else words()[code]


def words() -> Mapping[str, Words]:
    """All codes with their words."""
    return _words(foreign=True)


@cache
def _words(foreign: bool) -> Mapping[str, Words]:
    tables: dict[str, Words] = {}
    for subject in SUBJECTS:
        table: Mapping[str, Words] = import_module(f"nmm.base.findings.{subject}").WORDS
        if again := tables.keys() & table.keys():
            raise TypeError(
                f"nmm.base.findings.{subject}: codes of another subject too: {', '.join(sorted(again))}"
            )
        tables |= table
    for addition in tables_of_findings(foreign):
        table = addition.load() or {}
        if not isinstance(table, Mapping):
            complain(addition.plugin, f"{addition.entry} is no table from codes to words; it is left out")
            continue
        if again := tables.keys() & table.keys():
            complain(addition.plugin, f"codes that others have, which stay: {few(sorted(again))}")
        tables = {**table, **tables}
    return tables
