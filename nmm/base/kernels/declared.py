"""What numba is told of nmm's functions, not before something is compiled: a run of which all is in the cache
imports no numba.
"""

from __future__ import annotations

from collections import deque
from typing import Any

from nmm.base.lazy_call import interrupts_wait, lazy_call

_waiting: deque[tuple[str, tuple[Any, ...]]] = deque()
_compiling = False


def declare(registration: str, *arguments: Any) -> None:
    """Have the function "package.module:function" tell numba, now or when something is first compiled."""
    _waiting.append((registration, arguments))
    if _compiling:
        register()


def register() -> None:
    """Tell numba all that was declared; from now on at once."""
    global _compiling
    _compiling = True
    with interrupts_wait():
        while _waiting:
            registration, arguments = _waiting.popleft()
            lazy_call(registration)(*arguments)
