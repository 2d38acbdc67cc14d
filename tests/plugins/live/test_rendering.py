"""Videos of runs: what is asked, what is missing, and pictures that show what the page shows."""

from __future__ import annotations

import base64
import contextlib
import io
import itertools
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from command_line import process
from matplotlib.image import imread
from PIL import Image
from playback_browser import Window, file_url
from playback_browser import browser as browser
from playback_browser import empty_page as empty_page
from playback_browser import small_robot as small_robot
from playback_browser import window as window
from playback_robot import drive
from ports import MOST

import nmm
from nmm.base.errors import InputError, RunError
from nmm.cli.exit_status import status_of
from nmm.model.robots.robot import Robot
from nmm.plugins.live.rendering import encoder, render
from nmm.plugins.live.rendering.chromium import HeadlessPage

SMALL = (160, 96)


def seen(file: Path, fps: float) -> list[np.ndarray]:
    """The pictures of a video."""
    folder = file.parent / f"{file.name} seen"
    folder.mkdir()
    command = [encoder.find_ffmpeg(), "-loglevel", "error", "-i", str(file), "-r", f"{fps:g}"]
    subprocess.run([*command, str(folder / "%04d.png")], check=True)
    return [imread(path)[..., :3] for path in sorted(folder.iterdir())]


@pytest.mark.browser
@pytest.mark.parametrize("suffix", [".mp4", ".webm", ".gif"])
def test_a_video_has_its_pictures_in_their_order(small_robot: Robot, tmp_path: Path, suffix: str) -> None:
    motion = drive(small_robot, duration=2.0)
    shares: list[float] = []
    file = render(
        [motion], tmp_path / f"motion{suffix}", size=SMALL, view="top", fps=5, progress=shares.append
    )
    assert [path.name for path in tmp_path.iterdir()] == [file.name]
    assert shares == sorted(shares)
    assert shares[-1] == 1.0
    pictures = seen(file, 5)
    assert len(pictures) == 11
    assert {picture.shape for picture in pictures} == {(96, 160, 3)}
    # It moves, and each picture is nearer to the next one than to one a second later.
    near = [np.abs(a - b).mean() for a, b in itertools.pairwise(pictures)]
    far = [np.abs(a - b).mean() for a, b in zip(pictures, pictures[5:], strict=False)]
    assert min(far) > 0.0
    assert np.mean(near) < np.mean(far)


@pytest.mark.browser
def test_a_picture_of_a_video_is_what_the_page_shows(small_robot: Robot, tmp_path: Path) -> None:
    motion = drive(small_robot, duration=2.0)
    whole = render([motion], tmp_path / "whole.gif", size=SMALL, fps=2, title="")
    part = render([motion], tmp_path / "part.gif", size=SMALL, fps=2, start=1.0, end=1.5, title="")
    fast = render([motion], tmp_path / "fast.gif", size=SMALL, fps=2, speed=2.0, title="")
    pictures, some, few = (seen(file, 2) for file in (whole, part, fast))
    assert [len(pictures), len(some), len(few)] == [5, 2, 3]
    for shown, same, other in ((some[0], pictures[2], pictures[0]), (few[1], pictures[2], pictures[4])):
        differ = [int(np.sum(np.abs(shown - one) > 0.1)) for one in (same, other)]  # more than palettes do
        assert differ[0] < 0.1 * differ[1]


@pytest.mark.browser
def test_a_page_saves_its_scene_twice_as_large(small_robot: Robot, window: Window, tmp_path: Path) -> None:
    page = window.open(file_url([drive(small_robot, duration=1.0)], tmp_path) + "#plots=none")
    view = page.evaluate("(({ width, height }) => [width, height])(nmm.viewer.renderer.domElement)")
    data = page.evaluate("nmm.picture()")
    picture = Image.open(io.BytesIO(base64.b64decode(data.partition(",")[2])))
    assert list(picture.size) == [2 * side for side in view]
    assert len(np.unique(np.asarray(picture).reshape(-1, 4), axis=0)) > 100
    assert page.evaluate("(({ width, height }) => [width, height])(nmm.viewer.renderer.domElement)") == view
    with page.expect_download() as download:
        page.locator("#picture").click()
    assert re.fullmatch(r"[\w-]+-0\.00s\.png", download.value.suggested_filename)


@pytest.mark.browser
def test_a_page_that_throws_says_so(tmp_path: Path) -> None:
    file = tmp_path / "page.html"
    file.write_text("<!DOCTYPE html><title>page</title>", encoding="utf-8")
    with HeadlessPage(file, (200, 100)) as page:
        assert page.evaluate("1 + 1") == 2
        assert page.evaluate("Promise.resolve('later')") == "later"
        with pytest.raises(RunError, match="no such thing"):
            page.evaluate("throw new Error('no such thing')")
        pid = page._process.pid
        assert Image.open(io.BytesIO(page.picture())).size == (200, 100)
    for stat in Path("/proc").glob("[0-9]*/stat"):
        with contextlib.suppress(OSError):
            state, _, _, session = stat.read_text().rpartition(")")[2].split()[:4]
            assert int(session) != pid or state == "Z"  # nobody of its session is alive


@pytest.mark.browser
def test_an_interrupted_video_leaves_nothing(tmp_path: Path) -> None:
    run = nmm.Scenario.load("unicycle_2r_position", {"duration": 5.0}).run()
    run.save(tmp_path / "run", figures=False)
    running = process(tmp_path, "render", "run", "--video", "motion.mp4", "--size", "320x200")
    end = time.monotonic() + MOST
    while not [path for path in tmp_path.iterdir() if path.name == ".motion.mp4.nmm-writing"]:
        assert time.monotonic() < end
        assert running.poll() is None
        time.sleep(0.02)
    time.sleep(0.5)
    running.send_signal(signal.SIGINT)
    out, err = running.communicate(timeout=MOST)
    assert (running.returncode, out, err) == (130, "", "nmm render: interrupted\n")
    assert [path.name for path in tmp_path.iterdir()] == ["run"]


@pytest.mark.parametrize(
    ("options", "where"),
    [
        ({"size": (161, 96)}, "size"), ({"size": (10, 10)}, "size"), ({"size": (9000, 10)}, "size"),
        ({"size": (64,)}, "size"), ({"view": "below"}, "render"), ({"apart": 2.0}, "apart"),
        ({"start": 5.0}, "start and end"), ({"start": 1.0, "end": 0.5}, "start and end"),
        ({"fps": 1e6}, "fps"),
    ],
)  # fmt: skip
def test_what_cannot_be_filmed_is_refused(
    small_robot: Robot, tmp_path: Path, options: dict, where: str
) -> None:
    with pytest.raises(InputError) as refused:
        render([drive(small_robot, duration=2.0)], tmp_path / "motion.mp4", **options)
    assert refused.value.where.startswith(where)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("options", [{"fps": 0.0}, {"speed": -1.0}])
def test_a_rate_that_is_not_above_zero_is_refused(small_robot: Robot, tmp_path: Path, options: dict) -> None:
    (name,) = options
    with pytest.raises(InputError, match=name):
        render([drive(small_robot, duration=2.0)], tmp_path / "motion.mp4", **options)


def test_where_it_cannot_be_written_is_refused(small_robot: Robot, tmp_path: Path) -> None:
    motion = drive(small_robot, duration=1.0)
    for name, kind in (("motion.avi", True), ("motion", True), ("nowhere/motion.mp4", False)):
        with pytest.raises(InputError) as refused:
            render([motion], tmp_path / name)
        assert refused.value.where == str(tmp_path / name)
        assert bool(refused.value.expected) is kind
    with pytest.raises(InputError) as refused:
        render([], tmp_path / "motion.mp4")
    assert refused.value.where == "motions"


def test_what_is_missing_is_named(
    small_robot: Robot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    motion = drive(small_robot, duration=1.0)
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(RunError, match=r"Chromium or Chrome.*apt-get install chromium"):
        render([motion], tmp_path / "motion.mp4")
    fake = tmp_path / "chromium"
    fake.write_text("#!/bin/sh\necho cannot open display >&2\nexit 1\n")
    fake.chmod(0o755)
    with pytest.raises(RunError, match=r"has ended: .*cannot open display"):
        render([motion], tmp_path / "motion.mp4")
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    with pytest.raises(RunError, match=r"ffmpeg.*pip install imageio-ffmpeg"):
        render([motion], tmp_path / "motion.mp4")
    assert [path.name for path in tmp_path.iterdir()] == ["chromium"]


def test_the_command_says_what_is_wrong(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    for arguments, words in (
        (["nothing", "--video", "a.mp4"], "nothing"),
        (["nothing", "--video", "a.mp4", "--size", "big"], "WIDTHxHEIGHT"),
    ):
        status = status_of(["render", *arguments])
        out, err = capfd.readouterr()
        assert (status, out) == (2, "")
        assert err.startswith("nmm render: ")
        assert words in err
