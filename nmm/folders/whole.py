"""A folder written whole or not at all, which replaces only what is of the same kind."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from nmm.errors import InputError


@contextmanager
def replaced_folder(folder: str | Path, is_ours: Callable[[Path], bool]) -> Iterator[Path]:
    """A temporary folder beside `folder` that takes its place when the block ends without an error.

    Raises
    ------
    InputError : `folder` exists and is not one of ours, or cannot be written
    """
    import shutil  # here, both: `nmm --help` would pay
    import tempfile

    final = Path(folder)
    check_replaceable(final, is_ours)
    try:
        final.parent.mkdir(parents=True, exist_ok=True)
        temporary = Path(tempfile.mkdtemp(prefix=f".{final.name}-", dir=final.parent))
    except OSError as error:
        raise InputError(f"{final}: cannot be written: {error.strerror}") from None
    try:
        temporary.chmod(0o755)
        yield temporary
        old: Path | None = None
        if final.exists():
            old = Path(tempfile.mkdtemp(prefix=f".{final.name}-old-", dir=final.parent))
            final.rename(old / final.name)
        temporary.rename(final)
        if old is not None:
            shutil.rmtree(old, ignore_errors=True)
    finally:
        shutil.rmtree(temporary, ignore_errors=True)


def check_replaceable(folder: str | Path, is_ours: Callable[[Path], bool]) -> None:
    """`InputError` when `folder` exists, holds something, and is not one of ours."""
    final = Path(folder)
    if final.is_dir() and (not any(final.iterdir()) or is_ours(final)):
        return
    if final.exists() or final.is_symlink():
        raise InputError(
            f"{final}: exists and is not what this writes; expected a new or an empty folder, or one that "
            "this wrote before"
        )


def check_folder(folder: Path, is_ours: Callable[[Path], bool]) -> None:
    """`InputError` for a folder that must not, or cannot, be written: before anything is computed."""
    check_replaceable(folder, is_ours)
    parent = folder.absolute().parent
    while not parent.exists():
        parent = parent.parent
    if not parent.is_dir() or not os.access(parent, os.W_OK | os.X_OK):
        raise InputError(f"{folder}: cannot be written: {parent} is not a folder where you may write")


def has_format(file: Path, expected: str) -> bool:
    """Whether a JSON file of ours says that its folder is of that format."""
    try:
        content = json.loads(file.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return False
    return isinstance(content, dict) and content.get("format") == expected
