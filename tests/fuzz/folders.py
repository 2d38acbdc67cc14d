"""Folders of runs with a damaged file: read as what they hold, or refused in a line."""

from __future__ import annotations

import atexit
import random
import shutil
import tempfile
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from hypothesis import strategies as st

from nmm.base.errors import NmmError
from nmm.plugins.live.cli import runs_in
from nmm.views.playback.html import page_of

from .damaging import copied, damage, whole_folders
from .hunting import Hunt, refused


@cache
def _whole() -> list[Path]:
    top = Path(tempfile.mkdtemp())
    atexit.register(shutil.rmtree, top, ignore_errors=True)
    return sorted(whole_folders(top).values())


def check(seed: Any) -> str:
    rng = random.Random(seed)
    with tempfile.TemporaryDirectory() as place:
        folder = copied(rng.choice(_whole()), Path(place) / "damaged")
        damage(folder, rng)
        try:
            runs = runs_in(folder)
            for run in runs:
                assert np.isfinite(run.q).all(), "coordinates that are not finite"
                assert np.all(np.diff(run.t) > 0.0), "times that do not grow"
                run.summary()
            page_of(runs, None, ellipsoids=False)
        except NmmError as error:
            return refused(error)
    return "read"


HUNT = Hunt("folders", st.integers(0, 2**32), check)
