"""`nmm paper`: its folder, its page, its claims, and the processes that it shares the work out over."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Literal

import numpy as np
import pytest
from grounds import grounds
from page_links import Links
from playback_browser import browser as browser
from playwright.sync_api import Browser
from small_pictures import draw_only

from nmm.base.errors import InputError, RunError
from nmm.base.figure_options import FigureOptions
from nmm.base.machine import made_with
from nmm.base.text_format import number_text
from nmm.cli.paper import PaperReport, write, write_paper
from nmm.cli.paper.cases import CASES, CaseResult, CaseRow, PaperClaim
from nmm.cli.paper.claims import claims, decay_rate, ripple, settling_time, smallest_determinant
from nmm.cli.paper.write import render
from nmm.motion.trajectory import Trajectory
from nmm.scenario import Scenario
from nmm.views.folders.run import is_run

Progress = Callable[[float], None]


@pytest.fixture(scope="module")
def paper(tmp_path_factory: pytest.TempPathFactory) -> tuple[PaperReport, list[float]]:
    """The paper, once, with what it said of its progress; its own figures are drawn, the runs' are not."""
    fractions: list[float] = []
    with pytest.MonkeyPatch.context() as patch:
        draw_only([f"fig{number:02d}.png" for number in range(3, 11)], patch)
        report = write_paper(tmp_path_factory.mktemp("out") / "paper", fractions.append, 1)
    return report, fractions


@pytest.fixture(scope="module")
def whole_paper(tmp_path_factory: pytest.TempPathFactory) -> PaperReport:
    """As the command writes it, by several processes and with every picture."""
    return write_paper(tmp_path_factory.mktemp("out") / "paper")


def test_every_claim_holds(paper: tuple[PaperReport, list[float]]) -> None:
    report, _ = paper
    assert [claim for claim in report.claims if not claim.holds] == []
    assert report.holds
    assert len(report.claims) >= 20
    assert {case.number for case in report.cases} == {1, 2, 3, 4}


def test_folder_is_complete(paper: tuple[PaperReport, list[float]]) -> None:
    folder = paper[0].folder
    for number in range(3, 11):
        assert (folder / f"fig{number:02d}.png").read_bytes().startswith(b"\x89PNG")
    for case in CASES:
        assert (folder / case.folder / "playback.html").stat().st_size > 100_000
        for resolver in ("rg", "pg"):
            run = folder / case.folder / resolver
            assert is_run(run)
            names = {path.name for path in run.iterdir()}
            data = {"trajectory.npz", "trajectory.csv", "summary.json", "scenario.yaml"}
            assert names == data | {"motion.png", "errors.png", "inputs.png", "objective.png"}
    assert not list(folder.parent.glob(".*"))


def test_runs_can_be_read_back(paper: tuple[PaperReport, list[float]]) -> None:
    trajectory = Trajectory.load(paper[0].folder / "case4" / "pg")
    assert trajectory.complete
    assert (trajectory.resolver, trajectory.dt, len(trajectory)) == ("pg", 0.005, 5001)


def test_page_refers_to_what_is_there_and_to_nothing_else(paper: tuple[PaperReport, list[float]]) -> None:
    report, _ = paper
    page = report.index.read_text(encoding="utf-8")
    links = Links(page)
    assert len(links.found) > 60
    for link in links.found:
        if link.startswith("#"):
            assert link[1:] in links.ids
        else:
            assert ":" not in link
            assert (report.folder / link).exists(), link
    for outside in ("http:", "https:", "//cdn", "@import", "url("):
        assert outside not in page
    shown = {link for link in links.found if link.endswith(".png")}
    assert {f"fig{number:02d}.png" for number in range(3, 11)} <= shown
    assert {f"{case.folder}/{r}/{kind}.png" for case in CASES for r in ("rg", "pg")
            for kind in ("errors", "inputs")} <= shown  # fmt: skip


def test_numbers_are_the_runs(paper: tuple[PaperReport, list[float]]) -> None:
    report, _ = paper
    content = json.loads((report.folder / "paper.json").read_text(encoding="utf-8"))
    assert content["holds"] is True
    assert content["made_with"] == made_with()
    head, *lines = csv.reader(io.StringIO(report.table().csv()))
    assert [line[0] for line in lines] == [f"{k} {r}" for k in (1, 2, 3, 4) for r in ("RG", "PG")]
    final = [float(line[head.index("objective_final")]) for line in lines]
    for case in content["cases"]:
        summary = json.loads(
            (report.folder / f"case{case['number']}" / "rg" / "summary.json").read_text(encoding="utf-8")
        )
        rows = {row["name"]: row["rg"] for row in case["rows"]}
        assert final[2 * case["number"] - 2] == summary["objective_final"]
        assert rows["mean H in the second half"] == number_text(summary["objective_mean_second_half"])
        assert rows["‖e‖ at the end"] == number_text(summary["error_final"])


def test_progress_rises_to_the_end(paper: tuple[PaperReport, list[float]]) -> None:
    _, fractions = paper
    assert fractions == sorted(fractions)
    assert fractions[-1] == 1.0
    assert len(fractions) > 100


def test_page_opens_in_a_browser(whole_paper: PaperReport, browser: Browser) -> None:
    """All pictures load, nothing fails, and no width of window makes the page scroll sideways."""
    wrong: list[str] = []
    page = browser.new_page()
    page.on("pageerror", lambda error: wrong.append(str(error)))
    page.on("requestfailed", lambda request: wrong.append(request.url))
    page.on("request", lambda request: request.url.startswith("file:") or wrong.append(request.url))
    page.goto(whole_paper.index.as_uri(), wait_until="load")
    assert page.evaluate("[...document.images].every(image => image.naturalWidth > 500)")
    for width in (1600, 1000, 390):
        page.set_viewport_size({"width": width, "height": 900})
        assert page.evaluate("document.documentElement.scrollWidth") == width
    page.close()
    assert wrong == []


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_a_figures_ground_is_the_pages(
    paper: tuple[PaperReport, list[float]], browser: Browser, scheme: Literal["light", "dark"]
) -> None:
    """In the dark it was a grey box. What is drawn can be seen."""
    page = browser.new_page(color_scheme=scheme, viewport={"width": 820, "height": 900})
    page.goto(paper[0].index.as_uri(), wait_until="load")
    figures = page.locator("figure img[src^='fig']").all()
    assert len(figures) == 8
    for figure in figures:
        ground, own, most = grounds(figure)
        assert bool(ground.mean() < 60) == (scheme == "dark")
        np.testing.assert_allclose(own, np.broadcast_to(ground, own.shape), atol=2)
        assert most > 150
    page.close()


def result(number: int, found: str = "so") -> CaseResult:
    row = CaseRow("a quantity", "m", "1", "2")
    return CaseResult(number, (row,), (PaperClaim("it is so", "somewhere", found, True),), 11, 0.1)


@pytest.fixture
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    """Replaces the computation by nothing much."""

    def case(number: int, progress: Progress, folder: Path, figures: FigureOptions) -> CaseResult:
        assert figures == FigureOptions()
        (folder / f"case{number}").mkdir()
        progress(1.0)
        return result(number)

    monkeypatch.setattr(write, "run_case", case)


@pytest.mark.usefixtures("quick")
def test_an_earlier_paper_is_replaced(tmp_path: Path) -> None:
    folder = tmp_path / "paper"
    write_paper(folder, jobs=1)
    (folder / "left over").write_text("old")
    report = write_paper(folder, jobs=1)
    assert report.folder == folder
    assert {path.name for path in folder.iterdir()} == {
        "index.html",
        "paper.json",
        *(f"case{number}" for number in range(1, 5)),
    }
    assert [path.name for path in tmp_path.iterdir()] == ["paper"]


@pytest.mark.parametrize(
    "content", [{"thesis.txt": "mine"}, {"paper.json": "{}"}, {"paper.json": "[1"}, {"summary.json": "{}"}]
)
@pytest.mark.usefixtures("quick")
def test_any_other_folder_is_refused(tmp_path: Path, content: dict[str, str]) -> None:
    folder = tmp_path / "paper"
    folder.mkdir()
    for name, inside in content.items():
        (folder / name).write_text(inside)
    with pytest.raises(InputError, match="exists and is not what this writes"):
        write_paper(folder, jobs=1)
    assert {path.name: path.read_text() for path in folder.iterdir()} == content
    assert [path.name for path in tmp_path.iterdir()] == ["paper"]


@pytest.mark.usefixtures("quick")
def test_a_failure_leaves_the_earlier_paper(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = tmp_path / "paper"
    write_paper(folder, jobs=1)
    before = (folder / "index.html").read_bytes()

    def fails(number: int, progress: Progress, folder: Path, figures: FigureOptions) -> CaseResult:
        raise RunError(f"case {number} did not work")

    monkeypatch.setattr(write, "run_case", fails)
    with pytest.raises(RunError, match="case 1 did not work"):
        write_paper(folder, jobs=1)
    assert (folder / "index.html").read_bytes() == before
    assert [path.name for path in tmp_path.iterdir()] == ["paper"]


def test_jobs_are_checked(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="jobs: expected at least 1, got 0"):
        write_paper(tmp_path / "paper", jobs=0)
    assert list(tmp_path.iterdir()) == []


def test_page_escapes_text() -> None:
    page = render([result(1, "<script>alert(1)</script>")])
    assert "<script>alert" not in page
    assert "&lt;script&gt;" in page


def test_page_tells_when_a_claim_fails() -> None:
    good = render([result(1)])
    assert "All 1 statements" in good
    failed = replace(result(1), claims=(PaperClaim("it is so", "somewhere", "it is not", False),))
    bad = render([failed])
    assert "1 of the 1 statements checked below do not come out" in bad
    assert "✗" in bad


@cache
def run(number: int, resolver: str) -> Trajectory:
    return Scenario.load(CASES[number - 1].scenario).with_resolver(resolver).run()


@pytest.mark.parametrize("number", [1, 2, 3])
def test_claims_notice_when_the_resolvers_are_swapped(number: int) -> None:
    rg, pg = run(number, "rg"), run(number, "pg")
    swapped = claims(CASES[number - 1], replace(pg, partition=rg.partition), rg, 0.0)
    failed = {claim.statement for claim in swapped if not claim.holds}
    assert "RG optimises better than PG." in failed
    assert len(failed) >= 3


def test_claims_notice_a_wrong_decay() -> None:
    rg, pg = run(1, "rg"), run(1, "pg")
    lagging = replace(rg, error=rg.error + 1e-4)
    (tracking, *_) = claims(CASES[0], lagging, pg, 0.35)
    assert not tracking.holds


def test_smallest_determinant_is_case_2s_d() -> None:
    rg = run(2, "rg")
    controller = Scenario.load(CASES[1].scenario).controller()
    assert smallest_determinant(rg, controller) == pytest.approx(0.3, abs=1e-12)
    assert smallest_determinant(run(2, "pg"), controller) is None


def test_measures() -> None:
    trajectory = run(1, "rg")
    t = np.linspace(0.0, 5.0, 501)
    exact = replace(trajectory, t=t, objective=3.0 * np.exp(-4.0 * t))
    assert decay_rate(t, exact.objective, 1e-6) == pytest.approx(4.0, rel=1e-9)
    assert settling_time(exact, 0.01) == pytest.approx(np.ceil(np.log(100.0) / 4.0 * 100.0) / 100.0)
    assert settling_time(replace(exact, objective=t), 0.5) is None
    assert ripple(replace(exact, objective=np.where(t > 3.0, 0.2, 0.5))) == pytest.approx(0.3)


@pytest.mark.parametrize(
    ("value", "expected"),
    [
        (None, "–"),
        (np.inf, "–"),
        (0.0, "0"),
        (-2.5, "−2.50"),
        (1234.0, "1.23·10³"),
        (999.6, "1.00·10³"),
        (100.0, "100"),
        (2.07e-29, "2.07·10⁻²⁹"),
        (0.00238, "2.38·10⁻³"),
    ],
)
def test_numbers_for_people(value: float | None, expected: str) -> None:
    assert number_text(value) == expected
