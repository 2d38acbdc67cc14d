"""A folder written whole or not at all, which replaces only what is of the same kind.

What there is of the new one lies in a hidden folder (`nmm.writing`). The new one then changes places with the
old one in one step: whoever looks sees the old or the new.

Where the system cannot exchange two folders (Windows, some network file systems), the old one is moved into
the hidden folder for the moment until the new one stands; of a writer that was killed in that moment, the
next one moves it back first.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TypeVar

from nmm.errors import InputError
from nmm.files import read_bytes
from nmm.folders.exchange import exchanged
from nmm.writing import OLD, PATIENCE, at_work, busy, writing

Read = TypeVar("Read")

#: A folder's JSON is not longer than that, bytes.
MOST = 200_000_000
#: How often a folder that is replaced meanwhile is read anew.
MOST_READINGS = 20


@contextmanager
def replaced_folder(
    folder: str | Path, is_ours: Callable[[Path], bool], patience: float = PATIENCE
) -> Iterator[Path]:
    """A temporary folder that takes the place of `folder` when the block ends without an error.

    Parameters
    ----------
    folder : a new or an empty folder, or one of ours; of a symbolic link, the folder that it leads to
    is_ours : whether a folder is one that may be replaced
    patience : how long to wait for another process that writes it, s

    Raises
    ------
    InputError : `folder` exists and is not one of ours, cannot be written, or another process is writing it
    """
    import shutil  # here, both: `nmm --help` would pay
    import tempfile

    final = Path(os.path.realpath(folder))
    check_replaceable(folder, is_ours)
    try:
        final.parent.mkdir(parents=True, exist_ok=True)
        with writing(final, patience) as hidden:
            temporary = Path(tempfile.mkdtemp(dir=hidden))
            try:
                temporary.chmod(0o755)
                yield temporary
                check_replaceable(folder, is_ours)  # others may have made something there meanwhile
                _put(temporary, final, hidden / OLD)
            finally:
                shutil.rmtree(temporary, ignore_errors=True)
    except BrokenPipeError:  # of what the block prints
        raise
    except OSError as error:
        raise InputError(f"{folder}: cannot be written: {error.strerror or error}") from None


def _put(temporary: Path, final: Path, old: Path) -> None:
    """The folder that is written takes the place of the one that stands there, if any."""
    if not final.exists():
        temporary.rename(final)
    elif not exchanged(temporary, final):
        import shutil

        final.rename(old)
        try:
            temporary.rename(final)
        except BaseException:  # an interrupt, too
            old.rename(final)
            raise
        shutil.rmtree(old, ignore_errors=True)


def steady(folder: Path, read: Callable[[], Read]) -> Read:
    """What `read` finds in a folder that may be replaced meanwhile: all of the old one, or of the new."""
    for _ in range(MOST_READINGS):
        before = _identity(folder)
        try:
            found = read()
        except (InputError, OSError):
            if _identity(folder) == before:
                raise
            continue
        if _identity(folder) == before:
            return found
    raise InputError(f"{folder}: is being replaced again and again; read it when that has ended")


def check_replaceable(folder: str | Path, is_ours: Callable[[Path], bool]) -> None:
    """`InputError` when `folder` exists, holds something, and is not one of ours."""
    final = Path(folder)
    try:
        if final.is_dir() and (not any(final.iterdir()) or is_ours(final)):
            return
        exists = final.exists() or final.is_symlink()
    except OSError as error:
        raise InputError(f"{folder}: cannot be written: {error.strerror}") from None
    if exists:
        raise InputError(
            f"{final}: exists and is not what this writes; expected a new or an empty folder, or one that "
            "this wrote before"
        )


def check_folder(folder: Path, is_ours: Callable[[Path], bool]) -> None:
    """`InputError` for a folder that must not, or cannot, be written now: before anything is computed."""
    check_replaceable(folder, is_ours)
    parent = folder.absolute().parent
    while not os.path.lexists(parent):
        parent = parent.parent
    if not parent.is_dir() or not os.access(parent, os.W_OK | os.X_OK):
        raise InputError(f"{folder}: cannot be written: {parent} is not a folder where you may write")
    try:
        if at_work(Path(os.path.realpath(folder))):
            raise busy(folder)
    except OSError as error:  # a name that is too long
        raise InputError(f"{folder}: cannot be written: {error.strerror}") from None


def has_format(file: Path, expected: str) -> bool:
    """Whether a JSON file of ours says that its folder is of that format."""
    try:
        content = json.loads(read_bytes(file, MOST))
    except (OSError, ValueError, RecursionError):
        return False
    return isinstance(content, dict) and content.get("format") == expected


def _identity(folder: Path) -> tuple[int, int] | None:
    """Which folder stands there, and as of when; None where there is none."""
    try:
        found = folder.stat()
    except OSError:
        return None
    return found.st_ino, found.st_mtime_ns
