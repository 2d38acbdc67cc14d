"""A run that is shown while it is computed, in a real browser: what it draws, counts, and is in the end."""

from __future__ import annotations

import re

import numpy as np
import pytest
from live_pages import LivePage, live
from playback_browser import UPRIGHT, WALK, Window
from playback_browser import browser as browser
from playback_browser import empty_page as empty_page
from playback_browser import window as window
from playwright.sync_api import Browser, Page
from ports import MOST, wait_for

import nmm
from nmm.plugins.live.session import FPS

#: Not over while a page that draws slowly is looked at, s.
DURATION = 60.0
#: Whether a page plays what has run; while it is loaded anew it has no script yet.
PLAYS_IT = "window.nmm?.stage && !nmm.stage.live"


def scenario(duration: float = DURATION) -> nmm.Scenario:
    return nmm.Scenario.load("unicycle_2r_position", {"duration": duration})


def without_drawing(page: Page) -> None:
    """The processor that draws here is slow, and no part of what is counted."""
    page.evaluate("nmm.viewer.scene.visible = false; nmm.plots.show(false)")


def of_report(report: str, page: int) -> tuple[int, int, int, int]:
    """Pictures made, made too late; drawn and dropped by that page."""
    made = re.search(r"(\d+) pictures of", report)
    late = re.search(r"(\d+) could not be made", report)
    pages = re.findall(r"drew (\d+) and dropped (\d+)", report)
    assert made is not None
    return int(made[1]), int(late[1]) if late else 0, *(int(text) for text in pages[page])  # type: ignore[return-value]


def test_it_grows_and_becomes_the_page_that_plays_it(window: Window) -> None:
    with live(scenario()) as (shown, run):
        page = window.open(shown.url)
        assert page.locator("#status").inner_text() in ("", f"0.00 of {DURATION:g} s, the run begins")
        made = run()
        page.wait_for_function("nmm.runs[0].t.length > 20")
        # What is drawn is where the run was then, and the curves end there.
        t, tree, state = page.evaluate(f"[nmm.player.time, ({WALK})(), nmm.state()]")
        k = int(np.searchsorted(made.t, t))
        assert made.t[k] == t
        assert t < DURATION
        values = state["runs"][0]["values"]
        for i, name in enumerate(made.robot.q_names):
            assert values[name] == pytest.approx(made.q[k, i], rel=1e-6, abs=1e-7)
        assert values["error_norm"] == pytest.approx(made.error_norm[k], rel=1e-6)
        root = UPRIGHT.T @ np.reshape(tree[next(one for one in tree if one.endswith("/theta"))], (4, 4)).T
        np.testing.assert_allclose(root[:2, 3], made.q[k, :2], atol=1e-6)
        page.evaluate("nmm.seek(0)")  # the clock is the program's
        assert page.evaluate("nmm.player.time") >= t
        page.get_by_role("button", name="Whole run").click()
        page.wait_for_function(f"{PLAYS_IT} && nmm.player.time === nmm.stage.duration")
        assert "shown as it ran" in shown.report()
        page.evaluate("nmm.seek(2.5)")
        k = int(np.searchsorted(made.t, 2.5))
        values = page.evaluate("nmm.state()")["runs"][0]["values"]
        for i, name in enumerate(made.robot.q_names):
            assert values[name] == pytest.approx(made.q[k, i], abs=1e-6)
        assert page.locator("#status").inner_text() == ""
        assert not page.evaluate("nmm.camera.following")  # the whole of it is in the picture
        assert page.evaluate("document.body.classList.contains('running')") is False


def test_a_camera_that_somebody_has_moved_stays_where_it_is(window: Window) -> None:
    """When the run has been shown, and its page becomes the one that plays it."""
    place = "nmm.camera.place()"
    window.page.set_viewport_size({"width": 1280, "height": 800})
    with live(scenario()) as (shown, run):
        page = window.open(shown.url)
        run()
        page.wait_for_function("nmm.runs[0].t.length > 20")
        page.keyboard.press("x")  # without a grid
        page.mouse.move(300, 500)
        page.mouse.down()
        page.mouse.move(250, 520, steps=3)
        page.mouse.up()
        assert page.evaluate("nmm.camera.moved")
        # It goes along with the robot: what stays is where it is beside it.
        beside = """() => {
          const [x, y, z] = nmm.camera.place();
          viewer.scene.updateMatrixWorld(true);
          const { matrixWorld } = nmm.node(nmm.motions[0].root);
          const at = new MeshCat.THREE.Vector3().setFromMatrixPosition(matrixWorld);
          return [x - at.x, y + at.z, z];
        }"""
        before = page.evaluate(beside)
        page.get_by_role("button", name="Whole run").click()
        page.wait_for_function(f"{PLAYS_IT} && nmm.player.time === nmm.stage.duration")
        np.testing.assert_allclose(page.evaluate(beside), before, atol=1e-3)
        assert page.evaluate("nmm.camera.following")
        assert page.locator("#grid").get_attribute("aria-pressed") == "false"
        page.keyboard.press("r")
        page.wait_for_function("!location.hash.includes('camera')")
        assert page.evaluate(place) != before


def test_thirty_pictures_a_second_are_drawn_or_counted(
    window: Window, browser: Browser, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By a page, by a second one that comes late, and by one whose browser is killed."""
    # What is on its way when patience ends is neither drawn nor dropped.
    monkeypatch.setattr("nmm.plugins.live.running.PATIENCE", MOST)
    with live(scenario()) as (shown, run):
        page = window.open(shown.url)
        without_drawing(page)
        other, late = browser.new_context(), browser.new_context()
        dying = other.new_page()
        dying.goto(shown.url)
        dying.wait_for_function("nmm.running && nmm.running.drawn > 0")
        run()
        page.wait_for_function("nmm.player.time > 1", timeout=1000.0 * MOST)
        other.close()
        second = late.new_page()
        second.goto(shown.url)
        second.wait_for_function("nmm.running && nmm.running.drawn > 2", timeout=1000.0 * MOST)
        assert second.evaluate("nmm.runs[0].t[0]") == 0.0
        without_drawing(second)
        reached = page.evaluate("nmm.player.time")
        page.get_by_role("button", name="Whole run").click()
        for one in (page, second):
            one.wait_for_function(PLAYS_IT, timeout=1000.0 * MOST)
        wait_for(lambda: shown._over)
        report = shown.report()
        late.close()
    made, too_late, drew, dropped = of_report(report, 0)
    assert made + too_late >= 0.9 * FPS * reached
    assert drew > 0
    assert drew + dropped == made
    for i in (1, 2):
        _, _, drew, dropped = of_report(report, i)
        assert drew > 0
        assert drew + dropped < made


def test_a_page_that_hangs_keeps_nobody_waiting(window: Window, browser: Browser) -> None:
    with live(scenario(2.0)) as (shown, run):
        hung = browser.new_context()
        stuck = hung.new_page()
        stuck.goto(shown.url)
        stuck.wait_for_function("nmm.running && nmm.running.drawn > 0")
        stuck.evaluate(
            "setTimeout(() => { const t = performance.now(); while (performance.now() - t < 8000); }, 0); 0"
        )
        with LivePage(shown.url) as page:
            run()
            wait_for(lambda: bool(page.of("whole")))
        report = shown.report()
        made, too_late, drew, dropped = of_report(report, 1)
        assert drew + dropped == made or drew + dropped == made - 1
        assert made + too_late >= 0.9 * FPS * 2.0
        assert of_report(report, 0)[3] > 0.5 * made
        hung.close()
