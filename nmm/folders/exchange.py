"""Two folders change places, in one step where the system can."""

from __future__ import annotations

import ctypes
import errno
import os
import sys
from pathlib import Path

#: `AT_FDCWD` and `RENAME_EXCHANGE` of Linux (rename(2)), `RENAME_SWAP` of macOS (renamex_np(2)).
_HERE, _EXCHANGE, _SWAP = -100, 2, 2
#: What a kernel or a file system says that cannot do it: NFS and some of FUSE's, Linux before 3.15.
_CANNOT = (errno.EINVAL, errno.ENOSYS, errno.ENOTSUP)


def exchanged(one: Path, other: Path) -> bool:
    """Exchange two folders: at every moment both names are there. False where the system cannot do that.

    Raises
    ------
    OSError : they cannot be exchanged for another reason
    """
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
