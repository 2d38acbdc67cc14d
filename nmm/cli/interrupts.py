"""Ctrl-C and a request to end, raised where Python code takes them.

A `KeyboardInterrupt` raised during an import may be swallowed by a library's catch-all or leave a half-made
C++ module that crashes: of 450 in the first 1.4 s of `nmm run`, four to nine were lost and one crashed.
"""

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

#: What asks a command to end, and the alarm that asks again for one that came at a bad time.
SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGALRM)

#: Time between two checks for the end of an import, s.
AGAIN = 0.02

#: Code that catches an interrupt or breaks on it: LLVM goes on without what an interrupted callback of
#: llvmlite was to keep.
DEAF = ("importlib", "pydantic", "llvmlite")


def raise_interrupts() -> None:
    """SIGINT and SIGTERM raise `KeyboardInterrupt`, as soon as no import is under way.

    A run writes what it has, also where a script started it with "&" (then the shell ignores SIGINT).
    """
    for number in SIGNALS:
        signal.signal(number, _interrupt)


def ignore_interrupts() -> None:
    """From now on signals are ignored: the command is done, and Python is shutting down."""
    for number in SIGNALS:
        signal.signal(number, signal.SIG_IGN)
    # An interrupt that was raised in a text that Python ran (a named tuple is made so) ends the process by
    # the signal, although it was caught: until Python runs another.
    exec("")


@contextmanager
def shielded() -> Iterator[threading.Event]:
    """Signals do not end the block: a second Ctrl-C loses nothing. The event is set when one came."""
    asked = threading.Event()
    before = {number: signal.signal(number, lambda *of: asked.set()) for number in SIGNALS}
    try:
        yield asked
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _interrupt(number: int, frame: FrameType | None) -> None:
    while frame is not None:
        if frame.f_globals.get("__name__", "").partition(".")[0] in DEAF:
            signal.setitimer(signal.ITIMER_REAL, AGAIN)
            return
        frame = frame.f_back
    raise KeyboardInterrupt
