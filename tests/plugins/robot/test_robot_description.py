"""The URDF text in a log, by Pinocchio's own reader and yourdfpy's: of robots that were put together, too."""

from __future__ import annotations

import io
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
import yourdfpy
from gripping_cart import cart
from places import PANDA, UR5
from urdf_parts import joint, link, random_tree, robot, shape, vehicle, write

import nmm
from nmm.base.arrays import Array
from nmm.cli.exit_status import status_of
from nmm.model.robots.robot import Robot
from nmm.plugins.robot.ros.description import description, packaged
from nmm.plugins.robot.ros.links import Links
from nmm.plugins.robot.ros.making import root_link
from nmm.views.playback.placements import rolling_joints

typesys = pytest.importorskip("rosbags.typesys")
TYPES = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE).types


def by_hand() -> pin.Model:
    """A model without links: its frames are those of joints, and a tool's."""
    model, at = pin.Model(), pin.SE3(pin.rpy.rpyToMatrix(0.3, -0.2, 0.5), np.array([0.1, 0.2, 0.3]))
    model.name, along = "hand made", np.array([0.6, 0.0, 0.8])
    first = model.addJoint(0, pin.JointModelRevoluteUnaligned(along), at, "turn")
    second = model.addJoint(first, pin.JointModelPrismaticUnaligned(along), at, "slide")
    model.addFrame(pin.Frame("tool", second, 0, at, pin.FrameType.OP_FRAME))
    return model


MJCF = """<mujoco model="arm"><compiler angle="radian"/><worldbody><body name="foot" pos="0 0 0.1">
  <geom type="box" size="0.1 0.2 0.05" euler="0.1 0.2 0.3" rgba="1 0.5 0 1"/>
  <body name="upper" pos="0.1 0 0.2" euler="0.3 0 0.4">
    <joint name="lift" axis="0 1 0" pos="0 0.1 0" range="-1 1"/>
    <geom type="capsule" fromto="0 0 0 0.1 0.2 0.3" size="0.03"/><geom size="0.04" pos="0 0 0.1"/>
    <body name="lower" pos="0 0 0.3" quat="0.8 0.6 0 0">
      <joint name="push" type="slide" axis="1 1 0" range="-1 1"/>
      <geom type="cylinder" size="0.02 0.1"/></body></body></body></worldbody></mujoco>"""


def base_of_joints() -> str:
    """A base that two slides and a turn move over the ground, and an arm on it."""
    slide = '<limit lower="-9" upper="9" effort="1" velocity="1"/>'
    ways = {"along": '<axis xyz="1 0 0"/>' + slide, "across": '<axis xyz="0 1 0"/>' + slide}
    parts = [link("ground"), link("a"), link("b"), link("base_link"), link("arm")]
    for (name, body), parent, child in zip(ways.items(), ("ground", "a"), ("a", "b"), strict=True):
        parts.append(joint(name, parent, child, "prismatic", body, ""))
    parts.append(joint("about", "b", "base_link", "continuous", '<axis xyz="0 0 1"/>', ""))
    return robot(*parts, joint("q1", "base_link", "arm"))


def turned(folder: Path) -> Robot:
    return nmm.load(write(folder / "down.urdf", vehicle("steering", 0.7, False)))


#: Robots of one file, of several, of none; each made in an empty folder.
ROBOTS: dict[str, Callable[[Path], Robot]] = {
    "xacro": lambda _: nmm.load("unicycle_2r", arguments={"d": 0.2}),
    "trailers": lambda _: nmm.load("trailer_base"),
    "fixed": lambda _: nmm.load(UR5, platform="fixed"),
    "mounted": lambda _: nmm.mount("car_base", PANDA, placement=([0.1, 0.2, 0.3], [0.4, np.pi / 2, 0.6])),
    "prefixed": lambda _: nmm.mount("unicycle_2r", "unicycle_3r", at="arm_base", prefix="left_"),
    "axle": lambda _: nmm.load("unicycle_2r", axle=(0.3, 0.1)),
    "locked": lambda _: nmm.load("unicycle_3r", lock={"q2": 0.7}),
    "mimic": lambda folder: nmm.load(cart(folder / "cart.urdf", mimic=True)),
    "axes down": turned,
    "MJCF": lambda folder: nmm.load(write(folder / "arm.xml", MJCF)),
    "all joints": lambda folder: nmm.load(
        write(folder / "tree.urdf", random_tree(np.random.default_rng(3), 9)), platform="omnidirectional"
    ),
    "base of joints": lambda folder: nmm.load(write(folder / "base.urdf", base_of_joints())),
    "by hand": lambda _: nmm.load(by_hand()),
}


def text_of(made: Robot) -> str:
    text, left_out = description(made, Links(made, root_link(made)))
    assert not left_out
    return text


def standing(made: Robot, q: Array) -> pin.SE3:
    """Where the root link is."""
    x, y, theta = q[:3] if made.platform.n_p else np.zeros(3)
    ground = made.model.jointPlacements[1] if made.platform.n_p else pin.SE3.Identity()
    return ground * pin.SE3(pin.utils.rotate("z", theta), np.array([x, y, 0.0]))


@pytest.mark.parametrize("name", ROBOTS)
def test_its_links_are_where_nmm_has_them(name: str, tmp_path: Path) -> None:
    """At the angles that the log's JointState tells, wheels and mimic joints too."""
    made = ROBOTS[name](tmp_path)
    text, rng = text_of(made), np.random.default_rng(0)
    model = pin.buildModelFromXML(text)
    data, other = model.createData(), yourdfpy.URDF.load(io.BytesIO(text.encode()), load_meshes=False)
    messages, wheels = nmm.ros.Messages(made, TYPES), rolling_joints(made)
    links = {frame.name for frame in made.model.frames if frame.type.name == "BODY"} - {"universe"}
    links |= {frame.name for frame in made.model.frames if frame.type.name == "OP_FRAME"}
    assert {*other.link_map} >= links
    carried = {wheel.joint for wheel in made.wheels} | {*wheels}
    for _ in range(3):
        q = made.following.placed(rng.uniform(-0.6, 0.6, made.n))
        state = messages.joint_state(0.0, q, None, {one: (rng.uniform(-1, 1), 0.0) for one in wheels})
        told = dict(zip(state.name, state.position, strict=True))
        assert {*told} == {*model.names} - {"universe"}
        at = pin.neutral(model)
        for joint_name, value in told.items():
            moved = model.joints[model.getJointId(joint_name)]
            both = [np.cos(value), np.sin(value)] if moved.nq == 2 else [value]
            at[moved.idx_q : moved.idx_q + moved.nq] = both
        pin.framesForwardKinematics(model, data, at)
        other.update_cfg({one: told[one] for one in other.actuated_joint_names})
        here, root = nmm.Configuration(made, q), standing(made, q)
        for one in links:
            found = root * data.oMf[model.getFrameId(one, pin.FrameType.BODY)]
            also = root.homogeneous @ other.get_transform(one, other.base_link)
            np.testing.assert_allclose(also, found.homogeneous, atol=1e-9)
            supports = {
                model.names[k] for k in model.supports[model.frames[model.getFrameId(one)].parentJoint]
            }
            if not supports & carried:  # nmm's model has wheels at zero
                np.testing.assert_allclose(
                    found.homogeneous, here.placement(one).homogeneous, rtol=0, atol=1e-9
                )


@pytest.mark.parametrize("name", ["mounted", "locked", "axle", "MJCF", "mimic"])
def test_what_is_drawn_is_where_the_page_draws_it(name: str, tmp_path: Path) -> None:
    made = ROBOTS[name](tmp_path)
    text = text_of(made)
    model, folders = pin.buildModelFromXML(text), [*{folder for folder, _ in packaged(made).values()}]
    shapes = pin.buildGeomFromUrdfString(model, text, pin.GeometryType.VISUAL, package_dirs=folders)
    data, places = model.createData(), shapes.createData()
    pin.updateGeometryPlacements(model, data, shapes, places, pin.neutral(model))
    found = [np.r_[at.translation, at.rotation.ravel()] for at in places.oMg]
    whole, drawn = made.display_model, made.visual_model
    data, places = whole.createData(), drawn.createData()
    pin.updateGeometryPlacements(whole, data, drawn, places, np.zeros(whole.nq))
    assert len(found) >= len(drawn.geometryObjects) > 3
    for at in places.oMg:
        wanted = np.r_[at.translation, at.rotation.ravel()]
        assert min(np.abs(one - wanted).max() for one in found) < 1e-9
    wanted_colors = {tuple(one.meshColor) for one in drawn.geometryObjects if one.overrideMaterial}
    colors = {tuple(one.meshColor) for one in shapes.geometryObjects}
    assert all(min(np.abs(np.subtract(one, other)).max() for other in colors) < 1e-5 for one in wanted_colors)


def run_of(made: Robot) -> nmm.Trajectory:
    aim = nmm.Task(nmm.Posture(made.q_names[-1]), [0.1])
    return nmm.simulate(nmm.Controller(made, aim, nmm.ProjectedGradient()), made.rest, 0.1, 0.05)


@pytest.mark.parametrize(
    "name", ["mounted", "trailers", "mimic", "axle", "by hand", "fixed", "base of joints"]
)
def test_tf_is_the_tree_of_the_description(name: str, tmp_path: Path) -> None:
    """The same edges: a frame that has two parents is none in Rerun."""
    made = ROBOTS[name](tmp_path)
    told = messages(run_of(made).save_mcap(tmp_path / "run.mcap"))
    described = yourdfpy.URDF.load(
        io.BytesIO(told["/robot_description"][0].data.encode()), build_scene_graph=False, load_meshes=False
    )
    moving = [(one.header.frame_id, one.child_frame_id) for one in told["/tf"][-1].transforms]
    still = [
        (one.header.frame_id, one.child_frame_id)
        for part in told.get("/tf_static", [])
        for one in part.transforms
    ]
    if name == "base of joints":
        assert ("odom", "base_link") in moving
    children = [child for _, child in moving + still]
    assert len(children) == len({*children})
    edges = {(one.parent, one.child) for one in described.robot.joints}
    assert {*moving, *still} == edges | {("odom", root_link(made))}
    assert {*still} == {(one.parent, one.child) for one in described.robot.joints if one.type == "fixed"}
    assert {*children} == {one.name for one in described.robot.links}
    frames = nmm.ros.Transforms()
    for part in (*told.get("/tf_static", []), told["/tf"][-1]):
        frames.add(part)
    ends = [frame.name for frame in made.model.frames if frame.type.name == "BODY"][1:]
    here = nmm.Configuration(made, run_of(made).q[-1])
    turning = {one for wheel in made.wheels for one in wheel.joints}
    model = made.display_model
    for one in ends:
        supports = model.supports[model.frames[model.getFrameId(one)].parentJoint]
        if not turning & {model.names[k] for k in supports}:
            np.testing.assert_allclose(
                frames.placement("odom", one), here.placement(one).homogeneous, rtol=0, atol=1e-9
            )


def messages(path: Path) -> dict[str, list[Any]]:
    rosbag2 = pytest.importorskip("rosbags.rosbag2")
    store, found = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE), dict[str, list[Any]]()
    with rosbag2.Reader(path) as bag:
        for connection, _, data in bag.messages():
            found.setdefault(connection.topic, []).append(store.deserialize_cdr(data, connection.msgtype))
    return found


def test_limits_and_mimics_are_the_files(tmp_path: Path) -> None:
    """Those of joints that nmm counts the other way round, too."""
    file = write(tmp_path / "down.urdf", vehicle("steering", 0.7, False))
    given, found = (
        yourdfpy.URDF.load(source, build_scene_graph=False, load_meshes=False)
        for source in (str(file), io.BytesIO(text_of(nmm.load(file)).encode()))
    )
    for name in ("steering", "q1", "left_wheel"):
        one, other = given.joint_map[name], found.joint_map[name]
        assert one.type == other.type
        np.testing.assert_allclose(one.axis, other.axis, atol=1e-12)
        assert other.limit.velocity == one.limit.velocity
        assert (other.limit.lower, other.limit.upper) == (one.limit.lower, one.limit.upper)
    one, other = given.joint_map["flag_joint"].mimic, found.joint_map["flag_joint"].mimic
    assert (other.joint, other.multiplier, other.offset) == (one.joint, one.multiplier, one.offset)


def mesh_beside(folder: Path) -> str:
    """A mesh in a folder beside a robot's file, and in no package."""
    (folder / "our looks").mkdir()
    write(folder / "our looks" / "plate ü.stl", STL)
    return '<mesh filename="our looks/plate ü.stl" scale="1 2 3"/>'


def test_meshes_are_found_by_package_or_by_file(tmp_path: Path, capsys: Any, monkeypatch: Any) -> None:
    """From `nmm run` of a scenario with an arm mounted, to its log."""
    monkeypatch.chdir(tmp_path)
    plate = shape(mesh_beside(tmp_path))
    write(tmp_path / "stand.urdf", robot(link("a", plate), link("b"), joint(), attributes='name="stand"'))
    made = nmm.mount(nmm.mount("unicycle_2r", UR5, at="arm_base"), "stand.urdf", at="base_link")
    described = yourdfpy.URDF.load(
        io.BytesIO(text_of(made).encode()), build_scene_graph=False, load_meshes=False
    )
    names = {
        one.geometry.mesh.filename
        for part in described.robot.links
        for one in part.visuals
        if one.geometry.mesh is not None
    }
    by_file = {name for name in names if name.startswith("file://")}
    assert by_file == {f"file://{tmp_path}/our looks/plate ü.stl"}  # Rerun takes no %20
    (folder,) = {folder for folder, _ in packaged(made).values()}
    assert len(names - by_file) > 4
    for name in names - by_file:
        assert Path(folder, name.removeprefix("package://")).is_file()
    write(tmp_path / "both.yaml", SCENARIO.format(arm=UR5))
    assert status_of(["run", "both.yaml", "--out", "both"]) == 0
    assert status_of(["export", "both", "--mcap"]) == 0
    assert f"ROS_PACKAGE_PATH={folder}" in capsys.readouterr().out.replace("\n", "")
    told = messages(Path("both.mcap"))
    assert "package://" in told["/robot_description"][0].data
    assert told["/end_effector_pose"]
    assert {"ur5_wrist_3_link", "left_wheel"} <= {one.child_frame_id for one in told["/tf"][0].transforms}


STL = """solid a
facet normal 0 0 1
outer loop
vertex 0 0 0
vertex 1 0 0
vertex 0 1 0
endloop
endfacet
endsolid a
"""
SCENARIO = """\
robot: {{platform: unicycle_2r, arms: [{{arm: "{arm}", at: arm_base}}]}}
q0: {{ur5_shoulder_lift_joint: -1.0, ur5_elbow_joint: 1.2}}
duration: 0.2
dt: 0.05
task:
  - kind: position
    frame: ur5_ee_link
    axes: xyz
    reference: {{kind: line, start: [0.8, 0.2, 0.9], end: [0.9, 0.2, 0.9], duration: 0.2}}
resolver: {{kind: pg}}
"""


def test_what_urdf_has_no_words_for_is_told(tmp_path: Path) -> None:
    """A cone is left out by name; a capsule is a cylinder between two balls; a screw is moved by TF alone."""
    model, shapes = by_hand(), pin.GeometryModel()
    screw = model.addJoint(2, pin.JointModelHZ(0.1), pin.SE3.Identity(), "screw")
    forms = {"cone": pin.hppfcl.Cone(0.1, 0.2), "capsule": pin.hppfcl.Capsule(0.1, 0.4)}
    for name, form in forms.items():
        shapes.addGeometryObject(pin.GeometryObject(name, screw, 0, pin.SE3.Identity(), form))
    made = nmm.load(model, visual_model=shapes)
    told = messages(run_of(made).save_mcap(tmp_path / "run.mcap"))
    assert [one.msg.endswith("cone") for one in told["/rosout"]] == [True]
    found = yourdfpy.URDF.load(
        io.BytesIO(told["/robot_description"][0].data.encode()), build_scene_graph=False, load_meshes=False
    )
    assert found.joint_map["screw"].type == "floating"
    drawn = found.link_map["screw"].visuals
    assert [one.geometry.cylinder.length for one in drawn if one.geometry.cylinder] == [0.4]
    ends = [one.origin[2, 3] for one in drawn if one.geometry.sphere]
    assert sorted(ends) == [-0.2, 0.2]


def test_the_ground_of_a_file_is_still(tmp_path: Path) -> None:
    """The link below a free joint is where the world is, which the robot's base leaves."""
    text = """<robot name="box"><link name="world"/><link name="box"/><link name="arm"/>
    <joint name="root" type="floating"><parent link="world"/><child link="box"/></joint>
    <joint name="q1" type="continuous"><parent link="box"/><child link="arm"/><origin xyz="0 0 0.1"/>
    <axis xyz="0 0 1"/></joint></robot>"""
    made = nmm.load(write(tmp_path / "box.urdf", text), platform="omnidirectional")
    told = messages(run_of(made).save_mcap(tmp_path / "run.mcap"))
    ground = [frame.name for frame in made.model.frames if frame.type == pin.BODY and frame.parentJoint == 0]
    assert ground == ["world"]
    still = [one for part in told["/tf_static"] for one in part.transforms]
    assert [one.header.frame_id for one in still if one.child_frame_id == "world"] == ["odom"]
    frames = nmm.ros.Transforms()
    for part in (*told["/tf_static"], told["/tf"][-1]):
        frames.add(part)
    here = nmm.Configuration(made, run_of(made).q[-1])
    found = np.linalg.inv(frames.placement("odom", "world")) @ frames.placement("odom", "arm")
    wanted = here.placement("world").inverse() * here.placement("arm")
    np.testing.assert_allclose(found, wanted.homogeneous, atol=1e-12)


def test_a_root_away_from_the_origin_stands_on_its_ground(tmp_path: Path) -> None:
    """Paths and poses are in the frame that x and y count from, as TF has the robot."""
    model, at = pin.Model(), pin.SE3(pin.utils.rotate("z", 0.7), np.array([1.0, 2.0, 0.3]))
    model.name = "placed"
    root = model.addJoint(0, pin.JointModelPlanar(), at, "root")
    turn = model.addJoint(root, pin.JointModelRZ(), pin.SE3(np.eye(3), np.array([0.2, 0.1, 0.4])), "turn")
    model.addFrame(pin.Frame("tip", turn, 0, pin.SE3(np.eye(3), np.array([0.3, 0.0, 0.1])), pin.BODY))
    made = nmm.load(model, platform="omnidirectional")
    aim = nmm.Task(nmm.Position("tip", axes="xy"), [1.5, 2.5])
    run = nmm.simulate(nmm.Controller(made, aim, nmm.ProjectedGradient()), made.rest, 0.2, 0.05)
    told, frames = messages(run.save_mcap(tmp_path / "run.mcap")), nmm.ros.Transforms()
    for part in (*told.get("/tf_static", []), told["/tf"][-1]):
        frames.add(part)
    by_tf = frames.placement("odom", "tip")
    np.testing.assert_allclose(nmm.ros.placement(told["/end_effector_pose"][-1]), by_tf, atol=1e-12)
    end = told["/path"][0].poses[-1].pose.position
    np.testing.assert_allclose([end.x, end.y, end.z], by_tf[:3, 3], atol=1e-12)
    np.testing.assert_allclose(at.act(by_tf[:3, 3]), run.path[-1], atol=1e-12)
