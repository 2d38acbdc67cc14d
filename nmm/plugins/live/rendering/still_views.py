"""Pictures of a robot and what stands around it, and nothing else: what a camera beside them would see."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

from nmm.model.robots.motion import Motion
from nmm.motion.trajectory import Trajectory
from nmm.plugins.live.rendering.chromium import HeadlessPage
from nmm.views.playback.html import write_html

#: A clock, paths or a target would tell a policy what no camera sees.
BARE = "body * { visibility: hidden } #view, #view canvas { visibility: visible }"
UNDRAWN = """for (const part of ["paths", "grid"]) {
  if (document.getElementById(part).getAttribute("aria-pressed") === "true") nmm.actions[part]();
}"""


class SceneViews:
    """Pictures of a run's scene, one after the other."""

    def __init__(self, page: HeadlessPage) -> None:
        self._page = page

    def of(self, view: str, times: Sequence[float]) -> Iterator[bytes]:
        """PNG pictures at times, s, from one of the sides of `render`; the camera stands."""
        shown = {"view": view, "follow": False, "plots": False, "apart": 0.0}
        self._page.evaluate(f"nmm.film({json.dumps(shown)}); {UNDRAWN}")
        for t in times:
            self._page.evaluate(f"nmm.filmed({float(t)!r})")
            yield self._page.picture()


@contextmanager
def scene_views(run: Trajectory, size: tuple[int, int]) -> Iterator[SceneViews]:
    """The views of one run, of `size` (width, height), px. `RunError` where there is no Chromium."""
    with tempfile.TemporaryDirectory(prefix="nmm-video-", ignore_cleanup_errors=True) as folder:
        page = write_html([bare(run)], Path(folder) / "page.html", ghosts=0)
        with HeadlessPage(page, size) as browser:
            browser.wait_for("window.nmm && nmm.stage && !document.body.classList.contains('loading')")
            browser.evaluate(
                "{ const style = document.createElement('style');"
                f" style.textContent = {json.dumps(BARE)}; document.head.append(style); }}"
            )
            yield SceneViews(browser)


def bare(run: Trajectory) -> Motion:
    """The run's motion without what it was to do and what it believed."""
    motion = run.motion()
    return replace(motion, desired=None, planned=None, believed=None, target=None, nearest=None, cameras=())
