"""A scenario that is as short as one can be, for the tests to change."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from nmm import Scenario

MINIMAL = """\
robot: unicycle_2r
q0: {q1: 0.3, q2: 0.4}
duration: 0.05
task: {kind: position, frame: ee, axes: xy, reference: [1, 0.5]}
resolver: {kind: rg}
"""


def scenario(folder: Path, text: str = MINIMAL, **settings: Any) -> Scenario:
    """The text as a file in `folder`, with settings (`__` for the dots)."""
    path = folder / "given.yaml"
    path.write_text(text, encoding="utf-8")
    return Scenario.load(path, {key.replace("__", "."): value for key, value in settings.items()})
