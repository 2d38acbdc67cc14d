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

import nmm
from nmm.cli.runs import runs_in
from nmm.errors import NmmError
from nmm.folders import comparison
from nmm.playback.html import page_of

from .damaging import copied, damage
from .hunting import Hunt, refused


@cache
def _whole() -> list[Path]:
    """A run among obstacles, one of tasks that come and go, and a comparison."""
    top = Path(tempfile.mkdtemp())
    atexit.register(shutil.rmtree, top, ignore_errors=True)
    short = {"duration": 0.1}
    for name in ("unicycle_3r_crossing", "unicycle_3r_sequence"):
        nmm.Scenario.load(name, short).run().save(top / name, figures=False)
    case = nmm.Scenario.load("unicycle_2r_position", short)
    compared = [case.with_resolver(kind).run() for kind in ("rg", "pg")]
    comparison.save(compared, top / "compared", "compared")
    return sorted(top.iterdir())


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
