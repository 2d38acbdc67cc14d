"""A scenario as plain data, with the line of every key, and settings applied to it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from nmm.errors import ScenarioError
from nmm.files import read_bytes
from nmm.scenario.named_reference import is_path
from nmm.scenario.numbers import shown
from nmm.scenario.yaml_text import LONGEST, Place, dotted, read_text
from nmm.words import listed

#: Where one mapping may stand for a list of one: its index 0 is the mapping.
_ONE_OR_MORE = ("task", "objective", "added_task")


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

    Numbers stay strings, to be read as arithmetic: YAML 1.1 has its own mind about `1e-3` and `010`.

    Attributes
    ----------
    name : the file, as errors name it
    data : the top mapping
    lines : line of each key and item, from 1
    folder : where the file is
    settings : the places that were set since, and the working folder at that time
    tied : places that an anchor (&) and its aliases (*) gave one value
    """

    name: str
    data: dict[str, Any]
    lines: dict[Place, int] = field(default_factory=dict)
    folder: Path = field(default_factory=Path.cwd)
    settings: dict[Place, Path] = field(default_factory=dict)
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
        """Whether a place was set, or what it is in, or something in it."""
        return any(path[: len(place)] == place[: len(path)] for place in self.settings)

    def _setting_of(self, path: Place) -> Place | None:
        return next((place for place in self.settings if path[: len(place)] == place), None)

    def with_settings(self, settings: Mapping[str, object]) -> Document:
        """A copy in which the values at dotted paths are others, set one after the other.

        Parameters
        ----------
        settings : keys as "resolver.alpha" or "task.0.gain", counting begins at 0; values are text, read as
            in the file ("5/4*pi", "[v, q1]", "{x: 1}"), or plain data

        Raises
        ------
        ScenarioError : a path leads nowhere, or the text is not YAML
        """
        copy = replace(self, data=_copied(self.data), settings=dict(self.settings))
        for key, value in settings.items():
            copy._set(key, value)
        return copy

    def _set(self, key: str, value: object) -> None:
        path = _parsed(key, self)
        place: Any = self.data
        for depth, step in enumerate(path[:-1]):
            if isinstance(place, dict):
                inner = place.setdefault(step, {})
                shorthand = _shorthand(path[: depth + 1], self.data)
                if isinstance(inner, str) and shorthand is not None:
                    inner = place[step] = {shorthand: inner}
                place = inner
            else:
                place = place[step]
        if isinstance(value, str):
            value = read_text(value, f"{self.name}: set {key}", lines=False).value
        place[path[-1]] = _copied(value)
        self.settings[path] = Path.cwd()


def _parsed(key: str, document: Document) -> Place:
    """The path of a dotted key, with indices where there are lists; `ScenarioError` when it leads nowhere."""
    path: Place = ()
    place: Any = document.data
    for step in key.split("."):
        where = f"{document.name}: set {key}"
        if not step:
            raise ScenarioError(f"{where}: expected a dotted key such as resolver.alpha or task.0.gain")
        if isinstance(place, list):
            if not step.isdecimal() or int(step) >= len(place):
                last = len(place) - 1
                raise ScenarioError(
                    f"{where}: {dotted(path)} is a list; expected an index from 0 to {last}, got {step!r}"
                )
            path = (*path, int(step))
            place = place[int(step)]
        elif isinstance(place, dict) and step == "0" and path and path[-1] in _ONE_OR_MORE:
            continue
        elif isinstance(place, dict):
            path = (*path, step)
            place = place.get(step, {})
        elif isinstance(place, str) and (shorthand := _shorthand(path, document.data)) is not None:
            path = (*path, step)
            place = place if step == shorthand else {}
        elif is_path(place):
            raise ScenarioError(f"{where}: {dotted(path)} is {place}: set {place}.{step}")
        else:
            raise ScenarioError(
                f"{where}: {dotted(path)} is {shown(place)}, which has no keys: "
                f"give it some, as in --set '{dotted(path)}={{{step}: …}}'"
            )
    return path


def _copied(value: Any) -> Any:
    if isinstance(value, str):
        return value
    if hasattr(value, "tolist"):
        value = value.tolist()
    if isinstance(value, (dict, Mapping)):  # dict first: it is the one there, and quick to tell
        return {str(key): _copied(item) for key, item in value.items()}
    return [_copied(item) for item in value] if isinstance(value, list | tuple) else value


def read_file(path: Path) -> Document:
    """Read a scenario file; `ScenarioError` names file and line of what is wrong with it."""
    try:
        text = read_bytes(path, LONGEST).decode("utf-8-sig")
    except UnicodeDecodeError:
        raise ScenarioError(f"{path}: expected UTF-8 text") from None
    except OSError as error:
        raise ScenarioError(f"{path}: cannot be read ({error.strerror})") from None
    return document_of(text, str(path), path.resolve().parent)


def document_of(text: str, name: str, folder: Path) -> Document:
    """The document of a scenario's text; `name` is what errors call it, `folder` where it stands."""
    data, lines, tied = read_text(text, name)
    if not isinstance(data, dict):
        raise ScenarioError(f"{name}: expected a mapping (key: value), got {shown(data)}")
    lines.pop((), None)  # of the file as a whole its name is enough
    return Document(name, data, lines, folder, tied=tied)
