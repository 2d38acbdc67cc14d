"""Every door of the package opens: a name written as text is not checked by the imports."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import nmm
from nmm.doors import door

SOURCES = sorted(Path(nmm.__file__).parent.rglob("*.py"))
DOORS = sorted(
    {name for source in SOURCES for name in re.findall(r'\bdoor\(\s*"([^"]+)"', source.read_text("utf-8"))}
)


def test_runs_and_maps_have_doors() -> None:
    assert {"nmm.folders.run:save", "nmm.folders.run:load", "nmm.folders.map:save"} <= set(DOORS)


@pytest.mark.parametrize("name", DOORS)
def test_a_door_opens(name: str) -> None:
    assert callable(door(name))
