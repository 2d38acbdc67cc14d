"""Robots whose files have no shapes: drawn as sticks that end where Pinocchio has the joints."""

from __future__ import annotations

import threading
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from places import UR5
from playback_browser import Window, drawn_visuals, file_url
from playback_browser import browser as browser
from playback_browser import empty_page as empty_page
from playback_browser import window as window
from playback_robot import drive
from urdf_parts import AXIS, joint, link, robot, shape, write

import nmm
from nmm.views.playback import Motion, view
from nmm.views.playback.drawing import Drawing, encode
from nmm.views.playback.extent import robot_boxes
from nmm.views.playback.keyframes import keyframes
from nmm.views.playback.rolling import Rolling
from nmm.views.playback.scene import playback_scene
from nmm.views.playback.shapes import DrawnRobot
from nmm.views.playback.sticks import Appearance, appearance

LIMIT = '<limit lower="-2" upper="2" effort="1" velocity="1"/>'
SLIDE = '<axis xyz="0.6 0 0.8"/><limit lower="0" upper="0.25" effort="1" velocity="1"/>'
SPIN = '<axis xyz="0 1 0"/><limit effort="1" velocity="9"/>'
TYRE = shape('<cylinder radius="0.1" length="0.04"/>', more='<origin rpy="1.5708 0 0"/>')
LINKS = ("base", "upper", "fore", "hand", "tool")


def written(path: Path, bodies: dict[str, str] | None = None, wheels: str | None = TYRE) -> Path:
    """An arm of two turning joints and a sliding one on a base with two wheels, as quick experiments are.

    Parameters
    ----------
    bodies : what a link holds, by the link's name
    wheels : what the wheels' links hold; None for a base without wheels
    """
    parts = [link(name, (bodies or {}).get(name, "")) for name in LINKS]
    for name, y in (("left_wheel", 0.25), ("right_wheel", -0.25)) if wheels is not None else ():
        parts.append(link(name, wheels or ""))
        place = f'<origin xyz="0 {y} 0.1"/>'
        parts.append(joint(f"{name}_joint", "base", name, "continuous", SPIN, place))
    place = '<origin xyz="0.1 0 0.4" rpy="0 0.1 0.3"/>'
    parts.append(joint("q1", "base", "upper", "revolute", AXIS + LIMIT, place))
    place = '<origin xyz="0.4 0 0.1" rpy="0.2 0 0.1"/>'
    parts.append(joint("q2", "upper", "fore", "revolute", f'<axis xyz="0 1 0"/>{LIMIT}', place))
    place = '<origin xyz="0.3 0.05 0" rpy="0.4 -0.3 0.2"/>'
    parts.append(joint("q3", "fore", "hand", "prismatic", SLIDE, place))
    parts.append(joint("grip", "hand", "tool", "fixed", "", '<origin xyz="0.1 0 -0.1"/>'))
    return write(path, robot(*parts, attributes='name="bare"'))


@pytest.fixture(scope="module")
def bare(tmp_path_factory: pytest.TempPathFactory) -> nmm.Robot:
    return nmm.load(written(tmp_path_factory.mktemp("bare") / "bare.urdf"))


def configurations(robot: nmm.Robot, rng: np.random.Generator, count: int) -> np.ndarray:
    lower, upper = np.clip(robot.q_limits, -3.0, 3.0).T
    return rng.uniform(lower, upper, (count, robot.n))


def expected_ends(robot: nmm.Robot, q: np.ndarray) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Both ends of each link's stick in the world, from Pinocchio's placements of the links' frames."""
    model, data = robot.model, robot.model.createData()

    def origin(name: str, q: np.ndarray) -> np.ndarray:
        pin.framesForwardKinematics(model, data, q)
        return np.array(data.oMf[model.getFrameId(name)].translation)

    drawn_in = q.copy()
    drawn_in[robot.coordinate("q3")] = 0.0  # a stick ends where the slider begins
    return {
        "q1": (origin("upper", q), origin("fore", q)),
        "q2": (origin("fore", q), origin("hand", drawn_in)),
        "q3": (origin("hand", q), origin("tool", q)),
    }


def world(commands: list[dict[str, Any]], path: str) -> np.ndarray:
    """Placement of a node in the world: the product of those on the way down to it."""
    places = {
        command["path"]: np.reshape(command["matrix"], (4, 4)).T
        for command in commands
        if command["type"] == "set_transform"
    }
    steps = path.split("/")
    placement = np.eye(4)
    for k in range(2, len(steps) + 1):
        placement = placement @ places.get("/".join(steps[:k]), np.eye(4))
    return placement


def drawn_sticks(commands: list[dict[str, Any]]) -> dict[str, np.ndarray]:
    """The ends (2, 3) of each capsule that is drawn, by the name of its node, in the world."""
    geometries = {command["id"]: command["data"] for command in commands if command["type"] == "geometry"}
    ends = {}
    for command in commands:
        data = geometries[command["geometry"]] if command["type"] == "object" else {}
        if data.get("type") != "LatheGeometry":
            continue
        # The outline's last point is the pole; the circle through it and its neighbour has the radius.
        side, pole = data["points"][-2:]
        below = pole["y"] - side["y"]
        half = pole["y"] - (side["x"] ** 2 + below**2) / (2.0 * below)
        points = np.array([[0.0, -half, 0.0, 1.0], [0.0, half, 0.0, 1.0]])  # three.js turns it about y
        ends[command["path"].split("/")[-2]] = (points @ world(commands, command["path"]).T)[:, :3]
    return ends


def named(ends: dict[str, np.ndarray], what: str) -> np.ndarray:
    return next(value for name, value in ends.items() if name.endswith(what))


def objects(robot: nmm.Robot) -> dict[str, dict[str, Any]]:
    """What is drawn: a node's name without its number, and its geometry."""
    drawing = Drawing()
    DrawnRobot(drawing, robot, "/robot")
    geometries = {command["id"]: command["data"] for command in drawing.commands if "id" in command}
    return {
        command["path"].split("/")[-2].split(" ", 2)[2]: geometries[command["geometry"]]
        for command in drawing.commands
        if command["type"] == "object"
    }


def test_sticks_end_where_pinocchio_has_the_joints(bare: nmm.Robot, rng: np.random.Generator) -> None:
    for q in configurations(bare, rng, 6):
        drawing = Drawing()
        DrawnRobot(drawing, bare, "/robot").place(q, Rolling(bare).settled(q))
        sticks = drawn_sticks(drawing.commands)
        expected = expected_ends(bare, q)
        for name, ends in expected.items():
            np.testing.assert_allclose(named(sticks, f"stick 0 of {name}"), ends, atol=1e-12)
        columns = [ends for name, ends in sticks.items() if name.endswith("of theta")]
        nearest = min(np.linalg.norm(ends[1] - expected["q1"][0]) for ends in columns)
        assert nearest < 1e-12
        # The rail on which the hand slides goes through it.
        low, high = named(sticks, "rail of q3")
        hand, way = expected["q3"][0], high - low
        assert np.linalg.norm(way) == pytest.approx(0.25)
        assert np.linalg.norm(hand - low) == pytest.approx(q[bare.coordinate("q3")])
        np.testing.assert_allclose(np.cross(hand - low, way), 0.0, atol=1e-12)


@pytest.mark.browser
def test_sticks_follow_the_animation_and_have_ghosts(bare: nmm.Robot, window: Window, tmp_path: Path) -> None:
    swung = drive(bare, frame="tool", duration=2.0)
    q = swung.q.copy()
    q[:, bare.coordinate("q3")] = 0.1 + 0.1 * np.sin(swung.t)
    motion = Motion(bare, swung.t, q, swung.u, frame="tool")
    page = window.open(file_url([motion], tmp_path, ghosts=3))
    frames = keyframes(motion, 60)
    for k in (0, 20, 47, len(frames) - 1):
        page.evaluate(f"nmm.player.seek({frames.t[k] - motion.t[0]})")
        drawn, shown = drawn_visuals(page), frames.q[k]
        for name, (start, end) in expected_ends(bare, shown).items():
            matrix = next(value for key, value in drawn.items() if key.endswith(f"stick 0 of {name}"))
            along = 0.5 * np.linalg.norm(end - start) * matrix[:3, 2]
            found = matrix[:3, 3] + np.array([-along, along])
            np.testing.assert_allclose(found, [start, end], atol=1e-5, err_msg=f"{name}, frame {k}")
    counted = """(path) => {
      let count = 0;
      const add = (part) => (count += part.geometry.attributes.position.count);
      nmm.node(path).traverse((part) => part.isMesh && add(part));
      return count;
    }"""
    corners = page.evaluate(counted, "/nmm/motion 0/robot")
    assert corners > 0
    for copy in range(3):  # each is drawn in two passes
        assert page.evaluate(counted, f"/nmm/motion 0/ghosts/{copy}") == 2 * corners


def test_wheels_room_and_base_of_a_robot_without_shapes(tmp_path: Path, rng: np.random.Generator) -> None:
    """Its wheels are discs of their radius, and everything is in the room that it takes."""
    naked = nmm.load(written(tmp_path / "naked.urdf", wheels=""))
    drawn = objects(naked)
    for name in ("left_wheel_joint", "right_wheel_joint"):
        assert drawn[f"wheel {name}"]["radiusTop"] == pytest.approx(0.1)
    assert drawn["base"]["radiusTop"] == pytest.approx(0.25)
    assert drawn["joint q1"]["type"] == drawn["joint q2"]["type"] == "SphereGeometry"
    assert "joint q3" not in drawn  # it slides
    for q in configurations(naked, rng, 4):
        low, high = robot_boxes(naked, q[np.newaxis], Rolling(naked).settled(q)[np.newaxis])[0]
        points = np.array(list(expected_ends(naked, q).values())).reshape(-1, 3)
        assert np.all(points >= low)
        assert np.all(points <= high)
        assert low[2] < 1e-12  # the wheels stand on the ground
    cart = nmm.load(written(tmp_path / "cart.urdf", wheels=None))
    assert objects(cart)["base"]["radiusTop"] == pytest.approx(0.2)


@pytest.mark.parametrize(
    ("wheels", "middle"),
    [([(0.0, 0.0)], (0.0, 0.0)), ([(0.0, 0.25), (0.0, -0.25), (0.6, 0.25), (0.6, -0.25)], (0.3, 0.0))],
)
def test_the_base_lies_between_its_wheels(
    wheels: list[tuple[float, float]], middle: tuple[float, float], tmp_path: Path
) -> None:
    parts = [link("base")]
    for i, (x, y) in enumerate(wheels):
        parts.append(link(f"wheel_{i}"))
        place = f'<origin xyz="{x} {y} 0.1"/>'
        parts.append(joint(f"wheel_{i}_joint", "base", f"wheel_{i}", "continuous", SPIN, place))
    made = write(tmp_path / "cart.urdf", robot(*parts))
    cart = nmm.load(made, platform=nmm.Unicycle())  # about the root link, wherever its wheels are
    (base,) = [shape for shape in appearance(cart).shapes.geometryObjects if shape.name == "base"]
    np.testing.assert_allclose(base.placement.translation, [*middle, 0.1], atol=1e-12)
    base.geometry.computeLocalAABB()
    assert np.all(base.geometry.aabb_local.max_ > 0.01)
    assert "base" in objects(cart)


def test_links_are_drawn_by_their_collision_shapes_first(tmp_path: Path) -> None:
    egg = shape('<box size="0.3 0.1 0.2"/>', "collision")
    both = shape('<sphere radius="0.07"/>') + shape('<box size="1 1 1"/>', "collision")
    robot = nmm.load(written(tmp_path / "mixed.urdf", {"upper": egg, "fore": both}))
    before = [geometry.name for geometry in robot.visual_model.geometryObjects]
    found = appearance(robot)
    assert found.notes() == [
        "links without visuals are drawn by their collision shapes: upper",
        "links without shapes are drawn as sticks: base, hand",
    ]
    drawn = objects(robot)
    sizes = [
        sorted(data[key] for key in ("width", "height", "depth"))
        for data in drawn.values()
        if data["type"] == "BoxGeometry"
    ]
    np.testing.assert_allclose(sizes, [[0.1, 0.2, 0.3]])  # that of fore, which has a visual, is not shown
    assert not {"stick 0 of q1", "stick 0 of q2", "joint q1", "joint q2"} & drawn.keys()
    upper = robot.display_model.getJointId("q1")
    assert [g.parentJoint for g in found.shapes.geometryObjects][len(before)] == upper
    # The robot itself stays as it was.
    assert [geometry.name for geometry in robot.visual_model.geometryObjects] == before
    assert all(not geometry.overrideMaterial for geometry in robot.collision_model.geometryObjects)


@pytest.mark.parametrize("source", ["unicycle_2r", pytest.param(UR5, marks=pytest.mark.thorough)])
def test_robots_with_shapes_are_drawn_as_before(source: str, monkeypatch: pytest.MonkeyPatch) -> None:
    robot = nmm.load(source)
    motion = drive(robot, duration=0.5, dt=0.05, frame=None)
    commands = playback_scene([motion], title="", fps=10)
    shown = [command["path"] for command in commands if command["type"] == "object"]
    assert len({path.rsplit("/", 1)[0] for path in shown}) == robot.visual_model.ngeoms
    for module in ("shapes", "extent"):
        monkeypatch.setattr(
            f"nmm.views.playback.{module}.appearance", lambda robot: Appearance(robot.visual_model)
        )
    before = playback_scene([motion], title="", fps=10)
    assert [encode(command) for command in commands] == [encode(command) for command in before]


@pytest.mark.parametrize(
    "source", ["car_base", "differential_base", "omni_base", "small_arm", "trailer_base"]
)
def test_bundled_robots_have_shapes_everywhere(source: str) -> None:
    robot = nmm.load(source)
    assert appearance(robot).shapes is robot.visual_model
    assert appearance(robot).notes() == []


def test_a_link_without_length_between_others_stays_unseen(tmp_path: Path) -> None:
    """Where two axes cross, files put a link without shape and without length between the joints."""
    box = shape('<box size="0.1 0.1 0.1"/>')
    parts = [link("base", box), link("cross"), link("arm", box)]
    parts.append(joint("q1", "base", "cross"))
    parts.append(joint("q2", "cross", "arm", origin='<origin xyz="0 0 0" rpy="1 0 0"/>'))
    crossed = nmm.load(write(tmp_path / "crossed.urdf", robot(*parts)))
    assert appearance(crossed).shapes is crossed.visual_model


def test_a_fixed_base_stands_under_its_first_joint(tmp_path: Path, rng: np.random.Generator) -> None:
    arm = nmm.load(written(tmp_path / "arm.urdf", wheels=None), platform="fixed")
    drawn = objects(arm)
    assert {"base", "stick 0 of universe"} <= drawn.keys()
    for q in configurations(arm, rng, 3):
        drawing = Drawing()
        DrawnRobot(drawing, arm, "/robot").place(q, np.zeros(0))
        foot = named(drawn_sticks(drawing.commands), "stick 0 of universe")
        np.testing.assert_allclose(foot, [[0.0, 0.0, 0.0], [0.1, 0.0, 0.4]], atol=1e-12)


def test_the_viewer_tells_what_it_draws_as_sticks(
    bare: nmm.Robot, capsys: pytest.CaptureFixture[str]
) -> None:
    stop = threading.Event()
    stop.set()
    view(bare, open_browser=False, stop=stop)
    assert "links without shapes are drawn as sticks: base, upper, fore, hand\n" in capsys.readouterr().out
    view(nmm.load("unicycle_2r"), open_browser=False, stop=stop)
    assert "without" not in capsys.readouterr().out
