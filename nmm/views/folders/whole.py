"""A folder written whole or not at all, which replaces only a folder of the same kind.

It is written in a hidden folder (`nmm.base.files`), then exchanged atomically. Where the system cannot do
that (Windows, some network file systems), the old folder is moved aside meanwhile; if the writer is killed in
that moment, the next writer moves it back.
"""

import ctypes
import errno
import json
import os
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

from nmm.base.errors import InputError
from nmm.base.files import OLD, PATIENCE, at_work, busy, expect_name, read_bytes, writing, written_at
from nmm.base.machine import made_with

Read = TypeVar("Read")

#: Largest JSON file of a folder, bytes.
MOST = 200_000_000
#: Most attempts to read a folder that is being replaced.
MOST_READINGS = 20
#: `AT_FDCWD` and `RENAME_EXCHANGE` of Linux (rename(2)), `RENAME_SWAP` of macOS (renamex_np(2)).
_HERE, _EXCHANGE, _SWAP = -100, 2, 2
#: What a kernel or a file system says that cannot do it: NFS and some of FUSE's, Linux before 3.15.
_CANNOT = (errno.EINVAL, errno.ENOSYS, errno.ENOTSUP)


@dataclass(frozen=True)
class FolderKind:
    """A kind of folder; calling it checks the format in a folder's JSON file."""

    format: str
    file: str = "summary.json"

    def __call__(self, folder: Path) -> bool:
        try:
            content = json.loads(read_bytes(folder / self.file, MOST))
        except (OSError, ValueError, RecursionError):
            return False
        return isinstance(content, dict) and content.get("format") == self.format

    def write(self, folder: Path, content: Mapping[str, Any], *, ensure_ascii: bool = False) -> None:
        """Write the JSON file: the format, what made it unless `content` says so, and the content."""
        document = {"format": self.format, "made_with": made_with(), **content}
        text = json.dumps(document, indent=2, ensure_ascii=ensure_ascii)
        (folder / self.file).write_text(text + "\n", encoding="utf-8")


@contextmanager
def replaced_folder(
    folder: str | Path, is_ours: Callable[[Path], bool], patience: float = PATIENCE
) -> Iterator[Path]:
    """A temporary folder that replaces `folder` (new, empty or ours; or a symbolic link's target) if the
    block succeeds. InputError if it is not ours, cannot be written, or is still being written by another
    process after `patience` s."""
    import shutil  # here, both: `nmm --help` would pay
    import tempfile

    check_replaceable(folder, is_ours)
    final = Path(os.path.realpath(folder))
    with written_at(folder):
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


def _put(temporary: Path, final: Path, old: Path) -> None:
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


def exchanged(one: Path, other: Path) -> bool:
    """Exchange two folders atomically; False if the system cannot, OSError if it fails otherwise."""
    if sys.platform not in ("linux", "darwin"):
        return False
    library = ctypes.CDLL(None, use_errno=True)
    names = os.fsencode(one), os.fsencode(other)
    try:
        if sys.platform == "linux":
            failed = library.renameat2(_HERE, names[0], _HERE, names[1], ctypes.c_uint(_EXCHANGE))
        else:
            failed = library.renamex_np(*names, ctypes.c_uint(_SWAP))
    except AttributeError:  # a C library without it
        return False
    if not failed:
        return True
    number = ctypes.get_errno()
    if number in _CANNOT:
        return False
    raise OSError(number, os.strerror(number), str(one), None, str(other))


def steady(folder: Path, read: Callable[[], Read]) -> Read:
    """What `read` finds in a folder that may be replaced meanwhile: all old or all new."""
    expect_name(folder)
    for _ in range(MOST_READINGS):
        before = _identity(folder)
        try:
            content = read()
        except (InputError, OSError):
            if _identity(folder) == before:
                raise
            continue
        if _identity(folder) == before:
            return content
    raise InputError("is being replaced again and again; read it when that has ended", where=folder)


def check_replaceable(folder: str | Path, is_ours: Callable[[Path], bool]) -> None:
    """InputError if `folder` is neither new, empty nor ours."""
    expect_name(folder)
    final = Path(folder)
    with written_at(folder):
        if final.is_dir() and (not any(final.iterdir()) or is_ours(final)):
            return
        exists = final.exists() or final.is_symlink()
    if exists:
        raise InputError(
            "exists and is not what this writes",
            where=final,
            expected="a new or an empty folder, or one that this wrote before",
        )


def check_folder(folder: Path, is_ours: Callable[[Path], bool]) -> None:
    """InputError, before any computation, if a folder cannot or must not be written."""
    check_replaceable(folder, is_ours)
    parent = folder.absolute().parent
    while not os.path.lexists(parent):
        parent = parent.parent
    if not parent.is_dir() or not os.access(parent, os.W_OK | os.X_OK):
        raise InputError(f"cannot be written: {parent} is not a folder where you may write", where=folder)
    with written_at(folder):  # a name that is too long
        if at_work(Path(os.path.realpath(folder))):
            raise busy(folder)


def _identity(folder: Path) -> tuple[int, int] | None:
    """A folder's identity and change time, if it exists."""
    try:
        status = folder.stat()
    except OSError:
        return None
    return status.st_ino, status.st_mtime_ns
