"""Collecting what is wrong with a description while reading its attributes."""

from __future__ import annotations

import math
import re
import sys
from collections.abc import Sequence
from dataclasses import dataclass, field

from nmm.errors import unknown
from nmm.robots.loading.xml_tree import Element
from nmm.words import one_line

# What the C++ reader takes: Python's float would also take nan, inf, 1_0 and digits of other scripts.
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", re.ASCII)


@dataclass(frozen=True)
class Problem:
    """Something wrong with a description.

    Attributes
    ----------
    message : what, in words that name the element
    line : line of the text, if it has one
    """

    message: str
    line: int | None = None

    def __str__(self) -> str:
        return self.message if self.line is None else f"line {self.line}: {self.message}"


@dataclass
class Findings:
    """The problems found so far, and the readings of attributes that add to them."""

    problems: list[Problem] = field(default_factory=list)

    def add(self, element: Element | None, message: str) -> None:
        """Note a problem with an element."""
        self.problems.append(Problem(message, element.line if element is not None else None))

    def text(self, element: Element, attribute: str, owner: str) -> str | None:
        """A required attribute; None, and a problem, when it is missing or empty."""
        value = element.get(attribute)
        if not value:
            self.add(element, f"{owner}: <{element.tag}> has no {attribute}")
            return None
        return value

    def choice(self, element: Element, value: str, available: Sequence[str], kind: str, owner: str) -> bool:
        """Whether the value is one of those available; a problem that lists them when not."""
        if value in available:
            return True
        self.add(element, unknown(kind, value, available, owner))
        return False

    def vector(
        self, element: Element, attribute: str, size: int, owner: str, required: bool = False
    ) -> list[float] | None:
        """`size` finite numbers; None when absent or, with a problem, wrong."""
        value = element.get(attribute)
        if value is None:
            if required:
                self.add(element, f"{owner}: <{element.tag}> has no {attribute}")
            return None
        # A scalar may not have blanks around it (the C++ reader refuses them), a vector may.
        words = value.split() if size > 1 else [value]
        numbers = [float(word) for word in words if _NUMBER.fullmatch(word)]
        if len(words) != size or len(numbers) != size or not all(map(_readable, numbers)):
            expected = f"{size} finite numbers" if size > 1 else "a finite number"
            self.add(
                element,
                f"{owner}: <{element.tag}> {attribute}: expected {expected}, got {one_line(repr(value), 60)}",
            )
            return None
        return numbers

    def number(
        self, element: Element, attribute: str, owner: str, required: bool = False, minimum: float = -math.inf
    ) -> float | None:
        """A finite number, not below `minimum`; None when absent or, with a problem, wrong."""
        values = self.vector(element, attribute, 1, owner, required)
        if values is None:
            return None
        if values[0] < minimum:
            self.add(
                element,
                f"{owner}: <{element.tag}> {attribute}: expected {minimum:g} or more, got {values[0]:g}",
            )
            return None
        return values[0]

    def origin(self, parent: Element, owner: str) -> None:
        """The `<origin>` of a link's part or of a joint: xyz in m, rpy in rad."""
        origin = child(parent, "origin")
        if origin is not None:
            self.vector(origin, "xyz", 3, owner)
            self.vector(origin, "rpy", 3, owner)


def _readable(number: float) -> bool:
    """Whether the C++ reader takes it: it refuses numbers so small that they have lost digits."""
    return math.isfinite(number) and (number == 0.0 or abs(number) >= sys.float_info.min)


def child(parent: Element, tag: str) -> Element | None:
    """The first child with that tag, as an element that knows its line."""
    found = parent.find(tag)
    return found if isinstance(found, Element) else None


def children(parent: Element, tag: str) -> list[Element]:
    """All children with that tag."""
    return [element for element in parent.findall(tag) if isinstance(element, Element)]
