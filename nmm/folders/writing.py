"""The hidden folder in which one process alone writes what is to stand beside it."""

from __future__ import annotations

import os
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO

from nmm.errors import InputError
from nmm.files import taken

#: Between two looks whether another process is through, s.
AGAIN = 0.05
#: In the hidden folder: what is locked, and where the old folder waits where two cannot be exchanged.
LOCK, OLD = "lock", "old"


@contextmanager
def writing(final: Path, patience: float) -> Iterator[Path]:
    """The hidden folder beside `final`, for this process alone, without what a dead writer left in it.

    Raises
    ------
    InputError : another process has it longer than `patience`, s
    OSError : it cannot be made
    """
    import shutil  # here: `nmm --help` would pay

    hidden = _hidden(final)
    until = time.monotonic() + patience
    while (lock := _claimed(hidden)) is None:
        if time.monotonic() > until:
            raise busy(final)
        time.sleep(AGAIN)
    with lock:
        if taken(lock):
            if (hidden / OLD).exists() and not final.exists():
                (hidden / OLD).rename(final)
            for left in hidden.iterdir():
                if left.name != LOCK:
                    shutil.rmtree(left, ignore_errors=True)
        try:
            yield hidden
        finally:
            with suppress(OSError):  # where there are no locks, another may be writing in it
                (hidden / LOCK).unlink()
                hidden.rmdir()


def at_work(final: Path) -> bool:
    """Whether a process is writing what is to stand there; `OSError` where nothing can."""
    try:
        with (_hidden(final) / LOCK).open("rb") as lock:
            return taken(lock) is False
    except FileNotFoundError:
        return False


def busy(folder: Path) -> InputError:
    """The error of a second writer."""
    return InputError(f"{folder}: another process is writing it; wait for its end, or name another folder")


def _hidden(final: Path) -> Path:
    return final.parent / f".{final.name}.nmm-writing"


def _claimed(hidden: Path) -> IO[bytes] | None:
    """The lock, which is ours until it is closed; None while it is another process's."""
    hidden.mkdir(exist_ok=True)
    try:
        lock = (hidden / LOCK).open("ab")
    except FileNotFoundError:  # its writer has just ended
        return None
    with suppress(FileNotFoundError):
        if taken(lock) is not False and os.path.samestat(os.fstat(lock.fileno()), (hidden / LOCK).stat()):
            return lock
    lock.close()
    return None
