"""A page in a real browser, and what the tests of playback ask it."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from playback_robot import hand_built_robot
from playwright.sync_api import Browser, Page, ViewportSize, sync_playwright
from ports import MOST

from nmm.model.robots.robot import Robot
from nmm.views.playback import Motion, write_html
from nmm.views.playback.extent import corners, robot_boxes
from nmm.views.playback.placements import Placements

#: three.js has y upwards: MeshCat turns the whole scene by this.
UPRIGHT = np.array([[1.0, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]])

WALK = """() => {
  const found = {};
  const walk = (node, path) => {
    found[path] = node.object.matrixWorld.elements;
    for (const [name, child] of Object.entries(node.children)) walk(child, `${path}/${name}`);
  };
  viewer.scene.updateMatrixWorld(true);
  walk(viewer.scene_tree, "");
  return found;
}"""

PROJECT = """(points) => {
  viewer.scene.updateMatrixWorld(true);
  viewer.camera.updateProjectionMatrix();
  return points.map((p) => new MeshCat.THREE.Vector3(p[0], p[2], -p[1]).project(viewer.camera).toArray());
}"""


@dataclass
class Window:
    """A page with everything that it complained about and asked for."""

    page: Page
    errors: list[str] = field(default_factory=list)
    requests: list[str] = field(default_factory=list)

    def open(self, url: str) -> Page:
        """The document at `url`, loaded anew also where only what follows # differs."""
        # Within one document, what the page writes into its own address could come before what was asked for.
        self.page.goto("about:blank")
        self.page.goto(url)
        self.page.wait_for_function("!document.body.classList.contains('loading')")
        return self.page


@cache
def _launched(config: pytest.Config) -> Browser:
    """One browser for all files of a process: beside Playwright there can be no second one."""
    names = ("chromium", "chromium-browser", "google-chrome")
    path = next((found for name in names if (found := shutil.which(name))), None)
    if path is None:
        pytest.fail(
            f"these tests need Chromium (Debian: apt-get install chromium); none of {names} is in PATH"
        )
    options = ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
    options += ["--webgl-antialiasing-mode=none"]  # four samples a pixel would double what a picture takes
    playwright = sync_playwright().start()
    launched = playwright.chromium.launch(executable_path=path, args=options)
    for name in ("new_page", "new_context"):
        setattr(launched, name, _patient(getattr(launched, name)))
    config.add_cleanup(playwright.stop)
    config.add_cleanup(launched.close)  # before it
    return launched


def _patient(makes: Callable[..., Any]) -> Callable[..., Any]:
    """What it makes waits longer than 30 s: on a busy machine one picture of a page may take seconds."""

    def made(**options: Any) -> Any:
        waits = makes(**options)
        waits.set_default_timeout(2000.0 * MOST)
        return waits

    return made


@pytest.fixture(scope="module")
def browser(pytestconfig: pytest.Config) -> Iterator[Browser]:
    """Without anything open at the end of a file."""
    launched = _launched(pytestconfig)
    yield launched
    for context in launched.contexts:
        context.close()


#: Small: the processor draws it.
SIZE = ViewportSize(width=480, height=300)


@pytest.fixture(scope="module")
def empty_page(browser: Browser) -> Iterator[Page]:
    """A page for one `watched` after another: another document costs half of what another page does."""
    page = browser.new_page()
    yield page
    page.close()


@contextmanager
def watched(page: Page) -> Iterator[Window]:
    """A page's window, empty again afterwards; it may leave no error and not reach outside."""
    page.set_viewport_size(SIZE)
    window = Window(page)
    handlers: dict[Any, Callable[[Any], object]] = {
        "pageerror": lambda error: window.errors.append(str(error)),
        "console": lambda message: message.type == "error" and window.errors.append(message.text),
        "request": lambda request: window.requests.append(request.url),
        "websocket": lambda socket: window.requests.append(socket.url),
    }
    for event, handler in handlers.items():
        page.on(event, handler)
    try:
        yield window
    finally:
        page.goto("about:blank")
        for event, handler in handlers.items():
            page.remove_listener(event, handler)
    assert window.errors == [], f"the page complained: {window.errors}"
    here = ("file:///", "http://127.0.0.1:", "ws://127.0.0.1:", "data:", "blob:")
    assert [url for url in window.requests if not url.startswith(here)] == []


@pytest.fixture
def window(empty_page: Page) -> Iterator[Window]:
    with watched(empty_page) as window:
        yield window


def draw_frames(page: Page) -> None:
    """Let the page draw: what follows the picture is then where the picture is."""
    page.evaluate(
        """() => new Promise((done) => {
          const next = (left) => (left ? requestAnimationFrame(() => next(left - 1)) : done());
          next(3);
        })"""
    )


@pytest.fixture(scope="module")
def small_robot(tmp_path_factory: pytest.TempPathFactory) -> Robot:
    return hand_built_robot(tmp_path_factory.mktemp("robot"))


def file_url(motions: list[Motion], folder: Path, **options: object) -> str:
    return write_html(motions, folder / "playback.html", **options).as_uri()  # type: ignore[arg-type]  # each test gives its own


def drawn_visuals(page: Page, motion: int = 0) -> dict[str, np.ndarray]:
    """World placement of each visual's node, in the world's axes, by "visual <index> <name>"."""
    return {
        path.split("/")[-1]: UPRIGHT.T @ np.reshape(elements, (4, 4)).T
        for path, elements in page.evaluate(WALK).items()
        if path.split("/")[-1].startswith("visual ") and path.startswith(f"/nmm/motion {motion}/robot/")
    }


def expected_visuals(robot: Robot, q: np.ndarray, wheels: np.ndarray) -> dict[str, np.ndarray]:
    visuals, data = robot.visual_model, robot.visual_model.createData()
    model = robot.display_model
    full = Placements(robot).configuration(q, wheels)
    pin.updateGeometryPlacements(model, model.createData(), visuals, data, full)
    return {
        f"visual {i} {geometry.name.replace('/', '_')}": data.oMg[i].homogeneous
        for i, geometry in enumerate(visuals.geometryObjects)
    }


def assert_same(
    drawn: dict[str, np.ndarray], expected: dict[str, np.ndarray], tolerance: float = 1e-6
) -> None:
    assert drawn.keys() == expected.keys()
    assert drawn
    for name, placement in expected.items():
        np.testing.assert_allclose(drawn[name], placement, atol=tolerance, err_msg=name)


def assert_in_picture(page: Page, motions: list[Motion], at: list[float]) -> None:
    for fraction in at:
        page.evaluate(f"nmm.player.seek({fraction} * nmm.stage.duration)")
        for motion in motions:
            time_now = motion.t[0] + fraction * motion.duration
            q = np.array([np.interp(time_now, motion.t, column) for column in motion.q.T])
            box = robot_boxes(motion.robot, q[np.newaxis], np.zeros((1, len(motion.robot.wheels))))
            points = np.array(page.evaluate(PROJECT, corners(box)[0].tolist()))
            assert np.abs(points[:, :2]).max() < 1.0
            assert np.abs(points[:, 2]).max() < 1.0
