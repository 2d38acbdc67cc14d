"""Every line that a page draws has a row in its legend: of runs, while they are computed and afterwards, of
plans, and of robots that are driven (one that follows a plan: tests/plugins/live/test_drive_browser.py)."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest
from driven_pages import driven, opened
from legend_rows import DRAWN, lines_with_rows
from live_pages import live
from playback_browser import Window, file_url
from playback_browser import browser as browser
from playback_browser import empty_page as empty_page
from playback_browser import small_robot as small_robot
from playback_browser import window as window
from playback_robot import drive

import nmm
from nmm.model.robots.robot import Robot
from nmm.plugins.live.driving import ScenarioSetup
from nmm.views.playback import Motion

CASE = "unicycle_2r_position"


def test_a_run_while_it_is_computed(window: Window) -> None:
    """Two lines grow; each row hides its own, and shows it again."""
    with live(nmm.Scenario.load(CASE, {"duration": 600.0})) as (shown, run):
        page = window.open(shown.url)
        run()
        page.wait_for_function("nmm.runs[0].t.length > 2")
        lines = ["running desired", "running driven"]
        assert lines_with_rows(page) == ["ground", *lines]
        for text, line in (("path of ee", "running driven"), ("desired path", "running desired")):
            row = page.locator("#legend button", has_text=text)
            row.dispatch_event("click")  # a low window leaves it out
            assert {*lines} - {*page.evaluate(DRAWN)} == {line}
            row.dispatch_event("click")
        assert {*lines} <= {*page.evaluate(DRAWN)}


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_a_run_that_is_played(window: Window, tmp_path: Path, scheme: Literal["light", "dark"]) -> None:
    run = nmm.Scenario.load(CASE, {"duration": 3.0}).run()
    window.page.emulate_media(color_scheme=scheme)
    try:
        page = window.open(nmm.playback.write_html([run], tmp_path / "run.html").as_uri())
        assert lines_with_rows(page) == ["desired 0", "ground", "motion 0/path", "motion 0/platform"]
    finally:
        window.page.emulate_media(color_scheme="light")


def test_two_runs_and_the_plan_of_each(small_robot: Robot, window: Window, tmp_path: Path) -> None:
    """A plan is not called the desired path, which is drawn alike."""
    made = drive(small_robot, duration=2.0)
    planned = made.q + np.eye(made.q.shape[1])[0]
    assert made.driven is not None
    fields: dict[str, Any] = {"frame": "ee", "planned": planned, "desired": made.driven + 0.1}
    motions = [Motion(small_robot, made.t, made.q, made.u, label=name, **fields) for name in ("RG", "PG")]
    page = window.open(file_url(motions, tmp_path))
    each = [f"motion {i}/{line}" for i in (0, 1) for line in ("path", "plan", "platform")]
    assert lines_with_rows(page) == ["desired 0", "ground", *each]


def test_a_run_with_a_camera(window: Window, tmp_path: Path) -> None:
    run = nmm.Scenario.load("dock_by_markers", {"duration": 0.5}).run()
    page = window.open(nmm.playback.write_html([run], tmp_path / "run.html").as_uri())
    assert lines_with_rows(page) == ["ground", "motion 0/platform", "motion 0/rays 0"]


def test_a_plan_that_is_played(window: Window, tmp_path: Path) -> None:
    """Where it is near a wall, also the line to it."""
    run = nmm.Scenario.load("behind_the_wall").run()
    page = window.open(nmm.playback.write_html([run], tmp_path / "run.html").as_uri())
    nearest = run.motion().nearest
    assert nearest is not None
    page.evaluate(f"nmm.seek({run.t[np.nanargmin(nearest.distance)]})")
    lines = ["ground", "motion 0/nearest", "motion 0/path", "motion 0/platform"]
    assert lines_with_rows(page) == lines


def test_a_robot_that_is_driven(window: Window) -> None:
    """A low window has room for the robot, not for the rows."""
    with driven(ScenarioSetup(nmm.Scenario.load("unicycle_3r_position"))) as url:
        page = opened(window, url)
        assert lines_with_rows(page) == ["ground", "trail 0"]
        low = page.viewport_size
        assert low is not None
        row = page.get_by_role("button", name="the last 30 s of ee")
        assert not row.is_visible()
        assert page.locator("#heading").bounding_box()["height"] < 0.25 * low["height"]  # type: ignore[index]  # it is seen
        page.set_viewport_size({"width": 1280, "height": 800})
        row.click()
        assert "trail 0" not in page.evaluate(DRAWN)
