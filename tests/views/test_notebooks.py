"""Pages in a notebook's frame, in a real browser: shut off from what they stand in, and whole."""

from __future__ import annotations

import html
import re
from pathlib import Path

import numpy as np
import pytest
from playback_browser import Window
from playback_browser import browser as browser
from playback_browser import empty_page as empty_page
from playback_browser import small_robot as small_robot
from playback_browser import window as window
from playback_robot import drive

import nmm
from nmm.base.errors import InputError
from nmm.model.robots.robot import Robot
from nmm.views.playback import Page


@pytest.fixture(scope="module")
def runs() -> list[nmm.Trajectory]:
    scenario = nmm.Scenario.load("unicycle_2r_position", {"duration": "2"})
    return [scenario.with_resolver(kind).run() for kind in ("rg", "pg")]


def notebook(window: Window, folder: Path, *cells: str):
    """A page that shows cells as a notebook does, and their frames."""
    file = folder / "notebook.html"
    file.write_text("<!DOCTYPE html><title>notebook</title><main>" + "".join(cells) + "</main>", "utf-8")
    window.page.goto(file.as_uri())
    frames = [frame for frame in window.page.frames if frame != window.page.main_frame]
    for frame in frames:
        frame.wait_for_function("!document.body.classList.contains('loading')")
    return frames


@pytest.mark.browser
def test_a_run_a_comparison_and_a_robot_show_themselves(
    window: Window, tmp_path: Path, runs: list[nmm.Trajectory]
) -> None:
    one, several, robot = notebook(
        window, tmp_path, runs[0]._repr_html_() or "", Page(runs)._repr_html_(), runs[0].robot._repr_html_()
    )
    for frame, count in ((one, 1), (several, 2)):
        frame.evaluate("nmm.seek(1.5)")
        state = frame.evaluate("nmm.state()")
        assert len(state["runs"]) == count
        for run, told in zip(runs, state["runs"], strict=False):
            k = int(np.searchsorted(run.t, 1.5 - 1e-9))
            assert told["values"]["x"] == pytest.approx(run.q[k, 0], abs=1e-6)
    robot.evaluate("nmm.joints.set({x: 0.7})")
    assert robot.evaluate("nmm.joints.coordinates.find(({ name }) => name === 'x').value") == 0.7
    for frame in (one, several, robot):
        # A frame without a place of its own: nothing of the notebook is in its reach.
        assert frame.evaluate("self.origin") == "null"
        with pytest.raises(Exception, match=r"(?i)blocked|cross-origin|permission"):
            frame.evaluate("parent.document.title")


def test_the_frame_runs_scripts_and_nothing_else(small_robot: Robot) -> None:
    motion = drive(small_robot, duration=0.5)
    text = Page([motion], title='a "title" <b>')._repr_html_()
    assert re.match(r'<iframe sandbox="allow-scripts" title="a &quot;title&quot; &lt;b&gt;" ', text)
    page = html.unescape(re.search(r'srcdoc="([^"]*)"', text)[1])
    assert page.startswith("<!DOCTYPE html>")
    assert page.rstrip().endswith("</html>")


def test_what_is_not_trusted_says_so(small_robot: Robot) -> None:
    """JupyterLab leaves out a frame of a notebook that is not trusted, and keeps the words in it."""
    text = Page([drive(small_robot, duration=0.5)], title="a <b>")._repr_html_()
    words = re.sub(r"<[^>]*>", "", text)
    assert words == "a &lt;b&gt;: this page is drawn once the notebook is trusted."


def test_what_has_no_samples_has_no_page(runs: list[nmm.Trajectory]) -> None:
    with pytest.raises(InputError, match="at least one"):
        Page([])
    stopped = nmm.Scenario.load(
        "unicycle_2r_position",
        {"robot.arguments.d": "0", "q0": "{q1: pi/2}", "resolver.partitions": "[[v, q1], [v, omega]]",
         "task.0.axes": "xy"},
    ).run()  # fmt: skip
    assert len(stopped) == 0
    assert stopped._repr_html_() is None
