"""Folders of runs with damaged files: read as what they hold, or refused in a line."""

from __future__ import annotations

import atexit
import json
import shutil
import tempfile
from functools import cache
from pathlib import Path
from typing import Any

from hypothesis import strategies as st

import nmm
from nmm.errors import NmmError
from nmm.folders import run as run_folder

from .hunting import Hunt, refused
from .mutants import CHANGES, CUTS, changed, damaged

FILES = ("trajectory.npz", "summary.json", "scenario.yaml", "trajectory.csv")

CASES = st.one_of(
    st.fixed_dictionaries({"file": st.sampled_from(FILES), "cuts": CUTS}),
    st.fixed_dictionaries({"file": st.just("summary.json"), "changes": CHANGES}),
    st.fixed_dictionaries({"file": st.sampled_from(FILES), "gone": st.just(True)}),
)


@cache
def _whole() -> Path:
    folder = Path(tempfile.mkdtemp())
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    run_folder.save(nmm.Scenario.load("unicycle_2r_position", {"duration": 0.1}).run(), folder / "run")
    return folder / "run"


def check(case: Any) -> str:
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place) / "run"
        shutil.copytree(_whole(), folder)
        file = folder / case["file"]
        if "gone" in case:
            file.unlink()
        elif "cuts" in case:
            file.write_bytes(damaged(file.read_bytes(), case["cuts"]))
        else:
            data = changed(json.loads(file.read_text(encoding="utf-8")), case["changes"])
            file.write_text(json.dumps(data), encoding="utf-8")
        try:
            run = run_folder.load(folder)
        except NmmError as error:
            return refused(error)
        run.summary()
        nmm.playback.write_html([run], folder / "page.html")
    return "read"


HUNT = Hunt("folders", CASES, check)
