"""Strict YAML as plain data: no tags, one document, every key once, and the line of each."""

import re
from typing import Any, NamedTuple

import yaml

from nmm.base.errors import ScenarioError
from nmm.base.text_format import quoted

#: Where a value stands: mapping keys and list indices, from the top.
Place = tuple[str | int, ...]

#: How long a file may be, bytes, how many values it may have, and how deep lists and mappings may nest.
LONGEST, MOST_NODES, DEEPEST = 20_000_000, 200_000, 100
#: A line that begins with a key, maybe behind the - of a list.
_KEY = re.compile(r"[ ]*(?:- +)*([^\s#:'\"{\[-][^:]*):(?:\s|$)")
_NULL = ("", "~", "null", "Null", "NULL")
_TRUE = ("true", "True", "TRUE")
_FALSE = ("false", "False", "FALSE")


def dotted(path: Place) -> str:
    """A path as people write it: "task.0.gain"."""
    return ".".join(str(step) for step in path)


class Plain(NamedTuple):
    """Plain data (mappings, lists, strings, booleans, None), the line of each key and item, from 1, and the
    places that an anchor (&) and its aliases (*) gave one value."""

    value: Any
    lines: dict[Place, int]
    tied: list[list[Place]]


def read_text(text: str, name: str, *, lines: bool = True) -> Plain:
    """Read YAML of any shape. `lines`: errors name the line."""
    try:
        _check_events(text, name)
        root = yaml.compose(text, yaml.SafeLoader)
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        place = name if mark is None or not lines else f"{name}:{mark.line + 1}"
        raise ScenarioError(f"not valid YAML: {_fault(error, text)}", where=place) from None
    except yaml.YAMLError as error:
        raise ScenarioError(f"not valid YAML: {error}", where=name) from None
    reader = _Reader(name)
    value = None if root is None else reader.plain(root, ())
    return Plain(value, reader.lines, reader.tied)


def _fault(error: yaml.MarkedYAMLError, text: str) -> str:
    """What is wrong, in the words of one who writes the file; the parser's own where it is no usual slip."""
    problem, mark, since = str(error.problem or error.context), error.problem_mark, error.context_mark
    if mark is None:
        return problem
    if "cannot start any token" in problem:
        begin = problem.split("'")[1]
        return (
            "a tab: indent with spaces" if begin == "\\t" else f"text that begins with {begin} needs quotes"
        )
    if since is not None and "quoted scalar" in str(error.context):
        return f"the quote of line {since.line + 1} is not closed"
    if since is not None and (closing := re.match(r"expected ',' or '([]}])'", problem)):
        return f"a comma or {closing[1]} is missing behind what line {since.line + 1} opens"
    lines = text.splitlines()
    if since is not None and "expected ':'" in problem:
        return f"no colon behind {quoted(lines[since.line].strip())} in line {since.line + 1}"
    key = _KEY.match(lines[mark.line]) if mark.line < len(lines) else None
    if key is None:
        return problem
    if problem.startswith("mapping values") and mark.column > key.end(1):
        return "a second colon in one line: text with a colon and a blank needs quotes"
    before = next((line for line in reversed(lines[: mark.line]) if line.strip()), ":")
    if problem.startswith("mapping values") and ":" not in before:
        return f"no colon behind {quoted(before.strip())} in a line before"
    above = next((match for line in reversed(lines[: mark.line]) if (match := _KEY.match(line))), None)
    if above is None or above.start(1) == key.start(1):
        return problem
    return (
        f"{quoted(key[1])} begins in column {key.start(1) + 1}, {quoted(above[1])} above it in column "
        f"{above.start(1) + 1}: keys of one mapping begin in the same column"
    )


def _check_events(text: str, name: str) -> None:
    """Refuse tags and a second document, which a node graph no longer shows, and what takes long to read."""
    documents = depth = nodes = 0
    for event in yaml.parse(text, yaml.SafeLoader):
        line = 1 if event.start_mark is None else event.start_mark.line + 1
        nodes += isinstance(event, yaml.NodeEvent)
        if nodes > MOST_NODES:
            raise ScenarioError(where=f"{name}:{line}", expected=f"at most {MOST_NODES} values")
        depth += isinstance(event, yaml.CollectionStartEvent) - isinstance(event, yaml.CollectionEndEvent)
        if depth > DEEPEST:
            raise ScenarioError(
                f"not valid YAML: nested too deeply, beyond {DEEPEST}", where=f"{name}:{line}"
            )
        if isinstance(event, yaml.DocumentStartEvent):
            documents += 1
            if documents > 1:
                raise ScenarioError("a second one", where=f"{name}:{line}", expected="one YAML document")
        tag = getattr(event, "tag", None)
        if tag is not None:
            tag = str(tag).replace("tag:yaml.org,2002:", "!!")
            raise ScenarioError(f"it has the tag {tag}", where=f"{name}:{line}", expected="plain YAML")


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
            raise ScenarioError(where=f"{self._name}:{line}", expected=f"at most {MOST_NODES} values")
        self._places.setdefault(id(node), []).append(path)
        if id(node) in self._open:
            raise ScenarioError("an alias (*) that holds itself", where=f"{self._name}:{line}")
        if isinstance(node, yaml.ScalarNode):
            return self._scalar(node)
        self._open.add(id(node))
        try:
            if isinstance(node, yaml.SequenceNode):
                return [self.plain(item, (*path, i)) for i, item in enumerate(node.value)]
            return self._mapping(node, path)
        except RecursionError:
            raise ScenarioError("not valid YAML: nested too deeply", where=f"{self._name}:{line}") from None
        finally:
            self._open.discard(id(node))

    def _mapping(self, node: yaml.Node, path: Place) -> dict[str, Any]:
        result: dict[str, Any] = {}
        for key_node, value_node in node.value:
            line = key_node.start_mark.line + 1
            if not isinstance(key_node, yaml.ScalarNode):
                raise ScenarioError(
                    "a list or mapping as key", where=f"{self._name}:{line}", expected="a name"
                )
            key = key_node.value
            if key in result:
                where = f"{self._name}:{line}: {dotted((*path, key))}"
                raise ScenarioError(where=where, expected="every key once, this is the second")
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
