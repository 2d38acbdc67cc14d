"""The page makes a film of itself: each picture is the scene at its time, whatever the machine's speed."""

from __future__ import annotations

import base64
import re
import subprocess
from pathlib import Path

import numpy as np
import pytest
from playback_browser import Window, browser, empty_page, file_url, small_robot, window  # noqa: F401  # fixtures
from playback_robot import drive
from playwright.sync_api import Page

from nmm.model.robots.robot import Robot
from nmm.plugins.live.rendering.encoder import find_ffmpeg

FILM = """async (told) => {
  const shares = [];
  const film = await nmm.record((share) => shares.push(share));
  const bytes = new Uint8Array(await film.arrayBuffer());
  let text = "";
  for (const byte of bytes) text += String.fromCharCode(byte);
  return [btoa(text), shares, film.type];
}"""
PICTURE = """(time) => {
  const pen = nmm.filmPen();
  nmm.filmPicture(pen, time);
  const { width, height } = pen.canvas;
  const bytes = pen.getImageData(0, 0, width, height).data;
  let text = "";
  for (let k = 0; k < bytes.length; k += 8192) text += String.fromCharCode(...bytes.subarray(k, k + 8192));
  return [width, height, btoa(text)];
}"""


def drawn(page: Page, time: float) -> np.ndarray:
    """The page's own picture at a time, (height, width, 3)."""
    width, height, text = page.evaluate(PICTURE, time)  # millions of numbers one by one would take a minute
    return np.frombuffer(base64.b64decode(text), np.uint8).reshape(height, width, 4)[..., :3]


def decoded(film: Path, width: int, height: int) -> np.ndarray:
    """The pictures of a film, (N, height, width, 3), as another program reads them."""
    command = [find_ffmpeg(), "-v", "error", "-i", str(film), "-f", "rawvideo", "-pix_fmt", "rgb24", "-"]
    raw = subprocess.run(command, capture_output=True, check=True).stdout
    return np.frombuffer(raw, np.uint8).reshape(-1, height, width, 3).astype(float)


def test_a_film_shows_each_time(small_robot: Robot, window: Window, tmp_path: Path) -> None:  # noqa: F811
    page = window.open(file_url([drive(small_robot)], tmp_path) + "#plots=none&zoom=1,1.5&t=1.2")
    assert page.evaluate("[isSecureContext, typeof VideoEncoder]") == [True, "function"]
    times = page.evaluate("nmm.filmTimes()")
    np.testing.assert_allclose(times, 1.0 + np.arange(16) / 30.0, atol=1e-9)
    text, shares, kind = page.evaluate(FILM)
    assert kind == "video/webm"
    assert shares == [k / 16 for k in range(16)]
    assert page.evaluate("[nmm.player.time, nmm.player.playing]") == [1.2, False]
    film = tmp_path / "film.webm"
    film.write_bytes(base64.b64decode(text))

    told = subprocess.run([find_ffmpeg(), "-i", str(film)], capture_output=True, text=True).stderr
    assert re.search(r"Video: vp[89]", told), told
    assert "30 fps" in told
    hours, minutes, seconds = re.search(r"Duration: (\d+):(\d+):([\d.]+)", told).groups()  # type: ignore[union-attr]  # printed
    assert 3600 * int(hours) + 60 * int(minutes) + float(seconds) == pytest.approx(16 / 30, abs=0.011)

    shown = [0, 5, 10, 15]
    own = [drawn(page, times[k]) for k in shown]
    height, width, _ = own[0].shape
    pictures = decoded(film, width, height)
    assert len(pictures) == 16
    scene = slice(0, round(0.85 * height))  # above the time in words, by which pictures would differ, too
    for i, k in enumerate(shown):
        off = [float(np.abs(pictures[k] - picture)[scene].mean()) for picture in own]
        assert int(np.argmin(off)) == i
        assert off[i] < 4.0, off  # of 255: what the codec loses


def test_a_film_can_be_stopped_and_plays_on(small_robot: Robot, window: Window, tmp_path: Path) -> None:  # noqa: F811
    page = window.open(file_url([drive(small_robot)], tmp_path) + "#plots=none&t=0.5")
    page.evaluate("nmm.player.play()")
    page.locator("#film").click()
    page.wait_for_function("/^[1-9]/.test(document.getElementById('film').textContent)")
    page.keyboard.press("w")
    page.wait_for_function("document.getElementById('film').textContent === ''")
    assert page.evaluate("nmm.player.playing")
    assert page.locator("#status").text_content() == ""


def test_a_film_is_saved_under_the_pages_name(small_robot: Robot, window: Window, tmp_path: Path) -> None:  # noqa: F811
    url = file_url([drive(small_robot, duration=0.2)], tmp_path, title="Two laps") + "#plots=none"
    page = window.open(url)
    with page.expect_download() as waiting:
        page.keyboard.press("w")
    assert waiting.value.suggested_filename == "two-laps-0.00s.webm"
    assert Path(waiting.value.path()).read_bytes()[:4] == b"\x1a\x45\xdf\xa3"


def test_a_browser_that_encodes_nothing_says_so(small_robot: Robot, window: Window, tmp_path: Path) -> None:  # noqa: F811
    page = window.open(file_url([drive(small_robot, duration=0.2)], tmp_path))
    page.evaluate("delete window.VideoEncoder")
    page.locator("#film").click()
    assert "nmm render RUN --video" in (page.locator("#status").text_content() or "")
