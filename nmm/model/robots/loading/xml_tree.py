"""Files read into XML elements that know their line; no entity is expanded."""

import math
import os
import re
import sys
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, cast
from xml.etree import ElementTree
from xml.parsers import expat

from nmm.base.files import read_bytes
from nmm.base.findings import Finding
from nmm.base.findings.robot_file import refusal
from nmm.model.robots.loading.budget import MOST_ELEMENTS

#: How deep elements may stand in one another: what reads them further recurses.
DEEPEST = 200
#: A description with its meshes beside it is far shorter, bytes.
LONGEST = 50_000_000
#: White space before the declaration, which urdfdom, yourdfpy and MuJoCo pass over and expat refuses.
_LATE = re.compile(r"\A(\s+)(<\?xml\b[^>]*\?>)")


class Element(ElementTree.Element):
    #: 0 where it is not the file's.
    line: int = 0
    #: The file's name where another one includes it; "" in the file itself.
    file: str = ""

    @property
    def place(self) -> dict[str, Any]:
        """Where it stands, as findings have it in `where`."""
        place: dict[str, Any] = {"line": self.line} if self.line else {}
        return {**place, "file": self.file} if self.file else place


class XmlError(Exception):
    """The text is not XML that we read: what was found, with its line."""

    def __init__(self, code: str, line: int | None = None, **values: object) -> None:
        self.finding = Finding(code, values, {} if line is None else {"line": line})
        super().__init__(str(self.finding))


class Tried:
    """Contents in the place of those of files, by their real paths; `read` : the files that were read."""

    def __init__(self, contents: Mapping[Path, bytes]) -> None:
        self.contents, self.read = dict(contents), list[Path]()


_TRIED: ContextVar[Tried | None] = ContextVar("tried", default=None)


@contextmanager
def trying(contents: Mapping[Path, bytes]) -> Iterator[Tried]:
    """In the block, files are read as if they had these contents: what a change would make of a robot."""
    tried = Tried({Path(os.path.realpath(path)): content for path, content in contents.items()})
    token = _TRIED.set(tried)
    try:
        yield tried
    finally:
        _TRIED.reset(token)


def _content(path: Path) -> bytes:
    tried = _TRIED.get()
    if tried is None:
        return read_bytes(path, LONGEST)
    real = Path(os.path.realpath(path))
    tried.read.append(real)
    return tried.contents[real] if real in tried.contents else read_bytes(path, LONGEST)


def read_text(path: Path) -> str:
    """The text of a UTF-8 file, which starts with its XML declaration, if any; `RobotError` if it cannot be
    read, FileNotFoundError if it is not there."""
    try:
        content = _content(path)
        # Behind the declaration the white space keeps the lines' numbers.
        return _LATE.sub(r"\2\1", content.decode("utf-8-sig"))
    except FileNotFoundError:
        raise
    except UnicodeDecodeError as error:
        line = content[: error.start].count(b"\n") + 1
        raise refusal(path, Finding("not_text", {}, {"line": line})) from None
    except OSError as error:
        reason = "this is a directory" if isinstance(error, IsADirectoryError) else error.strerror
        raise refusal(path, Finding("file_unreadable", {"reason": reason})) from None


def parse(text: str) -> Element:
    """`XmlError` for empty or malformed text, too many elements, some over `DEEPEST` deep, or a DOCTYPE.
    Drives expat by hand: it alone stops at a DOCTYPE before any entity (endless, or another file's) is
    defined, gives lines, and needs no import (lxml takes 15 ms)."""
    if not text.strip():
        raise XmlError("file_empty")
    builder = ElementTree.TreeBuilder(element_factory=Element)
    parser = expat.ParserCreate()
    parser.buffer_text = True
    depth = count = 0

    def start(tag: str, attributes: dict[str, str]) -> None:
        nonlocal depth, count
        depth, count = depth + 1, count + 1
        if count > MOST_ELEMENTS:
            raise XmlError("beyond_bound", what="elements", most=MOST_ELEMENTS)
        if depth > DEEPEST:
            raise XmlError("nested_too_deep", parser.CurrentLineNumber, most=DEEPEST)
        element = cast("Element", builder.start(tag, attributes))
        element.line = parser.CurrentLineNumber

    def end(tag: str) -> None:
        nonlocal depth
        depth -= 1
        builder.end(tag)

    def doctype(*_: object) -> None:
        raise XmlError("doctype", parser.CurrentLineNumber)

    parser.StartElementHandler = start
    parser.EndElementHandler = end
    parser.CharacterDataHandler = builder.data
    parser.StartDoctypeDeclHandler = doctype
    try:
        parser.Parse(text, True)
    except expat.ExpatError as error:
        raise XmlError("not_xml", error.lineno, reason=expat.ErrorString(error.code)) from None
    root = builder.close()
    if not isinstance(root, Element):
        raise XmlError("not_xml", reason="holds no element")
    return root


def child(parent: Element, tag: str) -> Element | None:
    return cast("Element | None", parent.find(tag))


def children(parent: Element, tag: str) -> list[Element]:
    return cast("list[Element]", parent.findall(tag))


def link_at(joint: Element, tag: str) -> str:
    """The link that a joint names as its parent or child; "" without."""
    element = child(joint, tag)
    return "" if element is None else element.get("link", "")


def body_of(link: str, above: Mapping[str, Element]) -> str:
    """The link at the top of the body that a link is part of, with what is fixed to it; `above` are joints by
    the link below each."""
    met: set[str] = set()
    while link in above and above[link].get("type") == "fixed" and link not in met:
        met.add(link)
        link = link_at(above[link], "parent")
    return link


#: The link or joint that an element is part of, as findings have it in `where`.
Owner = Mapping[str, Any]

# What the C++ reader takes: Python's float would also take nan, inf, 1_0 and digits of other scripts.
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", re.ASCII)
NOBODY: Owner = {}
#: URDF 1.1 and later know quat_xyzw.
QUATERNIONS = 1


@dataclass
class Attributes:
    """Readings of attributes in a file of version 1.`minor`; `found` is what was wrong so far."""

    found: list[Finding] = field(default_factory=list)
    minor: int = 0

    def add(self, element: Element | None, code: str, owner: Owner = NOBODY, /, **values: Any) -> None:
        self.found.append(Finding(code, values, {**({} if element is None else element.place), **owner}))

    def text(self, element: Element, attribute: str, owner: Owner) -> str | None:
        """A required attribute; None, and a finding, when it is missing or empty."""
        value = element.get(attribute)
        if not value:
            self.add(element, "attribute_missing", owner, element=element.tag, attribute=attribute)
            return None
        return value

    def choice(
        self, element: Element, value: str, available: Collection[str], kind: str, owner: Owner
    ) -> bool:
        """Whether the value is available; if not, adds a finding that lists those that are."""
        if value in available:
            return True
        self.add(element, "name_unknown", owner, kind=kind, got=value, available=[*available])
        return False

    def vector(
        self, element: Element, attribute: str, size: int, owner: Owner, required: bool = False
    ) -> list[float] | None:
        """`size` finite numbers; None when absent or, with a finding, wrong."""
        value = element.get(attribute)
        about = {"element": element.tag, "attribute": attribute}
        if value is None and required:
            self.add(element, "attribute_missing", owner, **about)
        if value is None:
            return None
        # A scalar may not have blanks around it (the C++ reader refuses them), a vector may.
        words = value.split() if size > 1 else [value]
        numbers = [float(word) for word in words if _NUMBER.fullmatch(word)]
        if len(words) != size or len(numbers) != size or not all(map(_readable, numbers)):
            self.add(element, "not_numbers", owner, **about, count=size, got=value)
            return None
        return numbers

    def number(
        self,
        element: Element,
        attribute: str,
        owner: Owner = NOBODY,
        required: bool = False,
        minimum: float = -math.inf,
    ) -> float | None:
        """A finite number, not below `minimum`; None when absent or, with a finding, wrong."""
        values = self.vector(element, attribute, 1, owner, required)
        if values is not None and values[0] < minimum:
            about = {"element": element.tag, "attribute": attribute}
            self.add(element, "below_minimum", owner, **about, minimum=minimum, got=values[0])
            return None
        return None if values is None else values[0]

    def origin(self, parent: Element, owner: Owner) -> None:
        """The `<origin>` of a link's part or of a joint: xyz in m, rpy in rad or, from version 1.1 on, a
        quaternion."""
        origin = child(parent, "origin")
        if origin is None:
            return
        self.vector(origin, "xyz", 3, owner)
        self.vector(origin, "rpy", 3, owner)
        quaternion = None if self.minor < QUATERNIONS else self.vector(origin, "quat_xyzw", 4, owner)
        if quaternion is not None and origin.get("rpy") is not None:
            self.add(origin, "turned_twice", owner)
        if quaternion is not None and not math.hypot(*quaternion):
            self.add(origin, "quaternion_zero", owner)


def _readable(number: float) -> bool:
    """The C++ reader refuses numbers so small that they have lost digits."""
    return math.isfinite(number) and (number == 0.0 or abs(number) >= sys.float_info.min)
