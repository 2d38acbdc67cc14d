"""A scenario as plain data, with the line of every key, and settings applied to it."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from nmm.base.errors import InputError, ScenarioError, Setting, expect_kind
from nmm.base.files import read_bytes
from nmm.base.text_format import listed
from nmm.scenario.keys import is_path
from nmm.scenario.yaml_text import LONGEST, Place, dotted, read_text

#: Where one mapping may stand for a list of one: its index 0 is the mapping.
_ONE_OR_MORE = ("task", "objective", "added_task")
_MISSING = object()


def _shorthand(path: Place, data: Mapping[str, Any]) -> str | None:
    """Which key of the mapping a name is that stands at `path` in the mapping's place; None elsewhere."""
    where = tuple("*" if isinstance(step, int) else step for step in path)
    if where == ("robot", "platform"):
        mounted = isinstance(data["robot"], Mapping) and {"arm", "arms"} & set(data["robot"])
        return "source" if mounted else "kind"
    return "source" if where in {("robot",), ("robot", "arm"), ("robot", "arms", "*", "arm")} else None


@dataclass
class Document:
    """Plain data (mappings, lists, strings, booleans, None) and where each part of it was written.

    Numbers stay strings, to be read as arithmetic: YAML 1.1 reads `1e-3` as text and `010` as 8.
    """

    name: str  #: the file, as errors name it
    data: dict[str, Any]
    lines: dict[Place, int] = field(default_factory=dict)  #: of each key and item, from 1
    folder: Path = field(default_factory=Path.cwd)  #: where the file is
    #: The places that were set since, and the working folder at that time.
    settings: dict[Place, Path] = field(default_factory=dict)
    #: Places that an anchor (&) and its aliases (*) gave one value.
    tied: list[list[Place]] = field(default_factory=list)

    def where(self, path: Place) -> str:
        """How errors name a place: "file.yaml:12: task.0.gain", "file.yaml: set resolver.alpha"."""
        key = dotted(path)
        if self._setting_of(path) is not None:
            return f"{self.name}: set {key}"
        below = [dotted(place) for place in self.settings if place[: len(path)] == path]
        if path and below:  # it may be their doing
            key = f"{key}, with {', '.join(below)} set"
        line = next((self.lines[path[:k]] for k in range(len(path), -1, -1) if path[:k] in self.lines), None)
        place = self.name if line is None else f"{self.name}:{line}"
        return f"{place}: {key}" if key else place

    def absolute(self, file: str, path: Place) -> Path:
        """A file named at a place: relative to the scenario or, if it was set, to the working folder."""
        setting = self._setting_of(path)
        folder = self.folder if setting is None else self.settings[setting]
        return (folder / Path(file).expanduser()).resolve()

    def parted(self) -> list[str]:
        """A sentence for each setting whose value an anchor tied to others, which stay as they were."""
        sentences = []
        for path in self.settings:
            tied = dict.fromkeys(
                (*other, *path[len(place) :])
                for places in self.tied
                for place in places
                if path[: len(place)] == place
                for other in places
            )
            left = [dotted(place) for place in tied if not self._touched(place)]
            if left:
                sentences.append(
                    f"{dotted(path)} was set alone: an anchor (&) in {self.name} had given "
                    f"{listed(left)} the same value, which stays"
                )
        return sentences

    def _touched(self, path: Place) -> bool:
        return any(path[: len(place)] == place[: len(path)] for place in self.settings)

    def _setting_of(self, path: Place) -> Place | None:
        return next((place for place in self.settings if path[: len(place)] == place), None)

    def with_settings(self, settings: Mapping[str, object]) -> Document:
        """A copy with other values, text as in the file or plain data, at dotted paths (`Scenario.override`).

        They are set one after the other; `ScenarioError` for a path that leads nowhere, and text that is no
        YAML.
        """
        copy = replace(self, data=_copied(self.data), settings=dict(self.settings))
        for key, value in settings.items():
            copy._set(key, value)
        return copy

    def _set(self, key: str, value: object) -> None:
        where = f"{self.name}: set {key}"
        path: Place = ()
        place: Any = self.data
        holder: Any = None  # the mapping or list that holds the place
        for step in key.split("."):
            shorthand = _shorthand(path, self.data) if isinstance(place, str) else None
            if not step:
                raise ScenarioError(
                    where=where, expected="a dotted key such as resolver.alpha or task.0.gain"
                )
            if shorthand is not None:
                place = holder[path[-1]] = {shorthand: place}
            elif place is _MISSING:
                place = holder[path[-1]] = {}
            if isinstance(place, list):
                if not step.isdecimal() or int(step) >= len(place):
                    expected = f"an index up to {len(place) - 1}"
                    raise ScenarioError("it is a list", where=where, expected=expected, got=step)
                path, place, holder = (*path, int(step)), place[int(step)], place
            elif isinstance(place, dict):
                if step != "0" or not path or path[-1] not in _ONE_OR_MORE:
                    path, place, holder = (*path, step), place.get(step, _MISSING), place
            elif is_path(place):
                raise ScenarioError(f"{dotted(path)} is {place}: set {place}.{step}", where=where)
            else:
                what = f"{dotted(path)} is {ScenarioError.show(place)}, which has no keys"
                mend = Setting(tuple(map(str, path)), f"{{{step}: …}}")
                raise ScenarioError(what, where=where, expected="some", mend=mend)
        if isinstance(value, str):
            value = read_text(value, where, lines=False).value
        holder[path[-1]] = _copied(value)
        self.settings[path] = Path.cwd()


def _copied(value: Any) -> Any:
    if isinstance(value, str):
        return value
    if hasattr(value, "tolist"):
        value = value.tolist()
    if isinstance(value, (dict, Mapping)):  # dict first: it is the one there, and quick to tell
        return {str(key): _copied(item) for key, item in value.items()}
    return [_copied(item) for item in value] if isinstance(value, list | tuple) else value


#: How a robot's file begins, and no scenario.
_XML = re.compile(r"\s*<[?!\w]")


def read_file(path: Path) -> Document:
    try:
        text = read_bytes(path, LONGEST).decode("utf-8-sig")
    except UnicodeDecodeError:
        raise ScenarioError(where=path, expected="UTF-8 text") from None
    except OSError as error:
        raise ScenarioError(f"cannot be read ({error.strerror})", where=path) from None
    if _XML.match(text):
        what = "this is XML, as robots' files are"
        raise ScenarioError(what, where=path, expected=f"a scenario: nmm init {path} writes one for a robot")
    return document_of(text, str(path), path.resolve().parent)


def document_in(path: str | Path, longest: int) -> Document:
    """The document of a file that is no scenario, of so many bytes at most; `InputError` names the file, and
    the line where it is no YAML."""
    expect_kind(path, str | Path, "file", "a file's path")
    file = Path(path)
    try:
        return document_of(read_bytes(file, longest).decode("utf-8-sig"), str(file), file.parent)
    except UnicodeDecodeError:
        raise InputError(where=file, expected="UTF-8 text") from None
    except OSError as error:
        raise InputError(f"cannot be read ({error.strerror or error})", where=file) from None
    except ScenarioError as error:
        raise error.placed(error.where, InputError) from None


def document_of(text: str, name: str, folder: Path) -> Document:
    """The document of a scenario's text; `name` is what errors call it, `folder` where it stands."""
    data, lines, tied = read_text(text, name)
    if not isinstance(data, dict):
        raise ScenarioError(where=name, expected="a mapping (key: value)", got=data)
    lines.pop((), None)  # of the file as a whole its name is enough
    return Document(name, data, lines, folder, tied=tied)
