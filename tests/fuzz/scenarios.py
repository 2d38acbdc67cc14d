"""Scenarios with something changed in them: refused in a line, or run to an outcome that is true."""

from __future__ import annotations

import tempfile
from functools import cache
from pathlib import Path
from typing import Any

import yaml
from hypothesis import strategies as st

import nmm
from nmm.base.bundled import bundled_scenarios
from nmm.base.errors import NmmError

from .hunting import Hunt, refused
from .mutants import CHANGES, changed
from .truth import truthful

#: Small robots, so that a case is quick; every kind of key is in one of them.
NAMES = ("unicycle_2r_position", "unicycle_3r_position", "unicycle_2r_switching", "car_parks")
SHORT = "0.1"


@cache
def _document(name: str) -> Any:
    text = bundled_scenarios()[name].read_text(encoding="utf-8")
    return yaml.load(text, Loader=yaml.BaseLoader)


def check(case: Any) -> str:
    whole = {**_document(case["scenario"]), "duration": SHORT}
    data = changed(whole, case["changes"], ("duration", "dt", "method"))
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "scenario.yaml"
        path.write_text(yaml.safe_dump(data, allow_unicode=True), encoding="utf-8")
        try:
            run = nmm.Scenario.load(path).run()
        except NmmError as error:
            return refused(error)
    return truthful(run)


HUNT = Hunt(
    "scenarios", st.fixed_dictionaries({"scenario": st.sampled_from(NAMES), "changes": CHANGES}), check
)
