"""Tools over the scene, in a real browser: frames on and off, a tape between two points."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from figure_examples import run
from playback_browser import PROJECT, UPRIGHT, WALK, Window, draw_frames, file_url
from playback_browser import browser as browser
from playback_browser import empty_page as empty_page
from playback_browser import small_robot as small_robot
from playback_browser import window as window
from playback_robot import drive
from playwright.sync_api import Page

import nmm
from nmm.model.robots.robot import Robot
from nmm.views.playback import write_html

#: The axes that are seen, each with the node that it is drawn at.
SEEN = """() => {
  const all = [];
  viewer.scene.updateMatrixWorld(true);
  const walk = (node, path) => {
    const axes = (part) => part.visible && part.children.filter(({ isMesh }) => isMesh).length === 6;
    if (node.object.children.some(axes)) all.push(path);
    for (const [name, child] of Object.entries(node.children)) walk(child, `${path}/${name}`);
  };
  walk(viewer.scene_tree, "");
  return all.filter((path) => path.includes("/frame "));
}"""


def test_frames_of_links_and_tools_are_shown_where_they_are(tmp_path: Path, window: Window) -> None:
    motion = run("unicycle_2r_position", "rg", duration=2.0)
    page = window.open(write_html([motion], tmp_path / "page.html").as_uri())
    assert "platform's path" in (page.locator("#legend").text_content() or "")  # the thin line
    assert page.evaluate(SEEN) == []
    page.keyboard.press("t")
    seen = {path.rsplit("/", 1)[1].split(" ", 2)[2]: path for path in page.evaluate(SEEN)}
    assert seen.keys() == {"base_footprint", "link1", "link2", "ee"}
    page.evaluate("nmm.player.seek(nmm.stage.duration)")
    draw_frames(page)
    nodes = page.evaluate(WALK)
    configuration = nmm.Configuration(motion.robot, motion.q[-1])
    for name, path in seen.items():
        drawn = UPRIGHT.T @ np.reshape(nodes[path], (4, 4)).T
        np.testing.assert_allclose(drawn, configuration.placement(name).homogeneous, atol=1e-6, err_msg=name)
    page.wait_for_function("location.hash.includes('axes=on')")
    page.keyboard.press("t")
    assert page.evaluate(SEEN) == []


def place(page: Page, point: list[float]) -> tuple[float, float]:
    """Where a point of the world is in the window."""
    x, y = page.evaluate(PROJECT, [point])[0][:2]
    box = page.locator("#view").bounding_box()
    assert box is not None
    return box["x"] + 0.5 * (1 + x) * box["width"], box["y"] + 0.5 * (1 - y) * box["height"]


#: The ends that are drawn, in the world's axes.
ENDS = """() => {
  viewer.scene.updateMatrixWorld(true);
  const balls = [];
  const ball = ({ geometry, renderOrder }) => geometry?.type === "SphereGeometry" && renderOrder === 1200;
  viewer.scene.traverse((part) => ball(part) && balls.push(part));
  return balls.map(({ matrixWorld: { elements: m } }) => [m[12], -m[14], m[13]]);
}"""


def test_two_clicks_measure(small_robot: Robot, tmp_path: Path, window: Window) -> None:
    page = window.open(file_url([drive(small_robot)], tmp_path))
    page.set_viewport_size({"width": 800, "height": 600})
    page.keyboard.press("v")  # from above: the ground is nowhere seen from its side
    draw_frames(page)
    page.locator("#measure").click()
    told = page.locator("#measured")
    assert "Click a point" in told.inner_text()
    ends = [[-0.2, 0.6, 0.0], [0.4, 0.9, 0.0]]
    for end in ends:
        page.mouse.click(*place(page, end))
    pixel = np.linalg.norm(np.subtract(place(page, [0, 0, 0]), place(page, [1, 0, 0])))
    near = 2.0 / float(pixel)
    np.testing.assert_allclose(page.evaluate(ENDS), ends, atol=near)
    length, along = told.inner_text().replace("−", "-").removesuffix(" m").split(" m; along x, y, z ")
    assert float(length) == pytest.approx(np.hypot(0.6, 0.3), abs=2.0 * near)
    assert [float(x) for x in along.split(", ")] == pytest.approx([0.6, 0.3, 0.0], abs=2.0 * near)
    # A drag turns the camera, and no more.
    page.mouse.move(300, 300)
    page.mouse.down()
    page.mouse.move(340, 320, steps=3)
    page.mouse.up()
    assert len(page.evaluate(ENDS)) == 2
    # A third point begins anew; the tool away, nothing is left.
    page.mouse.click(*place(page, ends[0]))
    assert len(page.evaluate(ENDS)) == 1
    page.keyboard.press("k")
    assert page.evaluate(ENDS) == []
    assert not told.is_visible()
    page.mouse.click(*place(page, ends[0]))
    assert page.evaluate(ENDS) == []


def test_a_robot_is_measured_where_it_is_seen(small_robot: Robot, tmp_path: Path, window: Window) -> None:
    """Not the ground behind it: the point lies on the mesh, above the floor."""
    motion = drive(small_robot)
    page = window.open(file_url([motion], tmp_path))
    page.keyboard.press("k")
    top = nmm.Configuration(small_robot, motion.q[0]).placement(small_robot.frames[-1]).translation
    page.mouse.click(*place(page, [float(x) for x in top]))
    ((x, y, z),) = page.evaluate(ENDS)
    assert z > 0.02
    assert np.hypot(x - top[0], y - top[1]) < 0.3


def test_the_worlds_axes_are_seen_through_what_stands_before_them(
    small_robot: Robot, tmp_path: Path, window: Window
) -> None:
    page = window.open(file_url([drive(small_robot)], tmp_path))
    arrows = """() => {
      const over = [];
      const through = (part) => part.isMesh && !part.material.depthTest;
      nmm.node("/nmm/axes").traverse((part) => through(part) && over.push(part.renderOrder));
      return over;
    }"""
    assert page.evaluate(arrows) == [900] * 6
