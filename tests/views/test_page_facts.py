"""A page tells a run's numbers, and marks on its time axis what happened when."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from playback_browser import browser as browser
from playback_browser import empty_page as empty_page
from playback_browser import watched
from playwright.sync_api import Page

import nmm
from nmm.motion.trajectory import Outcome, Trajectory
from nmm.views.playback import write_html
from nmm.views.playback.channels import MOST, channels, events


def run(name: str, **settings: object) -> Trajectory:
    given = {key.replace("__", "."): value for key, value in settings.items()}
    return nmm.Scenario.load(name, given).run()


@pytest.fixture(scope="module")
def switching() -> Trajectory:
    return run("unicycle_2r_pointing", resolver__partitions="automatic", duration=5.0)


@pytest.fixture(scope="module")
def limited() -> Trajectory:
    """The arm's joints turn by at most 2 rad/s: too slow at first."""
    return run("unicycle_2r_position", limits={"velocity": {"arm": 2.0}}, duration=5.0)


def find_events(one: Trajectory, word: str) -> list[tuple[float, str]]:
    return [(t, text) for t, text in events(one, channels(one)) if word in text]


def test_partitions_are_told_when_they_change(switching: Trajectory) -> None:
    columns = np.sort(switching.partition, axis=1)
    times = switching.t[1:][np.any(np.diff(columns, axis=0) != 0, axis=1)]
    assert len(times) == switching.switches > 0
    found = find_events(switching, "partition ")
    assert [t for t, _ in found] == times.tolist()
    before, after = found[0][1].removeprefix("partition ").split(" → ")
    assert before.split(", ")[:2] == after.split(", ")[:2] == ["v", "ω"]
    assert before != after


def test_limits_are_told_when_they_are_reached(limited: Trajectory) -> None:
    """Once for as long as it stays there."""
    for i, name in ((2, "q̇₁"), (3, "q̇₂")):
        at = np.abs(limited.u[:, i]) >= 2.0 - 1e-9
        first = float(limited.t[np.argmax(at)])
        side = "upper" if limited.u[np.argmax(at), i] > 0 else "lower"
        assert find_events(limited, f"{name} reaches")[0] == (first, f"{name} reaches its {side} limit")
    assert len(find_events(limited, "reaches")) < 6


def test_tasks_settling_and_the_end(switching: Trajectory) -> None:
    (settled,) = find_events(switching, "‖e‖ down to 2 %")
    norm = np.linalg.norm(switching.error, axis=1)
    inside = np.flatnonzero(norm > 0.02 * norm[0])[-1]
    assert switching.t[inside] <= settled[0] <= switching.t[inside + 1]
    assert find_events(switching, "completed") == []  # the end of time is no event
    going = run("unicycle_3r_sequence", duration=6.0)
    for event in going.events:
        assert (event.t, f"{event.task} {event.what}: {event.why}") in find_events(going, event.task)
    bad = run("unicycle_2r_pointing", resolver__alpha=1000, duration=1.0)
    assert bad.outcome is not Outcome.COMPLETED
    first, *more = bad.verdict.reasons
    assert more
    assert find_events(bad, bad.outcome) == [(bad.t[-1], f"{bad.outcome}: {first}")]


def test_a_page_holds_so_many_events_and_says_how_many_more(
    switching: Trajectory, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("nmm.views.playback.channels.MOST", 1)
    page = write_html([switching], tmp_path / "page.html").read_text(encoding="utf-8")
    line = next(line for line in page.splitlines() if line.startswith("{") and '"type":"facts"' in line)
    (one,) = json.loads(line)["runs"]
    assert (len(one["events"]), one["more"]) == (1, len(list(events(switching, channels(switching)))) - 1)
    assert MOST > 1


@pytest.fixture(scope="module")
def page(
    empty_page: Page, switching: Trajectory, limited: Trajectory, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[Page]:
    file = write_html([switching, limited], tmp_path_factory.mktemp("facts") / "page.html", title="Two")
    with watched(empty_page) as window:
        window.page.set_viewport_size({"width": 1280, "height": 800})
        yield window.open(file.as_uri())


@pytest.mark.browser
def test_the_numbers_are_those_of_the_runs(page: Page, switching: Trajectory, limited: Trajectory) -> None:
    cells = {
        row.locator("th").inner_text(): row.locator("td").all_inner_texts()
        for row in page.locator("#facts tbody tr").all()
    }
    for i, one in enumerate((switching, limited)):
        numbers = one.summary()
        assert cells["outcome"][i].startswith(f"{one.outcome}, {one.t[-1]:g} s")
        assert cells["‖e‖ down to 2 % of its start"][i] == f"after {numbers['settling_time']:.3g} s"
        assert f"{max(abs(one.u[:, 0])):.3g} m/s" in cells["peak inputs"][i]
    assert cells["switches of partition"] == ["1", "0"]


@pytest.mark.browser
def test_events_are_marked_and_lead_there(page: Page, switching: Trajectory) -> None:
    (when, text), *_ = find_events(switching, "partition ")
    shown = page.evaluate("nmm.facts.events.map(({ time, text }) => [time, text])")
    assert [when, text] in shown
    assert [time for time, _ in shown] == sorted(time for time, _ in shown)
    page.locator("#facts li button", has_text="partition ").click()
    assert page.evaluate("nmm.state().t") == pytest.approx(when, abs=1e-9)
    page.locator("#ruler").scroll_into_view_if_needed()
    box = page.locator("#ruler").bounding_box()
    assert box is not None
    left, right = page.evaluate("[nmm.curves.LEFT, nmm.curves.RIGHT]")
    at = left + when / 5.0 * (box["width"] - left - right)
    inked = """(at) => {
      const pen = document.getElementById("ruler").getContext("2d");
      const [x, y] = [at, 20].map((place) => Math.round(place * devicePixelRatio));
      return [...pen.getImageData(x, y, 1, 1).data];
    }"""
    assert page.evaluate(inked, at)[3] == 255
    assert page.evaluate(inked, at + 12)[3] == 0
    page.mouse.move(box["x"] + at, box["y"] + 20)
    assert text in page.locator("#tip").inner_text()
    page.mouse.move(5, 5)
    assert not page.locator("#tip").is_visible()
    page.locator("#legend button").first.click()
    assert not page.locator("#facts li button", has_text="partition ").is_visible()
    assert page.evaluate(inked, at)[3] == 0
    page.locator("#legend button").first.click()


@pytest.mark.browser
def test_in_a_narrow_window_nothing_is_cut(page: Page) -> None:
    page.set_viewport_size({"width": 420, "height": 800})
    page.locator("#facts").scroll_into_view_if_needed()
    cut = """() => [...document.querySelectorAll("#facts :is(th, td, li, button)")].filter((one) => {
      const box = one.getBoundingClientRect();
      return box.left < -0.5 || box.right > innerWidth + 0.5 || one.scrollWidth > one.clientWidth + 1;
    }).map((one) => one.outerHTML.slice(0, 80))"""
    assert page.evaluate(cut) == []
    page.set_viewport_size({"width": 1280, "height": 800})


@pytest.mark.browser
def test_a_motion_has_none(empty_page: Page, limited: Trajectory, tmp_path: Path) -> None:
    with watched(empty_page) as window:
        window.open(write_html([limited.motion()], tmp_path / "page.html").as_uri())
        assert not window.page.locator("#facts").is_visible()
        assert "facts" not in window.page.evaluate("nmm.plots.ids()")
