"""The gallery in a browser: its page on a screen and on a phone, and its motions, which share one script."""

from __future__ import annotations

import functools
import http.server
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from playback_browser import Window
from playback_browser import browser as browser
from playback_browser import empty_page as empty_page
from playback_browser import window as window

from nmm.gallery import Gallery, write_gallery

pytestmark = pytest.mark.browser


@pytest.fixture(scope="module")
def gallery(tmp_path_factory: pytest.TempPathFactory) -> Gallery:
    folder = tmp_path_factory.mktemp("out") / "gallery"
    return write_gallery(folder, ["unicycle_2r_position"], jobs=1)


@contextmanager
def served(folder: Path) -> Iterator[str]:
    handler = functools.partial(http.server.SimpleHTTPRequestHandler, directory=folder)
    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    try:
        yield f"http://127.0.0.1:{server.server_port}"
    finally:
        server.shutdown()
        server.server_close()


@pytest.mark.parametrize("width", [420, 1280])
def test_the_page_fits_its_window(gallery: Gallery, window: Window, width: int) -> None:
    page = window.open(gallery.index.as_uri())
    page.set_viewport_size({"width": width, "height": 900})
    assert page.evaluate("document.documentElement.scrollWidth") == width
    assert page.evaluate("[...document.images].every(image => image.naturalWidth > 500)")


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
    with served(gallery.folder) as start:
        plays(start)
        window.page.goto("about:blank")
