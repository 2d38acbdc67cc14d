"""Words that sentences for people are made of."""

from __future__ import annotations

from collections.abc import Sequence


def listed(phrases: Sequence[str], word: str = "and") -> str:
    """ "a", "a and b", "a, b and c"."""
    if len(phrases) < 2:
        return "".join(phrases)
    return f"{', '.join(phrases[:-1])} {word} {phrases[-1]}"
