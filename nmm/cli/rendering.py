"""render: a video of a run or a comparison."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

from nmm.cli.output import progress, show_text
from nmm.cli.runs import runs_in
from nmm.errors import InputError
from nmm.words import quoted

if TYPE_CHECKING:
    from nmm.runs.ellipsoid_options import Wanted


def render_folder(folder: Path, video: Path, *, size: str, ellipsoids: Wanted, **asked: Any) -> None:
    """Write a video of a folder of `nmm run` or `nmm compare`."""
    from nmm.rendering import render

    found = re.fullmatch(r"(\d{1,5})x(\d{1,5})", size)
    if found is None:
        raise InputError(f"--size: expected WIDTHxHEIGHT, as in 1280x720, got {quoted(size)}")
    sides = int(found[1]), int(found[2])
    runs = runs_in(folder)
    with progress(video.name) as report:
        render(runs, video, size=sides, ellipsoids=ellipsoids, progress=report, **asked)
    show_text(f"written: {video}")
