"""What is written whole or not at all: in a hidden folder beside it, by one process alone.

While `runs/o` is written, a folder `runs/.o.nmm-writing` holds what there is of the new one, and a lock that
ends with the process, however that ends. What a writer that was killed has left, the next one removes.
Where there are no locks, writers are not kept apart, and leftovers stay.
"""

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
#: How long one waits for another process that writes the same, s.
PATIENCE = 30.0
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
    hidden = _hidden(final)
    until = time.monotonic() + patience
    try:
        while (lock := _claimed(hidden)) is None:
            if time.monotonic() > until:
                raise busy(final)
            time.sleep(AGAIN)
        with lock:
            _clear(lock, hidden, final)
            yield hidden
    finally:
        try:
            _leave(hidden, final)
        except KeyboardInterrupt:  # whoever ends it wants nothing left, either
            _leave(hidden, final)
            raise


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """A temporary file that takes the place of `path`, and is on the disk, when the block ends well.

    Raises
    ------
    InputError : another process is writing it
    OSError : it cannot be written
    """
    import tempfile  # here: `nmm --help` would pay

    with writing(path, PATIENCE) as hidden, tempfile.TemporaryDirectory(dir=hidden) as folder:
        temporary = Path(folder) / path.name
        yield temporary
        with temporary.open("rb") as file:
            os.fsync(file.fileno())
        temporary.replace(path)


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
    try:
        with suppress(FileNotFoundError):
            if taken(lock) is not False and os.path.samestat(os.fstat(lock.fileno()), (hidden / LOCK).stat()):
                return lock
    except BaseException:  # an interrupt, whose traceback would keep it
        lock.close()
        raise
    lock.close()
    return None


def _clear(lock: IO[bytes], hidden: Path, final: Path) -> None:
    """Nothing of a writer that has ended stays but what it was about to replace, which is put back."""
    import shutil  # here: `nmm --help` would pay

    if not taken(lock):  # where there are no locks, another may be writing here
        return
    if (hidden / OLD).exists() and not final.exists():
        (hidden / OLD).rename(final)
    for left in hidden.iterdir():
        if left.name != LOCK:
            shutil.rmtree(left, ignore_errors=True)


def _leave(hidden: Path, final: Path) -> None:
    """The hidden folder goes, unless another process has it by now."""
    with suppress(OSError):
        lock = _claimed(hidden)
        if lock is not None:
            with lock:
                _clear(lock, hidden, final)
                (hidden / LOCK).unlink()
                hidden.rmdir()
