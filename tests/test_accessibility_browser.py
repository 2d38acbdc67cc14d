"""axe-core finds no serious fault in the pages. It is from npm, for this test alone: NMM_AXE is its file."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from figure_examples import cut, run
from playback_browser import Window
from playback_browser import browser as browser
from playback_browser import empty_page as empty_page
from playback_browser import window as window

from nmm.playback import write_html

pytestmark = pytest.mark.browser

#: Each fault: how bad it is, which rule, and where.
FAULTS = """axe.run().then(({ violations }) =>
  violations.map(({ impact, id, nodes }) => [impact, id, nodes.map(({ target }) => target.join())]))"""


@pytest.fixture(scope="module")
def axe() -> str:
    file = os.environ.get("NMM_AXE", "")
    if not file:
        pytest.skip("axe-core is not here: npm install axe-core, and NMM_AXE=…/axe-core/axe.min.js")
    return Path(file).read_text(encoding="utf-8")


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("count", [1, 2])
def test_a_page_has_no_serious_fault(
    window: Window, axe: str, tmp_path: Path, count: int, scheme: str
) -> None:
    """A run's, and a comparison's."""
    runs = [cut(run("unicycle_2r_position"), 60 - 10 * k) for k in range(count)]
    window.page.emulate_media(color_scheme=scheme)  # type: ignore[arg-type]  # one of its words
    page = window.open(write_html(runs, tmp_path / "page.html").as_uri())
    page.evaluate(axe)
    faults = page.evaluate(FAULTS)
    window.page.emulate_media(color_scheme="null")
    assert [fault for fault in faults if fault[0] in ("serious", "critical")] == []
