"""axe-core finds no serious fault in the pages. It is from npm, for this test alone: NMM_AXE is its file."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import Literal

import pytest
from figure_examples import cut, run
from gallery import write_gallery
from playback_browser import browser as browser
from playback_browser import empty_page as empty_page
from playback_browser import watched
from playwright.sync_api import Page
from ports import served
from short_scenario import MINIMAL

import nmm
from nmm.plugins.live.driving import ScenarioSetup, drive
from nmm.views.playback import view, write_html

#: Each fault: how bad it is, which rule, and where.
FAULTS = """axe.run().then(({ violations }) =>
  violations.map(({ impact, id, nodes }) => [impact, id, nodes.map(({ target }) => target.join())]))"""


@pytest.fixture(scope="module")
def axe() -> str:
    file = os.environ.get("NMM_AXE", "")
    if not file:
        pytest.skip("axe-core is not here: npm install axe-core, and NMM_AXE=…/axe-core/axe.min.js")
    return Path(file).read_text(encoding="utf-8")


@contextmanager
def a_run(folder: Path) -> Iterator[str]:
    yield write_html([cut(run("unicycle_2r_position"), 60)], folder / "page.html").as_uri()


@contextmanager
def a_comparison(folder: Path) -> Iterator[str]:
    runs = [cut(run("unicycle_2r_position"), count) for count in (60, 50)]
    yield write_html(runs, folder / "page.html").as_uri()


@contextmanager
def a_sweep(folder: Path) -> Iterator[str]:
    (folder / "short.yaml").write_text(MINIMAL, encoding="utf-8")
    sweep = nmm.Sweep(folder / "short.yaml", {"q0.x": (-1, 1)}, samples=4)
    yield sweep.run(folder / "out", jobs=1).page.as_uri()


@contextmanager
def a_gallery(folder: Path) -> Iterator[str]:
    yield write_gallery(folder / "out", ["unicycle_3r_out_of_reach"], jobs=1).index.as_uri()


def a_robot(folder: Path) -> AbstractContextManager[str]:
    robot = nmm.load("unicycle_3r")
    return served(view, robot, None, task=[nmm.Position("ee")])


def a_driven_robot(folder: Path) -> AbstractContextManager[str]:
    return served(drive, ScenarioSetup(nmm.Scenario.load("unicycle_3r_position")))


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("shown", [a_run, a_comparison, a_sweep, a_gallery, a_robot, a_driven_robot])
def test_a_page_has_no_serious_fault(
    empty_page: Page,
    axe: str,
    tmp_path: Path,
    shown: Callable[[Path], AbstractContextManager[str]],
    scheme: Literal["light", "dark"],
) -> None:
    with watched(empty_page) as window, shown(tmp_path) as url:
        empty_page.emulate_media(color_scheme=scheme)
        page = window.open(url)
        page.wait_for_timeout(500.0)  # what a live page is told first
        page.evaluate(axe)
        faults = page.evaluate(FAULTS)
        empty_page.emulate_media(color_scheme="null")
        page.goto("about:blank")
    assert [fault for fault in faults if fault[0] in ("serious", "critical")] == []
