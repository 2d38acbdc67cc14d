"""Playback in a real browser: everything stands where Pinocchio says, in the file and live."""

from __future__ import annotations

import signal
from pathlib import Path

import numpy as np
import pytest
from playback_browser import (
    PROJECT,
    UPRIGHT,
    WALK,
    Window,
    assert_in_picture,
    assert_same,
    drawn_visuals,
    expected_visuals,
    file_url,
)
from playback_browser import browser as browser
from playback_browser import small_robot as small_robot
from playback_browser import window as window
from playback_robot import drive, hand_built_robot
from test_playback_live import listening, start_player

import nmm
from nmm.playback import LiveViewer, Motion
from nmm.playback.extent import corners, robot_boxes
from nmm.playback.keyframes import ghost_samples, keyframes
from nmm.playback.placements import Placements
from nmm.playback.rolling import wheel_angles
from nmm.robot import Robot

pytestmark = pytest.mark.browser

#: Box around the vertices below each visual, in the visual's own frame.
BOXES = """() => {
  const found = {};
  const walk = (node, path) => {
    if (path.split("/").pop().startsWith("visual ")) {
      const box = new MeshCat.THREE.Box3();
      const inverse = node.object.matrixWorld.clone().invert();
      node.object.traverse((part) => {
        if (!part.isMesh) return;
        const vertices = part.geometry.attributes.position;
        for (let i = 0; i < vertices.count; i++) {
          const vertex = new MeshCat.THREE.Vector3().fromBufferAttribute(vertices, i);
          box.expandByPoint(vertex.applyMatrix4(part.matrixWorld).applyMatrix4(inverse));
        }
      });
      found[path] = [box.min.toArray(), box.max.toArray()];
    }
    for (const [name, child] of Object.entries(node.children)) walk(child, `${path}/${name}`);
  };
  viewer.scene.updateMatrixWorld(true);
  walk(viewer.scene_tree, "");
  return found;
}"""


#: Bases with swivels, trailers and rollers, and a base that stands still.
OTHERS = ("car_base", "trailer_base", "omni_base", "small_arm")


@pytest.fixture(scope="module", params=["hand-built", "unicycle_2r", "unicycle_3r", *OTHERS])
def robot(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Robot:
    if request.param == "hand-built":
        return hand_built_robot(tmp_path_factory.mktemp("robot"))
    return nmm.load(request.param, platform="fixed" if request.param == "small_arm" else None)


# The file


def test_every_visual_is_where_pinocchio_says(robot: Robot, window: Window, tmp_path: Path) -> None:
    motion = drive(robot)
    page = window.open(file_url([motion], tmp_path))
    frames = keyframes(motion)
    # As it opens, paused at the start, before anybody touches it.
    assert page.locator("#time").inner_text() == "0.00 / 4.00 s"
    assert_same(drawn_visuals(page), expected_visuals(robot, frames.q[0], frames.wheels[0]))
    for k in (60, 7, len(frames) // 2, len(frames) - 1, 0, 200):
        # The browser's animations keep time in single precision.
        page.evaluate(f"nmm.player.seek({float(np.float32(frames.t[k]))!r})")
        assert_same(drawn_visuals(page), expected_visuals(robot, frames.q[k], frames.wheels[k]))
    page.evaluate("nmm.player.seek(1e9)")
    assert_same(drawn_visuals(page), expected_visuals(robot, motion.q[-1], wheel_angles(motion)[-1]))


def test_every_visual_fills_the_room_that_its_shape_fills(
    robot: Robot, window: Window, tmp_path: Path
) -> None:
    page = window.open(file_url([drive(robot, duration=0.5)], tmp_path))
    drawn = {path.split("/")[-1]: np.array(box) for path, box in page.evaluate(BOXES).items()}
    assert len(drawn) == len(robot.visual_model.geometryObjects)
    for i, geometry in enumerate(robot.visual_model.geometryObjects):
        shape = geometry.geometry
        shape.computeLocalAABB()
        expected = np.array([shape.aabb_local.min_, shape.aabb_local.max_])
        # Round things have forty flat sides.
        close = 0.004 * np.ptp(expected, axis=0).max()
        box = drawn[f"visual {i} {geometry.name.replace('/', '_')}"]
        np.testing.assert_allclose(box, expected, atol=close, err_msg=geometry.name)


def test_ghosts_stand_where_the_robot_passes(small_robot: Robot, window: Window, tmp_path: Path) -> None:
    motion = drive(small_robot)
    page = window.open(file_url([motion], tmp_path, ghosts=4))
    matrices = page.evaluate(WALK)
    samples = ghost_samples(motion, 4)
    assert len(samples) == 4
    for k, sample in enumerate(samples):
        world = Placements(small_robot).world(motion.q[sample], wheel_angles(motion)[sample])
        for j, expected in enumerate(world):
            drawn = matrices.get(f"/nmm/motion 0/ghosts/{k}/{j}")
            if drawn is not None:  # joints that carry nothing have no ghost
                np.testing.assert_allclose(UPRIGHT.T @ np.reshape(drawn, (4, 4)).T, expected, atol=1e-12)
    ghosts = [path for path in matrices if path.startswith("/nmm/motion 0/ghosts/") and path.count("/") == 5]
    assert len(ghosts) == 4 * len(
        {geometry.parentJoint for geometry in small_robot.visual_model.geometryObjects}
    )


@pytest.mark.parametrize("size", [(1280, 720), (420, 700), (640, 300)])
def test_the_robots_stay_in_the_picture(
    small_robot: Robot, window: Window, tmp_path: Path, size: tuple[int, int]
) -> None:
    window.page.set_viewport_size({"width": size[0], "height": size[1]})
    swing = drive(small_robot, duration=6.0)
    # Far from the origin, where a camera that looks there would miss them.
    motions = [
        Motion(small_robot, swing.t, swing.q * [scale, scale, 1, 1, 1, 1] + [9, -4, 0, 0, 0, 0], swing.u)
        for scale in (1.0, 1.3)
    ]
    page = window.open(file_url(motions, tmp_path))
    times = [0.0, 0.25, 0.5, 0.75, 1.0]
    assert_in_picture(page, motions, times)
    page.keyboard.press("f")
    assert page.locator("#follow").get_attribute("aria-pressed") == "true"
    assert_in_picture(page, motions, times)
    page.keyboard.press("f")
    page.set_viewport_size({"width": 500, "height": 500})
    page.wait_for_function("viewer.camera.aspect === 1")
    assert_in_picture(page, motions, times)


# Live


def test_motions_play_live_until_the_process_ends(window: Window, tmp_path: Path) -> None:
    robot = hand_built_robot(tmp_path)
    for number in (signal.SIGINT, signal.SIGTERM):
        process, port = start_player(tmp_path)
        page = window.open(f"http://127.0.0.1:{port}/")
        motion = drive(robot, duration=1.0)
        page.wait_for_function("nmm.player.playing && nmm.player.time > 0.1")
        page.locator("#play").click()
        frames = keyframes(motion)
        for k in (20, len(frames) - 1, 0):
            page.evaluate(f"nmm.player.seek({float(np.float32(frames.t[k]))!r})")
            assert_same(drawn_visuals(page), expected_visuals(robot, frames.q[k], frames.wheels[k]))
        assert_in_picture(page, [motion], [0.0, 0.5, 1.0])
        process.send_signal(number)
        process.communicate(timeout=10)
        assert port not in listening()
        # What it got, it can go on playing.
        page.evaluate("nmm.player.seek(0.5)")
        assert page.locator("#time").inner_text() == "0.50 / 1.00 s"


def test_a_loop_moves_the_robot_in_the_page(robot: Robot, window: Window) -> None:
    motion = drive(robot, duration=2.0)
    angles = wheel_angles(motion)
    with LiveViewer(robot, motion.q[0]) as viewer:
        page = window.open(viewer.url)
        for k in (0, 77, 150, len(motion.t) - 1):
            seen = page.evaluate("viewer.num_messages_received")
            viewer.display(motion.q[k], angles[k])
            page.wait_for_function(f"viewer.num_messages_received > {seen}")
            assert_same(drawn_visuals(page), expected_visuals(robot, motion.q[k], angles[k]), 1e-12)
            box = robot_boxes(robot, motion.q[k : k + 1], angles[k : k + 1])
            points = np.array(page.evaluate(PROJECT, corners(box)[0].tolist()))
            assert np.abs(points).max() < 1.0
        # A page that comes later begins where the robot is.
        page.reload()
        page.wait_for_function("viewer.num_messages_received >= 2")
        assert_same(drawn_visuals(page), expected_visuals(robot, motion.q[-1], angles[-1]), 1e-12)
    page.wait_for_function("document.getElementById('status').textContent.includes('ended')")


def test_a_loop_that_is_faster_than_the_page_shows_the_newest(small_robot: Robot, window: Window) -> None:
    motion = drive(small_robot, duration=2.0, dt=0.001)
    with LiveViewer(small_robot) as viewer:
        page = window.open(viewer.url)
        for q in motion.q:
            viewer.display(q)
        last = float(motion.q[-1, 0])
        page.wait_for_function(f"Math.abs(nmm.node('/nmm/motion 0/robot/x').position.x - {last!r}) < 1e-12")
        assert page.evaluate("viewer.num_messages_received") < len(motion.q)
        assert_same(
            drawn_visuals(page), expected_visuals(small_robot, motion.q[-1], wheel_angles(motion)[-1]), 1e-9
        )
