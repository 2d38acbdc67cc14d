"""The page's controls in a real browser: the play bar, the keyboard, the legend."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from playback_browser import (
    UPRIGHT,
    WALK,
    Window,
    assert_same,
    draw_frames,
    drawn_visuals,
    expected_visuals,
    file_url,
    watched,
)
from playback_browser import browser as browser
from playback_browser import empty_page as empty_page
from playback_browser import small_robot as small_robot
from playback_browser import window as window
from playback_robot import drive
from playwright.sync_api import Browser

from nmm.model.robots.robot import Robot
from nmm.views.playback import Motion
from nmm.views.playback.rolling import wheel_angles

#: A page that holds one of ours.
OUTER = (
    '<body style="height: 3000px"><iframe src="playback.html#plots=none" width="400" height="250"></iframe>'
)
EYE = "nmm.viewer.camera.position.toArray()"


def test_the_keyboard_and_the_bar_play(small_robot: Robot, window: Window, tmp_path: Path) -> None:
    page = window.open(file_url([drive(small_robot, duration=8.0)], tmp_path))
    assert page.evaluate("nmm.player.playing") is False
    page.keyboard.press("Space")
    page.wait_for_function("nmm.player.time > 0.1")
    assert page.locator("#play").get_attribute("aria-label") == "Pause"
    page.keyboard.press("Space")
    stopped = page.evaluate("nmm.player.time")
    draw_frames(page)
    assert page.evaluate("nmm.player.time") == stopped
    page.locator("#slider").fill("3.25")
    assert page.locator("#time").inner_text() == "3.25 / 8.00 s"
    page.keyboard.press("ArrowRight")
    assert page.locator("#time").inner_text() == "3.75 / 8.00 s"
    page.keyboard.press("Shift+ArrowLeft")
    assert page.evaluate("nmm.player.time") == pytest.approx(3.75 - 1 / 60)
    page.keyboard.press("End")
    assert page.locator("#time").inner_text() == "8.00 / 8.00 s"
    page.keyboard.press("Home")
    assert float(page.locator("#slider").input_value()) == 0.0
    page.locator("#play").click()
    page.wait_for_function("nmm.player.time > 0.1")
    page.locator("#play").click()
    assert page.evaluate("nmm.player.playing") is False


@pytest.mark.parametrize("speed", ["0.5", "1", "4"])
def test_the_speed_is_the_clocks(small_robot: Robot, window: Window, tmp_path: Path, speed: str) -> None:
    page = window.open(file_url([drive(small_robot, duration=200.0, dt=0.5)], tmp_path))
    page.locator("#speed").select_option(speed)
    # Asked within a frame, after the player: both know that frame's time.
    measure = "new Promise((done) => requestAnimationFrame((now) => done([nmm.player.time, now / 1000])))"
    page.keyboard.press("Space")
    page.wait_for_function("nmm.player.time > 0")
    first = page.evaluate(measure)
    page.wait_for_function(f"nmm.player.time > {first[0] + 0.6 * float(speed)}")
    last = page.evaluate(measure)
    assert last[1] > first[1] + 0.5
    assert (last[0] - first[0]) / (last[1] - first[1]) == pytest.approx(float(speed), rel=1e-6)


def test_at_the_end_it_stops_or_begins_again(small_robot: Robot, window: Window, tmp_path: Path) -> None:
    motion = drive(small_robot, duration=1.0)
    page = window.open(file_url([motion], tmp_path, autoplay=True))
    assert page.evaluate("nmm.player.playing") is True
    page.keyboard.press("l")
    page.wait_for_function("!nmm.player.playing")
    assert page.locator("#time").inner_text() == "1.00 / 1.00 s"
    assert_same(drawn_visuals(page), expected_visuals(small_robot, motion.q[-1], wheel_angles(motion)[-1]))
    page.keyboard.press("l")
    page.keyboard.press("Space")
    page.wait_for_function("nmm.player.time > 0.8")
    page.wait_for_function("nmm.player.time < 0.5")
    assert page.evaluate("nmm.player.playing") is True


def test_ghosts_paths_and_motions_can_be_hidden(small_robot: Robot, window: Window, tmp_path: Path) -> None:
    motion = drive(small_robot, duration=2.0)
    target = np.array([1.0, 1.0, 0.4])
    fields = {"frame": "ee", "desired": motion.driven + 0.1, "target": target}
    motions = [
        Motion(small_robot, motion.t, motion.q, motion.u, label=name, **fields) for name in ("RG", "PG")
    ]
    page = window.open(file_url(motions, tmp_path, title="Both", ghosts=3))
    assert page.locator("h1").inner_text() == "Both"
    assert page.locator("#legend li").all_inner_texts() == [
        "RG",
        "PG",
        "desired path",
        "target",
        "platform's path",
        "grid of 0.1 m",
    ]
    visible = "(paths) => paths.map((path) => nmm.node(path).visible)"
    objects = {
        "#ghosts": ["/nmm/motion 0/ghosts", "/nmm/motion 1/ghosts"],
        "#paths": ["/nmm/motion 0/path/<object>", "/nmm/motion 1/path/<object>", "/nmm/desired 0/<object>"],
    }
    for button, paths in objects.items():
        for shown in (False, True):
            page.locator(button).click()
            assert page.locator(button).get_attribute("aria-pressed") == str(shown).lower()
            assert page.evaluate(visible, paths) == [shown] * len(paths)
    page.locator("#legend button", has_text="PG").click()
    assert page.evaluate(visible, ["/nmm/motion 0", "/nmm/motion 1"]) == [True, False]
    at = np.reshape(page.evaluate(WALK)["/nmm/target 0"], (4, 4)).T
    np.testing.assert_allclose((UPRIGHT.T @ at)[:3, 3], target, atol=1e-12)


def test_the_path_grows_as_it_is_driven(small_robot: Robot, window: Window, tmp_path: Path) -> None:
    motion = drive(small_robot)
    page = window.open(file_url([motion], tmp_path))
    # The last ring of vertices that is drawn: its centre is where the path ends.
    tip = """() => {
      const { geometry } = nmm.scenery.trails[0];
      const last = geometry.index.getX(geometry.drawRange.count - 1);
      const at = new MeshCat.THREE.Vector3();
      const first = 8 * Math.floor(last / 8);
      for (let k = 0; k < 8; k++) {
        at.add(new MeshCat.THREE.Vector3().fromBufferAttribute(geometry.attributes.position, first + k));
      }
      return at.divideScalar(8).toArray();
    }"""
    for fraction in (0.3, 0.8, 1.0):
        page.evaluate(f"nmm.player.seek({fraction * motion.duration})")
        reached = motion.driven[round(fraction * (len(motion.t) - 1))]
        np.testing.assert_allclose(page.evaluate(tip), reached, atol=0.03)


def test_a_link_opens_the_page_at_an_instant(small_robot: Robot, window: Window, tmp_path: Path) -> None:
    motion = drive(small_robot)
    later = Motion(small_robot, motion.t + 10.0, motion.q, motion.u)
    page = window.open(file_url([later], tmp_path) + "#t=12.5")
    assert page.locator("#time").inner_text() == "12.50 / 14.00 s"


def test_inside_another_page_the_wheel_is_the_readers_until_he_clicks(
    small_robot: Robot, window: Window, tmp_path: Path
) -> None:
    file_url([drive(small_robot)], tmp_path)
    (tmp_path / "outer.html").write_text(OUTER, encoding="utf-8")
    page = window.page
    page.goto((tmp_path / "outer.html").as_uri())
    inner = page.frames[1]
    inner.wait_for_function("window.nmm && !document.body.classList.contains('loading')")
    first = inner.evaluate(EYE)
    page.mouse.move(200, 100)
    page.mouse.wheel(0, 60)
    page.wait_for_function("scrollY === 60")
    assert inner.evaluate(EYE) == first
    page.mouse.click(200, 50)
    page.mouse.wheel(0, 60)
    inner.wait_for_function(f"{EYE}.join() !== '{','.join(map(str, first))}'")
    assert page.evaluate("scrollY") == 60
    page.evaluate("document.body.tabIndex = 0; document.body.focus()")
    page.mouse.wheel(0, -60)
    page.wait_for_function("scrollY === 0")


def test_inside_another_page_its_plots_let_the_reader_scroll_too(
    small_robot: Robot, window: Window, tmp_path: Path
) -> None:
    file_url([drive(small_robot)], tmp_path)
    outer = OUTER.replace("#plots=none", "").replace('"250"', '"500"')
    (tmp_path / "outer.html").write_text(outer, encoding="utf-8")
    page = window.page
    page.set_viewport_size({"width": 480, "height": 600})
    page.goto((tmp_path / "outer.html").as_uri())
    inner = page.frames[1]
    inner.wait_for_function("window.nmm && !document.body.classList.contains('loading')")
    inner.evaluate("nmm.plots.show(true); nmm.plots.open(nmm.plots.ids())")
    plots = "document.getElementById('plots').scrollTop"
    page.mouse.move(200, 400)
    page.mouse.wheel(0, 60)
    page.wait_for_function("scrollY === 60")
    assert inner.evaluate(plots) == 0
    page.mouse.click(200, 50)
    page.mouse.move(200, 350)
    page.mouse.wheel(0, 40)
    inner.wait_for_function(f"{plots} === 40")
    assert page.evaluate("scrollY") == 60


def test_inside_another_page_a_finger_scrolls_it_until_it_has_tapped(
    small_robot: Robot, browser: Browser, tmp_path: Path
) -> None:
    file_url([drive(small_robot)], tmp_path)
    (tmp_path / "outer.html").write_text(OUTER, encoding="utf-8")
    context = browser.new_context(has_touch=True)
    try:
        page = context.new_page()
        with watched(page):
            page.goto((tmp_path / "outer.html").as_uri())
            inner = page.frames[1]
            inner.wait_for_function("window.nmm && !document.body.classList.contains('loading')")
            fingers = context.new_cdp_session(page)

            def wipe() -> None:
                """Up by 60 px, on the view; it rests before it leaves, which throws nothing."""
                for k in range(7):
                    at = [{"x": 200, "y": 90 - 10 * k}]
                    kind = "touchMove" if k else "touchStart"
                    fingers.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": at})
                    draw_frames(page)
                page.wait_for_timeout(200)
                fingers.send("Input.dispatchTouchEvent", {"type": "touchEnd", "touchPoints": []})

            first = inner.evaluate(EYE)
            wipe()
            page.wait_for_function("scrollY > 20")
            assert inner.evaluate(EYE) == first
            page.touchscreen.tap(200, 50)
            inner.wait_for_function("!document.body.classList.contains('asleep')")
            scrolled = page.evaluate("scrollY")
            wipe()
            inner.wait_for_function(f"{EYE}.join() !== '{','.join(map(str, first))}'")
            assert page.evaluate("scrollY") == scrolled
    finally:
        context.close()


def test_hostile_names_are_only_text(small_robot: Robot, window: Window, tmp_path: Path) -> None:
    name = "</script><img src=x onerror=\"document.title='!'\">@title@"
    page = window.open(file_url([drive(small_robot, duration=0.5, label=name)], tmp_path, title=name))
    assert page.title() == name
    assert page.locator("h1").inner_text() == name
    assert page.locator("#legend li").all_inner_texts() == [name, "platform's path", "grid of 0.1 m"]
