"""The gallery that docs/ makes: its folder, its page, and what a scenario that cannot be run leaves."""

from __future__ import annotations

import html
import json
import signal
import subprocess
import sys
import time
from pathlib import Path

import gallery
import made_from
import pytest
from gallery import Card, Gallery, make_card, render, write_gallery
from page_links import Links
from ports import MOST

import nmm
from nmm.base.bundled import bundled_scenarios
from nmm.base.errors import InputError, RunError
from nmm.cli.exit_status import status_of
from nmm.motion.table import summary_rows

TWO = ("unicycle_2r_position", "unicycle_3r_out_of_reach")


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Gallery:
    """Two scenarios, one of which misses its target on purpose."""
    return write_gallery(tmp_path_factory.mktemp("out") / "gallery", TWO, jobs=1)


def test_each_scenario_has_picture_page_numbers_and_file(made: Gallery) -> None:
    assert [one.name for one in made.cards] == [*TWO]
    assert {path.name for path in made.folder.iterdir()} == {"index.html", "gallery.json", "viewer.js", *TWO}
    for name in TWO:
        own = made.folder / name
        assert {path.name for path in own.iterdir()} == {
            "motion.png", "playback.html", "summary.json", f"{name}.yaml",
        }  # fmt: skip
        assert (own / "motion.png").read_bytes().startswith(b"\x89PNG")
        assert (own / f"{name}.yaml").read_bytes() == bundled_scenarios()[name].read_bytes()


def test_numbers_are_those_of_the_scenarios_own_run(made: Gallery) -> None:
    for one in made.cards:
        run = nmm.Scenario.load(one.name).run()
        summary = json.loads((made.folder / one.name / "summary.json").read_text(encoding="utf-8"))
        assert summary == json.loads(json.dumps(run.summary()))
        numbers = dict(one.numbers)
        assert numbers["tracking ‖e‖"].startswith(f"RMS {summary['error_rms']:.3g}, ")
        assert numbers["smallest σ_min"] == f"{summary['sigma_min']:.3g}"
        printed = dict(summary_rows(run, run.summary()))
        assert next(iter(numbers)) == "robot"
        assert all(printed[label] == value for label, value in one.numbers[1:])
        assert one.outcome == summary["outcome"]


def test_the_page_refers_to_what_is_there_and_says_what_came_out(
    made: Gallery,
) -> None:
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


def test_pages_share_the_viewer(made: Gallery) -> None:
    page = (made.folder / TWO[0] / "playback.html").read_text(encoding="utf-8")
    assert '<script src="../viewer.js"></script>' in page
    assert (made.folder / "viewer.js").stat().st_size > 500_000
    assert len(page) < 1_000_000


def test_a_scenario_that_cannot_be_run_is_told_on_its_card(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    broken = tmp_path / "broken.yaml"
    broken.write_text("robot: no_such_robot\ntask: {kind: position}\n", encoding="utf-8")
    shown = bundled_scenarios() | {"broken": broken}
    monkeypatch.setattr(gallery, "bundled_scenarios", lambda: shown)
    monkeypatch.setattr(nmm.Scenario, "load", staticmethod(lambda name: refuse(name)))
    card = make_card("broken", tmp_path / "broken")
    assert (card.outcome, card.shown, card.ran, card.numbers) == ("refused", False, False, ())
    page = render([card])
    assert "Refused:</b> broken: no robot &lt;at all&gt;" in page
    assert 'href="broken/broken.yaml"' in page
    assert "playback.html" not in page


def refuse(name: str) -> None:
    raise RunError(f"{name}: no robot <at all>")


def test_an_earlier_gallery_is_replaced(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def quick(name: str, folder: Path, progress: object = None) -> Card:
        folder.mkdir()
        return Card(name, name, "diverged", "it grew", (), False)

    monkeypatch.setattr("gallery.make_card", quick)
    write_gallery(tmp_path / "g", TWO[1:], jobs=1)
    (tmp_path / "g" / "left over").write_text("old")
    made = write_gallery(tmp_path / "g", TWO[:1], jobs=1)
    assert {path.name for path in (tmp_path / "g").iterdir()} == {
        "index.html", "gallery.json", "viewer.js", TWO[0],
    }  # fmt: skip
    content = json.loads((tmp_path / "g" / "gallery.json").read_text(encoding="utf-8"))
    assert [one["outcome"] for one in content["scenarios"]] == [card.outcome for card in made.cards]
    assert not made.cards[0].ran


def test_the_sites_pictures_show_what_the_scenarios_say_now() -> None:
    """Else: `python docs/make_pictures.py`, `python docs/make_gallery.py`; and look at them."""
    recorded = made_from.recorded()
    shown = {
        path.relative_to(made_from.IMAGES).as_posix() for path in made_from.IMAGES.rglob("*.[pg][ni][gf]")
    }
    assert {*recorded} == shown
    assert made_from.old() == []


def test_a_picture_is_old_once_its_scenario_has_changed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    name = "unicycle_2r_position"
    changed = tmp_path / f"{name}.yaml"
    changed.write_text(
        "# A remark.\n" + bundled_scenarios()[name].read_text(encoding="utf-8"), encoding="utf-8"
    )
    then = made_from.content(name)
    monkeypatch.setattr(made_from, "bundled_scenarios", lambda: {name: changed})
    assert made_from.content(name) == then
    changed.write_text(
        changed.read_text(encoding="utf-8").replace("radius: 3", "radius: 2"), encoding="utf-8"
    )
    assert made_from.content(name) != then


def test_wrong_names_and_folders_are_refused(tmp_path: Path) -> None:
    out = tmp_path / "gallery"
    with pytest.raises(InputError) as refused:
        write_gallery(out, ["unicycle_2r_positon"])
    assert (refused.value.where, refused.value.got) == ("only", "unicycle_2r_positon")
    assert not out.exists()
    out.mkdir()
    (out / "thesis.txt").write_text("mine")
    with pytest.raises(InputError):
        write_gallery(out, TWO[:1])
    assert [path.name for path in out.iterdir()] == ["thesis.txt"]


def test_there_is_no_such_command(capsys: pytest.CaptureFixture[str]) -> None:
    assert status_of(["gallery"]) == 2
    assert "No such command 'gallery'" in capsys.readouterr().err


@pytest.mark.thorough
def test_ctrl_c_leaves_nothing(tmp_path: Path) -> None:
    """Of the script that writes it, and of the processes that share the work."""
    script = Path(gallery.__file__).parent.parent / "make_gallery.py"
    running = subprocess.Popen([sys.executable, script, "--folder", "gallery"], cwd=tmp_path)
    while not list(tmp_path.glob(".gallery*/*/viewer.js")):
        assert running.poll() is None
        time.sleep(0.02)
    running.send_signal(signal.SIGINT)
    assert running.wait(MOST) == -signal.SIGINT
    assert list(tmp_path.iterdir()) == []
