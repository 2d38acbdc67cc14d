"""How much work a robot's file may ask for: xacro is a language, a few lines of which can ask for more than
any machine has. No known robot comes near a bound."""

from __future__ import annotations

import math
import re
import time
from collections.abc import Callable, Iterable, Iterator
from functools import partial, reduce
from typing import Any

from nmm.base.findings import Finding

#: Steps of xacro (an element, a piece of text, a call in an expression, an item of its loops), what a file
#: counts, and how many seconds of processor they may take.
MOST_STEPS, STEPS_OF_A_FILE, PATIENCE = 500_000, 100, 10.0
#: Characters in all that is read and made, in one expression, in a YAML file; bits of an integer.
LONGEST, LONGEST_EXPRESSION, LONGEST_YAML, MOST_BITS = 50_000_000, 20_000, 1_000_000, 10_000
#: Elements in a file or in what becomes of it, its links, those in a row, and joints that move.
MOST_ELEMENTS, MOST_LINKS, MOST_IN_A_ROW, MOST_MOVING = 200_000, 10_000, 1_000, 500
#: Digits of a number that is written, as wide as a format may ask for, or rounded to.
MOST_DIGITS = 999
#: Functions whose integers have as many digits as the argument is large.
_GROWING = (math.factorial, math.comb, math.perm)
#: Those that take all that an iterator gives.
_CONSUMERS = (list, tuple, set, frozenset, dict, sorted, max, min, any, all)
_ITEMS = str | list | tuple | dict | set | frozenset
#: Of printf's formats those that say how wide a text is.
_WIDE = re.compile(r"%(?:\([^)]*\))?[-+ #0]*(?:\*|\d{4}|\d*\.(?:\*|\d{4}))")


class RefusedContent(Exception):
    """What a file may not ask for; `text` is where it does, as it stands in the file."""

    def __init__(self, finding: Finding, text: str = "") -> None:
        self.finding, self.text = finding, text
        super().__init__(str(finding))


class BeyondBound(RefusedContent):
    """A bound, by what it counts."""

    def __init__(self, what: str, most: float) -> None:
        super().__init__(Finding("beyond_bound", {"what": what, "most": most}))


class Budget:
    """What the expansion of one file has used."""

    def __init__(self) -> None:
        self._steps, self._length, self._until = 0, 0, time.thread_time() + PATIENCE

    def step(self, count: int = 1) -> None:
        before, self._steps = self._steps, self._steps + count
        if self._steps > MOST_STEPS:
            raise BeyondBound("steps of xacro", MOST_STEPS)
        # Not each time: the clock may take longer than the step.
        if before // 16 < self._steps // 16 and time.thread_time() > self._until:
            raise BeyondBound("seconds of processor for xacro", PATIENCE)

    def took(self, value: Any) -> Any:
        """The value, counted by its length."""
        self.step()
        if isinstance(value, int) and value.bit_length() > MOST_BITS:
            raise BeyondBound("bits in an integer", MOST_BITS)
        if isinstance(value, _ITEMS | range):
            self._length += len(value)
            if self._length > LONGEST:
                raise BeyondBound("characters and items for xacro", LONGEST)
        return value

    def each(self, items: Iterable[Any]) -> Iterator[Any]:
        for item in items:
            yield self.took(item)

    def called(self, function: Any, *arguments: Any, **named: Any) -> Any:
        if function in _GROWING and max(map(abs, arguments), default=0) > 1_000:
            raise BeyondBound("bits in an integer", MOST_BITS)
        digits = named.get("ndigits", arguments[1] if len(arguments) > 1 else 0) if function is round else 0
        if isinstance(digits, int) and abs(digits) > MOST_DIGITS:
            raise BeyondBound("digits of a number", MOST_DIGITS)
        if function is sum or function is math.prod:
            add, first = (self.plus, 0) if function is sum else (self.times, 1)
            rest = [*arguments[1:], *named.values()]  # where it starts
            return self.took(reduce(add, self.each(arguments[0]), *(rest or [first])))
        if function is math.lcm:
            return reduce(lambda left, right: self.took(math.lcm(left, right)), arguments, 1)
        if function in _CONSUMERS:
            arguments = tuple(
                self.each(one) if isinstance(one, Iterator | range) else one for one in arguments
            )
        if function in (map, filter) and arguments and callable(arguments[0]):
            arguments = (partial(self.called, arguments[0]), *arguments[1:])
        if callable(named.get("key")):
            named["key"] = partial(self.called, named["key"])
        value = self.took(function(*arguments, **named))
        return self.display(value) if isinstance(value, _ITEMS) else value

    def power(self, base: Any, exponent: Any) -> Any:
        if isinstance(base, int) and isinstance(exponent, int) and base.bit_length() * exponent > MOST_BITS:
            raise BeyondBound("bits in an integer", MOST_BITS)
        return base**exponent

    def times(self, left: Any, right: Any) -> Any:
        for value, count in ((left, right), (right, left)):
            if isinstance(value, str | list | tuple) and isinstance(count, int):
                self.took(range(max(0, len(value) * min(count, LONGEST + 1))))
                return self.took(self.display(left * right))
        return self.took(left * right)

    def plus(self, left: Any, right: Any) -> Any:
        value = left + right
        return self.took(value) if isinstance(value, str | list | tuple) else value

    def modulo(self, left: Any, right: Any) -> Any:
        if isinstance(left, str):
            if _WIDE.search(left):
                raise BeyondBound("characters of a number's width", MOST_DIGITS)
            longest = len(left) + left.count("%") * (_size(right, {}) + MOST_DIGITS)
            if longest > LONGEST:
                raise BeyondBound("characters and items for xacro", LONGEST)
        return self.took(left % right)

    def display(self, value: Any) -> Any:
        """A list, tuple, set or mapping: lists of lists double with each, but for what they say."""
        if _size(value, {}) > LONGEST:
            raise BeyondBound("characters and items for xacro", LONGEST)
        return value

    def shift(self, value: Any, count: Any) -> Any:
        if isinstance(count, int) and count > MOST_BITS:
            raise BeyondBound("bits in an integer", MOST_BITS)
        return self.took(value << count)


def _size(value: Any, sizes: dict[int, int]) -> int:
    """How many characters and items a value would have written out; each of its parts is counted once."""
    if isinstance(value, str):
        return len(value)
    if not isinstance(value, _ITEMS):
        return 1
    if id(value) not in sizes:
        sizes[id(value)] = 1
        # Of the type itself: xacro's lists wrap each item anew.
        parts = [*dict.keys(value), *dict.values(value)] if isinstance(value, dict) else _items(value)
        sizes[id(value)] = 1 + sum(_size(part, sizes) for part in parts)
    return sizes[id(value)]


def _items(value: Any) -> Iterable[Any]:
    kind: Callable[[Any], Iterable[Any]] = next(
        one.__iter__ for one in (list, tuple, set, frozenset) if isinstance(value, one)
    )
    return kind(value)
