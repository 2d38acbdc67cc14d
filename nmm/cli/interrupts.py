"""Ctrl-C and a request to end, raised where Python code takes them.

Raised while a module is being imported, a `KeyboardInterrupt` is now and then swallowed (a library that tries
whether another is there catches everything) or leaves a half-made C++ module behind that ends the process
with "double free": of 450 interrupts in the first 1.4 s of `nmm run`, four to nine were lost and one crashed.
"""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

#: What asks a command to end, and the alarm that asks again for one that came at a bad time.
SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGALRM)

#: Between two looks whether the import is through, s.
AGAIN = 0.02

#: Their code catches, or cannot stand, an interrupt: LLVM calls llvmlite back, and goes on without what an
#: interrupted call was to keep.
DEAF = ("importlib", "pydantic", "llvmlite")


def raise_interrupts() -> None:
    """SIGINT and SIGTERM raise `KeyboardInterrupt`, as soon as no import is under way.

    A run that is told to end writes what it has, whether by Ctrl-C, by the system, or by a script that
    started it with "&" (for which the shell has set SIGINT to be ignored).
    """
    for number in SIGNALS:
        signal.signal(number, _interrupt)


def ignore_interrupts() -> None:
    """What was asked is done, or told: nothing that comes while Python takes itself apart changes that."""
    for number in SIGNALS:
        signal.signal(number, signal.SIG_IGN)
    # An interrupt that was raised in a text that Python ran (a named tuple is made so) ends the process by
    # the signal, although it was caught: until Python runs another.
    exec("")


@contextmanager
def shielded() -> Iterator[threading.Event]:
    """Whoever presses Ctrl-C twice wants the run to end, not to lose what there is of it.

    What is yielded is set when the command was asked to end meanwhile.
    """
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
