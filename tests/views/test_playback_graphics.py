"""A page whose browser takes its graphics away, as when they crash or too many pages want to draw."""

from __future__ import annotations

import io

import numpy as np
import pytest
from PIL import Image
from playback_browser import Window, draw_frames, file_url, watched
from playback_browser import browser as browser
from playback_browser import empty_page as empty_page
from playback_browser import small_robot as small_robot
from playback_browser import window as window
from playback_robot import drive
from playwright.sync_api import Browser, Page

from nmm.model.robots.robot import Robot


@pytest.fixture(scope="module")
def opened(small_robot: Robot, tmp_path_factory: pytest.TempPathFactory) -> str:
    return file_url([drive(small_robot, duration=4.0)], tmp_path_factory.mktemp("page"))


def looks(page: Page) -> np.ndarray:
    """The scene as it stands in the window, (height, width, 3), without the tools that lie over it."""
    page.evaluate("document.getElementById('tools').style.visibility = 'hidden'")
    draw_frames(page)
    picture = page.locator("#view canvas").screenshot()
    return np.array(Image.open(io.BytesIO(picture)).convert("RGB")).astype(int)


def test_the_scene_is_in_the_window_with_its_shadows(window: Window, opened: str) -> None:
    page = window.open(f"{opened}#t=2")
    seen = looks(page)
    page.evaluate("viewer.scene.visible = false; viewer.set_dirty()")
    empty = looks(page)
    assert (seen != empty).any(axis=2).mean() > 0.05
    page.evaluate(
        "viewer.renderer.shadowMap.enabled = false; viewer.scene.visible = true; viewer.set_dirty();"
        "viewer.scene.traverse(({ material }) => "
        "[material].flat().forEach((one) => one && (one.needsUpdate = true)))"
    )
    darker = seen.sum(axis=2) < looks(page).sum(axis=2) - 20
    assert darker.sum() > 50


def test_graphics_taken_away_come_back(window: Window, opened: str) -> None:
    """As a browser takes them when its graphics crash, or when too many pages want to draw."""
    page = window.open(f"{opened}#t=2")
    before = looks(page)
    lose = (
        "window.taken = viewer.renderer.getContext().getExtension('WEBGL_lose_context'); taken.loseContext()"
    )
    page.evaluate(lose)
    page.wait_for_function("document.body.classList.contains('blind')")
    assert page.locator("#blind").is_visible()
    page.evaluate("nmm.seek(3)")
    assert page.evaluate("nmm.state()")["t"] == 3.0
    page.evaluate("nmm.seek(2); taken.restoreContext()")
    page.wait_for_function("!document.body.classList.contains('blind')")
    assert (looks(page) == before).all()
    assert window.errors == []


#: The call after which they are lost: the one that makes them, or the first shader's.
LOSSES = {
    "when made": ("HTMLCanvasElement", "getContext", "lose(made)"),
    "soon after": ("HTMLCanvasElement", "getContext", "setTimeout(() => lose(made))"),
    "in the first picture": ("WebGL2RenderingContext", "linkProgram", "lose(this)"),
}


@pytest.mark.parametrize("loss", LOSSES)
def test_graphics_taken_away_while_a_page_is_read(browser: Browser, opened: str, loss: str) -> None:
    """three.js throws when it asks after shaders that are being lost, and the page would not be shown."""
    kind, function, losing = LOSSES[loss]
    page = browser.new_page()
    page.add_init_script(
        f"const usual = {kind}.prototype.{function};"
        f"{kind}.prototype.{function} = function (...given) {{"
        f"  const made = usual.apply(this, given); if (given[0] !== '2d') {losing}; return made; }};"
        "const lose = (context) => context.getExtension('WEBGL_lose_context')?.loseContext();"
    )
    with watched(page) as window:
        window.open(f"{opened}#t=2")
        page.wait_for_function("document.body.classList.contains('blind')")
        assert page.evaluate("nmm.state()")["t"] == 2.0
        assert page.locator("#status").inner_text() == ""
    page.close()
