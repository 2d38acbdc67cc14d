"""Every lazy call of the package finds its function: a name written as text is not checked by the imports."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import nmm
from nmm.base.lazy_call import lazy_call

SOURCES = sorted(Path(nmm.__file__).parent.rglob("*.py"))
CALLED = sorted(
    {
        name
        for source in SOURCES
        for name in re.findall(r'\blazy_call\(\s*"([^"]+)"', source.read_text("utf-8"))
    }
)


def test_runs_and_maps_call_lazily() -> None:
    assert {"nmm.views.folders.run:save", "nmm.views.folders.run:load", "nmm.views.folders.map:save"} <= set(
        CALLED
    )


@pytest.mark.parametrize("name", CALLED)
def test_what_is_called_lazily_is_there(name: str) -> None:
    assert callable(lazy_call(name))
