"""Robots set apart, where to look from, what stands around: the page in a real browser."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from playback_browser import PROJECT, SIZE, UPRIGHT, WALK, Window, draw_frames, file_url
from playback_browser import browser as browser
from playback_browser import empty_page as empty_page
from playback_browser import small_robot as small_robot
from playback_browser import window as window
from playback_robot import drive, hand_built_robot

from nmm.model.robots.robot import Robot
from nmm.views.playback import Motion, Surroundings
from nmm.views.playback.extent import corners, robot_boxes
from nmm.views.playback.rolling import wheel_angles


@pytest.fixture(scope="module")
def robot(tmp_path_factory: pytest.TempPathFactory) -> Robot:
    return hand_built_robot(tmp_path_factory.mktemp("robot"))


def test_robots_are_set_apart_with_their_paths(robot: Robot, window: Window, tmp_path: Path) -> None:
    """By a slider or the address; what is shared goes along, and nothing else of the motion changes."""
    first = drive(robot, label="RG")
    goal, path = np.array([1.0, 2.0, 0.5]), np.column_stack([first.q[:, :2], np.ones(len(first.q))])
    motions = [
        Motion(robot, first.t, first.q, first.u, frame="ee", label=name, target=goal, desired=path)
        for name in ("RG", "PG", "EJ")
    ]
    page = window.open(file_url(motions, tmp_path))
    places = "() => nmm.motions.map(({ path }) => nmm.node(path).position.toArray())"
    assert np.all(np.array(page.evaluate(places)) == 0.0)
    before = page.evaluate(WALK)
    page.evaluate("nmm.apart.set(1)")
    draw_frames(page)
    moved = np.array(page.evaluate(places))
    np.testing.assert_allclose(moved[2], 2.0 * moved[1], atol=1e-12)
    assert np.count_nonzero(moved[1]) == 1
    boxes = corners(robot_boxes(robot, first.q, wheel_angles(first))).reshape(-1, 3)
    way = int(np.argmax(np.abs(moved[1])))
    assert abs(moved[1, way]) >= np.ptp(boxes[:, way])  # beside one another, not into one another
    after = page.evaluate(WALK)
    for i in range(3):
        for path in (p for p in before if p.startswith(f"/nmm/motion {i}/robot")):
            old, new = (np.array(tree[path]).reshape(4, 4).T for tree in (before, after))
            way_gone = (UPRIGHT.T @ (new - old))[:3, 3]
            np.testing.assert_allclose(way_gone, moved[i], atol=1e-9)
    shown = page.evaluate(
        """() => [1, 2].map((i) => nmm.node(`/nmm/apart ${i}`))
          .map((node) => [node.children[0].children.length, node.position.toArray()])"""
    )
    assert [count for count, _ in shown] == [2, 2]  # the desired path and the target
    np.testing.assert_allclose([place for _, place in shown], moved[1:], atol=1e-12)
    page.evaluate("nmm.address.write()")
    assert "apart=1" in page.url
    page.get_by_label("Apart").fill("0")
    assert np.all(np.array(page.evaluate(places)) == 0.0)
    assert not page.evaluate("nmm.node('/nmm/apart 1').visible")


def test_a_run_that_is_hidden_takes_its_own_copies_along(
    robot: Robot, window: Window, tmp_path: Path
) -> None:
    """Set apart, each has a desired path and a target of its own; over one another they share them."""
    first = drive(robot, label="RG")
    goal, path = np.array([1.0, 2.0, 0.5]), np.column_stack([first.q[:, :2], np.ones(len(first.q))])
    motions = [
        Motion(robot, first.t, first.q, first.u, frame="ee", label=name, target=goal, desired=path)
        for name in ("RG", "PG", "EJ")
    ]
    page = window.open(file_url(motions, tmp_path))
    # Drawn, node by node: the shared ones, then each copy's; then all dashes, by their own button.
    drawn = """() => {
      const seen = (object) => !object || (object.visible && seen(object.parent));
      const dashes = (path) => {
        const found = [];
        nmm.node(path).traverse((part) => part.isMesh && found.push(seen(part)));
        return found;
      };
      return ["/nmm/desired 0", "/nmm/apart 1", "/nmm/apart 2"].map((path) => {
        const all = dashes(path);
        return [all.some(Boolean), all.every(Boolean)];
      });
    }"""
    both, none, target = [True, True], [False, False], [True, False]
    page.evaluate("nmm.apart.set(1)")
    assert page.evaluate(drawn) == [both, both, both]
    for i in range(3):
        page.locator("#legend button").nth(i).click()
        assert page.evaluate(drawn) == [none if k == i else both for k in range(3)]
        page.locator("#legend button").nth(i).click()
    page.locator("#paths").click()
    assert page.evaluate(drawn) == [none, target, target]  # the targets are no paths
    page.locator("#paths").click()
    page.locator("#legend button").first.click()
    page.evaluate("nmm.apart.set(0)")
    assert page.evaluate(drawn) == [both, none, none]  # those of the others, too


def test_one_robot_is_not_set_apart(small_robot: Robot, window: Window, tmp_path: Path) -> None:
    page = window.open(file_url([drive(small_robot)], tmp_path) + "#apart=1")
    assert not page.get_by_label("Apart").is_visible()
    assert page.evaluate("nmm.apart.share") == 0


def test_grid_and_axes_are_hidden_by_button_key_and_address(
    small_robot: Robot, window: Window, tmp_path: Path
) -> None:
    url = file_url([drive(small_robot)], tmp_path)
    page = window.open(url)
    shown = "() => [...new Set(nmm.scenery.measures.map((one) => one.visible))]"
    assert page.evaluate(shown) == [True]
    page.locator("#grid").click()
    assert page.evaluate(shown) == [False]
    page.keyboard.press("x")
    assert page.evaluate(shown) == [True]
    window.open(url + "#grid=off")
    assert page.evaluate(shown) == [False]
    assert page.locator("#grid").get_attribute("aria-pressed") == "false"
    window.open(url + "#ghosts=off&paths=off")
    assert page.evaluate("nmm.address.text()").count("=off") == 2
    # A slider that has the focus has its own keys, and no more.
    page.locator("#slider").evaluate("slider => slider.focus()")
    page.keyboard.press("p")
    assert "paths" not in page.evaluate("nmm.address.text()")


@pytest.mark.parametrize("angle", [0.0, 0.7, 2.5])
def test_from_the_wall_one_looks_along_the_normal_of_its_path(
    robot: Robot, window: Window, tmp_path: Path, angle: float
) -> None:
    """The wall is behind the path as one sees it from the robot."""
    motion = drive(robot)
    turn = np.linspace(0.0, 2.0 * np.pi, 60)
    along, normal = np.array([np.cos(angle), np.sin(angle)]), np.array([-np.sin(angle), np.cos(angle)])
    middle = motion.q[:, :2].mean(axis=0) + 5.0 * normal
    circle = np.column_stack([middle + np.cos(turn)[:, None] * along, 1.0 + np.sin(turn)])
    page = window.open(
        file_url([Motion(robot, motion.t, motion.q, motion.u, label="wall", desired=circle)], tmp_path)
        + "#view=wall"
    )
    assert page.locator("#from").input_value() == "wall"
    gaze = np.array(
        page.evaluate("viewer.camera.getWorldDirection(new MeshCat.THREE.Vector3()).toArray()")
    ) @ np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])
    assert gaze[:2] @ normal / np.linalg.norm(gaze[:2]) > 0.999


def test_names_and_ghosts_texts_are_smaller_than_the_robot(
    robot: Robot, window: Window, tmp_path: Path
) -> None:
    page = window.open(file_url([drive(robot, label=name) for name in ("RG", "PG")], tmp_path, ghosts=3))
    for size in ((420, 800), (1280, 800)):
        page.set_viewport_size({"width": size[0], "height": size[1]})
        draw_frames(page)
        heights = page.evaluate(
            """() => {
              const found = [];
              viewer.scene.traverse((part) => part.isSprite && found.push(part.scale.y));
              const unit = document.getElementById("view").clientHeight / (2 * Math.tan(Math.PI / 10));
              return found.map((high) => high * unit);
            }"""
        )
        assert len(heights) == 3 + 2 + 6  # axes, names, ghosts
        np.testing.assert_array_less(heights, 22.01)
        np.testing.assert_array_less(14.0, heights)


#: For each text of a ghost: how far above the highest point of its own, and aside of it, and its box, px.
TEXTS = """() => {
  const view = document.getElementById("view");
  const [width, height] = [view.clientWidth, view.clientHeight];
  const seen = (p) => {
    const { x, y } = p.clone().project(viewer.camera);
    return [0.5 * (1 + x) * width, 0.5 * (1 - y) * height];
  };
  viewer.render();
  return nmm.motions.flatMap(({ path }) => [0, 1, 2, 3, 4, 5].map((k) => {
    const node = nmm.viewer.scene_tree.find(nmm.split(`${path}/ghosts/${k}`));
    let top = null;
    node.find(["robot"]).object.traverse((part) => {
      if (!part.isMesh) return;
      const { position } = part.geometry.attributes;
      for (let i = 0; i < position.count; i++) {
        const p = new MeshCat.THREE.Vector3().fromBufferAttribute(position, i).applyMatrix4(part.matrixWorld);
        if (top === null || p.y > top.y) top = p;
      }
    });
    let sprite = null;
    node.find(["text"]).object.traverse((part) => part.isSprite && (sprite = part));
    const unit = height / (2 * Math.tan((viewer.camera.fov * Math.PI) / 360));
    const [wide, high] = [sprite.scale.x * unit, sprite.scale.y * unit];
    const [x, y] = seen(new MeshCat.THREE.Vector3().setFromMatrixPosition(sprite.matrixWorld));
    const [left, bottom] = [x - sprite.center.x * wide, y + sprite.center.y * high];
    const [tx, ty] = seen(top);
    const box = [left, bottom - high, left + wide, bottom];
    return { above: ty - bottom, aside: Math.abs(left + 0.5 * wide - tx), box };
  }));
}"""


@pytest.mark.parametrize("size", [(420, 800), (1280, 800)])
@pytest.mark.parametrize("way", [0.3, 6.0])
def test_texts_of_ghosts_stand_at_their_own_and_not_on_one_another(
    robot: Robot, window: Window, tmp_path: Path, size: tuple[int, int], way: float
) -> None:
    """Copies that are far apart, and copies that are nearly at one place."""
    q = np.zeros((60, robot.n))
    q[:, 0] = np.linspace(0.0, way, 60)
    motion = Motion(robot, np.linspace(0.0, 6.0, 60), q, np.zeros((60, robot.n_u)))
    window.page.set_viewport_size({"width": size[0], "height": size[1]})
    page = window.open(file_url([motion], tmp_path, ghosts=6))
    for side in ("iso", "front", "top"):
        page.evaluate(f"nmm.camera.look('{side}')")
        found = page.evaluate(TEXTS)
        assert len(found) == 6
        cards = page.evaluate(
            """["heading", "tools", "bar"].map((id) => document.getElementById(id).getBoundingClientRect())
               .map(({ left, top, right, bottom }) => [left, top, right, bottom])"""
        )
        boxes = [*cards, *(one["box"] for one in found)]
        for i, one in enumerate(found):
            if way > 1.0 and side == "iso":  # there is room
                assert one["above"] == pytest.approx(3.0, abs=1.5)
                assert one["aside"] < 2.0
            left, top, right, bottom = one["box"]
            assert left >= 0.0
            assert right <= page.evaluate("document.getElementById('view').clientWidth")
            for other in boxes[: len(cards) + i]:
                assert right <= other[0] or other[2] <= left or bottom <= other[1] or other[3] <= top


def test_a_copy_moves_where_odometry_has_the_robot(
    small_robot: Robot, window: Window, tmp_path: Path
) -> None:
    """Beside the robot by what it is off, at each time; the legend hides it."""
    motion = drive(small_robot)
    off = np.zeros_like(motion.q)
    off[:, 0] = 0.1 * motion.t
    motion = Motion(small_robot, motion.t, motion.q, motion.u, frame="ee", believed=motion.q + off)
    page = window.open(file_url([motion], tmp_path))
    for t in (0.0, 2.0, 4.0):
        page.evaluate(f"nmm.player.seek({t})")
        nodes = page.evaluate(WALK)
        there = [path for path in nodes if path.startswith("/nmm/motion 0/believed/") and "visual" in path]
        assert there
        for path in there:
            believed, real = (
                UPRIGHT.T @ np.reshape(nodes[one], (4, 4)).T
                for one in (path, path.replace("/believed/", "/robot/"))
            )
            np.testing.assert_allclose(believed[:3, :3], real[:3, :3], atol=1e-5)
            np.testing.assert_allclose(believed[:3, 3] - real[:3, 3], [0.1 * t, 0.0, 0.0], atol=1e-4)
    shown = "nmm.node('/nmm/motion 0/believed').visible"
    assert page.evaluate(shown)
    page.locator("#legend button", has_text="believed").click()
    assert not page.evaluate(shown)
    assert page.evaluate("nmm.node('/nmm/motion 0/robot').visible")


def test_from_above_the_view_is_a_plan(robot: Robot, window: Window, tmp_path: Path) -> None:
    """What is 1 m higher is at the same place to 1 cm, lengths are alike everywhere, and the
    grid says its pitch; the address tells of the camera the same for any lens."""
    page = window.open(file_url([drive(robot)], tmp_path) + "#view=top")
    ends = [[x, y, z] for x, y in ((-1.0, 0.0), (1.0, 0.0), (1.0, 1.0)) for z in (0.0, 1.0)]
    at = np.array(page.evaluate(PROJECT, ends))[:, :2] * [240.0, 150.0]
    metre = 0.5 * np.linalg.norm(at[2] - at[0])
    assert np.abs(at[1::2] - at[::2]).max() < 0.01 * metre
    assert np.linalg.norm(at[4] - at[2]) == pytest.approx(metre, rel=0.01)
    assert (page.locator("#legend").text_content() or "").count("grid of ") == 1
    assert not page.get_by_text("grid of ").is_visible()  # a low window is for the robot
    page.set_viewport_size({"width": 480, "height": 480})
    assert page.get_by_text("grid of ").is_visible()
    page.set_viewport_size(SIZE)
    page.evaluate("nmm.camera.put([0, -2, 3, 0, 0, 0])")
    assert page.evaluate("nmm.camera.place()") == pytest.approx([0, -2, 3, 0, 0, 0], abs=1e-6)
    heights = [abs(np.subtract(*np.array(page.evaluate(PROJECT, [[0, 0, 0], [0, 0.1, 0]]))[:, 1]))]
    page.evaluate("nmm.camera.look('iso'); nmm.camera.put([0, -2, 3, 0, 0, 0])")
    heights.append(abs(np.subtract(*np.array(page.evaluate(PROJECT, [[0, 0, 0], [0, 0.1, 0]]))[:, 1])))
    assert heights[0] == pytest.approx(heights[1], rel=0.05)


def test_a_name_is_above_its_robot_as_that_stands_now(robot: Robot, window: Window, tmp_path: Path) -> None:
    """Over one another and set apart; Coal says where the robot's shapes are."""
    motion = drive(robot, label="RG")
    page = window.open(file_url([motion, drive(robot, label="PG")], tmp_path))
    for share in (0.0, 1.0):
        page.evaluate(f"nmm.apart.set({share})")
        for k in (0, len(motion.t) // 2, len(motion.t) - 1):
            page.evaluate(f"nmm.player.seek({motion.t[k]})")
            draw_frames(page)
            found = page.evaluate(
                """() => nmm.motions.map(({ path, tag }) => {
                  const at = nmm.node(path).children.find((part) => part.isSprite).position;
                  return at.toArray();
                })"""
            )
            wheels = wheel_angles(motion)[k : k + 1]
            (low, high) = robot_boxes(robot, motion.q[k : k + 1], wheels)[0]
            above = [*(0.5 * (low + high))[:2], high[2]]
            np.testing.assert_allclose(found, [above, above], atol=0.03)


def test_a_copy_gives_way_to_the_robot_that_stands_there(
    robot: Robot, window: Window, tmp_path: Path
) -> None:
    q = np.zeros((61, robot.n))
    q[:, 0] = np.linspace(0.0, 9.0, 61)
    t = np.linspace(0.0, 6.0, 61)
    page = window.open(file_url([Motion(robot, t, q, np.zeros((61, robot.n_u)))], tmp_path))
    shown = "() => nmm.ghosts[0].children.map((copy) => copy.visible)"
    for k, at in enumerate((0.0, 2.0, 4.0, 6.0)):
        page.evaluate(f"nmm.player.seek({at})")
        draw_frames(page)
        assert page.evaluate(shown) == [i != k for i in range(4)]
    page.evaluate("nmm.player.seek(3)")
    draw_frames(page)
    assert page.evaluate(shown) == [True] * 4


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_texts_have_a_rim_and_names_of_axes_lie_on_none(
    robot: Robot, window: Window, tmp_path: Path, scheme: str
) -> None:
    window.page.set_viewport_size({"width": 1280, "height": 800})
    page = window.open(file_url([drive(robot)], tmp_path, ghosts=0))
    page.emulate_media(color_scheme=scheme)  # type: ignore[arg-type]  # mypy takes each for any text
    axes = """() => {
      viewer.render();
      return nmm.texts.all.filter(({ rank }) => rank === 5).map(({ sprite }) => sprite.material.visible);
    }"""
    assert page.evaluate(axes) == [True] * 3
    # How dark and how light a text is, from 0 to 1.
    low, high = page.evaluate(
        """() => {
          const { sprite } = nmm.texts.all.find(({ rank }) => rank === 5);
          nmm.texts.add("12 s", sprite.getWorldPosition(new MeshCat.THREE.Vector3()));
          const added = nmm.texts.all[nmm.texts.all.length - 1].sprite;
          viewer.scene.add(added);
          const { image } = added.material.map;
          const { data } = image.getContext("2d").getImageData(0, 0, image.width, image.height);
          const seen = [];
          for (let i = 0; i < data.length; i += 4) if (data[i + 3] > 190) seen.push(data[i] / 255);
          return [Math.min(...seen), Math.max(...seen)];
        }"""
    )
    assert low < 0.35
    assert high > 0.65
    assert page.evaluate(axes) == [False, True, True]


def test_a_scenarios_first_view_is_between_heading_and_tools(
    robot: Robot, window: Window, tmp_path: Path
) -> None:
    """In a narrow window; what it looks at is in the middle of what they leave free."""
    motion = drive(robot)
    around = Surroundings(camera=(0.0, -4.0, 3.0, 0.0, 0.0, 0.5))
    motion = Motion(robot, motion.t, motion.q, motion.u, surroundings=around)
    points = [[0.0, 0.0, 0.5], [0.0, 0.0, 1.5], [0.0, 0.0, -0.5]]
    page = window.open(file_url([motion], tmp_path))
    for width in (420, 1280, 420):
        page.set_viewport_size({"width": width, "height": 800})
        draw_frames(page)
        high, head, tools, bar = page.evaluate(
            """["view", "heading", "tools", "bar"].map((id) => document.getElementById(id))
               .map((part) => part.getBoundingClientRect())
               .map(({ height, top, bottom }, i) => [height, bottom, top, top][i])"""
        )
        middle, top, bottom = (0.5 * high * (1 - y) for _, y, _ in page.evaluate(PROJECT, points))
        if width == 1280:
            assert middle == pytest.approx(0.5 * high, abs=1.0)
            continue
        assert middle == pytest.approx(0.5 * (head + min(tools, bar)), abs=8.0)
        assert head < top < bottom < min(tools, bar)


@pytest.mark.parametrize(("scheme", "least"), [("light", 1.6), ("dark", 2.0)])
def test_a_path_ahead_can_be_told_from_the_floor(
    robot: Robot, window: Window, tmp_path: Path, scheme: str, least: float
) -> None:
    """As WCAG's contrast has it, for the darkest colour of a run."""
    window.page.set_viewport_size({"width": 1280, "height": 800})
    window.page.emulate_media(color_scheme=scheme)  # type: ignore[arg-type]  # mypy takes each for any text
    q = np.zeros((61, robot.n))
    q[:, 0] = np.linspace(0.0, 4.0, 61)
    t = np.linspace(0.0, 6.0, 61)
    motion = Motion(robot, t, q, np.zeros((61, robot.n_u)), frame="ee", label="RG")
    page = window.open(file_url([motion], tmp_path, ghosts=0))
    page.evaluate("nmm.actions.grid()")
    ((x, y, _),) = page.evaluate(PROJECT, [[2.5, 0.0, 0.0]])  # the platform's path
    draw_frames(page)
    at = 640 * (1 + x) - 12, 400 * (1 - y) - 12
    shot = page.screenshot(clip={"x": at[0], "y": at[1], "width": 24, "height": 24})
    pixels = np.asarray(Image.open(io.BytesIO(shot)).convert("RGB")) / 255.0
    linear = np.where(pixels <= 0.04045, pixels / 12.92, ((pixels + 0.055) / 1.055) ** 2.4)
    luminance = linear @ [0.2126, 0.7152, 0.0722] + 0.05
    floor = np.median(luminance)
    page.emulate_media(color_scheme="light")
    assert max(luminance.max() / floor, floor / luminance.min()) > least
