"""Playback in a real browser: everything stands where Pinocchio says, in the file and live."""

from __future__ import annotations

import signal
from dataclasses import dataclass, replace
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
    draw_frames,
    drawn_visuals,
    expected_visuals,
    file_url,
    watched,
)
from playback_browser import browser as browser
from playback_browser import empty_page as empty_page
from playback_browser import small_robot as small_robot
from playback_browser import window as window
from playback_robot import drive, hand_built_robot
from playwright.sync_api import Page
from ports import MOST, listening, start_player

import nmm
from nmm.model.robots.configuration import Configuration
from nmm.model.robots.robot import Robot
from nmm.views.playback import LiveViewer, Motion
from nmm.views.playback.ellipsoids import CLOSE, THINNEST, EllipsoidOptions
from nmm.views.playback.extent import corners, robot_boxes
from nmm.views.playback.keyframes import ghost_samples, ghost_times, keyframes
from nmm.views.playback.placements import Placements
from nmm.views.playback.rolling import wheel_angles

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


@dataclass
class Opened:
    """What a file showed of a motion: as it opened, at some frames, beyond its end, and its shapes' boxes."""

    motion: Motion
    time: str
    at_first: dict[str, np.ndarray]
    at_frame: dict[int, dict[str, np.ndarray]]
    beyond: dict[str, np.ndarray]
    boxes: dict[str, np.ndarray]


@pytest.fixture(scope="module")
def opened(robot: Robot, empty_page: Page, tmp_path_factory: pytest.TempPathFactory) -> Opened:
    motion = drive(robot)
    t = keyframes(motion).t
    with watched(empty_page) as window:
        page = window.open(file_url([motion], tmp_path_factory.mktemp("file")))
        # As it opens, paused at the start, before anybody touches it.
        time, at_first = page.locator("#time").inner_text(), drawn_visuals(page)

        def drawn_at(time: float) -> dict[str, np.ndarray]:
            page.evaluate(f"nmm.player.seek({time!r})")
            return drawn_visuals(page)

        # The browser's animations keep time in single precision.
        at_frame = {k: drawn_at(float(np.float32(t[k]))) for k in (60, 7, len(t) // 2, len(t) - 1, 0, 200)}
        boxes = {path.split("/")[-1]: np.array(box) for path, box in page.evaluate(BOXES).items()}
        return Opened(motion, time, at_first, at_frame, drawn_at(1e9), boxes)


def test_every_visual_is_where_pinocchio_says(robot: Robot, opened: Opened) -> None:
    motion, frames = opened.motion, keyframes(opened.motion)
    assert opened.time == "0.00 / 4.00 s"
    assert_same(opened.at_first, expected_visuals(robot, frames.q[0], frames.wheels[0]))
    for k, drawn in opened.at_frame.items():
        assert_same(drawn, expected_visuals(robot, frames.q[k], frames.wheels[k]))
    assert_same(opened.beyond, expected_visuals(robot, motion.q[-1], wheel_angles(motion)[-1]))


def test_every_visual_fills_the_room_that_its_shape_fills(robot: Robot, opened: Opened) -> None:
    assert len(opened.boxes) == len(robot.visual_model.geometryObjects)
    for i, geometry in enumerate(robot.visual_model.geometryObjects):
        shape = geometry.geometry
        shape.computeLocalAABB()
        expected = np.array([shape.aabb_local.min_, shape.aabb_local.max_])
        # Round things have forty flat sides.
        close = 0.004 * np.ptp(expected, axis=0).max()
        box = opened.boxes[f"visual {i} {geometry.name.replace('/', '_')}"]
        np.testing.assert_allclose(box, expected, atol=close, err_msg=geometry.name)


CORNERS = """([at, within]) => {
  viewer.scene.updateMatrixWorld(true);
  const inverse = nmm.node(within).matrixWorld.clone().invert();
  const found = [];
  const parts = nmm.split(at).length > nmm.split(within).length ? [nmm.node(at)]
    : nmm.node(at).children.filter((child) => child.name.startsWith("visual "));
  for (const one of parts) one.traverse((part) => {
    if (!part.isMesh) return;
    const points = part.geometry.attributes.position;
    for (let i = 0; i < points.count; i++) {
      const point = new MeshCat.THREE.Vector3().fromBufferAttribute(points, i);
      found.push(point.applyMatrix4(part.matrixWorld).applyMatrix4(inverse).toArray());
    }
  });
  return found;
}"""


CALLS = "viewer.renderer.render(viewer.scene, viewer.camera), viewer.renderer.info.render.calls"


#: How opaque each pixel of the picture is, 0 to 255.
OPACITIES = """() => {
  viewer.renderer.render(viewer.scene, viewer.camera);
  const gl = viewer.renderer.getContext();
  const [width, height] = [gl.drawingBufferWidth, gl.drawingBufferHeight];
  const pixels = new Uint8Array(4 * width * height);
  gl.readPixels(0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
  return [...pixels.filter((_, i) => i % 4 === 3)];
}"""


def test_ghosts_stand_where_the_robot_passes(small_robot: Robot, window: Window, tmp_path: Path) -> None:
    """With every corner of every part; a copy is drawn in two passes, however many joints it has."""
    motion = drive(small_robot)
    page = window.open(file_url([motion], tmp_path, ghosts=4))
    samples = ghost_samples(motion, 4)
    assert len(samples) == 4
    paths = [f"/nmm/motion 0/robot/{'/'.join(names)}" for names in _joints_above(small_robot)]
    parts = [np.reshape(page.evaluate(CORNERS, [path, path]), (-1, 3)) for path in paths]
    for k, sample in enumerate(samples):
        world = Placements(small_robot).world(motion.q[sample], wheel_angles(motion)[sample])
        expected = [part @ place[:3, :3].T + place[:3, 3] for part, place in zip(parts, world, strict=True)]
        drawn = np.array(page.evaluate(CORNERS, [f"/nmm/motion 0/ghosts/{k}/robot", "/nmm"]))
        np.testing.assert_allclose(drawn, np.vstack([*expected, *expected]), atol=1e-6)
    page.evaluate("nmm.actions.grid()")  # names of axes give way to the copies' texts
    calls, opaque = page.evaluate(CALLS), np.array(page.evaluate(OPACITIES))
    page.evaluate("nmm.actions.ghosts()")
    # What is opaque stays so: else the page's ground would shine through.
    assert np.all(opaque >= page.evaluate(OPACITIES))
    assert calls - page.evaluate(CALLS) == 3 * 4  # with its text
    shown = page.evaluate("nmm.ghosts[0].children.map((copy) => copy.children.map((part) => part.name))")
    assert [sorted(names) for names in shown] == [["robot", "text"]] * 4


def test_copies_of_large_meshes_are_coarse_and_where_the_robot_is(window: Window, tmp_path: Path) -> None:
    """TIAGo's: at most 4,000 triangles, within 3 cm of its own box; of two runs at one place, one's."""
    robot = nmm.load("package://example-robot-data/robots/tiago_description/robots/tiago_no_hand.urdf")
    q = np.tile(robot.rest, (61, 1))
    q[:, 0] = np.linspace(0.0, 6.0, 61)
    motion = Motion(robot, np.linspace(0.0, 6.0, 61), q, np.zeros((61, robot.n_u)), label="RG")
    page = window.open(file_url([motion, replace(motion, label="PG")], tmp_path))
    page.evaluate("nmm.player.seek(3)")  # a copy gives way to a robot
    draw_frames(page)
    copies = page.evaluate(
        """() => nmm.ghosts.map((run) => run.children.filter(({ visible }) => visible).map((copy) => {
             const { index, boundingBox } = copy.children[0].children[0].children[0].geometry;
             return [index.count / 3, boundingBox.min.toArray(), boundingBox.max.toArray()];
           }))"""
    )
    assert [len(run) for run in copies] == [4, 0]
    for k, (count, *box) in enumerate(copies[0]):
        assert 500 < count <= 4000
        sample = ghost_times(0.0, 6.0, motion.t, robot_boxes(robot, q, wheel_angles(motion)))[k]
        expected = robot_boxes(robot, q[[round(10 * sample)]], wheel_angles(motion)[:1])[0]
        np.testing.assert_allclose(box, expected, atol=0.03)
    page.evaluate("nmm.apart.set(1)")
    draw_frames(page)
    shown = "nmm.ghosts.map((run) => run.children.filter(({ visible }) => visible).length)"
    assert page.evaluate(shown) == [4, 4]


def _joints_above(robot: Robot) -> list[list[str]]:
    """The names of each joint of the display model and of those above it, the first one first."""
    model = robot.display_model
    found: list[list[str]] = [[]]
    for joint in range(1, model.njoints):
        found.append([*found[model.parents[joint]], model.names[joint]])
    return found[1:]


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


# Ellipsoids

#: m of drawing for each m/s
SCALE = 0.25


def velocities(robot: Robot, q: np.ndarray, part: str) -> np.ndarray:
    """J_v of the end-effector, the columns of the arm's inputs or of all, drawn to scale."""
    first = robot.platform.p if part == "arm" else 0
    J = Configuration(robot, q).jacobian("ee")[:3] @ robot.S(q)
    return np.asarray(SCALE * J[:, first:])


def stretch(matrix: np.ndarray, least: float) -> np.ndarray:
    """The symmetric matrix that makes a ball into the ellipsoid of A Aᵀ, with radii of at least `least`."""
    U, radii, _ = np.linalg.svd(np.hstack([matrix, np.zeros((3, 3))]), full_matrices=False)
    return np.asarray((U * np.maximum(radii, least)) @ U.T)


def drawn_ellipsoid(page: Page, motion: int, part: str) -> tuple[np.ndarray, np.ndarray]:
    """Centre, and the matrix of `stretch`, of what the page shows."""
    matrix = page.evaluate(WALK)[f"/nmm/motion {motion}/ellipsoids/{part}"]
    place = UPRIGHT.T @ np.reshape(matrix, (4, 4)).T
    assert np.linalg.det(place[:3, :3]) > 0.0
    return place[:3, 3], stretch(place[:3, :3], 0.0)


@pytest.mark.parametrize("name", ["hand-built", "unicycle_2r"])
def test_ellipsoids_are_those_of_the_jacobian(name: str, window: Window, tmp_path: Path) -> None:
    robot = hand_built_robot(tmp_path) if name == "hand-built" else nmm.load(name)
    first = drive(robot, label="RG")
    second = Motion(robot, first.t, first.q * 0.7 + 0.1, first.u, frame="ee", label="PG")
    motions = [first, second]
    page = window.open(file_url(motions, tmp_path, ellipsoids=EllipsoidOptions(scale=SCALE)))
    frames = [keyframes(motion) for motion in motions]
    largest = max(
        float(np.linalg.norm(velocities(robot, q, part), 2))
        for frame in frames
        for q in frame.q
        for part in ("robot", "arm")
    )
    least = THINNEST * largest
    count = len(frames[0])
    assert np.array_equal(frames[0].t, frames[1].t)
    for at in (0.0, 60, 7, count - 1, 17.5, 101.3, 0.4):
        now = float(np.float32(np.interp(at, np.arange(count), frames[0].t)))
        page.evaluate(f"nmm.player.seek({now!r})")
        for i, frame in enumerate(frames):
            q = np.array([np.interp(now, frame.t, column) for column in frame.q.T])
            center = Configuration(robot, q).placement("ee").translation
            for part in ("robot", "arm"):
                drawn = drawn_ellipsoid(page, i, part)
                # At a frame as exact as single precision, between two as close as was promised.
                close = 2e-6 if at == int(at) else CLOSE * largest
                np.testing.assert_allclose(drawn[0], center, atol=close)
                np.testing.assert_allclose(drawn[1], stretch(velocities(robot, q, part), least), atol=close)
    # What the planar robot cannot do is drawn as thin as that.
    flat = np.linalg.eigvalsh(drawn_ellipsoid(page, 0, "robot")[1])
    assert (flat[0] == pytest.approx(least, rel=1e-4)) == (name == "unicycle_2r")


def test_ellipsoids_are_shown_hidden_and_in_the_picture(
    small_robot: Robot, window: Window, tmp_path: Path
) -> None:
    motions = [drive(small_robot, label=label) for label in ("RG", "PG")]
    window.page.set_viewport_size({"width": 900, "height": 600})
    page = window.open(file_url(motions, tmp_path, ellipsoids=EllipsoidOptions(scale=1.5)))
    groups = [f"/nmm/motion {i}/ellipsoids" for i in range(2)]

    def shown(path: str) -> bool:
        return bool(page.evaluate(f"nmm.node({path!r}).visible"))

    button = page.locator("#ellipsoids")
    button.click()
    assert button.get_attribute("aria-pressed") == "false"
    assert [shown(group) for group in groups] == [False, False]
    page.keyboard.press("e")
    assert [shown(group) for group in groups] == [True, True]
    legend = page.locator("#legend")
    assert "1 m/s is drawn as 1.5 m" in legend.inner_text()
    legend.get_by_text("arm alone").click()
    assert [shown(f"{group}/{part}") for group in groups for part in ("robot", "arm")] == [True, False] * 2
    legend.get_by_text("arm alone").click()
    assert shown(f"{groups[1]}/arm")
    # A motion's own entry takes its ellipsoids along.
    legend.get_by_text("PG", exact=True).click()
    assert not shown("/nmm/motion 1")
    for fraction in (0.0, 0.4, 1.0):
        page.evaluate(f"nmm.player.seek({fraction} * nmm.stage.duration)")
        center, reach = drawn_ellipsoid(page, 0, "robot")
        ends = np.vstack([center + reach @ d for d in np.vstack([np.eye(3), -np.eye(3)])])
        assert np.abs(np.array(page.evaluate(PROJECT, ends.tolist()))).max() < 1.0
    page = window.open(file_url([motions[0]], tmp_path))
    assert not page.locator("#ellipsoids").is_visible()
    assert page.evaluate("nmm.ellipsoids") is None


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
        process.communicate(timeout=MOST)
        assert port not in listening()
        # What it got, it can go on playing.
        page.evaluate("nmm.player.seek(0.5)")
        assert page.locator("#time").inner_text() == "0.50 / 1.00 s"


@pytest.mark.parametrize("robot", ["hand-built", "trailer_base", "omni_base"], indirect=True)
def test_a_loop_moves_the_robot_in_the_page(robot: Robot, window: Window) -> None:
    """With swivels, trailers and rollers; what a page draws is tried with all robots above."""
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
