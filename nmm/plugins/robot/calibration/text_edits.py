"""Edits of attributes in the text of an XML file: all else, lines, quotes and spaces, stays as it is."""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from xml.parsers import expat

#: A start tag, or that of an empty element.
_TAG = re.compile(rb"<[^\s/>]+(?:\s+[^\s=]+\s*=\s*(?:\"[^\"]*\"|'[^']*'))*\s*/?>")
_TOKEN = re.compile(rb"\S+")


@dataclass(eq=False)
class Node:
    """An element: its tag, its attributes, where its start tag is in the text (bytes), and what is in it."""

    tag: str
    attributes: Mapping[str, str]
    start: int
    end: int
    children: list[Node] = field(default_factory=list)

    def first(self, tag: str) -> Node | None:
        return next((child for child in self.children if child.tag == tag), None)

    def every(self, tag: str) -> Iterator[Node]:
        return (child for child in self.children if child.tag == tag)

    def below(self) -> Iterator[Node]:
        """It and all that is in it."""
        yield self
        for child in self.children:
            yield from child.below()


class XmlText:
    """The text of an XML file (bytes in UTF-8, which has been read as XML before) with edits."""

    def __init__(self, content: bytes) -> None:
        self.content = content
        self._edits: dict[tuple[int, int], bytes] = {}
        self.root = self._parsed()

    def line(self, node: Node) -> int:
        """The line on which a node begins, from 1."""
        return self.content.count(b"\n", 0, node.start) + 1

    def write(self, node: Node, name: str, text: str) -> None:
        """Give an attribute another text, or one where it has none."""
        span = self._value(node, name)
        if span is None:
            at = node.end - (2 if self.content[: node.end].endswith(b"/>") else 1)
            self._edits[at, at] = self._edits.get((at, at), b"") + f' {name}="{text}"'.encode()
        else:
            self._edits[span] = text.encode()

    def write_parts(self, node: Node, name: str, texts: Mapping[int, str]) -> None:
        """Give some of the numbers in an attribute other texts; without it, 0 stands for those not given."""
        span = self._value(node, name)
        if span is None:
            self.write(node, name, " ".join(texts.get(i, "0") for i in range(3)))
            return
        tokens = [*_TOKEN.finditer(self.content, *span)]
        for i, text in texts.items():
            self._edits[tokens[i].span()] = text.encode()

    def insert(self, node: Node, text: str) -> None:
        """Put text right behind a node's start tag."""
        self._edits[node.end, node.end] = self._edits.get((node.end, node.end), b"") + text.encode()

    def edited(self) -> bytes:
        """The text with all edits."""
        parts, at = [], 0
        for (start, end), text in sorted(self._edits.items()):
            parts += [self.content[at:start], text]
            at = end
        return b"".join([*parts, self.content[at:]])

    def _value(self, node: Node, name: str) -> tuple[int, int] | None:
        """Where the text of an attribute stands, without its quotes."""
        tag = re.compile(rb"\s" + re.escape(name.encode()) + rb"\s*=\s*(?:\"([^\"]*)\"|'([^']*)')")
        match = tag.search(self.content, node.start, node.end)
        if match is None:
            return None
        return match.span(1) if match.group(1) is not None else match.span(2)

    def _parsed(self) -> Node:
        skipped = len(self.content) - len(self.content.removeprefix(b"\xef\xbb\xbf").lstrip())
        parser = expat.ParserCreate("utf-8")
        above: list[Node] = []
        top: list[Node] = []

        def start(tag: str, attributes: dict[str, str]) -> None:
            at = skipped + parser.CurrentByteIndex
            match = _TAG.match(self.content, at)
            node = Node(tag, attributes, at, at if match is None else match.end())
            (above[-1].children if above else top).append(node)
            above.append(node)

        parser.StartElementHandler = start
        parser.EndElementHandler = lambda _: above.pop()
        parser.Parse(self.content[skipped:], True)
        return top[0]


def unified_diff(name: str, before: bytes, after: bytes) -> str:
    """Both texts beside each other, as `patch -p1` takes it; "" where they are the same."""
    old, new = (text.decode("utf-8").splitlines(keepends=True) for text in (before, after))
    lines = difflib.unified_diff(old, new, f"a/{name}", f"b/{name}")
    marked = (line if line.endswith("\n") else f"{line}\n\\ No newline at end of file\n" for line in lines)
    return "".join(marked)
