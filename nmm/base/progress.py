"""Progress: a function that is called with the fraction done, and shares of it."""

from collections.abc import Callable
from typing import TypeAlias

Progress: TypeAlias = Callable[[float], None]


def between(progress: Progress | None, first: float, share: float) -> Progress | None:
    """A progress function for a part of the work: from the fraction `first`, a `share` of the whole."""
    return None if progress is None else lambda fraction: progress(min(1.0, first + share * fraction))
