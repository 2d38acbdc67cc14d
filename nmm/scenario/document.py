"""A scenario's text as plain data: strict YAML, the line of every key, and settings applied to it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import yaml

from nmm.errors import ScenarioError
from nmm.files import read_bytes
from nmm.scenario.named_reference import is_path
from nmm.scenario.numbers import shown
from nmm.words import listed

#: Where a value stands: mapping keys and list indices, from the top.
Place = tuple[str | int, ...]

#: How long a file may be, bytes, how many values it may have, and how deep lists and mappings may nest.
LONGEST, MOST_NODES, DEEPEST = 20_000_000, 200_000, 100
_NULL = ("", "~", "null", "Null", "NULL")
_TRUE = ("true", "True", "TRUE")
_FALSE = ("false", "False", "FALSE")


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
            value = read_text(value, f"{self.name}: set {key}", lines=False).data["value"]
        place[path[-1]] = _copied(value)
        self.settings[path] = Path.cwd()


def dotted(path: Place) -> str:
    """A path as people write it: "task.0.gain"."""
    return ".".join(str(step) for step in path)


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
    document = read_text(text, name)
    data = document.data["value"]
    if not isinstance(data, dict):
        raise ScenarioError(f"{name}: expected a mapping (key: value), got {shown(data)}")
    lines = {place[1:]: line for place, line in document.lines.items() if len(place) > 1}
    tied = [[place[1:] for place in places] for places in document.tied]
    return Document(name, data, lines, folder, tied=tied)


def read_text(text: str, name: str, *, lines: bool = True) -> Document:
    """Read YAML of any shape; what it holds is under the key `value`. `lines`: errors name the line."""
    try:
        _check_events(text, name)
        root = yaml.compose(text, yaml.SafeLoader)
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        place = name if mark is None or not lines else f"{name}:{mark.line + 1}"
        raise ScenarioError(f"{place}: not valid YAML: {error.problem or error.context}") from None
    except yaml.YAMLError as error:
        raise ScenarioError(f"{name}: not valid YAML: {' '.join(str(error).split())}") from None
    except RecursionError:
        raise ScenarioError(f"{name}: not valid YAML: nested too deeply") from None
    reader = _Reader(name)
    data = {"value": None if root is None else reader.plain(root, ("value",))}
    return Document(name, data, reader.lines, tied=reader.tied)


def _check_events(text: str, name: str) -> None:
    """Refuse tags and a second document, which a node graph no longer shows, and what takes long to read."""
    documents = depth = nodes = 0
    for event in yaml.parse(text, yaml.SafeLoader):
        line = 1 if event.start_mark is None else event.start_mark.line + 1
        nodes += isinstance(event, yaml.NodeEvent)
        if nodes > MOST_NODES:
            raise ScenarioError(f"{name}:{line}: expected at most {MOST_NODES} values")
        depth += isinstance(event, yaml.CollectionStartEvent) - isinstance(event, yaml.CollectionEndEvent)
        if depth > DEEPEST:
            raise ScenarioError(
                f"{name}:{line}: not valid YAML: nested too deeply; expected at most {DEEPEST} lists and "
                "mappings in one another"
            )
        if isinstance(event, yaml.DocumentStartEvent):
            documents += 1
            if documents > 1:
                raise ScenarioError(f"{name}:{line}: expected one YAML document, got a second")
        tag = getattr(event, "tag", None)
        if tag is not None:
            shown_tag = str(tag).replace("tag:yaml.org,2002:", "!!")
            raise ScenarioError(f"{name}:{line}: expected plain YAML, got the tag {shown_tag}")


class _Reader:
    """From YAML nodes to plain data."""

    def __init__(self, name: str) -> None:
        self.lines: dict[Place, int] = {}
        self._places: dict[int, list[Place]] = {}
        self._name = name
        self._open: set[int] = set()
        self._count = 0

    @property
    def tied(self) -> list[list[Place]]:
        """The places of each node that has several."""
        return [places for places in self._places.values() if len(places) > 1]

    def plain(self, node: yaml.Node, path: Place) -> Any:
        line = node.start_mark.line + 1
        self.lines.setdefault(path, line)
        self._count += 1
        if self._count > MOST_NODES:  # aliases of aliases multiply
            raise ScenarioError(f"{self._name}:{line}: expected at most {MOST_NODES} values")
        self._places.setdefault(id(node), []).append(path)
        if id(node) in self._open:
            raise ScenarioError(f"{self._name}:{line}: an alias (*) that holds itself")
        if isinstance(node, yaml.ScalarNode):
            return self._scalar(node)
        self._open.add(id(node))
        try:
            if isinstance(node, yaml.SequenceNode):
                return [self.plain(item, (*path, i)) for i, item in enumerate(node.value)]
            return self._mapping(node, path)
        except RecursionError:
            raise ScenarioError(f"{self._name}:{line}: not valid YAML: nested too deeply") from None
        finally:
            self._open.discard(id(node))

    def _mapping(self, node: yaml.Node, path: Place) -> dict[str, Any]:
        result: dict[str, Any] = {}
        for key_node, value_node in node.value:
            line = key_node.start_mark.line + 1
            if not isinstance(key_node, yaml.ScalarNode):
                raise ScenarioError(f"{self._name}:{line}: expected a name as key, got a list or a mapping")
            key = key_node.value
            if key in result:
                where = f"{self._name}:{line}: {dotted((*path[1:], key))}"
                raise ScenarioError(f"{where}: expected every key once, this is the second")
            self.lines[(*path, key)] = line
            result[key] = self.plain(value_node, (*path, key))
        return result

    @staticmethod
    def _scalar(node: yaml.ScalarNode) -> str | bool | None:
        text = str(node.value)
        if node.style is not None:  # quoted or block text
            return text
        if text in _NULL:
            return None
        return text if text not in _TRUE + _FALSE else text in _TRUE
