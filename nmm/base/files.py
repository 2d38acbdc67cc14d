"""Files that are read, replaced or locked: no device, no pipe, no more than is reasonable; and written whole
or not at all: in a hidden folder beside them, locked by one process.

The next writer removes what a killed one left. Where there are no locks, writers are not kept apart, and
leftovers stay.
"""

import errno
import os
import stat
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO

from nmm.base.errors import InputError, NmmError, RunError, expect
from nmm.base.text_format import one_line, printable

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None  # type: ignore[assignment]  # a module where there is one


def read_bytes(path: Path, most: int) -> bytes:
    """The content of a file of at most so many bytes; `OSError` also for a device (/dev/zero has no end)."""
    expect_file(path)
    with path.open("rb") as file:
        content = file.read(most + 1)
    if len(content) > most:
        raise OSError(errno.EFBIG, f"longer than {most / 1e6:g} MB")
    return content


def expect_file(path: Path) -> None:
    """`OSError` for what is not there, a device and a pipe, and for a name that no file can have."""
    try:
        mode = path.stat().st_mode
    except ValueError as error:  # a null character, half a character
        raise OSError(errno.EINVAL, f"no name of a file: {error}") from None
    if not stat.S_ISREG(mode) and not stat.S_ISDIR(mode):
        raise OSError(errno.EINVAL, "expected a file, this is a device or a pipe")


def expect_name(path: str | Path) -> None:
    """`InputError` for what no file and no folder can be called."""
    try:
        os.lstat(path)
    except ValueError as error:  # a null character, half a character
        raise InputError(f"is no name of a file: {error}", where=printable(str(path))) from None
    except OSError as error:
        expect(error.errno != errno.ENAMETOOLONG, one_line(str(path), 100), "a shorter name", error.strerror)


def replaceable(path: Path) -> Path:
    """The file to replace, symbolic links followed; `InputError` where something there is no file."""
    expect_name(path)
    target = Path(os.path.realpath(path))
    expect(not target.is_dir(), path, "a file, this is a folder")
    expect(not target.is_symlink(), path, "a file, this is a symbolic link that leads to itself")
    expect(target.is_file() or not target.exists(), path, "a file, this is a device or a pipe")
    return target


def taken(lock: IO[bytes]) -> bool | None:
    """Whether this process now holds the lock, until it is closed; None where the system has no locks."""
    if fcntl is None:
        return None
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:
        return None
    return True


def named_folder(text: str) -> tuple[str, str]:
    """The name, "" without, and the folder of NAME=FOLDER or FOLDER."""
    name, separator, folder = text.partition("=")
    return (name, folder) if separator and "/" not in name else ("", text)


#: What another name would not mend: the disk, a quota, the process's limits.
_MACHINE = {getattr(errno, name, None) for name in ("ENOSPC", "EDQUOT", "EFBIG", "EIO", "EMFILE", "ENFILE")}


class UnwrittenError(RunError):
    """What was computed could not be written, for want of room: the place itself is right."""


@contextmanager
def written_at(where: object) -> Iterator[None]:
    """An `OSError` of the block is told as the place's: `UnwrittenError`, also of a part that is written
    aside, or `InputError`. Not that of a reader of the output who has gone."""
    try:
        yield
    except BrokenPipeError:
        raise
    except OSError as error:
        lasting = error.errno in _MACHINE
        reason = os.strerror(error.errno) if error.errno and lasting else error.strerror or error
        kind: type[NmmError] = UnwrittenError if lasting else InputError
        raise kind(f"cannot be written: {reason}", where=where) from None
    except UnwrittenError as error:
        raise error.placed(str(where)) if ASIDE in error.where else error from None


#: Between two looks whether another process is through, s.
AGAIN = 0.05
#: How long one waits for another process that writes the same, s.
PATIENCE = 30.0
#: In the hidden folder: what is locked, and where the old folder waits where two cannot be exchanged.
LOCK, OLD = "lock", "old"
#: How a hidden folder's name ends.
ASIDE = ".nmm-writing"


@contextmanager
def writing(final: Path, patience: float) -> Iterator[Path]:
    """This process's empty hidden folder; `InputError` if another holds it longer than `patience`, s."""
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
        except KeyboardInterrupt:  # an interrupted run leaves nothing, either
            _leave(hidden, final)
            raise


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """A temporary file that replaces `path`, synced, when the block succeeds; or `InputError` if locked."""
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
    return InputError("another process is writing it; wait for its end, or name another folder", where=folder)


def _hidden(final: Path) -> Path:
    return final.parent / f".{final.name}{ASIDE}"


def _claimed(hidden: Path) -> IO[bytes] | None:
    """The lock, which is ours until it is closed; None while it is another process's."""
    with suppress(FileExistsError):  # not `exist_ok`, which raises where its writer removes it in that moment
        hidden.mkdir()
    try:
        lock = (hidden / LOCK).open("ab")
    except FileNotFoundError:  # its writer has just ended
        return None
    except OSError:  # no room for it: the folder, if it is ours and empty, goes again
        with suppress(OSError):
            hidden.rmdir()
        raise
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
