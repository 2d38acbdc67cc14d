"""`nmm render` with options of all kinds, of damaged folders too: a film, or a line and no file."""

from __future__ import annotations

import atexit
import contextlib
import io
import os
import random
import shutil
import sys
import tempfile
from functools import cache
from pathlib import Path
from typing import Any
from unittest.mock import patch

from hypothesis import strategies as st

from nmm.base.errors import RunError
from nmm.cli.exit_status import status_of
from nmm.plugins.live.rendering.chromium import find_browser
from nmm.plugins.live.rendering.encoder import find_ffmpeg

from .damaging import copied, damage, whole_folders
from .hunting import LONGEST_LINE, Hunt
from .mutants import VALUES

FOLDERS = ("unicycle_3r_crossing", "unicycle_3r_sequence", "compared", "damaged", "nothing")
SMALL = ["--size", "64x64", "--fps", "20"]
#: Words that the option understands; those of `FEW` decide how many pictures there are, and how large.
FEW = {"--size": ("100x64", "64x65", "0x0"), "--fps": ("5", "1e9"), "--speed": ("2", "0.5", "-1")}
WORDS = FEW | {
    "--view": ("iso", "top", "wall"), "--apart": ("1", "0.5", "2"), "--from": ("0.05", "-1"),
    "--to": ("0.08", "9"), "--ellipsoid-scale": ("0.1", "-1"),
}  # fmt: skip
FILES = st.sampled_from(["a.mp4", "a.gif", "a.webm", "a.avi", "b/a.mp4", ".", "/dev/null"])
FLAGS = ("--follow", "--plots", "--ellipsoids")


@st.composite
def _cases(draw: st.DrawFn) -> dict[str, Any]:
    real = draw(st.sampled_from([False, False, False, True]))
    file = draw(st.one_of(FILES, FILES, VALUES))
    line = ["--video", file, *SMALL]
    names = sorted(WORDS.keys() - FEW.keys() if real else WORDS)
    for name in draw(st.lists(st.sampled_from(names), max_size=3, unique=True)):
        line += [name, draw(st.one_of(st.sampled_from(WORDS[name]), VALUES))]
    line += draw(st.lists(st.sampled_from(FLAGS), max_size=2, unique=True))
    seed = draw(st.integers(0, 2**32))
    return {"folder": draw(st.sampled_from(FOLDERS)), "seed": seed, "line": line, "programs": real}


@cache
def _whole() -> dict[str, Path]:
    top = Path(tempfile.mkdtemp())
    atexit.register(shutil.rmtree, top, ignore_errors=True)
    return whole_folders(top)


def _missing() -> bool:
    try:
        find_browser(), find_ffmpeg()
    except RunError:
        return True
    return False


def check(case: Any) -> str:
    folder, err, home = _whole().get(case["folder"], Path(case["folder"])), io.StringIO(), Path.cwd()
    nowhere = {} if case["programs"] else {"PATH": ""}
    with tempfile.TemporaryDirectory() as place, patch.dict(os.environ, nowhere), patch.dict(sys.modules):
        if not case["programs"]:
            sys.modules["imageio_ffmpeg"] = None  # type: ignore[assignment]  # how Python spells "not there"
        if case["folder"] == "damaged":
            rng = random.Random(case["seed"])
            folder = copied(_whole()[rng.choice(FOLDERS[:3])], Path(place) / "damaged")
            damage(folder, rng)
        here = Path(place) / "here"
        here.mkdir()
        os.chdir(here)
        try:
            with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(err):
                status = status_of(["render", str(folder), *case["line"]])
        finally:
            os.chdir(home)
        made, missing, told = list(here.rglob("*")), _missing(), err.getvalue()
        if status == 0:
            assert not missing
            assert [path.stat().st_size > 0 for path in made] == [True]
        else:
            assert made == [], "a film that was refused"
            assert status in (1, 2), f"status {status}"
            assert told.startswith("nmm render: ")
            assert told.count("\n") == 1, told
            assert len(told) <= LONGEST_LINE
            assert status == 2 or (missing and ("ffmpeg" in told or "Chromium" in told)), told
    return f"status {status}"


HUNT = Hunt("films", _cases(), check)
