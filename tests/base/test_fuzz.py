"""A short hunt, the same each time, and what longer ones have found (`python -m tests.fuzz`)."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Iterator

import pytest
from fuzz import HUNTS
from fuzz.hunting import KEPT, some, tried

#: Cases of each hunt: a few seconds of it; without `-m thorough`, half of them.
EXAMPLES = {
    "scenarios": 20, "robots": 80, "xacros": 12, "meshes": 60, "folders": 20, "caches": 6, "commands": 14,
    "films": 5, "problems": 20,
}  # fmt: skip


@pytest.fixture(scope="module", autouse=True)
def _what_hunts_keep_is_the_tests_own(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """They remove it when their process ends, which a worker of pytest-xdist does without a word."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(tempfile, "tempdir", str(tmp_path_factory.mktemp("hunts")))
        yield


@pytest.mark.parametrize("share", [pytest.param(1, marks=pytest.mark.thorough), 2])
@pytest.mark.parametrize("name", HUNTS)
def test_a_short_hunt(name: str, share: int) -> None:
    found = some(HUNTS[name], EXAMPLES[name] // share)
    assert sum(found.counts.values()) >= EXAMPLES[name] // share // 2


@pytest.mark.parametrize("path", sorted(KEPT.glob("*.json")), ids=lambda path: path.stem)
def test_what_was_found_once(path: object) -> None:
    name = path.stem.split("-")[0]  # type: ignore[attr-defined]
    tried(HUNTS[name], json.loads(path.read_text(encoding="utf-8")))  # type: ignore[attr-defined]
