"""A video of runs: instants of their playback page in sequence."""

from __future__ import annotations

import json
import math
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path

from nmm.base.arrays import counted, positive
from nmm.base.ellipsoid_options import Wanted
from nmm.base.errors import InputError, expect, expect_known
from nmm.base.progress import Progress
from nmm.plugins.live.rendering.chromium import HeadlessPage, find_browser
from nmm.plugins.live.rendering.encoder import encode, expect_video, find_ffmpeg
from nmm.views.playback.html import write_html
from nmm.views.playback.scene import Shown

VIEWS = ("iso", "top", "front", "wall")
#: Sides of a picture, px.
LEAST, MOST = 64, 4096
#: At most an hour at 30 pictures a second.
MOST_PICTURES = 108_000


def render(
    motions: Sequence[Shown],
    file: str | Path,
    *,
    size: tuple[int, int] = (1280, 720),
    view: str = "iso",
    fps: float = 30.0,
    speed: float = 1.0,
    follow: bool = False,
    plots: bool = False,
    apart: float = 0.0,
    start: float | None = None,
    end: float | None = None,
    title: str | None = None,
    ellipsoids: Wanted = False,
    progress: Progress | None = None,
) -> Path:
    """Write a video of runs or motions: the page of `write_html`, picture by picture, without ghosts.

    Parameters
    ----------
    motions : at least one run (`Trajectory`) or `Motion`
    file : ends in .mp4, .webm or .gif; it appears whole or not at all, and replaces an older one
    size : width and height, px, even numbers
    view : iso, top, front, or wall
    fps : pictures a second
    speed : 2 shows the motion twice as fast
    follow : whether the camera goes with the robots
    plots : whether the curves are beside the robot
    apart : 0 for robots over one another, 1 for side by side
    start, end : s; the first and the last instant when not given
    title : heading; the first robot's name when not given
    ellipsoids : whether manipulability ellipsoids are drawn, or how (`EllipsoidOptions`)
    progress : called with the fraction done

    Raises
    ------
    InputError : no motion, another suffix, a size, view or time that cannot be
    RunError : no Chromium, no ffmpeg (`pip install imageio-ffmpeg`), or one that fails

    Examples
    --------
    >>> run = nmm.Scenario.load("unicycle_2r_position", {"duration": 0.2}).run()
    >>> nmm.rendering.render([run], "motion.mp4", size=(320, 240), fps=10)
    PosixPath('motion.mp4')
    """
    width, height = checked_size(size)
    fps, speed = positive(fps, "fps"), positive(speed, "speed")
    expect_known("view", view, VIEWS, "render")
    expect(0.0 <= apart <= 1.0, "apart", "0 to 1", apart)
    expect_video(Path(file))
    expect(motions, "motions", "at least one motion")
    times = _times(motions, start, end, fps, speed)
    find_browser(), find_ffmpeg()  # before anything is drawn
    with tempfile.TemporaryDirectory(prefix="nmm-video-", ignore_cleanup_errors=True) as folder:
        page = write_html(motions, Path(folder) / "page.html", title=title, ghosts=0, ellipsoids=ellipsoids)
        with HeadlessPage(page, (width, height)) as browser:
            browser.wait_for("window.nmm && nmm.stage && !document.body.classList.contains('loading')")
            shown = {"view": view, "follow": bool(follow), "plots": bool(plots), "apart": float(apart)}
            browser.evaluate(f"nmm.film({json.dumps(shown)})")
            encode(_pictures(browser, times, progress), Path(file), fps)
    return Path(file)


def checked_size(size: tuple[int, int]) -> tuple[int, int]:
    expect(len(size) == 2, "size", "width and height", size)
    width, height = (counted(side, "size") for side in size)
    for side in (width, height):
        expected = f"even numbers from {LEAST} to {MOST} px, as in 1280x720"
        expect(side % 2 == 0 and LEAST <= side <= MOST, "size", expected, f"{width}x{height}")
    return width, height


def _times(
    motions: Sequence[Shown], start: float | None, end: float | None, fps: float, speed: float
) -> list[float]:
    first, last = min(float(run.t[0]) for run in motions), max(float(run.t[-1]) for run in motions)
    begin, stop = first if start is None else start, last if end is None else end
    expected = f"instants of the run, from {first:g} to {last:g} s, one after the other"
    expect(first <= begin <= stop <= last, "start and end (--from, --to)", expected, (begin, stop))
    wanted = (stop - begin) * fps / speed
    if not wanted < MOST_PICTURES:
        expected = f"at most {MOST_PICTURES}: fewer a second, or a part of the run"
        raise InputError(f"{wanted:.6g} pictures", where="fps", expected=expected)
    count = math.floor(wanted + 1e-9) + 1
    return [begin + k * speed / fps for k in range(count)]


def _pictures(page: HeadlessPage, times: Sequence[float], progress: Progress | None) -> Iterator[bytes]:
    tell = progress or (lambda share: None)
    for k, t in enumerate(times):
        tell(k / len(times))
        page.evaluate(f"nmm.filmed({t!r})")
        yield page.picture()
    tell(1.0)
