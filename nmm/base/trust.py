"""Whether the robots' files that are read now may run programs: what their reader answers, and who asks."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar

_TRUSTED: ContextVar[bool] = ContextVar("xacro_trusted", default=False)


def is_trusted() -> bool:
    """Whether the xacro files that are read now, in this thread, may run programs."""
    return _TRUSTED.get()


@contextmanager
def trusting(trust: bool) -> Iterator[None]:
    """Files that are read in the block are trusted, if that is asked for here or was around it."""
    before = _TRUSTED.set(trust or _TRUSTED.get())
    try:
        yield
    finally:
        _TRUSTED.reset(before)
