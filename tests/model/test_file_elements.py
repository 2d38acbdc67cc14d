"""What of a URDF counts and what is noted: versions against Pinocchio's reader (urdfdom 6), and the tables
against the formats' own lists."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
import trimesh
import yourdfpy
import yourdfpy.urdf
from findings import holds, of_code, refused_for
from urdf_parts import AXIS, LIMIT, inertial, joint, link, numbers, robot, shape, write

import nmm
from nmm.model.robots.loading.file_elements import READ, SRDF, URDF
from nmm.model.robots.loading.packages import package_file
from nmm.model.robots.loading.provenance import accelerations_of
from nmm.model.robots.loading.report import file_report
from nmm.scenario.scaffold import first_scenario

UNREAD = ("element_unknown", "attribute_unknown", "element_unread", "attribute_unread", "element_again")


def told(robot_: nmm.Robot) -> list[tuple[str, str, str, int, int | None]]:
    """Code, element, attribute, count and line of what is noted as unread."""
    found = [note for note in robot_.notes if note.code in UNREAD]
    return [
        (
            note.code,
            note.values["element"],
            note.values.get("attribute", ""),
            note.values["count"],
            note.where.get("line"),
        )
        for note in found
    ]


# ------------------------------------------------------------------------------------------------ versions


def turned(version: str, quaternion: str, more: str = "") -> str:
    """Two links with all that has a place, each turned by a quaternion."""
    origin = f'<origin xyz="0.1 0.2 0.3" quat_xyzw="{quaternion}"{more}/>'
    moments = '<inertia ixx="0.1" ixy="0.01" ixz="0.02" iyy="0.2" iyz="0.03" izz="0.25"/>'
    heavy = f'<inertial>{origin}<mass value="2"/>{moments}</inertial>'
    shapes = "".join(
        f'<{tag}>{origin}<geometry><box size="1 2 3"/></geometry></{tag}>' for tag in ("visual", "collision")
    )
    return robot(
        link("a"), link("b", heavy + shapes), joint(origin=origin),
        attributes=f'name="r" version="{version}"',
    )  # fmt: skip


@pytest.mark.parametrize("version", ["1.1", "1.2"])
@pytest.mark.parametrize(
    "quaternion",
    [
        [0, 0, np.sqrt(0.5), np.sqrt(0.5)],
        [0, 2, 0, 2],  # not of length 1, and pitched by a quarter turn, where roll and yaw are one
        [0.5, -0.5, 0.5, 0.5],
        [0.1, -0.7, 0.3, 0.2],
        [-0.3, 0.2, 0.9, -0.4],
    ],
)
def test_quaternions_are_read_as_pinocchio_reads_them(
    tmp_path: Path, version: str, quaternion: list[float]
) -> None:
    text = turned(version, numbers(quaternion))
    model = pin.buildModelFromXML(text)
    still = nmm.load(write(tmp_path / "r.urdf", text), platform="fixed")
    assert not told(still)
    there = model.jointPlacements[1].homogeneous
    np.testing.assert_allclose(still.model.jointPlacements[1].homogeneous, there, atol=1e-12)
    np.testing.assert_allclose(still.model.inertias[1].matrix(), model.inertias[1].matrix(), atol=1e-12)
    for ours, kind in (
        (still.visual_model, pin.GeometryType.VISUAL),
        (still.collision_model, pin.GeometryType.COLLISION),
    ):
        theirs = pin.buildGeomFromUrdfString(model, text, kind)
        (one,), (other,) = ours.geometryObjects, theirs.geometryObjects
        np.testing.assert_allclose(one.placement.homogeneous, other.placement.homogeneous, atol=1e-12)


def test_before_version_1_1_a_quaternion_does_not_count(tmp_path: Path) -> None:
    text = turned("1.0", "0 0 0.6 0.8")
    still = nmm.load(write(tmp_path / "r.urdf", text), platform="fixed")
    assert told(still) == [("attribute_unread", "origin", "quat_xyzw", 4, 2)]
    there = pin.buildModelFromXML(text).jointPlacements[1].homogeneous
    np.testing.assert_array_equal(still.model.jointPlacements[1].homogeneous, there)


def test_quaternions_that_are_none(tmp_path: Path) -> None:
    def of_joint(origin: str) -> Path:
        text = robot(link("a"), link("b"), joint(origin=origin), attributes='name="r" version="1.1"')
        return write(tmp_path / "r.urdf", text)

    with refused_for(("turned_twice", {"joint": "j", "line": 4})):
        nmm.load(of_joint('\n<origin rpy="0 0 1" quat_xyzw="0 0 0 1"/>'))
    with refused_for(("quaternion_zero", {"joint": "j"})):
        nmm.load(of_joint('<origin quat_xyzw="0 0 0 0"/>'))
    with refused_for(("not_numbers", {"joint": "j", "attribute": "quat_xyzw", "count": 4})):
        nmm.load(of_joint('<origin quat_xyzw="0 0 1"/>'))
    # Kinematics does not feel a body's inertia: it is left out, as Pinocchio does.
    wrong = inertial().replace('xyz="0 0 0"', 'xyz="0 0 0" rpy="0 0 0" quat_xyzw="0 0 0 1"')
    text = robot(link("a"), link("b", wrong), joint(), attributes='name="r" version="1.1"')
    spared = nmm.load(write(tmp_path / "r.urdf", text))
    assert of_code(spared.notes, "faults_spared")
    assert spared.model.inertias[-1].mass == pin.buildModelFromXML(text).inertias[-1].mass == 0.0


@pytest.mark.parametrize(
    "version", ["1.0", "1.1", "1.2", "1.00", "01.2", " 1.1", "1.3", "1", "2.0", "1.0.0", "", "1.x", "0.9"]
)
def test_versions_are_those_of_urdfdom(tmp_path: Path, version: str) -> None:
    text = robot(link("a"), link("b"), joint(), attributes=f'name="r" version="{version}"')
    try:
        pin.buildModelFromXML(text)
    except ValueError:
        with refused_for(("version_unknown", {"got": version})):
            nmm.load(write(tmp_path / "r.urdf", text))
    else:
        nmm.load(write(tmp_path / "r.urdf", text))


@pytest.mark.parametrize("version", ["1.1", "1.2"])
@pytest.mark.parametrize(
    ("kind", "limit"),
    [
        ("revolute", 'lower="-1" upper="1"'),
        ("revolute", 'lower="-1" upper="1" velocity="2"'),
        ("prismatic", 'upper="1" effort="1" velocity="2"'),
        ("continuous", 'effort="1"'),
        ("revolute", 'lower="-1" upper="1" effort="1" velocity="2"'),
    ],
)
def test_what_a_limit_needs(tmp_path: Path, version: str, kind: str, limit: str) -> None:
    """Effort and velocity until 1.1, without which it loads with a note; both ends from 1.2 on."""
    text = robot(
        link("a"), link("b"), joint(kind=kind, body=AXIS + f"<limit {limit}/>"),
        attributes=f'name="r" version="{version}"',
    )  # fmt: skip
    file = write(tmp_path / "r.urdf", text)
    if version == "1.2" and "lower" not in limit and kind != "continuous":
        with pytest.raises(ValueError, match="valid URDF"):
            pin.buildModelFromXML(text)
        with refused_for(("attribute_missing", {"element": "limit", "attribute": "lower"})):
            nmm.load(file)
        return
    made = nmm.load(file)
    try:
        model = pin.buildModelFromXML(text)
    except ValueError:
        assert of_code(made.notes, "faults_spared")
        return
    assert not of_code(made.notes, "faults_spared")
    assert made.u_limits[-1] == model.velocityLimit[-1]
    if kind != "continuous":
        assert made.q_limits[-1].tolist() == [model.lowerPositionLimit[-1], model.upperPositionLimit[-1]]


def accelerated(version: str = "1.2") -> str:
    def limit(more: str) -> str:
        return AXIS + f'<limit lower="-1" upper="1" effort="1" velocity="1" {more}/>'

    names = ("a", "b", "c", "d", "e")
    follow = '<mimic joint="j" multiplier="-4"/>'
    return robot(
        *map(link, names),
        joint("j", "a", "b", body=limit('acceleration="3"')),
        joint("k", "b", "c", "prismatic", limit('acceleration="5" deceleration="2" jerk="9"')),
        joint("l", "c", "d", body=limit('acceleration="2"') + follow),
        joint("m", "d", "e", body=limit('acceleration="0"')),
        attributes=f'name="r" version="{version}"',
    )  # fmt: skip


def test_limits_of_acceleration_are_told_and_written(tmp_path: Path) -> None:
    file = write(tmp_path / "r.urdf", accelerated())
    made = nmm.load(file)
    right = {"j": 2.0 / 4.0, "k": 2.0}  # l follows j four times as fast
    (note,) = of_code(made.notes, "accelerations_of_file")
    assert holds(note, "accelerations_of_file", limits=right)
    assert ("attribute_unread", "limit", "jerk", 1) in [one[:4] for one in told(made)]
    limits = nmm.Limits(acceleration=note.values["limits"]).on(made)
    assert limits.accelerations[-3:].tolist() == [0.5, 2.0, np.inf]
    mounted = nmm.mount("unicycle_2r", made, at="arm_base", prefix="on_")
    assert accelerations_of(mounted) == {"on_j": 0.5, "on_k": 2.0}
    assert accelerations_of(nmm.load(file, lock={"l": 0.0})) == {"j": 3.0, "k": 2.0}
    older = nmm.load(write(tmp_path / "older.urdf", accelerated("1.1")))
    assert not accelerations_of(older)
    assert [one[:4] for one in told(older)] == [
        ("attribute_unread", "limit", "acceleration", 4),
        ("attribute_unread", "limit", "deceleration", 1),
        ("attribute_unread", "limit", "jerk", 1),
    ]


def test_a_first_scenario_keeps_the_files_accelerations(tmp_path: Path) -> None:
    text = robot(
        link("base"), link("upper"), link("lower"), link("tip"),
        joint("j", "base", "upper", body=AXIS + LIMIT.replace("/>", ' acceleration="3"/>')),
        joint("k", "upper", "lower", origin='<origin xyz="0.5 0 0.1"/>'),
        joint("f", "lower", "tip", "fixed", "", '<origin xyz="0.4 0 0"/>'),
        attributes='name="r" version="1.2"',
    )  # fmt: skip
    file = write(tmp_path / "r.urdf", text)
    made = first_scenario(file, file=tmp_path / "s.yaml", platform="unicycle")
    assert made.scenario.resolved()["limits"]["acceleration"]["j"] == 3.0
    run = made.trajectory
    change = np.diff(run.u[:, run.robot.input("j")]) / np.diff(run.t)
    assert np.abs(change).max() <= 3.0 + 1e-6


# ------------------------------------------------------------------------------------------- what is noted


def test_slips_are_noted_with_the_name_that_was_meant(tmp_path: Path) -> None:
    lines = [
        '<robot name="r"><link name="a"/><link name="b"/><lnk name="c"/>',
        '<joint name="j" type="revolute"><parent link="a"/><child link="b"/>',
        '<orgin xyz="1 0 0"/><axis xyz="0 0 1" xzy="1 0 0"/>',
        '<limit lower="-1" upper="1" effort="1" velocity="1" accelaration="2"/></joint>',
        "</robot>",
    ]
    made = nmm.load(write(tmp_path / "r.urdf", "\n".join(lines)))
    found = [
        (note.values["near"], note.where["line"]) for note in made.notes if note.code.endswith("_unknown")
    ]
    assert found == [("link", 1), ("origin", 3), ("xyz", 3), ("acceleration", 4)]


def test_one_note_of_a_kind(tmp_path: Path) -> None:
    limit = LIMIT + '<limit lower="-9" upper="9" effort="1" velocity="1"/>'
    parts = [link("a", '<origin xyz="1 0 0"/>'), link("b", '<origin xyz="1 0 0"/>')]
    made = nmm.load(
        write(
            tmp_path / "r.urdf",
            robot(
                *parts, joint(body=AXIS + limit), "<loop_joint/>", "<drake:joint/>", "<gazebo><o/></gazebo>",
                '<transmission name="t"/>', '<ros2_control><joint name="j"/></ros2_control>',
                '<ros2_control><joint name="j"><command_interface name="position">'
                '<param name="min">-0.5</param></command_interface></joint></ros2_control>',
                attributes='name="r" xmlns:drake="http://drake.mit.edu"',
            ),
        )
    )  # fmt: skip
    assert told(made) == [
        ("element_unread", "origin", "", 2, 1),
        ("element_again", "limit", "", 1, 3),
        ("element_unread", "loop_joint", "", 1, 4),
        ("element_unknown", "drake:joint", "", 1, 5),
        ("element_unread", "ros2_control", "", 1, 9),
    ]
    np.testing.assert_array_equal(made.q_limits[-1], [-1, 1])  # the first counts, as in Pinocchio
    warnings = file_report(tmp_path / "r.urdf").warnings
    assert {one[0] for one in told(made)} <= {one.code for one in warnings}


def test_a_second_shape_does_not_count(tmp_path: Path) -> None:
    two = shape('<sphere radius="0.1"/><box size="1 1 1"/>', "collision")
    made = nmm.load(write(tmp_path / "r.urdf", robot(link("a", two), link("b"), joint())))
    assert told(made) == [("element_again", "box", "", 1, 1)]
    assert [type(one.geometry).__name__ for one in made.collision_model.geometryObjects] == ["Sphere"]


def test_soft_limits_are_noted_where_they_are_narrower(tmp_path: Path) -> None:
    def safe(name: str, at: str, kind: str, soft: str) -> str:
        body = AXIS + LIMIT + f"\n<safety_controller {soft} k_velocity='1'/>"
        return joint(name, at, f"{name}_link", kind, body)

    text = robot(
        *map(link, ("a", "j_link", "k_link", "l_link", "m_link", "n_link")),
        safe("j", "a", "revolute", 'soft_lower_limit="-0.5" soft_upper_limit="0.8"'),
        safe("k", "a", "revolute", 'soft_lower_limit="-1" soft_upper_limit="1"'),  # not narrower
        safe("l", "a", "revolute", ""),
        safe("m", "a", "continuous", 'soft_lower_limit="-3" soft_upper_limit="3"'),
        safe("n", "a", "prismatic", 'soft_lower_limit="-2" soft_upper_limit="0.9"'),
    )
    made = nmm.load(write(tmp_path / "r.urdf", text))
    (note,) = of_code(made.notes, "soft_limits")
    assert holds(note, "soft_limits", limits={"j": [-0.5, 0.8], "m": [-3.0, 3.0], "n": [-2.0, 0.9]}, count=3)
    assert note.where["line"] == text[: text.index("<safety")].count("\n") + 1
    (note,) = of_code(made.notes, "limits_of_continuous")
    assert holds(note, "limits_of_continuous", names=["m"], count=1)


def test_notes_of_a_xacro_file_have_no_line_of_another_text(tmp_path: Path) -> None:
    text = robot(
        '<xacro:property name="n" value="b"/>', link("a"), link("${n}"), joint(), "<lnk/>",
        attributes='name="r" xmlns:xacro="http://www.ros.org/wiki/xacro"',
    )  # fmt: skip
    assert told(nmm.load(write(tmp_path / "r.xacro", text))) == [("element_unknown", "lnk", "", 1, None)]


@pytest.mark.parametrize(
    ("compiler", "name", "place"),
    [
        ('meshdir="meshes"', "box.stl", "meshes/box.stl"),
        ('meshdir="../assets/"', "package://nowhere/visual/box.stl", "../assets/box.stl"),
        ('meshdir="m" strippath="false"', "parts/box.stl", "m/parts/box.stl"),
        ('assetdir="m"', "box.stl", "m/box.stl"),
    ],
)
def test_meshes_are_where_mujoco_looks_for_them(tmp_path: Path, compiler: str, name: str, place: str) -> None:
    text = robot(f"<mujoco><compiler {compiler}/></mujoco>", link("a", shape(f'<mesh filename="{name}"/>')))
    (tmp_path / "r").mkdir()
    file = write(tmp_path / "r" / "r.urdf", text)
    with pytest.raises(nmm.RobotError, match=r"box\.stl"):
        nmm.load(file, platform="fixed")
    mesh = file.parent / place
    mesh.parent.mkdir(parents=True, exist_ok=True)
    trimesh.creation.box((0.1, 0.2, 0.3)).export(mesh)
    made = nmm.load(file, platform="fixed")
    (there,) = made.visual_model.geometryObjects
    there.geometry.computeLocalAABB()
    np.testing.assert_allclose(2.0 * there.geometry.aabb_local.max_, [0.1, 0.2, 0.3], atol=1e-6)


@pytest.mark.parametrize(
    ("file", "codes"),
    [
        ("ur_description/urdf/ur5_robot.urdf", set()),
        ("talos_data/robots/talos_left_arm.urdf", set()),
        ("panda_description/urdf/panda.urdf", {"attribute_unknown"}),
        ("pr2_description/urdf/pr2.urdf", {"soft_limits"}),
        ("tiago_description/robots/tiago_no_hand.urdf", {"soft_limits"}),
    ],
)
def test_known_robots_have_few_notes(file: str, codes: set[str]) -> None:
    name = f"package://example-robot-data/robots/{file}"
    made = nmm.load(name, missing_meshes="skip")
    kinds = (*UNREAD, "soft_limits", "limits_of_continuous")
    found = {note.code for note in made.notes if note.code in kinds and "srdf" not in note.where}
    assert found == codes
    # Their limits are those that yourdfpy reads.
    theirs = yourdfpy.URDF.load(
        str(package_file(f"package://example-robot-data/robots/{file}")), load_meshes=False
    )
    safe = {name for name, one in theirs.joint_map.items() if one.safety_controller is not None}
    for note in of_code(made.notes, "soft_limits"):
        for name, (lower, upper) in note.values["limits"].items():
            soft = theirs.joint_map[name].safety_controller
            assert (lower, upper) == (soft.soft_lower_limit, soft.soft_upper_limit)
        assert {*note.values["limits"]} <= safe


# ---------------------------------------------------------------------------------------------- the tables

#: Elements of a URDF and their attributes: the schema of urdfdom and what its README adds for 1.1 and 1.2.
OF_URDF = {
    "robot": "name version",
    "robot/link": "name type",
    "robot/link/inertial": "",
    "robot/link/inertial/origin": "xyz rpy quat_xyzw",
    "robot/link/inertial/mass": "value",
    "robot/link/inertial/inertia": "ixx ixy ixz iyy iyz izz",
    "robot/link/visual": "name",
    "robot/link/visual/origin": "xyz rpy quat_xyzw",
    "robot/link/visual/geometry": "",
    "robot/link/visual/geometry/box": "size",
    "robot/link/visual/geometry/cylinder": "radius length",
    "robot/link/visual/geometry/sphere": "radius",
    "robot/link/visual/geometry/capsule": "radius length",
    "robot/link/visual/geometry/mesh": "filename scale",
    "robot/link/visual/material": "name",
    "robot/link/visual/material/color": "rgba",
    "robot/link/visual/material/texture": "",
    "robot/link/collision": "name",
    "robot/link/collision/origin": "xyz rpy quat_xyzw",
    "robot/link/collision/geometry": "",
    "robot/link/collision/geometry/capsule": "radius length",
    "robot/link/collision/verbose": "",
    "robot/joint": "name type",
    "robot/joint/origin": "xyz rpy quat_xyzw",
    "robot/joint/parent": "link",
    "robot/joint/child": "link",
    "robot/joint/axis": "xyz",
    "robot/joint/calibration": "",
    "robot/joint/dynamics": "damping friction",
    "robot/joint/limit": "lower upper effort velocity acceleration deceleration jerk",
    "robot/joint/safety_controller": "",
    "robot/joint/mimic": "joint multiplier offset",
    "robot/material": "name",
    "robot/material/color": "rgba",
    "robot/material/texture": "",
    "robot/transmission": "",
    "robot/gazebo": "",
    "robot/sensor": "",
}
#: What srdfdom's reader takes.
OF_SRDF = {
    "robot": "name",
    "robot/virtual_joint": "name child_link parent_frame type",
    "robot/group": "name",
    "robot/group/link": "name",
    "robot/group/joint": "name",
    "robot/group/chain": "base_link tip_link",
    "robot/group/group": "name",
    "robot/group_state": "name group",
    "robot/group_state/joint": "name value",
    "robot/end_effector": "",
    "robot/link_sphere_approximation": "",
    "robot/disable_default_collisions": "link",
    "robot/enable_collisions": "link1 link2 reason",
    "robot/disable_collisions": "link1 link2 reason",
    "robot/passive_joint": "name",
    "robot/joint_property": "",
}


@pytest.mark.parametrize(("table", "known"), [(URDF, OF_URDF), (SRDF, OF_SRDF)])
def test_the_tables_hold_all_that_the_formats_have(table: object, known: dict[str, str]) -> None:
    assert isinstance(table, dict)
    assert {*known} <= {*table}
    for path, attributes in known.items():
        assert {*attributes.split()} <= {*table[path].attributes}, path
        above = path.rpartition("/")[0]
        assert not above or table[above].how == READ, path  # no one looks below others


#: yourdfpy's records of a joint's and a link's parts, which are what it reads of them.
RECORDS = {
    "robot/joint/limit": yourdfpy.urdf.Limit,
    "robot/joint/dynamics": yourdfpy.urdf.Dynamics,
    "robot/joint/mimic": yourdfpy.urdf.Mimic,
    "robot/link/visual/geometry/cylinder": yourdfpy.urdf.Cylinder,
    "robot/link/visual/geometry/box": yourdfpy.urdf.Box,
    "robot/link/visual/geometry/sphere": yourdfpy.urdf.Sphere,
    "robot/link/visual/geometry/mesh": yourdfpy.urdf.Mesh,
}


@pytest.mark.parametrize("path", RECORDS)
def test_what_another_reader_reads_is_read(path: str) -> None:
    names = {field.name for field in dataclasses.fields(RECORDS[path])}
    read = {name for name, how in URDF[path].attributes.items() if how.how == READ}
    assert names <= read


#: A value in place of another, of an attribute that is said to be read.
CHANGES = [
    ("robot/joint/origin", "xyz", "0.1 0.2 0.3", "0.1 0.2 0.4"),
    ("robot/joint/origin", "rpy", "0.3 0.2 0.1", "0.3 0.2 0.2"),
    ("robot/joint/axis", "xyz", "0 0 1", "0 1 0"),
    ("robot/joint/limit", "lower", "-1.5", "-1.25"),
    ("robot/joint/limit", "upper", "1.75", "1.25"),
    ("robot/joint/limit", "effort", "7", "8"),
    ("robot/joint/limit", "velocity", "5", "6"),
    ("robot/joint/limit", "acceleration", "3", "2"),
    ("robot/joint/limit", "deceleration", "4", "1"),
    ("robot/joint/dynamics", "damping", "0.25", "0.5"),
    ("robot/joint/dynamics", "friction", "0.125", "0.75"),
    ("robot/joint/parent", "link", "c", "a"),
    ("robot/joint/mimic", "joint", "j", "i"),
    ("robot/joint/mimic", "multiplier", "-0.5", "0.25"),
    ("robot/joint/mimic", "offset", "0.0625", "0.03"),
    ("robot/joint", "type", "prismatic", "revolute"),
    ("robot/link/inertial/mass", "value", "2.5", "3.5"),
    ("robot/link/inertial/inertia", "izz", "0.35", "0.45"),
    ("robot/link/inertial/origin", "xyz", "0.01 0 0", "0.02 0 0"),
    ("robot/link/visual/geometry/box", "size", "1 2 3", "1 2 4"),
    ("robot/link/collision/geometry/capsule", "radius", "0.55", "0.65"),
    ("robot/link/collision/geometry/cylinder", "length", "0.95", "0.85"),
    ("robot/link/visual/material/color", "rgba", "0.5 0.5 0.5 1", "0.5 0.25 0.5 1"),
]
ALL = f"""<robot name="r" version="1.2"><link name="a"/><link name="b"><inertial><origin xyz="0.01 0 0"/>
<mass value="2.5"/><inertia ixx="0.3" ixy="0" ixz="0" iyy="0.3" iyz="0" izz="0.35"/></inertial>
<visual><geometry><box size="1 2 3"/></geometry><material name="m"><color rgba="0.5 0.5 0.5 1"/></material>
</visual><collision><geometry><capsule radius="0.55" length="1"/></geometry></collision>
<collision><geometry><cylinder radius="0.2" length="0.95"/></geometry></collision></link>
<link name="c"/><link name="d"/><link name="e"/>
<joint name="i" type="revolute"><parent link="a"/><child link="c"/><axis xyz="0 1 0"/>{LIMIT}</joint>
<joint name="j" type="revolute"><parent link="a"/><child link="b"/>
<origin xyz="0.1 0.2 0.3" rpy="0.3 0.2 0.1"/>
<axis xyz="0 0 1"/><dynamics damping="0.25" friction="0.125"/>
<limit lower="-1.5" upper="1.75" effort="7" velocity="5" acceleration="3" deceleration="4"/></joint>
<joint name="k" type="prismatic"><parent link="c"/><child link="d"/><axis xyz="1 0 0"/>{LIMIT}</joint>
<joint name="l" type="revolute"><parent link="d"/><child link="e"/><axis xyz="1 0 0"/>{LIMIT}
<mimic joint="j" multiplier="-0.5" offset="0.0625"/></joint></robot>"""


def everything(made: nmm.Robot) -> str:
    """All that a robot has of its file, as text."""
    model, limits = made.model, accelerations_of(made)
    shapes = [*made.visual_model.geometryObjects, *made.collision_model.geometryObjects]
    sizes = []
    for one in shapes:
        one.geometry.computeLocalAABB()
        sizes.append(
            [one.geometry.aabb_local.max_.tolist(), one.meshColor.tolist(), one.placement.homogeneous]
        )
    arrays = [
        *(placement.homogeneous for placement in model.jointPlacements),
        *(joint_.shortname() for joint_ in model.joints),
        *(inertia.matrix() for inertia in model.inertias),
        *(model.lowerPositionLimit, model.upperPositionLimit, model.velocityLimit, model.effortLimit),
        *(model.damping, model.friction, model.parents.tolist(), made.mimic_joints, limits, sizes),
    ]
    return repr([str(one) for one in arrays])


@pytest.mark.parametrize(("path", "attribute", "old", "new"), CHANGES)
def test_what_is_called_read_changes_the_robot(
    tmp_path: Path, path: str, attribute: str, old: str, new: str
) -> None:
    """So that the table says `read` of no attribute that is dropped."""
    assert URDF[path].attributes[attribute].how == READ
    assert ALL.count(f'{attribute}="{old}"') == 1 or path == "robot/joint/parent"
    before = nmm.load(write(tmp_path / "r.urdf", ALL))
    assert not told(before)
    at = ALL.rindex(f'{attribute}="{old}"')
    changed = ALL[:at] + f'{attribute}="{new}"' + ALL[at + len(f'{attribute}="{old}"') :]
    after = nmm.load(write(tmp_path / "s.urdf", changed))
    assert everything(before) != everything(after)
