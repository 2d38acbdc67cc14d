"""What a loop's stream says beside its pictures."""

from __future__ import annotations

from pathlib import Path

import pytest
from loop_faults import PERIOD, make_loop
from ports import wait_for
from streamed import by_foxglove

import nmm
from nmm.base.findings import Finding

pytest.importorskip("foxglove")
pytest.importorskip("mcap_protobuf")
STEPS = 60


def test_findings_are_put_into_words_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Words take long to make, and the loop's thread waits for whoever makes them: none at each picture."""
    made, words = list[str](), Finding.__str__

    def counted(found: Finding) -> str:
        made.append(found.code)
        return words(found)

    monkeypatch.setattr(Finding, "__str__", counted)
    loop, file = make_loop(), tmp_path / "loop.mcap"
    q = loop.controller.robot.q({"q1": 0.1, "q2": 0.5})
    with nmm.stream(loop, "foxglove", file=file, rate=1000.0) as shown:
        for k in range(12):
            for i in range(30):
                loop._found.add("said", k * PERIOD + 1e-4 * i, text=f"{k} {i}")
            loop.step(k * PERIOD, q)
            shown(loop)
            wait_for(lambda k=k: shown.sent > k)  # type: ignore[misc]
    kept = len(loop.findings)
    assert kept == 200
    assert 360 <= len(made) <= 360 + kept + 10
    assert len(shown._told) <= kept  # type: ignore[attr-defined]
    told = [message.message for _, message in by_foxglove(file)["/log"]]
    assert {f"{k} {i}" for k in range(12) for i in range(30)} <= {*told}
    assert len({*told}) == len(told)


def test_a_line_that_cannot_be_made_drops_no_picture(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    words = Finding.__str__

    def breaks(found: Finding) -> str:
        if found.values.get("text") == "bad":
            raise KeyError("no such word")
        return words(found)

    monkeypatch.setattr(Finding, "__str__", breaks)
    loop, file = make_loop(), tmp_path / "loop.mcap"
    q = loop.controller.robot.q({"q1": 0.1, "q2": 0.5})
    with nmm.stream(loop, "foxglove", file=file, rate=1000.0) as shown:
        for k in range(STEPS):
            if k == 5:
                loop._found.add("said", k * PERIOD, text="bad")
                loop._found.add("said", k * PERIOD + 1e-3, text="good")
            loop.step(k * PERIOD, q)
            shown(loop)
    assert shown.dropped == 0
    assert shown.sent >= STEPS
    assert "no such word" in shown.trouble
    assert "good" in [message.message for _, message in by_foxglove(file)["/log"]]
