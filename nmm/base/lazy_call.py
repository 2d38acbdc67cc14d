"""Lazy calls: the only calls from a lower package to a higher one, against the direction of imports.

Packages that save, draw or play data import the data's package. So that `trajectory.save(folder)` works all
the same, such a method imports its function by name when it is called.
"""

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pkgutil import resolve_name
from typing import Any


def lazy_call(name: str) -> Callable[..., Any]:
    """The function "package.module:function", imported now."""
    return resolve_name(name)


@contextmanager
def interrupts_wait() -> Iterator[None]:
    """Ctrl-C waits until the block has ended: numba and Pinocchio, interrupted while they are imported, stay
    broken for as long as Python runs; a process whose start is interrupted ends in a traceback."""
    before = signal.getsignal(signal.SIGINT)
    if before is None or threading.current_thread() is not threading.main_thread():
        yield
        return
    came: list[int] = []
    signal.signal(signal.SIGINT, lambda number, _: came.append(number))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
        if came:
            signal.raise_signal(signal.SIGINT)
