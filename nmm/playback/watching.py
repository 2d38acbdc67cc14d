"""What a page is sent of a motion that goes on, and what it has drawn of it."""

from __future__ import annotations

import json
from collections import deque
from collections.abc import Sequence

#: Pictures on their way to a page at most: more would only make it late.
AHEAD = 2
#: Pages that a report names.
NAMED = 4


class Watching:
    """One page: it is sent pictures by rising number, and answers each with how many it has drawn.

    One that does not answer is sent no more: what it misses is dropped, and it delays nobody.

    Parameters
    ----------
    made : the number of the last picture before it came

    Attributes
    ----------
    drawn : how many pictures it has drawn
    """

    def __init__(self, made: int) -> None:
        self._first = self._last = self._answered = made
        self._sent = 0
        self._waiting: deque[int] = deque()
        self._left: int | None = None
        self.drawn = 0

    def takes(self, number: int) -> bool:
        """Whether the picture of that number is sent to it now; it is then on its way."""
        if number == self._last or len(self._waiting) >= AHEAD:
            return False
        self._last = number
        self._sent += 1
        self._waiting.append(number)
        return True

    def heard(self, text: str | bytes) -> bool:
        """Take a page's answer; whether it was one. What no page of ours says is left aside."""
        try:
            data = json.loads(text)
        except (ValueError, RecursionError):
            return False
        if not isinstance(data, dict) or data.keys() != {"type", "picture", "drawn"}:
            return False
        picture, drawn = data["picture"], data["drawn"]
        if data["type"] != "drawn" or type(picture) is not int or type(drawn) is not int:
            return False
        if not (self._answered < picture <= self._last and self.drawn < drawn <= self._sent):
            return False
        self._answered, self.drawn = picture, drawn
        while self._waiting and self._waiting[0] <= picture:
            self._waiting.popleft()
        return True

    def has_drawn(self, number: int) -> bool:
        """Whether the picture of that number is drawn, or will never be: it has gone."""
        return self._left is not None or self._answered >= number

    def leaves(self, made: int) -> None:
        """It has gone: pictures after number `made` are not its."""
        self._left = made

    def dropped(self, made: int) -> int:
        """How many of the pictures up to number `made` it came for and did not draw, but for those on their
        way."""
        last = made if self._left is None else self._left
        return max(0, last - self._first - self.drawn - len(self._waiting))


def counted(pages: Sequence[Watching], made: int) -> str:
    """What became of the pictures up to number `made`, page by page."""
    told = [f"drew {page.drawn} and dropped {page.dropped(made)}" for page in pages[:NAMED]]
    if len(pages) <= 1:
        return "".join(f"the page {text}" for text in told) or "no page was open"
    more = f", {len(pages) - NAMED} more" if len(pages) > NAMED else ""
    return ", ".join(f"page {i} {text}" for i, text in enumerate(told, 1)) + more
