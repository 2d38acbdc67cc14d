"""What tests of pages share."""

from __future__ import annotations

import pytest


@pytest.fixture(autouse=True)
def _ports_of_the_systems_choice(monkeypatch: pytest.MonkeyPatch) -> None:
    """Tests beside this one have pages, too: a port that is freed could be theirs at once."""
    monkeypatch.setattr("nmm.plugins.live.server.PORTS", ())
