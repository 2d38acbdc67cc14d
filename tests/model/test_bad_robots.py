"""Robots that cannot be loaded: one line that names file and cause, and nothing on the terminal."""

from __future__ import annotations

import copy
from collections.abc import Iterator
from itertools import islice
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pinocchio as pin
import pytest
from findings import assert_found, holds
from urdf_parts import AXIS, LIMIT, inertial, joint, link, robot, shape, write

from nmm import Finding
from nmm.base.bundled import bundled_robots
from nmm.base.errors import RobotError
from nmm.base.text_format import printable, short_words
from nmm.model.robots.loading import load
from nmm.model.robots.loading.check import inspect
from nmm.model.robots.loading.check_parts import MESH_SUFFIXES, FindMesh
from nmm.model.robots.loading.report import file_report
from nmm.model.robots.robot import Robot

pytestmark = pytest.mark.usefixtures("xacro_each_time")

XACRO = 'name="r" xmlns:xacro="http://www.ros.org/wiki/xacro"'
LINKS = link("a") + link("b")
NO_LIMIT = AXIS


@pytest.fixture(autouse=True)
def _silent(capfd: pytest.CaptureFixture[str]) -> Iterator[None]:
    """Nothing on standard output or error, the C library's included."""
    yield
    assert capfd.readouterr() == ("", "")


def find_problems(text: str, *find_mesh: FindMesh, lock: tuple[str, ...] = ()) -> list[Finding]:
    return inspect(text, *find_mesh, lock=lock)[1]


def refused(source: object, **options: object) -> RobotError:
    """The error with which a source is refused: one line."""
    with pytest.raises(RobotError) as caught:
        load(source, **options)  # type: ignore[arg-type]  # wrong on purpose
    message = str(caught.value)
    assert message.isprintable()
    assert message == message.strip()
    return caught.value


def refused_text(text: str, tmp_path: Path, name: str = "bad.urdf") -> RobotError:
    path = write(tmp_path / name, text)
    error = refused(path)
    assert error.where == str(path)
    assert all(printable(short_words(str(one))) in str(error) for one in error.findings[:12])
    return error


def arm(body: str, kind: str = "revolute") -> str:
    return robot(LINKS, joint("elbow", kind=kind, body=body))


def one(body: str) -> str:
    return robot(link("upper", body))


def sphere(more: str) -> str:
    return one(shape('<sphere radius="1"/>', more=more))


MOMENTS = '<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/>'
# What is wrong, the text, and all that is found: codes, with values and where.
BAD = {
    "empty": ("", [("file_empty", {})]),
    "blank": (" \n\t ", [("file_empty", {})]),
    "no xml": ("hello", [("not_xml", {"line": 1, "reason": "syntax error"})]),
    "cut": ('<robot name="r">\n<link name="a"/>', [("not_xml", {"line": 2, "reason": "no element found"})]),
    "wrong end": ("<robot>\n<link>\n</robot>", [("not_xml", {"line": 3, "reason": "mismatched tag"})]),
    "two attributes": (
        '<robot name="r" name="s"/>',
        [("not_xml", {"line": 1, "reason": "duplicate attribute"})],
    ),
    "null": (
        '<robot name="r"\x00/>',
        [("not_xml", {"line": 1, "reason": "not well-formed (invalid token)"})],
    ),
    "unknown entity": ('<robot name="&lol;"/>', [("not_xml", {"line": 1, "reason": "undefined entity"})]),
    "doctype": (f"<!DOCTYPE robot>\n{robot(link('a'))}", [("doctype", {"line": 1})]),
    "entity bomb": (
        '<!DOCTYPE r [<!ENTITY a "aaaa"><!ENTITY b "&a;&a;">]>\n<robot name="&b;"/>',
        [("doctype", {"line": 1})],
    ),
    "external entity": (
        '<!DOCTYPE r [<!ENTITY f SYSTEM "file:///etc/passwd">]>\n<robot name="r">&f;</robot>',
        [("doctype", {"line": 1})],
    ),
    "another root": ("<sdf><model/></sdf>", [("not_robot", {"got": "sdf"})]),
    "no robot name": (
        robot(link("a"), attributes=""),
        [("attribute_missing", {"element": "robot", "attribute": "name"})],
    ),
    "empty robot name": (
        robot(link("a"), attributes='name=""'),
        [("attribute_missing", {"element": "robot", "attribute": "name"})],
    ),
    "version": (robot(link("a"), attributes='name="r" version="2.0"'), [("version_unknown", {"got": "2.0"})]),
    "call left over from xacro": (
        robot(link("a"), "<xacro:grey/>", attributes=XACRO),
        [("xacro_left_over", {"element": "xacro:grey"})],
    ),
    "no link": (robot(), [("no_links", {})]),
    "nameless link": (robot("<link/>"), [("name_missing", {"kind": "link"}), ("no_links", {})]),
    "nameless joint": (
        robot(LINKS, '<joint type="fixed"><parent link="a"/><child link="b"/></joint>'),
        [("name_missing", {"kind": "joint"})],
    ),
    "empty link name": (robot(link("a"), link("")), [("name_missing", {"kind": "link"})]),
    "two roots": (robot(LINKS, link("c"), joint()), [("several_roots", {"roots": ["a", "c"]})]),
    "three roots": (robot(LINKS, link("c")), [("several_roots", {"roots": ["a", "b", "c"]})]),
    "cycle": (robot(LINKS, joint(), joint("k", "b", "a")), [("cycle", {"links": ["a", "b", "a"]})]),
    "cycle beside the tree": (
        robot(link("base"), LINKS, joint(), joint("k", "b", "a")),
        [("cycle", {"links": ["a", "b", "a"]})],
    ),
    "its own parent": (
        robot(link("base"), link("a"), joint("j", "a", "a")),
        [("cycle", {"links": ["a", "a"]})],
    ),
    "two parents": (
        robot(LINKS, link("c"), joint("j"), joint("k", "a", "c"), joint("l", "b", "c")),
        [("two_parents", {"name": "c", "parents": ["a", "b"]})],
    ),
    "unknown parent": (
        robot(LINKS, joint(parent="bb")),
        [("name_unknown", {"joint": "j", "kind": "parent link", "got": "bb"})],
    ),
    "unknown child": (
        robot(LINKS, joint(child="zz")),
        [
            ("name_unknown", {"joint": "j", "kind": "child link", "got": "zz"}),
            ("several_roots", {"roots": ["a", "b"]}),
        ],
    ),
    "no parent": (
        robot(LINKS, '<joint name="j" type="fixed"><child link="b"/></joint>'),
        [("element_missing", {"joint": "j", "element": "joint", "missing": "parent"})],
    ),
    "no child": (
        robot(LINKS, '<joint name="j" type="fixed"><parent link="a"/></joint>'),
        [
            ("element_missing", {"joint": "j", "element": "joint", "missing": "child"}),
            ("several_roots", {"roots": ["a", "b"]}),
        ],
    ),
    "parent without link": (
        robot(LINKS, '<joint name="j" type="fixed"><parent/><child link="b"/></joint>'),
        [("attribute_missing", {"joint": "j", "element": "parent", "attribute": "link"})],
    ),
    "two links of a name": (
        robot(LINKS, link("a"), joint()),
        [("name_twice", {"kind": "link", "name": "a"})],
    ),
    "two joints of a name": (
        robot(LINKS, link("c"), joint(), joint(parent="b", child="c")),
        [("name_twice", {"kind": "joint", "name": "j"})],
    ),
    "no type": (
        robot(LINKS, '<joint name="j"><parent link="a"/><child link="b"/></joint>'),
        [("joint_type_missing", {"joint": "j"})],
    ),
    "unknown type": (
        arm("", "hinge"),
        [("name_unknown", {"joint": "elbow", "kind": "joint type", "got": "hinge"})],
    ),
    "capital type": (
        arm("", "Revolute"),
        [("name_unknown", {"joint": "elbow", "kind": "joint type", "got": "Revolute"})],
    ),
    "spherical": (
        arm("", "spherical"),
        [("name_unknown", {"joint": "elbow", "kind": "joint type", "got": "spherical"})],
    ),
    "planar": (
        robot(LINKS, joint("elbow"), link("c"), joint("wrist", "b", "c", "planar")),
        [("base_inside_tree", {"joint": "wrist", "kind": "planar"})],
    ),
    "floating": (
        robot(LINKS, joint("elbow"), link("c"), joint("wrist", "b", "c", "floating", "")),
        [("base_inside_tree", {"joint": "wrist", "kind": "floating"})],
    ),
    "mimic": (
        robot(LINKS, link("c"), joint(), joint("k", "b", "c", body=AXIS + LIMIT + '<mimic joint="i"/>')),
        [("leader_unknown", {"joint": "k", "leader": "i"})],
    ),
    "revolute without limit": (arm(AXIS), [("limit_missing", {"joint": "elbow", "kind": "revolute"})]),
    "prismatic without limit": (
        arm(AXIS, "prismatic"),
        [("limit_missing", {"joint": "elbow", "kind": "prismatic"})],
    ),
    "limit without effort": (
        arm('<limit lower="0" upper="1" velocity="1"/>'),
        [("attribute_missing", {"joint": "elbow", "element": "limit", "attribute": "effort"})],
    ),
    "limit without velocity": (
        arm('<limit lower="0" upper="1" effort="1"/>'),
        [("attribute_missing", {"joint": "elbow", "element": "limit", "attribute": "velocity"})],
    ),
    "continuous limit without effort": (
        arm('<limit velocity="1"/>', "continuous"),
        [("attribute_missing", {"joint": "elbow", "element": "limit", "attribute": "effort"})],
    ),
    "limits crossed": (
        arm('<limit lower="1" upper="-1" effort="1" velocity="1"/>'),
        [("limits_crossed", {"joint": "elbow", "lower": 1.0, "upper": -1.0})],
    ),
    "negative velocity": (
        arm('<limit effort="1" velocity="-1"/>'),
        [
            (
                "below_minimum",
                {"joint": "elbow", "element": "limit", "attribute": "velocity", "minimum": 0.0, "got": -1.0},
            )
        ],
    ),
    "negative effort": (
        arm('<limit effort="-1" velocity="1"/>'),
        [
            (
                "below_minimum",
                {"joint": "elbow", "element": "limit", "attribute": "effort", "minimum": 0.0, "got": -1.0},
            )
        ],
    ),
    **{
        f"limit {value!r}": (
            arm(f'<limit lower="{value}" upper="1" effort="1" velocity="1"/>'),
            [("not_numbers", {"joint": "elbow", "element": "limit", "attribute": "lower", "got": value})],
        )
        for value in ("abc", "nan", "-inf", "-1e999", "", "1 2", "0x1", "1_0", " 1", "٣", "1e-308", "${pi}")
    },
    "zero axis": (arm('<axis xyz="0 0 0"/>' + LIMIT), [("axis_zero", {"joint": "elbow", "got": "0 0 0"})]),
    "axis without xyz": (
        arm("<axis/>" + LIMIT),
        [("attribute_missing", {"joint": "elbow", "element": "axis", "attribute": "xyz"})],
    ),
    **{
        f"axis {value!r}": (
            arm(f'<axis xyz="{value}"/>' + LIMIT),
            [("not_numbers", {"joint": "elbow", "element": "axis", "attribute": "xyz", "got": value})],
        )
        for value in ("0 1", "0 0 1 0", "0 0 z", "0 0 nan", "0 0 inf", "", "0,0,1")
    },
    **{
        f"origin {attribute} {value!r}": (
            robot(LINKS, joint("elbow", origin=f'<origin {attribute}="{value}"/>')),
            [("not_numbers", {"joint": "elbow", "element": "origin", "attribute": attribute, "got": value})],
        )
        for attribute in ("xyz", "rpy")
        for value in ("0 0", "0 0 0 0", "a b c", "0 0 nan", "0 0 1e400", "", "1f 0 0")
    },
    "empty dynamics": (arm(AXIS + LIMIT + "<dynamics/>"), [("dynamics_empty", {"joint": "elbow"})]),
    "damping": (
        arm(AXIS + LIMIT + '<dynamics damping="q"/>'),
        [
            (
                "not_numbers",
                {"joint": "elbow", "element": "dynamics", "attribute": "damping", "count": 1, "got": "q"},
            )
        ],
    ),
    "negative friction": (
        arm(AXIS + LIMIT + '<dynamics friction="-1"/>'),
        [
            (
                "below_minimum",
                {
                    "joint": "elbow",
                    "element": "dynamics",
                    "attribute": "friction",
                    "minimum": 0.0,
                    "got": -1.0,
                },
            )
        ],
    ),
    "no mass": (
        one(f"<inertial>{MOMENTS}</inertial>"),
        [("element_missing", {"link": "upper", "element": "inertial", "missing": "mass"})],
    ),
    "mass without value": (
        one(f"<inertial><mass/>{MOMENTS}</inertial>"),
        [("attribute_missing", {"link": "upper", "element": "mass", "attribute": "value"})],
    ),
    **{
        f"mass {value!r}": (
            one(f'<inertial><mass value="{value}"/>{MOMENTS}</inertial>'),
            [(code, {"link": "upper", "element": "mass", "attribute": "value", "got": got})],
        )
        for value, code, got in (
            *((value, "not_numbers", value) for value in ("heavy", "nan", "inf", "")),
            ("-1", "below_minimum", -1.0),
        )
    },
    "no inertia": (
        one('<inertial><mass value="1"/></inertial>'),
        [("element_missing", {"link": "upper", "element": "inertial", "missing": "inertia"})],
    ),
    "moment missing": (
        one('<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1"/></inertial>'),
        [
            ("attribute_missing", {"link": "upper", "element": "inertia", "attribute": "ixy"}),
            ("attribute_missing", {"link": "upper", "element": "inertia", "attribute": "ixz"}),
            ("attribute_missing", {"link": "upper", "element": "inertia", "attribute": "iyz"}),
        ],
    ),
    "moment": (
        one(f'<inertial><mass value="1"/>{MOMENTS.replace("1", "nan", 1)}</inertial>'),
        [
            (
                "not_numbers",
                {"link": "upper", "element": "inertia", "attribute": "ixx", "count": 1, "got": "nan"},
            )
        ],
    ),
    "inertial origin": (
        one(f'<inertial><origin xyz="0 0 up"/><mass value="1"/>{MOMENTS}</inertial>'),
        [
            (
                "not_numbers",
                {
                    "link": "upper",
                    "part": "inertial",
                    "element": "origin",
                    "attribute": "xyz",
                    "count": 3,
                    "got": "0 0 up",
                },
            )
        ],
    ),
    "visual origin": (
        one('<visual><origin xyz="0 0 up"/><geometry><sphere radius="1"/></geometry></visual>'),
        [
            (
                "not_numbers",
                {
                    "link": "upper",
                    "part": "visual",
                    "element": "origin",
                    "attribute": "xyz",
                    "count": 3,
                    "got": "0 0 up",
                },
            )
        ],
    ),
    "no geometry": (
        one("<collision/>"),
        [("shape_missing", {"link": "upper", "part": "collision"})],
    ),
    "empty geometry": (one(shape("")), [("shape_missing", {"link": "upper", "part": "visual"})]),
    "unknown shape": (
        one(shape('<cone radius="1"/>')),
        [("name_unknown", {"link": "upper", "part": "visual", "kind": "shape", "got": "cone"})],
    ),
    "box without size": (
        one(shape("<box/>")),
        [("attribute_missing", {"link": "upper", "part": "visual", "element": "box", "attribute": "size"})],
    ),
    "box of two": (
        one(shape('<box size="1 1"/>')),
        [
            (
                "not_numbers",
                {
                    "link": "upper",
                    "part": "visual",
                    "element": "box",
                    "attribute": "size",
                    "count": 3,
                    "got": "1 1",
                },
            )
        ],
    ),
    "negative box": (
        one(shape('<box size="1 1 -1"/>')),
        [
            (
                "negative_length",
                {"link": "upper", "part": "visual", "element": "box", "attribute": "size", "got": "1 1 -1"},
            )
        ],
    ),
    "sphere without radius": (
        one(shape("<sphere/>")),
        [
            (
                "attribute_missing",
                {"link": "upper", "part": "visual", "element": "sphere", "attribute": "radius"},
            )
        ],
    ),
    "negative sphere": (
        one(shape('<sphere radius="-1"/>')),
        [
            (
                "negative_length",
                {"link": "upper", "part": "visual", "element": "sphere", "attribute": "radius", "got": "-1"},
            )
        ],
    ),
    "cylinder without length": (
        one(shape('<cylinder radius="1"/>')),
        [
            (
                "attribute_missing",
                {"link": "upper", "part": "visual", "element": "cylinder", "attribute": "length"},
            )
        ],
    ),
    "cylinder without radius": (
        one(shape('<cylinder length="1"/>')),
        [
            (
                "attribute_missing",
                {"link": "upper", "part": "visual", "element": "cylinder", "attribute": "radius"},
            )
        ],
    ),
    "mesh without filename": (
        one(shape("<mesh/>")),
        [
            (
                "attribute_missing",
                {"link": "upper", "part": "visual", "element": "mesh", "attribute": "filename"},
            )
        ],
    ),
    "mesh missing": (
        one(shape('<mesh filename="no.stl"/>')),
        [("mesh_missing", {"link": "upper", "part": "visual", "mesh": "no.stl", "cause": "file"})],
    ),
    "mesh of a missing package": (
        one(shape('<mesh filename="package://nowhere/no.stl"/>')),
        [
            (
                "mesh_missing",
                {
                    "link": "upper",
                    "part": "visual",
                    "mesh": "package://nowhere/no.stl",
                    "cause": "package",
                    "package": "nowhere",
                },
            )
        ],
    ),
    "mesh with a long name": (
        one(shape(f'<mesh filename="{"m" * 5000}.stl"/>')),
        [("mesh_missing", {"link": "upper", "part": "visual", "mesh": f"{'m' * 5000}.stl", "cause": "file"})],
    ),
    "package with a long name": (
        one(shape(f'<mesh filename="package://{"m" * 5000}/a"/>')),
        [
            (
                "mesh_missing",
                {
                    "link": "upper",
                    "part": "visual",
                    "mesh": f"package://{'m' * 5000}/a",
                    "cause": "package",
                    "package": "m" * 5000,
                },
            )
        ],
    ),
    "file url missing": (
        one(shape('<mesh filename="file:///no.stl"/>')),
        [("mesh_missing", {"link": "upper", "part": "visual", "mesh": "file:///no.stl", "cause": "file"})],
    ),
    "mesh on the net": (
        one(shape('<mesh filename="https://a/b.stl"/>')),
        [
            (
                "mesh_missing",
                {
                    "link": "upper",
                    "part": "visual",
                    "mesh": "https://a/b.stl",
                    "cause": "scheme",
                    "scheme": "https",
                },
            )
        ],
    ),
    "mesh scale": (
        one(shape('<mesh filename="no.stl" scale="1 1"/>')),
        [
            (
                "not_numbers",
                {
                    "link": "upper",
                    "part": "visual",
                    "element": "mesh",
                    "attribute": "scale",
                    "count": 3,
                    "got": "1 1",
                },
            ),
            ("mesh_missing", {"link": "upper", "part": "visual", "mesh": "no.stl", "cause": "file"}),
        ],
    ),
    "nameless material": (
        sphere('<material><color rgba="1 1 1 1"/></material>'),
        [
            (
                "attribute_missing",
                {"link": "upper", "part": "visual", "element": "material", "attribute": "name"},
            )
        ],
    ),
    "colour of three": (
        sphere('<material name="m"><color rgba="1 1 1"/></material>'),
        [
            (
                "not_numbers",
                {
                    "link": "upper",
                    "part": "visual",
                    "element": "color",
                    "attribute": "rgba",
                    "count": 4,
                    "got": "1 1 1",
                },
            )
        ],
    ),
    "colour in bytes": (
        sphere('<material name="m"><color rgba="255 0 0 1"/></material>'),
        [("colour_beyond", {"link": "upper", "part": "visual", "got": "255 0 0 1"})],
    ),
    "colour without numbers": (
        sphere('<material name="m"><color/></material>'),
        [("attribute_missing", {"link": "upper", "part": "visual", "element": "color", "attribute": "rgba"})],
    ),
    "top material": (
        robot('<material name="m"><color rgba="1 1 1 x"/></material>', link("a")),
        [
            (
                "not_numbers",
                {"part": "robot", "element": "color", "attribute": "rgba", "count": 4, "got": "1 1 1 x"},
            )
        ],
    ),
    "nameless top material": (
        robot('<material><color rgba="1 1 1 1"/></material>', link("a")),
        [("attribute_missing", {"part": "robot", "element": "material", "attribute": "name"})],
    ),
    "material twice": (
        robot('<material name="m"><color rgba="1 1 1 1"/></material>' * 2, link("a")),
        [("name_twice", {"kind": "material", "name": "m"})],
    ),
}


#: Those of `BAD` that kinematics does not feel.
SPARED = {
    *("call left over from xacro", "mimic", "limit without effort", "limit without velocity"),
    *("continuous limit without effort", "negative velocity", "negative effort", "no mass", "no inertia"),
    *("mass without value", "mass 'heavy'", "mass 'nan'", "mass 'inf'", "mass ''", "mass '-1'"),
    *("moment missing", "moment", "inertial origin", "nameless material", "colour of three"),
    *("colour in bytes", "colour without numbers", "top material", "nameless top material"),
}


@pytest.mark.parametrize("case", [case for case in BAD if case not in SPARED])
def test_malformed_urdf(case: str, tmp_path: Path) -> None:
    text, expected = BAD[case]
    assert_found(refused_text(text, tmp_path).findings, *expected)


@pytest.mark.parametrize("case", sorted(SPARED))
def test_faults_that_kinematics_does_not_feel_are_warnings(case: str, tmp_path: Path) -> None:
    text, expected = BAD[case]
    path = write(tmp_path / "odd.urdf", text)
    made = file_report(path)
    assert made.problems == ()
    for code, values in expected:
        assert any(holds(one, code, **values) for one in made.warnings)
    notes = {note.code for note in load(path).notes}
    assert notes & {"leader_unknown", "faults_spared"}


def test_what_is_spared_is_left_out(tmp_path: Path) -> None:
    """Against the same robot without the faults: limits are none, a mass stays, a colour is the usual one."""
    red = '<material name="m"><color rgba="{}"/></material>'
    ball = shape('<sphere radius="0.1"/>', "visual", '<material name="m"/>')
    mass = '<inertial><mass value="2"/>{}</inertial>'
    limit = '<limit lower="-1" upper="1" {}/>'

    def made(name: str, colour: str, moments: str, more: str) -> Robot:
        parts = [link("a", ball), link("b", mass.format(moments) + ball)]
        text = robot(red.format(colour), *parts, joint("j", body=AXIS + limit.format(more)))
        return load(write(tmp_path / f"{name}.urdf", text), platform="fixed")

    odd = made("odd", "255 0 0 1", "", 'velocity="-1"')
    plain = made(
        "plain",
        "1 0 0 1",
        '<inertia ixx="0" ixy="0" ixz="0" iyy="0" iyz="0" izz="0"/>',
        'effort="0" velocity="0"',
    )
    assert odd.model.inertias[1].mass == plain.model.inertias[1].mass == 2.0
    assert odd.q_limits.tolist() == plain.q_limits.tolist() == [[-1.0, 1.0]]
    assert odd.u_limits.tolist() == plain.u_limits.tolist() == [np.inf]
    assert odd.model.upperEffortLimit[0] == np.inf
    assert len(odd.visual_model.geometryObjects) == 2


def test_a_capsule_is_read(tmp_path: Path) -> None:
    capsule = shape('<capsule radius="0.1" length="0.6"/>', "collision")
    (solid,) = load(write(tmp_path / "r.urdf", robot(link("a", capsule)))).collision_model.geometryObjects
    assert (solid.geometry.radius, 2.0 * solid.geometry.halfLength) == (0.1, 0.6)


def test_a_mesh_scaled_by_four_numbers_takes_three(tmp_path: Path) -> None:
    write(tmp_path / "m.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    mesh = shape('<mesh filename="m.obj" scale="2 3 4 1"/>')
    path = write(tmp_path / "r.urdf", robot(link("a", mesh)))
    (solid,) = load(path).shapes.visual_model.geometryObjects
    assert solid.meshScale.tolist() == [2.0, 3.0, 4.0]
    assert any(holds(one, "not_numbers", attribute="scale") for one in file_report(path).warnings)


def test_every_problem_is_named_with_its_line(tmp_path: Path) -> None:
    text = "\n".join(
        [
            '<robot name="r">',
            '<link name="base"/>',
            '<link name="a"><visual><geometry><box/></geometry></visual></link>',
            '<link name="stray"/>',
            '<joint name="j" type="revolute"><parent link="base"/><child link="a"/></joint>',
            '<joint name="k" type="ball"><parent link="base"/><child link="nothing"/></joint>',
            "</robot>",
        ]
    )
    error = refused_text(text, tmp_path)
    assert_found(
        error.findings,
        ("name_unknown", {"line": 6, "joint": "k", "kind": "child link", "got": "nothing"}),
        ("several_roots", {"roots": ["base", "stray"]}),
        ("attribute_missing", {"line": 3, "link": "a", "part": "visual", "attribute": "size"}),
        ("limit_missing", {"line": 5, "joint": "j"}),
        ("name_unknown", {"line": 6, "joint": "k", "kind": "joint type", "got": "ball"}),
    )
    assert find_problems(text) == [*error.findings]
    for one in error.findings:
        assert (f"line {one.where['line']}: {one}" if one.where else str(one)) in str(error)


def test_long_lists_of_problems_are_cut(tmp_path: Path) -> None:
    text = robot(*(link(f"l{i}", "<visual/>") for i in range(50)))
    assert str(refused_text(text, tmp_path)).endswith("and 39 more")
    assert len(find_problems(text)) == 51


def test_problems_with_joints_locked() -> None:
    """A joint that is locked follows nobody, whatever its <mimic> says."""
    text = robot(LINKS, link("c"), joint(), joint("k", "b", "c", body=AXIS + LIMIT + '<mimic joint="i"/>'))
    (spared,) = inspect(text, lock=("j",))[0].spared
    assert holds(spared, "leader_unknown", joint="k", leader="i")
    assert inspect(text, lock=("k",))[0].spared == ()


def test_problems_without_a_file() -> None:
    assert find_problems(robot(LINKS, joint())) == []
    # Whether a mesh exists is asked only where one says how to find it.
    mesh = one(shape('<mesh filename="package://p/m.stl"/>'))
    assert find_problems(mesh) == []
    lost = Finding("mesh_missing", {"mesh": "package://p/m.stl", "cause": "file"})
    (found,) = find_problems(mesh, lambda name: lost)
    assert (found.values, found.where) == (lost.values, {"line": 1, "link": "upper", "part": "visual"})


# ------------------------------------------------------------------------------------------------ meshes


def mesh_file(tmp_path: Path, name: str, content: bytes) -> str:
    (tmp_path / name).write_bytes(content)
    return one(shape(f'<mesh filename="{name}"/>', "collision"))


def test_mesh_of_unknown_format(tmp_path: Path) -> None:
    error = refused_text(mesh_file(tmp_path, "part.step", b"ISO-10303-21;"), tmp_path)
    assert_found(
        error.findings, ("mesh_format_unknown", {"mesh": "part.step", "available": [*MESH_SUFFIXES]})
    )


@pytest.mark.parametrize("suffix", [".stl", ".dae", ".obj", ".ply", ".glb", ".gltf", ".off", ".3mf"])
@pytest.mark.parametrize(
    "content", [b"", b"junk", b"\x00" * 200, b"<a>"], ids=["empty", "junk", "zeros", "xml"]
)
def test_mesh_that_is_none(suffix: str, content: bytes, tmp_path: Path) -> None:
    """Refused when it is needed: a controller needs no mesh."""
    loaded = load(write(tmp_path / "r.urdf", mesh_file(tmp_path, f"part{suffix}", content)))
    for _ in range(2):
        with pytest.raises(RobotError) as caught:
            _ = loaded.collision_model
        assert str(caught.value).isprintable()
        mesh = str(tmp_path / f"part{suffix}")
        assert_found(caught.value.findings, ("mesh_unreadable", {"link": "upper", "mesh": mesh}))


def test_mesh_that_is_a_folder(tmp_path: Path) -> None:
    (tmp_path / "part.stl").mkdir()
    error = refused_text(one(shape('<mesh filename="part.stl"/>')), tmp_path)
    assert_found(error.findings, ("mesh_missing", {"mesh": "part.stl", "cause": "file"}))


# ------------------------------------------------------------------------------------------------- files


def test_unknown_name() -> None:
    error = refused("unicycle_2R")
    assert error.got == "unicycle_2R"
    assert set(error.available or ()) == set(bundled_robots())
    assert "'unicycle_2r'" in error.what
    assert refused("").got == ""


@pytest.mark.parametrize("source", [None, 3, ["unicycle_2r"], b"unicycle_2r", pin.GeometryModel()])
def test_source_of_another_type(source: object) -> None:
    assert refused(source).got is source


@pytest.mark.parametrize(
    "source",
    ["no.urdf", "~nobody-of-this-name/r.urdf", "./no.urdf.xacro", "/no/where.urdf", "unicycle_2r.urdf"],
)
def test_missing_file(source: str) -> None:
    for given in (source, Path(source)):
        error = refused(given)
        assert (error.where, error.findings) == (str(Path(source)), ())


def test_impossible_file_name() -> None:
    assert "File name too long" in refused("/" + "x" * 5000 + ".urdf").what
    assert str(refused("a\0b.urdf")).startswith(r"a\x00b.urdf: ")


def test_names_with_control_characters(tmp_path: Path) -> None:
    """No name can break the line or reach the terminal as an escape sequence."""
    folder = tmp_path / "new\nline"
    folder.mkdir()
    path = write(folder / "\x1b[31mred.urdf", robot(link("a&#10;b"), link("c&#127;d"), link("e")))
    message = str(refused(path))
    assert r"new\nline/\x1b[31mred.urdf" in message
    assert r"a\nb, c\x7fd, e" in message


@pytest.mark.parametrize("suffix", ["", ".urdf", ".xacro"])
def test_folder(suffix: str, tmp_path: Path) -> None:
    folder = tmp_path / f"robot{suffix}"
    folder.mkdir()
    assert refused(folder).where == str(folder)
    assert refused(folder).expected == "a .urdf, .xacro or .xml file"


@pytest.mark.parametrize("name", ["robot.sdf", "robot.urdf.bak", "robot", "robot.json"])
def test_other_suffix(name: str, tmp_path: Path) -> None:
    path = write(tmp_path / name, robot(link("a")))
    assert (refused(path).where, refused(path).got) == (str(path), name)


@pytest.mark.parametrize(("name", "kind"), [("robot.sdf", "SDF"), ("arm.usda", "USD")])
def test_other_languages_are_told_what_to_give(name: str, kind: str, tmp_path: Path) -> None:
    error = refused(write(tmp_path / name, "<sdf/>"))
    assert error.what == f"{kind} is not read: give the URDF or xacro file that it was made from"


@pytest.mark.parametrize("suffix", [".urdf", ".xacro"])
def test_unreadable(suffix: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = write(tmp_path / f"r{suffix}", robot(link("a")))

    def read_bytes(file: Path, most: int) -> bytes:
        raise PermissionError(13, "Permission denied", str(file))

    monkeypatch.setattr("nmm.model.robots.loading.xml_tree.read_bytes", read_bytes)
    assert_found(refused(path).findings, ("file_unreadable", {"reason": "Permission denied"}))


@pytest.mark.parametrize("suffix", [".urdf", ".xacro"])
@pytest.mark.parametrize("encoding", ["latin-1", "utf-16"])
def test_not_utf_8(suffix: str, encoding: str, tmp_path: Path) -> None:
    path = tmp_path / f"r{suffix}"
    path.write_bytes('<robot name="r">\n<link name="é"/></robot>'.encode(encoding))
    line = 2 if encoding == "latin-1" else 1
    assert_found(refused(path).findings, ("not_text", {"line": line}))


# ------------------------------------------------------------------------------------------------- xacro


def xacro(*parts: str) -> str:
    return robot(*parts, attributes=XACRO)


BAD_XACRO = {
    "empty": ("", [("file_empty", {})], []),
    "malformed": ("<robot>\n<link>", [("not_xml", {"reason": "no element found"})], []),
    "doctype": ('<!DOCTYPE r [<!ENTITY a "b">]>\n' + xacro(link("&a;")), [("doctype", {})], []),
    "unknown name": (
        xacro(link("${nothing}")),
        [("xacro_failed", {})],
        ["name 'nothing' is not defined", "expression 'nothing'"],
    ),
    "bad expression": (xacro(link("${1 +}")), [("xacro_failed", {})], ["invalid syntax"]),
    "division": (xacro(link("${1/0}")), [("xacro_failed", {})], ["division by zero", "expression '1/0'"]),
    "unclosed": (xacro(link("${1")), [("xacro_failed", {})], ["invalid expression"]),
    "undeclared argument": (xacro(link("$(arg l1)")), [("xacro_argument_missing", {"name": "l1"})], []),
    "unknown macro": (xacro("<xacro:arm/>"), [("xacro_failed", {})], ["unknown macro name: xacro:arm"]),
    "macro parameter": (
        xacro('<xacro:macro name="arm" params="l"/>', "<xacro:arm/>"),
        [("xacro_failed", {})],
        ["Undefined parameters [l]"],
    ),
    "missing include": (
        xacro('<xacro:include filename="no.xacro"/>'),
        [("xacro_failed", {})],
        ["included file", "no.xacro", "does not exist"],
    ),
    "included folder": (
        xacro('<xacro:include filename="."/>'),
        [("file_unreadable", {"reason": "this is a directory"})],
        [],
    ),
    "missing package": (
        xacro('<xacro:include filename="$(find pk)/a"/>'),
        [("package_missing", {"package": "pk", "by": "$(find pk)"})],
        [],
    ),
    "eval": (xacro(link("$(eval 1 +)")), [("xacro_failed", {})], ["invalid syntax"]),
    "package name": (
        xacro(link("$(find ../..)")),
        [("package_missing", {"package": "../..", "by": "$(find ../..)"})],
        [],
    ),
    "unknown substitution": (
        xacro(link("$(finds p)")),
        [("xacro_failed", {})],
        ["Unknown substitution command"],
    ),
    "environment": (
        xacro(link("$(env NMM_NOTHING)")),
        [("xacro_untrusted", {"what": "environment variable NMM_NOTHING"})],
        [],
    ),
    "condition": (xacro('<xacro:if value="maybe"/>'), [("xacro_failed", {})], ["maybe", "not a boolean"]),
    "fatal": (xacro("${xacro.fatal('arm too long')}"), [("xacro_failed", {})], ["arm too long"]),
    "printed": (
        xacro("${xacro.error('oh no')}", "${nothing}"),
        [("xacro_failed", {})],
        ["'nothing' is not defined"],
    ),
    "no yaml": (xacro("${xacro.load_yaml('no.yaml')}"), [("xacro_failed", {})], ["no.yaml"]),
    "circular": (
        xacro('<xacro:property name="a" value="${b}"/><xacro:property name="b" value="${a}"/>', link("${a}")),
        [("xacro_failed", {})],
        ["circular variable definition: a -> b -> a"],
    ),
    "includes itself": (xacro('<xacro:include filename="bad.xacro"/>'), [("xacro_endless", {})], []),
    "calls itself": (
        xacro('<xacro:macro name="m"><xacro:m/></xacro:macro>', "<xacro:m/>"),
        [("xacro_endless", {})],
        [],
    ),
    "bad include attribute": (xacro("<xacro:include/>"), [("xacro_failed", {})], ["filename"]),
    "expands to nothing": (xacro(), [("no_links", {})], []),
    "expands to a bad robot": (xacro(LINKS), [("several_roots", {"roots": ["a", "b"]})], []),
    "expands to a bad number": (
        xacro('<xacro:property name="l" value="long"/>', LINKS, joint(origin='<origin xyz="${l} 0 0"/>')),
        [
            (
                "not_numbers",
                {"joint": "j", "element": "origin", "attribute": "xyz", "count": 3, "got": "long 0 0"},
            )
        ],
        [],
    ),
}


@pytest.mark.parametrize("case", list(BAD_XACRO))
def test_malformed_xacro(case: str, tmp_path: Path) -> None:
    text, expected, parts = BAD_XACRO[case]
    error = refused_text(text, tmp_path, "bad.xacro")
    assert_found(error.findings, *expected)
    assert all(part in error.findings[0].values["reason"] for part in parts)


@pytest.mark.parametrize(
    ("content", "code", "line"),
    [
        (b"<robot>\n<link>", "not_xml", {"line": 2}),
        (b"", "file_empty", {}),
        (b"<!DOCTYPE a><robot/>", "doctype", {"line": 1}),
        (b"<robot>\n\xff</robot>", "not_text", {"line": 2}),
        (robot("${nothing}").encode(), "xacro_failed", {}),
    ],
)
def test_included_file_is_named(content: bytes, code: str, line: dict[str, int], tmp_path: Path) -> None:
    (tmp_path / "part.xacro").write_bytes(content)
    path = write(tmp_path / "whole.xacro", xacro('<xacro:include filename="part.xacro"/>', link("a")))
    (found,) = refused(path).findings
    assert (found.code, found.where) == (code, {"file": str(tmp_path / "part.xacro"), **line})


def test_lines_of_expanded_text_are_not_given(tmp_path: Path) -> None:
    """They are no lines of the file."""
    assert "line " not in str(refused_text(xacro("\n\n", LINKS, joint(kind="ball")), tmp_path, "bad.xacro"))


def test_unknown_arguments(tmp_path: Path) -> None:
    error = refused("unicycle_2r", arguments={"l3": 0.3})
    assert error.where.endswith("unicycle_2r.urdf.xacro")
    assert error.available == ("d", "h", "l1", "l2", "wheel_radius", "track")
    path = write(tmp_path / "r.xacro", xacro(link("a")))
    error = refused(path, arguments={"l": 1})
    assert (error.where, error.got, error.available) == (str(path), "l", ())
    path = write(tmp_path / "r.urdf", robot(link("a")))
    error = refused(path, arguments={"l": 1})
    assert (error.where, error.findings) == (str(path), ())


def test_impossible_arguments() -> None:
    for name in ("l1", "h", "wheel_radius"):
        (found,) = refused("unicycle_2r", arguments={name: 0}).findings
        assert (
            f"argument {name} must be greater than 0 (m), got 0" in found.values["reason"]
        )  # the file's own
    for value in (None, [0.3], {"a": 1}, 1j):
        error = refused("unicycle_2r", arguments={"l1": value})
        assert (error.where, error.got) == ("arguments: l1", value)
    for arguments, got in (({1: 2}, 1), (["l1"], ["l1"])):
        error = refused("unicycle_2r", arguments=arguments)
        assert (error.where, error.got) == ("arguments", got)


def test_options_that_do_not_fit(tmp_path: Path) -> None:
    model = pin.buildSampleModelManipulator()
    refused(model, arguments={"a": 1})
    refused(model, package_dirs=["/tmp"])
    refused("unicycle_2r", visual_model=pin.GeometryModel())
    missing = tmp_path / "nothing"
    error = refused("unicycle_2r", package_dirs=[missing])
    assert (error.where, error.got) == ("package_dirs", str(missing))


# -------------------------------------------------------------------------------------------- everything

RICH = robot(
    '<material name="m"><color rgba="1 0 0 1"/></material>',
    link("base", inertial() + shape('<box size="1 1 1"/>', "visual", '<material name="m"/>')),
    link(
        "arm", inertial() + shape('<cylinder radius="1" length="2"/>', "collision", '<origin rpy="0 0 1"/>')
    ),
    link(
        "hand",
        shape('<sphere radius="0.1"/>', "visual", '<material name="n"><color rgba="0 0 0 1"/></material>'),
    ),
    joint("one", "base", "arm", body=AXIS + LIMIT + '<dynamics damping="1" friction="2"/>'),
    joint(
        "two",
        "arm",
        "hand",
        "prismatic",
        AXIS + LIMIT + '<safety_controller k_velocity="1"/><calibration rising="1"/>',
    ),
    '<transmission name="t"><joint name="one"/></transmission><gazebo reference="arm"/>',
    attributes='name="rich" version="1.0"',
)


def spoiled() -> Iterator[str]:
    """Each attribute gone, empty or nonsense; each element gone, empty, doubled or of another name."""
    root = ElementTree.fromstring(RICH)
    count = len(list(root.iter()))
    for i in range(count):
        for key in list(root.iter())[i].attrib:
            for value in (None, "", "junk", "nan", "1e999", "-1", "0", "1 2 3", "a&b<c>\"'é"):
                made = copy.deepcopy(root)
                attributes = list(made.iter())[i].attrib
                if value is None:
                    del attributes[key]
                else:
                    attributes[key] = value
                yield ElementTree.tostring(made, encoding="unicode")
        for what in ("gone", "empty", "doubled", "renamed"):
            made = copy.deepcopy(root)
            element = list(made.iter())[i]
            parent = next((p for p in made.iter() if element in list(p)), None)
            if what == "renamed":
                element.tag = "other"
            elif what == "empty":
                element.clear()
            elif parent is not None and what == "gone":
                parent.remove(element)
            elif parent is not None:
                parent.append(copy.deepcopy(element))
            yield ElementTree.tostring(made, encoding="unicode")


def loading_error(path: Path) -> RobotError | None:
    try:
        load(path)
    except RobotError as error:
        return error
    return None


@pytest.mark.parametrize("step", [4, pytest.param(1, marks=pytest.mark.thorough)])
def test_nothing_gets_past_the_checks(step: int, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    """Whatever is spoiled in a description: it loads, or one line says why not; never a word from C++."""
    path = tmp_path / "r.urdf"
    results = {True: 0, False: 0}
    for text in islice(spoiled(), 0, None, step):
        error = loading_error(write(path, text))
        if error is not None:
            assert str(error).isprintable()
            assert error.where == str(path)
            # Pinocchio gets no description that it refuses.
            assert error.findings, text
            assert all(one.code != "library_failed" for one in error.findings), text
        assert capfd.readouterr() == ("", ""), text
        results[error is None] += 1
    assert min(results.values()) > 100 // step


def test_pinocchio_alone_would_not_say(capfd: pytest.CaptureFixture[str]) -> None:
    """Why there is a check: the cause is on C's standard error, or nowhere (which may change)."""
    for text in (BAD["two roots"][0], BAD["revolute without limit"][0], BAD["unknown parent"][0]):
        with pytest.raises(ValueError, match="does not contain a valid URDF"):
            pin.buildModelFromXML(text)
        assert "Error" in capfd.readouterr().err
    for case in ("cycle beside the tree", "two parents", "zero axis"):
        pin.buildModelFromXML(BAD[case][0])
        assert capfd.readouterr().err == ""
