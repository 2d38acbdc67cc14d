"""`Finding`: a code, values, and where; its sentence is made on demand."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cache
from importlib import import_module
from string import Formatter
from typing import Any

from nmm.base.errors import few
from nmm.base.plugins import complain, tables_of_findings
from nmm.base.text_format import counted, listed, quoted

#: A format string over values and where (`_Sentence`), or a function that takes both as keywords.
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
        return sentence(words_of(self.code), {**self.where, **self.values})

    def as_json(self) -> dict[str, Any]:
        """The finding for a file: code, values, where, and its sentence as `text`."""
        return {"code": self.code, "values": dict(self.values), "where": dict(self.where), "text": str(self)}

    @classmethod
    def from_json(cls, told: Mapping[str, Any]) -> Finding:
        """The finding that `as_json` wrote."""
        return cls(told["code"], told.get("values", {}), told.get("where", {}))


class _Absent:
    """A value that a finding does not have: false, and an error where it is written."""

    def __bool__(self) -> bool:
        return False


class _Sentence(Formatter):
    """Format strings that besides Python's formats know, of `x` a list or a mapping, and of `n` a number,

    - {x:all}, {x:few} : all of them, or at most ten and how many more; {x:few %s at %g} each written so
    - {x:and} : "a, b and c"; {x:number} : how many
    - {n:count sample}, {n:many sample} : "1 sample", "3 samples", and for none "0 samples" and "no samples"
    - {n:plural it|them} : the first for 1, or where there is one
    - {x:quoted} : as an error shows a value

    and parts that may themselves hold values: {x:if TEXT} and {x:else TEXT} where x is true and where it is
    not, {x:known TEXT} and {x:unknown TEXT} where there is an x, None aside, and where there is none."""

    def __init__(self, values: Mapping[str, Any]) -> None:
        self._values = values

    def write(self, text: str) -> str:
        return self.vformat(text, (), self._values)

    def get_value(self, key: int | str, args: Any, kwargs: Any) -> Any:
        return kwargs.get(key, _Absent())

    def parse(self, format_string: Any) -> Any:
        for literal, name, spec, conversion in super().parse(format_string):
            if spec and spec.split(" ")[0] in _PARTS:  # written only if it counts
                spec = spec.replace("{", "{{").replace("}", "}}")
            yield literal, name, spec, conversion

    def format_field(self, value: Any, format_spec: str) -> str:
        word, _, rest = format_spec.partition(" ")
        if word in _PARTS:
            return self.write(rest) if _PARTS[word](value) else ""
        if isinstance(value, _Absent):
            raise KeyError(format_spec)
        match word:
            case "all":
                return ", ".join(_texts(value, rest))
            case "few":
                return few(_texts(value, rest))
            case "and":
                return listed(value)
            case "number":
                return str(len(value))
            case "count":
                return counted(value, rest)
            case "many":
                return counted(value, rest) if value else f"no {rest}s"
            case "plural":
                singular, plural = rest.split("|")
                return singular if (value if isinstance(value, int) else len(value)) == 1 else plural
            case "quoted":
                return quoted(value)
        return str(super().format_field(value, format_spec))


#: Of a part of a sentence, by its word: whether it is written.
_PARTS: Mapping[str, Callable[[Any], bool]] = {
    "if": bool,
    "else": lambda value: not value,
    "known": lambda value: not (value is None or isinstance(value, _Absent)),
    "unknown": lambda value: value is None or isinstance(value, _Absent),
}


def _texts(values: Any, form: str) -> list[str]:
    """Each value, or a mapping's name and value, as a form with % has it; a list in it is written in turn."""
    rows = values.items() if isinstance(values, Mapping) else [(value,) for value in values]
    flat = [[x for cell in row for x in (cell if isinstance(cell, list | tuple) else [cell])] for row in rows]
    return [(form or "%s") % tuple(row) for row in flat]


def sentence(words: Words, values: Mapping[str, Any]) -> str:
    return _Sentence(values).write(words) if isinstance(words, str) else words(**values)


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
