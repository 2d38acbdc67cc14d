"""The gallery in a browser: its page on a screen and on a phone, and its motions, which share one script."""

from __future__ import annotations

import pytest
from gallery import Gallery, write_gallery
from playback_browser import Window
from playback_browser import browser as browser
from playback_browser import empty_page as empty_page
from playback_browser import window as window
from ports import served_folder


@pytest.fixture(scope="module")
def gallery(tmp_path_factory: pytest.TempPathFactory) -> Gallery:
    folder = tmp_path_factory.mktemp("out") / "gallery"
    return write_gallery(folder, ["unicycle_2r_position"], jobs=1)


@pytest.mark.parametrize("width", [420, 1280])
def test_the_page_fits_its_window(gallery: Gallery, window: Window, width: int) -> None:
    page = window.open(gallery.index.as_uri())
    page.set_viewport_size({"width": width, "height": 900})
    assert page.evaluate("document.documentElement.scrollWidth") == width
    page.wait_for_function("[...document.images].every(image => image.naturalWidth > 500)")


@pytest.mark.parametrize("how", ["as a file", "from a server"])
def test_a_motion_plays_with_the_script_beside_it(gallery: Gallery, window: Window, how: str) -> None:
    def plays(start: str) -> None:
        page = window.open(f"{start}/unicycle_2r_position/playback.html")
        page.evaluate("nmm.seek(12.5)")
        state = page.evaluate("nmm.state()")
        assert state["t"] == pytest.approx(12.5)
        assert [run["name"] for run in state["runs"]] == ["RG"]

    if how == "as a file":
        plays(gallery.folder.as_uri())
        return
    with served_folder(gallery.folder) as start:
        plays(start)
        window.page.goto("about:blank")


def test_a_picture_plays_where_it_stands(gallery: Gallery, window: Window) -> None:
    page = window.page
    page.set_viewport_size({"width": 1280, "height": 800})
    page.goto(gallery.index.as_uri())
    page.locator("a.play").click()
    frame = page.frame_locator(".card iframe")
    frame.locator("body.playing").wait_for()
    assert frame.locator("#time").inner_text() != ""
    assert page.locator("a.play").count() == 0
    # What moves is seen, and the bar ends within the card.
    seen, inside = page.frames[1].evaluate(
        """() => {
          viewer.render();
          const { matrixWorld } = nmm.node(nmm.motions[0].root);
          const p = new MeshCat.THREE.Vector3().setFromMatrixPosition(matrixWorld).project(viewer.camera);
          const at = [0.5 * (1 + p.x) * innerWidth, 0.5 * (1 - p.y) * innerHeight];
          const { tagName } = document.elementFromPoint(...at);
          const shown = [...document.querySelectorAll("#bar > *")];
          return [tagName, shown.every((part) => part.getBoundingClientRect().right <= innerWidth - 8)];
        }"""
    )
    assert seen == "CANVAS"
    assert inside
