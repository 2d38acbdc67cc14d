"""Bytes cached on disk: read back whole, or treated as missing."""

import hashlib
import os
import tempfile
from contextlib import suppress
from pathlib import Path

_DIGEST = hashlib.sha256
_LENGTH = _DIGEST().digest_size


def read(path: Path) -> bytes | None:
    """The bytes that `write` put there; None where there are none, or they are cut short or damaged."""
    try:
        content = path.read_bytes()
    except OSError:
        return None
    data = content[_LENGTH:]
    return data if _DIGEST(data).digest() == content[:_LENGTH] else None


def write(path: Path, data: bytes) -> None:
    """Replace the file atomically, also among processes; an `OSError` leaves nothing behind."""
    path.parent.mkdir(parents=True, exist_ok=True)
    file, temporary = tempfile.mkstemp(dir=path.parent, prefix=".", suffix=".tmp")
    try:
        with open(file, "wb") as opened:
            opened.write(_DIGEST(data).digest())
            opened.write(data)
        os.replace(temporary, path)
    except BaseException:  # an interrupt, too
        with suppress(OSError):
            os.unlink(temporary)
        raise
