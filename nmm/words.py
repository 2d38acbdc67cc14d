"""Words that sentences for people are made of, and text as one line of a message."""

from __future__ import annotations

from collections.abc import Sequence


def listed(phrases: Sequence[str], word: str = "and") -> str:
    """ "a", "a and b", "a, b and c"."""
    if len(phrases) < 2:
        return "".join(phrases)
    return f"{', '.join(phrases[:-1])} {word} {phrases[-1]}"


def printable(text: str) -> str:
    """The text with control characters, line breaks among them, as escapes: names in files may hold any."""
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)


def one_line(text: str, limit: int = 300) -> str:
    """The text with all white space as single spaces, cut after `limit` characters."""
    joined = " ".join(text.split())
    return joined if len(joined) <= limit else f"{joined[: limit - 1]}…"
