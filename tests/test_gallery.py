"""`nmm gallery`: its folder, its page, and what a scenario that cannot be run leaves."""

from __future__ import annotations

import html
import json
import shutil
import signal
from pathlib import Path

import pytest
from command_line import process
from test_paper import Links

import nmm
from nmm.bundled import bundled_scenarios
from nmm.cli.exit_status import status_of
from nmm.errors import InputError, RunError
from nmm.gallery import Gallery, card, write, write_gallery
from nmm.gallery.card import Card, make_card
from nmm.runs.table import rows

TWO = ("unicycle_2r_position", "unicycle_3r_out_of_reach")


@pytest.fixture(scope="module")
def gallery(tmp_path_factory: pytest.TempPathFactory) -> tuple[Gallery, list[float]]:
    """Two scenarios, one of which misses its target on purpose, with what was said of the progress."""
    fractions: list[float] = []
    folder = tmp_path_factory.mktemp("out") / "gallery"
    return write_gallery(folder, TWO, progress=fractions.append), fractions


def test_each_scenario_has_picture_page_numbers_and_file(gallery: tuple[Gallery, list[float]]) -> None:
    made = gallery[0]
    assert [one.name for one in made.cards] == [*TWO]
    assert {path.name for path in made.folder.iterdir()} == {"index.html", "gallery.json", "viewer.js", *TWO}
    for name in TWO:
        own = made.folder / name
        assert {path.name for path in own.iterdir()} == {
            "motion.png", "playback.html", "summary.json", f"{name}.yaml",
        }  # fmt: skip
        assert (own / "motion.png").read_bytes().startswith(b"\x89PNG")
        assert (own / f"{name}.yaml").read_bytes() == bundled_scenarios()[name].read_bytes()


def test_numbers_are_those_of_the_scenarios_own_run(gallery: tuple[Gallery, list[float]]) -> None:
    for one in gallery[0].cards:
        run = nmm.Scenario.load(one.name).run()
        summary = json.loads((gallery[0].folder / one.name / "summary.json").read_text(encoding="utf-8"))
        assert summary == json.loads(json.dumps(run.summary()))
        numbers = dict(one.numbers)
        assert numbers["tracking ‖e‖"].startswith(f"RMS {summary['error_rms']:.3g}, ")
        assert numbers["smallest σ_min"] == f"{summary['sigma_min']:.3g}"
        printed = dict(rows(run, run.summary()))
        assert next(iter(numbers)) == "robot"
        assert all(printed[label] == value for label, value in one.numbers[1:])
        assert one.outcome == summary["outcome"]


def test_the_page_refers_to_what_is_there_and_says_what_came_out(
    gallery: tuple[Gallery, list[float]],
) -> None:
    made = gallery[0]
    page = made.index.read_text(encoding="utf-8")
    for link in Links(page).found:
        assert (made.folder / link).exists(), link
    assert "http" not in page
    for one in made.cards:
        assert one.title in page
        assert f"nmm run {one.name}" in page
        for label, value in one.numbers:
            assert f'<tr><th scope="row">{label}</th><td>{value}</td></tr>' in page
    missed = made.cards[1]
    assert (missed.outcome, missed.ran) == ("missed", True)
    assert missed.message.split(":")[0] in html.unescape(page)


def test_pages_share_the_viewer(gallery: tuple[Gallery, list[float]]) -> None:
    made = gallery[0]
    page = (made.folder / TWO[0] / "playback.html").read_text(encoding="utf-8")
    assert '<script src="../viewer.js"></script>' in page
    assert (made.folder / "viewer.js").stat().st_size > 500_000
    assert len(page) < 1_000_000


def test_progress_rises_to_the_end(gallery: tuple[Gallery, list[float]]) -> None:
    fractions = gallery[1]
    assert fractions == sorted(fractions)
    assert fractions[-1] == 1.0


def test_a_scenario_that_cannot_be_run_is_told_on_its_card(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    broken = tmp_path / "broken.yaml"
    broken.write_text("robot: no_such_robot\ntask: {kind: position}\n", encoding="utf-8")
    shown = bundled_scenarios() | {"broken": broken}
    monkeypatch.setattr(card, "bundled_scenarios", lambda: shown)
    monkeypatch.setattr(nmm.Scenario, "load", staticmethod(lambda name: refuse(name)))
    made = make_card("broken", tmp_path / "broken")
    assert (made.outcome, made.shown, made.ran, made.numbers) == ("refused", False, False, ())
    page = write.render([made])
    assert "Refused:</b> broken: no robot &lt;at all&gt;" in page
    assert 'href="broken/broken.yaml"' in page
    assert "playback.html" not in page


def refuse(name: str) -> None:
    raise RunError(f"{name}: no robot <at all>")


def _quick(name: str, folder: Path, progress: object = None) -> Card:
    folder.mkdir()
    shutil.copyfile(bundled_scenarios()[name], folder / f"{name}.yaml")
    ends = name != TWO[0]
    return Card(name, name, "completed" if ends else "diverged", "" if ends else "it grew", (), False)


def test_exit_status_and_replacing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(write, "make_card", _quick)
    write_gallery(tmp_path / "g", TWO[1:], jobs=1)
    (tmp_path / "g" / "left over").write_text("old")
    monkeypatch.chdir(tmp_path)
    assert status_of(["gallery", "--only", TWO[0], "--out", "g"]) == 1
    assert f"nmm gallery: {TWO[0]} diverged: it grew" in capsys.readouterr().err
    assert {path.name for path in (tmp_path / "g").iterdir()} == {
        "index.html", "gallery.json", "viewer.js", TWO[0],
    }  # fmt: skip
    assert status_of(["gallery", "--only", TWO[1], "--out", "g"]) == 0


def test_wrong_names_and_folders_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "gallery"
    assert status_of(["gallery", "--only", "unicycle_2r_positon", "--out", str(out)]) == 2
    said = capsys.readouterr().err
    assert "--only: unknown scenario 'unicycle_2r_positon' (did you mean 'unicycle_2r_position'?)" in said
    assert status_of(["gallery", "--only", ",", "--out", str(out)]) == 2
    assert not out.exists()
    out.mkdir()
    (out / "thesis.txt").write_text("mine")
    assert status_of(["gallery", "--only", TWO[0], "--out", str(out)]) == 2
    assert [path.name for path in out.iterdir()] == ["thesis.txt"]
    with pytest.raises(InputError, match="only: unknown scenario 'no'"):
        write_gallery(tmp_path / "other", ["no"])
    with pytest.raises(InputError, match="jobs: expected at least 1, got 0"):
        write_gallery(tmp_path / "other", jobs=0)
    assert not (tmp_path / "other").exists()


def test_ctrl_c_leaves_nothing(tmp_path: Path) -> None:
    running = process(tmp_path, "gallery")
    while not list(tmp_path.glob(".gallery*/*/viewer.js")):
        assert running.poll() is None
    running.send_signal(signal.SIGINT)
    assert running.wait(20.0) == 130
    assert not (tmp_path / "gallery").exists()
