"""XML read into elements that know their line, with nothing expanded that the file defines itself."""

from __future__ import annotations

from xml.etree import ElementTree
from xml.parsers import expat

#: How deep elements may stand in one another: what reads them further recurses.
DEEPEST = 200


class Element(ElementTree.Element):
    """An element and the line that it starts in."""

    line: int = 0


class XmlError(Exception):
    """The text is not XML that we read: why, and in which line."""

    def __init__(self, message: str, line: int | None) -> None:
        super().__init__(message)
        self.line = line


def parse(text: str) -> Element:
    """Read XML.

    The standard library's expat is driven by hand because it alone stops at a DOCTYPE before any
    entity is defined, tells lines, and costs no import (lxml takes 15 ms).

    Raises
    ------
    XmlError : empty or malformed text, elements more than `DEEPEST` deep, or a DOCTYPE (entities could be
        endless, or read other files)
    """
    if not text.strip():
        raise XmlError("the file is empty", None)
    builder = ElementTree.TreeBuilder(element_factory=Element)
    parser = expat.ParserCreate()
    parser.buffer_text = True

    depth = 0

    def start(tag: str, attributes: dict[str, str]) -> None:
        nonlocal depth
        depth += 1
        if depth > DEEPEST:
            raise XmlError(
                f"elements stand more than {DEEPEST} deep in one another", parser.CurrentLineNumber
            )
        element = builder.start(tag, attributes)
        if isinstance(element, Element):
            element.line = parser.CurrentLineNumber

    def end(tag: str) -> None:
        nonlocal depth
        depth -= 1
        builder.end(tag)

    def doctype(*_: object) -> None:
        raise XmlError(
            "holds a DOCTYPE, which is refused (entities are not expanded)", parser.CurrentLineNumber
        )

    parser.StartElementHandler = start
    parser.EndElementHandler = end
    parser.CharacterDataHandler = builder.data
    parser.StartDoctypeDeclHandler = doctype
    try:
        parser.Parse(text, True)
    except expat.ExpatError as error:
        raise XmlError(f"not well-formed XML: {expat.ErrorString(error.code)}", error.lineno) from None
    root = builder.close()
    if not isinstance(root, Element):
        raise XmlError("holds no element", None)
    return root
