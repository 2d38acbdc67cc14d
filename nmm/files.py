"""Files that are read, replaced or locked: no device, no pipe, no more than is reasonable."""

from __future__ import annotations

import errno
import os
import stat
from pathlib import Path
from typing import IO

from nmm.errors import InputError

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None  # type: ignore[assignment]  # a module where there is one


def read_bytes(path: Path, most: int) -> bytes:
    """The content of a file of at most so many bytes.

    Raises
    ------
    OSError : it is not there, cannot be read, is no file (/dev/zero has no end), or is longer
    """
    expect_file(path)
    with path.open("rb") as file:
        content = file.read(most + 1)
    if len(content) > most:
        raise OSError(errno.EFBIG, f"longer than {most / 1e6:g} MB")
    return content


def expect_file(path: Path) -> None:
    """`OSError` for what is not there, a device and a pipe."""
    mode = path.stat().st_mode
    if not stat.S_ISREG(mode) and not stat.S_ISDIR(mode):
        raise OSError(errno.EINVAL, "expected a file, this is a device or a pipe")


def replaceable(path: Path) -> Path:
    """The file that a new one may take the place of, through symbolic links, which stay.

    Raises
    ------
    InputError : something stands there that is no file
    """
    target = Path(os.path.realpath(path))
    if target.is_dir():
        raise InputError(f"{path}: expected a file, this is a folder")
    if target.is_symlink():
        raise InputError(f"{path}: expected a file, this is a symbolic link that leads to itself")
    if target.exists() and not target.is_file():
        raise InputError(f"{path}: expected a file, this is a device or a pipe")
    return target


def taken(lock: IO[bytes]) -> bool | None:
    """Whether the lock, an open file, is this process's now, until it is closed; None where the system has
    none."""
    if fcntl is None:
        return None
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:
        return None
    return True
