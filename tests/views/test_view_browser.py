"""`nmm view` in a real browser: the sliders move the robot to where Pinocchio says."""

from __future__ import annotations

import signal
from contextlib import AbstractContextManager
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from command_line import process
from gripping import folding
from playback_browser import (
    PROJECT,
    UPRIGHT,
    WALK,
    Window,
    assert_same,
    draw_frames,
    drawn_visuals,
    expected_visuals,
)
from playback_browser import browser as browser
from playback_browser import empty_page as empty_page
from playback_browser import window as window
from playback_robot import hand_built_robot
from playwright.sync_api import Page
from ports import MOST, free_port, listening, served

import nmm
from nmm.model.robots.robot import Robot
from nmm.plugins.live.viewer import asked_for
from nmm.views.playback import view
from nmm.views.playback.extent import corners
from nmm.views.playback.rolling import Rolling


@pytest.fixture(scope="module", params=["hand-built", "unicycle_3r", "folding", "car_base"])
def robot(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Robot:
    if request.param == "hand-built":  # with skew axes, and a joint that slides
        return hand_built_robot(tmp_path_factory.mktemp("robot"))
    if request.param == "folding":  # with a joint that follows another
        return folding()
    return nmm.load(request.param)


@pytest.fixture(scope="module")
def robot_3r() -> Robot:
    return nmm.load("unicycle_3r")


def shown(robot: Robot, **options: object) -> AbstractContextManager[str]:
    """The address of a robot that is shown."""
    return served(view, robot, **options)


def slide(page: Page, name: str, fraction: float) -> float:
    """Move a slider as a user's hand does, to a fraction of its way; returns its value."""
    slider = page.locator(f'input[data-name="{name}"]')
    value: float = slider.evaluate(
        """(slider, fraction) => {
          slider.value = Number(slider.min) + fraction * (slider.max - slider.min);
          slider.dispatchEvent(new Event("input"));
          return Number(slider.value);
        }""",
        fraction,
    )
    return value


def drawn_frames(page: Page) -> dict[str, np.ndarray]:
    """World placement of each frame's node, by the frame's name."""
    matrices = page.evaluate(WALK)
    paths = page.evaluate("nmm.frames.list.map(({ name, path }) => [name, path])")
    return {name: UPRIGHT.T @ np.reshape(matrices[path], (4, 4)).T for name, path in paths}


def expected_frames(robot: Robot, q: np.ndarray) -> dict[str, np.ndarray]:
    data = robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, q)
    return {name: data.oMf[robot.frame_id(name)].homogeneous for name in robot.frames}


def test_sliders_move_every_joint_to_where_pinocchio_says(robot: Robot, window: Window) -> None:
    rng = np.random.default_rng(8)
    with shown(robot) as url:
        page = window.open(url)
        sliders = page.locator("input[data-name]").evaluate_all("all => all.map((one) => one.dataset.name)")
        names = [robot.q_names[i] for i in robot.following.independent]
        assert sliders == names
        angles = Rolling(robot).settled(robot.rest)  # wheels and swivels stay
        assert_same(drawn_visuals(page), expected_visuals(robot, robot.rest, angles))
        for _ in range(3):
            q = robot.q({name: slide(page, name, rng.uniform()) for name in names})
            assert_same(drawn_visuals(page), expected_visuals(robot, q, angles), 1e-6)
            drawn, expected = drawn_frames(page), expected_frames(robot, q)
            for name in ("x", "y"):
                expected.pop(name, None)
            assert_same(drawn, {name: expected[name] for name in drawn}, 1e-6)
            assert drawn.keys() == expected.keys()
        page.locator("#rest").click()
        assert_same(drawn_visuals(page), expected_visuals(robot, robot.rest, angles), 1e-12)


def test_sliders_end_at_the_limits_and_show_what_they_are_at(window: Window, tmp_path: Path) -> None:
    robot = nmm.load("car_base")
    with shown(robot) as url:
        page = window.open(url)
        slider = page.locator('input[data-name="steering"]')
        lower, upper = robot.q_limits[3]
        assert float(slider.get_attribute("min") or "nan") == pytest.approx(lower)
        assert float(slider.get_attribute("max") or "nan") == pytest.approx(upper)
        theta = page.locator('input[data-name="theta"]')
        assert float(theta.get_attribute("max") or "nan") == pytest.approx(np.pi)
        value = slide(page, "steering", 0.75)
        assert value == pytest.approx(0.3)
        row = page.locator("label.coordinate", has=slider)
        assert row.locator("output").inner_text() == "17.2° · 0.300 rad"
        assert slider.get_attribute("aria-valuetext") == "17.2° · 0.300 rad"
        slide(page, "x", 1.0)
        row = page.locator("label.coordinate", has=page.locator('input[data-name="x"]'))
        assert row.locator("output").inner_text().endswith(" m")


def test_the_keyboard_moves_a_slider(robot_3r: Robot, window: Window) -> None:
    with shown(robot_3r) as url:
        page = window.open(url)
        slider = page.locator('input[data-name="q2"]')
        slider.focus()
        page.keyboard.press("ArrowRight")
        first = float(slider.input_value())
        assert first > 0.0
        page.keyboard.press("ArrowLeft")
        page.keyboard.press("ArrowLeft")
        assert float(slider.input_value()) == pytest.approx(-first)
        page.keyboard.press("End")
        assert float(slider.input_value()) == pytest.approx(np.pi)
        q = robot_3r.q({"q2": np.pi})
        angles = Rolling(robot_3r).settled(q)
        assert_same(drawn_visuals(page), expected_visuals(robot_3r, q, angles))
        page.keyboard.press("Tab")
        assert page.evaluate("document.activeElement.dataset.name") == "q3"


def test_the_pose_of_a_frame_is_told(robot_3r: Robot, window: Window) -> None:
    with shown(robot_3r) as url:
        page = window.open(url)
        assert page.locator("#posed").input_value() == "ee"
        values = {name: slide(page, name, 0.5 + 0.11 * k) for k, name in enumerate(robot_3r.q_names, -2)}
        q = robot_3r.q(values)
        for frame in ("ee", "link2", "base_link"):
            page.locator("#posed").select_option(frame)
            placement = pin.SE3(expected_frames(robot_3r, q)[frame])
            told = page.evaluate(f"nmm.frames.pose({frame!r})")
            np.testing.assert_allclose(told["position"], placement.translation, atol=1e-9)
            np.testing.assert_allclose(told["rpy"], pin.rpy.matrixToRpy(placement.rotation), atol=1e-9)
            cells = page.locator("#pose dd").all_inner_texts()
            assert [float(cell.rstrip(" m°")) for cell in cells] == pytest.approx(
                [*placement.translation, *np.degrees(pin.rpy.matrixToRpy(placement.rotation))], abs=6e-3
            )


def visible_names(page: Page) -> set[str]:
    draw_frames(page)  # names follow the picture
    return set(page.locator("#labels span:visible").all_inner_texts())


def test_frames_are_shown_and_hidden_by_name(robot_3r: Robot, window: Window) -> None:
    window.page.set_viewport_size({"width": 1000, "height": 640})
    with shown(robot_3r) as url:
        page = window.open(url)
        kept, first = {"base_footprint", "ee"}, {"base_footprint", "link1", "link2", "link3", "ee"}
        assert visible_names(page) == kept
        joint = page.evaluate("""() => {
          const { path } = nmm.frames.list.find(({ name }) => name === "link2");
          const at = new MeshCat.THREE.Vector3().setFromMatrixPosition(nmm.node(path).matrixWorld);
          const { x, y } = at.project(viewer.camera);
          const { clientWidth, clientHeight } = document.getElementById("view");
          return [0.5 * (1 + x) * clientWidth, 0.5 * (1 - y) * clientHeight];
        }""")
        page.mouse.move(*joint)
        assert visible_names(page) == kept | {"link2"}
        page.mouse.move(joint[0], 600)
        page.locator("#names").click()
        assert visible_names(page) == first
        page.locator("#frames summary").click()
        page.locator('input[data-frame="gripper"]').check()
        page.locator('input[data-frame="link1"]').uncheck()
        assert visible_names(page) == (first | {"gripper"}) - {"link1"}
        page.locator("#names").click()
        assert visible_names(page) == kept | {"gripper"}
        page.locator("#triads").click()
        assert visible_names(page) == set()
        assert not page.evaluate("nmm.frames.list.some(({ triad }) => triad && triad.visible)")
        page.locator("#triads").click()
        page.get_by_role("button", name="at first").click()
        page.locator("#names").click()
        assert visible_names(page) == first
        listed = page.locator("input[data-frame]").evaluate_all("all => all.map((one) => one.dataset.frame)")
        assert listed == [name for name in robot_3r.frames if name not in ("x", "y")]
    with shown(robot_3r, frames=False) as url:
        page = window.open(url)
        assert page.locator("#triads").get_attribute("aria-pressed") == "false"
        assert visible_names(page) == set()


@pytest.mark.parametrize("width", [1100, 420])
@pytest.mark.parametrize("file", ["tiago_description/robots/tiago.urdf", "pr2_description/urdf/pr2.urdf"])
def test_names_lie_neither_on_one_another_nor_on_the_tools(window: Window, file: str, width: int) -> None:
    """Robots with many frames: those named at first, and all of them."""
    window.page.set_viewport_size({"width": width, "height": 800})
    with shown(nmm.load(f"package://example-robot-data/robots/{file}")) as url:
        page = window.open(url)
        few = len(visible_names(page))
        assert 2 <= few <= 5
        for asked in (False, True):
            if asked:
                page.locator("#names").click()
                assert len(visible_names(page)) > 2 * few
            boxes = page.locator("#tools, #heading, #labels span:visible").evaluate_all(
                """all => all.map((one) => one.getBoundingClientRect())
                             .map(({ left, top, right, bottom }) => [left, top, right, bottom])"""
            )
            view_width = page.evaluate("document.getElementById('view').clientWidth")
            for i, (left, top, right, bottom) in enumerate(boxes):
                assert left >= 0
                assert right <= view_width
                for other in boxes[:i]:
                    assert right <= other[0] or other[2] <= left or bottom <= other[1] or other[3] <= top


@pytest.mark.parametrize("size", [(1280, 800), (800, 900), (420, 760)])
def test_the_robot_is_in_the_picture_also_after_it_moved(
    robot_3r: Robot, window: Window, size: tuple[int, int]
) -> None:
    window.page.set_viewport_size({"width": size[0], "height": size[1]})
    with shown(robot_3r) as url:
        page = window.open(url)
        for values in ({}, {"x": 2.0, "y": -3.0, "theta": 1.0, "q2": 1.5, "q3": -0.3}):
            q = robot_3r.q(values)
            page.evaluate("(values) => nmm.joints.set(values)", values)
            page.locator("#reset").click()
            placements = expected_visuals(robot_3r, q, Rolling(robot_3r).settled(q)).values()
            points = []
            for placement, geometry in zip(placements, robot_3r.visual_model.geometryObjects, strict=True):
                geometry.geometry.computeLocalAABB()
                box = geometry.geometry.aabb_local
                local = corners(np.array([box.min_, box.max_]))
                points += (local @ placement[:3, :3].T + placement[:3, 3]).tolist()
            assert np.abs(page.evaluate(PROJECT, points)).max() < 1.0


def test_what_a_scenario_asks_for_is_in_the_picture(window: Window) -> None:
    """The target with its obstacle, which are metres away, and a path."""
    window.page.set_viewport_size({"width": 1280, "height": 800})
    for name in ("unicycle_3r_crossing", "unicycle_2r_position"):
        scenario = nmm.Scenario.load(name)
        robot = scenario.robot()
        asked = asked_for(scenario, robot)
        points = [one for one in (asked.desired, asked.target) if one is not None]
        with shown(robot, q=asked.q[0], beside=asked) as url:
            page = window.open(url)
            assert np.abs(page.evaluate(PROJECT, np.vstack(points).tolist()))[:, :2].max() < 1.0
            assert page.evaluate("nmm.camera.held().length") > 8


def test_the_camera_comes_along_where_the_arm_bends_out_of_the_picture(
    robot_3r: Robot, window: Window
) -> None:
    """Unless somebody has moved it."""
    window.page.set_viewport_size({"width": 1280, "height": 800})
    outside = """() => {
      viewer.camera.updateMatrixWorld();
      return nmm.camera.held().some((p) => {
        const { x, y } = p.project(viewer.camera);
        return Math.abs(x) > 1 || Math.abs(y) > 1;
      });
    }"""
    with shown(robot_3r) as url:
        page = window.open(url)
        page.evaluate("nmm.joints.set({ q2: -1.4, q3: 0 })")  # folded, and so fitted
        page.locator("#reset").click()
        distance = "viewer.camera.position.distanceTo(nmm.viewer.controls.target)"
        near = page.evaluate(distance)
        slider = page.locator('input[data-name="q2"]')
        for angle in (-0.7, 0.0, 0.8, 1.5):
            slider.fill(str(angle))
            assert not page.evaluate(outside)
        assert page.evaluate(distance) > near
        page.evaluate("nmm.joints.set({ q2: -1.4 })")
        page.locator("#reset").click()
        page.evaluate("nmm.camera.moved = true")
        placed = page.evaluate("nmm.camera.place()")
        slider.fill("1.5")
        np.testing.assert_allclose(page.evaluate("nmm.camera.place()"), placed, atol=1e-9)
        assert page.evaluate(outside)


def test_numbers_and_ellipsoid_follow_the_sliders(robot_3r: Robot, window: Window) -> None:
    def answered() -> None:
        page.wait_for_function("nmm.task.asked > 0 && nmm.task.answered === nmm.task.asked")

    def node(path: str) -> np.ndarray:
        return np.asarray(UPRIGHT.T @ np.reshape(page.evaluate(WALK)[path], (4, 4)).T)

    with shown(robot_3r, task=nmm.Position("ee")) as url:
        page = window.open(url)
        cell = page.locator('[data-value="robot sigma_min"]')
        assert cell.inner_text() == "0"
        assert page.locator("#lost").inner_text() == "Lost: no input gives motion of ee along z."
        rng = np.random.default_rng(2)
        for _ in range(3):
            q = robot_3r.q({name: slide(page, name, rng.uniform(0.2, 0.8)) for name in robot_3r.q_names})
            page.evaluate("nmm.joints.set({})")  # one more question, after the last slider's
            draw_frames(page)
            answered()
            data = robot_3r.model.createData()
            frame = robot_3r.frame_id("ee")
            J = pin.computeFrameJacobian(robot_3r.model, data, q, frame, pin.LOCAL_WORLD_ALIGNED)[:3]
            J = J @ robot_3r.S(q)
            values = np.linalg.svd(J, compute_uv=False)
            assert float(cell.inner_text()) == pytest.approx(values[-1], rel=1e-3)
            volume = page.locator('[data-value="robot manipulability"]').inner_text()
            assert float(volume) == pytest.approx(np.sqrt(np.linalg.det(J @ J.T)), rel=1e-3)
            drawn = node("/nmm/task 0/robot")
            np.testing.assert_allclose(drawn[:3, 3], expected_frames(robot_3r, q)["ee"][:3, 3], atol=1e-6)
            radii = np.linalg.svd(drawn[:3, :3], compute_uv=False)
            # A flat one keeps 1.2 % of its largest radius.
            np.testing.assert_allclose(radii / radii[0], np.maximum(values / values[0], 0.012), atol=1e-5)
        page.locator("#rest").click()
        page.wait_for_function("nmm.task.answer.state === 'lost'")
        # The arrow is upright, at the end of the arm, and in the picture.
        arrow = "nmm.node('/nmm/lost/0').children[0].matrixWorld.elements"
        draw_frames(page)
        placed = UPRIGHT.T @ np.reshape(page.evaluate(arrow), (4, 4)).T
        np.testing.assert_allclose(np.abs(placed[:3, 2]), [0.0, 0.0, 1.0], atol=1e-6)
        np.testing.assert_allclose(
            placed[:3, 3], expected_frames(robot_3r, robot_3r.q())["ee"][:3, 3], atol=1e-6
        )
        page.locator("#reset").click()
        ends = [placed[:3, 3] + sign * 0.2 * placed[:3, 2] for sign in (1.0, -1.0)]
        assert np.abs(page.evaluate(PROJECT, np.array(ends).tolist())).max() < 1.0
        page.locator("#ellipsoids").click()
        assert not page.evaluate("nmm.ellipsoids.some((group) => group.visible)")


def test_the_command_shows_a_robot_until_it_is_interrupted(window: Window, tmp_path: Path) -> None:
    port = free_port()
    viewer = process(tmp_path, "view", "unicycle_2r", "--no-open", "--port", str(port), "--lock", "q1=pi/2")
    assert viewer.stdout is not None
    assert f"http://127.0.0.1:{port}/" in viewer.stdout.readline()
    assert listening()[port] == "0100007F"
    page = window.open(f"http://127.0.0.1:{port}/")
    assert page.locator("input[data-name]").evaluate_all("all => all.map((one) => one.dataset.name)") == [
        "x", "y", "theta", "q2",
    ]  # fmt: skip
    q2 = slide(page, "q2", 0.9)
    locked = nmm.load("unicycle_2r", lock={"q1": np.pi / 2})
    angles = Rolling(locked).settled(locked.q())
    assert_same(drawn_visuals(page), expected_visuals(locked, locked.q({"q2": q2}), angles))
    viewer.send_signal(signal.SIGINT)
    _, err = viewer.communicate(timeout=MOST)
    assert (viewer.returncode, err) == (0, "")
    assert port not in listening()
