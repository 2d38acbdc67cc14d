"""A folder of files that hold a number each, for processes that replace it again and again."""

from __future__ import annotations

import time
from pathlib import Path

from nmm.views.folders.whole import FolderKind, replaced_folder

NAMES = tuple("abcdefgh")

ours = FolderKind("ours", "a")


def write(folder: Path, number: int, pause: float = 0.0) -> None:
    """A folder whose files all hold a number; the first one says whose it is."""
    with replaced_folder(folder, ours) as temporary:
        for name in NAMES:
            (temporary / name).write_text(f'{{"format": "ours", "number": {number}}}')
            time.sleep(pause)
