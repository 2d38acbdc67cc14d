"""Robots that cannot be loaded: one line that names file and cause, and nothing on the terminal."""

from __future__ import annotations

import copy
import re
from collections.abc import Iterator
from pathlib import Path
from xml.etree import ElementTree

import pinocchio as pin
import pytest
from urdf_parts import AXIS, LIMIT, inertial, joint, link, robot, shape, write

from nmm.errors import RobotError
from nmm.robots.loading import find_problems, load

pytestmark = pytest.mark.usefixtures("xacro_each_time")

XACRO = 'name="r" xmlns:xacro="http://www.ros.org/wiki/xacro"'
LINKS = link("a") + link("b")
NO_LIMIT = AXIS


@pytest.fixture(autouse=True)
def _silent(capfd: pytest.CaptureFixture[str]) -> Iterator[None]:
    """Nothing on standard output or error, the C library's included."""
    yield
    assert capfd.readouterr() == ("", "")


def refused(source: object, **options: object) -> str:
    """The message with which a source is refused: one line."""
    with pytest.raises(RobotError) as caught:
        load(source, **options)  # type: ignore[arg-type]  # wrong on purpose
    message = str(caught.value)
    assert message.isprintable()
    assert message == message.strip()
    return message


def refused_text(text: str, tmp_path: Path, name: str = "bad.urdf") -> str:
    path = write(tmp_path / name, text)
    message = refused(path)
    assert str(path) in message
    return message


def arm(body: str, kind: str = "revolute") -> str:
    return robot(LINKS, joint("elbow", kind=kind, body=body))


def one(body: str) -> str:
    return robot(link("upper", body))


def sphere(more: str) -> str:
    return one(shape('<sphere radius="1"/>', more=more))


MOMENTS = '<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/>'
# What is wrong, the text, and the parts of the message that must be there.
BAD = {
    "empty": ("", ["file is empty"]),
    "blank": (" \n\t ", ["file is empty"]),
    "no xml": ("hello", ["line 1: not well-formed XML"]),
    "cut": ('<robot name="r">\n<link name="a"/>', ["line 2: not well-formed XML", "no element found"]),
    "wrong end": ("<robot>\n<link>\n</robot>", ["line 3: not well-formed XML", "mismatched tag"]),
    "two attributes": ('<robot name="r" name="s"/>', ["duplicate attribute"]),
    "null": ('<robot name="r"\x00/>', ["not well-formed XML"]),
    "unknown entity": ('<robot name="&lol;"/>', ["undefined entity"]),
    "doctype": (f"<!DOCTYPE robot>\n{robot(link('a'))}", ["line 1", "DOCTYPE"]),
    "entity bomb": (
        '<!DOCTYPE r [<!ENTITY a "aaaa"><!ENTITY b "&a;&a;">]>\n<robot name="&b;"/>',
        ["DOCTYPE", "refused"],
    ),
    "external entity": (
        '<!DOCTYPE r [<!ENTITY f SYSTEM "file:///etc/passwd">]>\n<robot name="r">&f;</robot>',
        ["DOCTYPE"],
    ),
    "another root": ("<sdf><model/></sdf>", ["expected <robot> as the root element, got <sdf>"]),
    "no robot name": (robot(link("a"), attributes=""), ["<robot> has no name"]),
    "empty robot name": (robot(link("a"), attributes='name=""'), ["<robot> has no name"]),
    "version": (robot(link("a"), attributes='name="r" version="2.0"'), ["version", "'2.0'", "1.0"]),
    "xacro in a urdf": (
        robot('<xacro:macro name="m"/>', attributes=XACRO),
        ["xacro:macro", "name the file .xacro"],
    ),
    "no link": (robot(), ["no links"]),
    "nameless link": (robot("<link/>"), ["a link without a name"]),
    "nameless joint": (
        robot(LINKS, '<joint type="fixed"><parent link="a"/><child link="b"/></joint>'),
        ["a joint without a name"],
    ),
    "empty link name": (robot(link("a"), link("")), ["a link without a name"]),
    "two roots": (robot(LINKS, link("c"), joint()), ["one root link", "two", "a, c"]),
    "three roots": (robot(LINKS, link("c")), ["one root link", "three", "a, b, c"]),
    "cycle": (robot(LINKS, joint(), joint("k", "b", "a")), ["cycle", "-> b", "a -> "]),
    "cycle beside the tree": (
        robot(link("base"), LINKS, joint(), joint("k", "b", "a")),
        ["cycle: a -> b -> a"],
    ),
    "its own parent": (robot(link("base"), link("a"), joint("j", "a", "a")), ["cycle: a -> a"]),
    "two parents": (
        robot(LINKS, link("c"), joint("j"), joint("k", "a", "c"), joint("l", "b", "c")),
        ["link 'c' has two parents: 'a', 'b'"],
    ),
    "unknown parent": (
        robot(LINKS, joint(parent="bb")),
        ["joint 'j': unknown parent link 'bb'", "did you mean 'b'"],
    ),
    "unknown child": (
        robot(LINKS, joint(child="zz")),
        ["joint 'j': unknown child link 'zz'", "available: a, b"],
    ),
    "no parent": (
        robot(LINKS, '<joint name="j" type="fixed"><child link="b"/></joint>'),
        ["'j': no <parent>"],
    ),
    "no child": (
        robot(LINKS, '<joint name="j" type="fixed"><parent link="a"/></joint>'),
        ["'j': no <child>"],
    ),
    "parent without link": (
        robot(LINKS, '<joint name="j" type="fixed"><parent/><child link="b"/></joint>'),
        ["joint 'j': <parent> has no link"],
    ),
    "two links of a name": (robot(LINKS, link("a"), joint()), ["two links named 'a'"]),
    "two joints of a name": (
        robot(LINKS, link("c"), joint(), joint(parent="b", child="c")),
        ["two joints named 'j'"],
    ),
    **{
        f"{kind} named {name}": (text, [f"{kind} {name!r}", "taken"])
        for name in ("x", "y", "theta", "universe")
        for kind, text in (
            ("joint", robot(LINKS, joint(name))),
            ("link", robot(link("a"), link(name), joint(child=name))),
        )
    },
    "no type": (
        robot(LINKS, '<joint name="j"><parent link="a"/><child link="b"/></joint>'),
        ["joint 'j': no type", "revolute, continuous, prismatic, fixed"],
    ),
    "unknown type": (arm("", "hinge"), ["joint 'elbow': unknown joint type 'hinge'", "available: revolute"]),
    "capital type": (arm("", "Revolute"), ["unknown joint type 'Revolute'", "did you mean 'revolute'"]),
    "spherical": (arm("", "spherical"), ["unknown joint type 'spherical'"]),
    "planar": (
        robot(LINKS, joint("elbow"), link("c"), joint("wrist", "b", "c", "planar")),
        ["joint 'wrist': a planar joint is refused inside the tree"],
    ),
    "floating": (
        robot(LINKS, joint("elbow"), link("c"), joint("wrist", "b", "c", "floating", "")),
        ["joint 'wrist': a floating joint is refused inside the tree"],
    ),
    "mimic": (
        robot(LINKS, link("c"), joint(), joint("k", "b", "c", body=AXIS + LIMIT + '<mimic joint="i"/>')),
        ["'k'", "unknown joint to follow 'i'"],
    ),
    "revolute without limit": (arm(AXIS), ["joint 'elbow': a revolute joint needs a <limit>"]),
    "prismatic without limit": (arm(AXIS, "prismatic"), ["joint 'elbow': a prismatic joint needs a <limit>"]),
    "limit without effort": (
        arm('<limit lower="0" upper="1" velocity="1"/>'),
        ["'elbow': <limit> has no effort"],
    ),
    "limit without velocity": (arm('<limit lower="0" upper="1" effort="1"/>'), ["<limit> has no velocity"]),
    "continuous limit without effort": (
        arm('<limit velocity="1"/>', "continuous"),
        ["<limit> has no effort"],
    ),
    "limits crossed": (
        arm('<limit lower="1" upper="-1" effort="1" velocity="1"/>'),
        ["joint 'elbow': <limit> lower 1 is above upper -1"],
    ),
    "negative velocity": (arm('<limit effort="1" velocity="-1"/>'), ["velocity: expected 0 or more, got -1"]),
    "negative effort": (arm('<limit effort="-1" velocity="1"/>'), ["effort: expected 0 or more, got -1"]),
    **{
        f"limit {value!r}": (
            arm(f'<limit lower="{value}" upper="1" effort="1" velocity="1"/>'),
            ["joint 'elbow': <limit> lower: expected a finite number", repr(value)],
        )
        for value in ("abc", "nan", "-inf", "-1e999", "", "1 2", "0x1", "1_0", " 1", "٣", "1e-308", "${pi}")
    },
    "zero axis": (arm('<axis xyz="0 0 0"/>' + LIMIT), ["joint 'elbow': <axis> xyz is zero"]),
    "axis without xyz": (arm("<axis/>" + LIMIT), ["joint 'elbow': <axis> has no xyz"]),
    **{
        f"axis {value!r}": (
            arm(f'<axis xyz="{value}"/>' + LIMIT),
            ["joint 'elbow': <axis> xyz: expected 3 finite numbers", repr(value)],
        )
        for value in ("0 1", "0 0 1 0", "0 0 z", "0 0 nan", "0 0 inf", "", "0,0,1")
    },
    **{
        f"origin {attribute} {value!r}": (
            robot(LINKS, joint("elbow", origin=f'<origin {attribute}="{value}"/>')),
            [f"joint 'elbow': <origin> {attribute}: expected 3 finite numbers", repr(value)],
        )
        for attribute in ("xyz", "rpy")
        for value in ("0 0", "0 0 0 0", "a b c", "0 0 nan", "0 0 1e400", "", "1f 0 0")
    },
    "empty dynamics": (arm(AXIS + LIMIT + "<dynamics/>"), ["<dynamics> has neither damping nor friction"]),
    "damping": (
        arm(AXIS + LIMIT + '<dynamics damping="q"/>'),
        ["<dynamics> damping: expected a finite number"],
    ),
    "negative friction": (arm(AXIS + LIMIT + '<dynamics friction="-1"/>'), ["friction: expected 0 or more"]),
    "no mass": (one(f"<inertial>{MOMENTS}</inertial>"), ["link 'upper': <inertial> has no <mass>"]),
    "mass without value": (
        one(f"<inertial><mass/>{MOMENTS}</inertial>"),
        ["link 'upper': <mass> has no value"],
    ),
    **{
        f"mass {value!r}": (
            one(f'<inertial><mass value="{value}"/>{MOMENTS}</inertial>'),
            ["link 'upper': <mass> value: expected"],
        )
        for value in ("heavy", "nan", "inf", "-1", "")
    },
    "no inertia": (
        one('<inertial><mass value="1"/></inertial>'),
        ["link 'upper': <inertial> has no <inertia>"],
    ),
    "moment missing": (
        one('<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1"/></inertial>'),
        ["<inertia> has no ixy", "<inertia> has no ixz", "<inertia> has no iyz"],
    ),
    "moment": (
        one(f'<inertial><mass value="1"/>{MOMENTS.replace("1", "nan", 1)}</inertial>'),
        ["link 'upper': <inertia> ixx: expected a finite number, got 'nan'"],
    ),
    "inertial origin": (
        one(f'<inertial><origin xyz="0 0 up"/><mass value="1"/>{MOMENTS}</inertial>'),
        ["link 'upper', inertial: <origin> xyz"],
    ),
    "visual origin": (
        one('<visual><origin xyz="0 0 up"/><geometry><sphere radius="1"/></geometry></visual>'),
        ["link 'upper', visual: <origin> xyz"],
    ),
    "no geometry": (
        one("<collision/>"),
        ["link 'upper', collision: no shape", "box, cylinder, sphere, mesh"],
    ),
    "empty geometry": (one(shape("")), ["link 'upper', visual: no shape"]),
    "unknown shape": (one(shape('<cone radius="1"/>')), ["unknown shape 'cone'", "available: box, cylinder"]),
    "box without size": (one(shape("<box/>")), ["link 'upper', visual: <box> has no size"]),
    "box of two": (one(shape('<box size="1 1"/>')), ["<box> size: expected 3 finite numbers, got '1 1'"]),
    "negative box": (one(shape('<box size="1 1 -1"/>')), ["<box> size: expected lengths of 0 or more"]),
    "sphere without radius": (one(shape("<sphere/>")), ["<sphere> has no radius"]),
    "negative sphere": (
        one(shape('<sphere radius="-1"/>')),
        ["<sphere> radius: expected lengths of 0 or more"],
    ),
    "cylinder without length": (one(shape('<cylinder radius="1"/>')), ["<cylinder> has no length"]),
    "cylinder without radius": (one(shape('<cylinder length="1"/>')), ["<cylinder> has no radius"]),
    "mesh without filename": (one(shape("<mesh/>")), ["link 'upper', visual: <mesh> has no filename"]),
    "mesh missing": (
        one(shape('<mesh filename="no.stl"/>')),
        ["link 'upper', visual: mesh 'no.stl': no such file"],
    ),
    "mesh of a missing package": (
        one(shape('<mesh filename="package://nowhere/no.stl"/>')),
        ["mesh 'package://nowhere/no.stl': package 'nowhere' not found", "package_dirs"],
    ),
    "mesh with a long name": (one(shape(f'<mesh filename="{"m" * 5000}.stl"/>')), ["no such file"]),
    "package with a long name": (one(shape(f'<mesh filename="package://{"m" * 5000}/a"/>')), ["not found"]),
    "file url missing": (
        one(shape('<mesh filename="file:///no.stl"/>')),
        ["mesh 'file:///no.stl': no such file"],
    ),
    "mesh on the net": (one(shape('<mesh filename="https://a/b.stl"/>')), ["cannot read from https://"]),
    "mesh in $(find)": (
        one(shape('<mesh filename="$(find p)/m.stl"/>')),
        ["'$(find p)/m.stl': no such file"],
    ),
    "mesh scale": (
        one(shape('<mesh filename="no.stl" scale="1 1"/>')),
        ["<mesh> scale: expected 3 finite numbers"],
    ),
    "nameless material": (sphere('<material><color rgba="1 1 1 1"/></material>'), ["<material> has no name"]),
    "colour of three": (
        sphere('<material name="m"><color rgba="1 1 1"/></material>'),
        ["<color> rgba: expected 4"],
    ),
    "colour in bytes": (
        sphere('<material name="m"><color rgba="255 0 0 1"/></material>'),
        ["<color> rgba: expected numbers from 0 to 1, got '255 0 0 1'"],
    ),
    "colour without numbers": (sphere('<material name="m"><color/></material>'), ["<color> has no rgba"]),
    "top material": (
        robot('<material name="m"><color rgba="1 1 1 x"/></material>', link("a")),
        ["rgba: expected 4"],
    ),
    "nameless top material": (
        robot('<material><color rgba="1 1 1 1"/></material>', link("a")),
        ["has no name"],
    ),
    "material twice": (
        robot('<material name="m"><color rgba="1 1 1 1"/></material>' * 2, link("a")),
        ["two materials named 'm'"],
    ),
}


@pytest.mark.parametrize("case", list(BAD))
def test_malformed_urdf(case: str, tmp_path: Path) -> None:
    text, parts = BAD[case]
    message = refused_text(text, tmp_path)
    for part in parts:
        assert part in message


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
    message = refused_text(text, tmp_path)
    for part in (
        "line 3: link 'a', visual: <box> has no size",
        "line 5: joint 'j': a revolute joint needs a <limit>",
        "line 6: joint 'k': unknown joint type 'ball'",
        "line 6: joint 'k': unknown child link 'nothing'",
        "expected one root link, found two: base, stray",
    ):
        assert part in message
    problems = find_problems(text)
    assert len(problems) == 5
    assert {problem.line for problem in problems} == {3, 5, 6, None}
    assert all(str(problem) in message for problem in problems)


def test_long_lists_of_problems_are_cut(tmp_path: Path) -> None:
    text = robot(*(link(f"l{i}", "<visual/>") for i in range(50)))
    message = refused_text(text, tmp_path)
    assert message.endswith("and 39 more")
    assert len(find_problems(text)) == 51


def test_problems_with_joints_locked() -> None:
    """A joint that is locked follows nobody, whatever its <mimic> says."""
    text = robot(LINKS, link("c"), joint(), joint("k", "b", "c", body=AXIS + LIMIT + '<mimic joint="i"/>'))
    (problem,) = find_problems(text, lock=["j"])
    assert "unknown joint to follow 'i'" in problem.message
    assert find_problems(text, lock=["k"]) == []


def test_problems_without_a_file() -> None:
    assert find_problems(robot(LINKS, joint())) == []
    # Whether a mesh exists is asked only where one says how to find it.
    mesh = one(shape('<mesh filename="package://p/m.stl"/>'))
    assert find_problems(mesh) == []
    assert [p.message for p in find_problems(mesh, lambda name: f"no {name}")] == [
        "link 'upper', visual: mesh 'package://p/m.stl': no package://p/m.stl"
    ]


# ------------------------------------------------------------------------------------------------ meshes


def mesh_file(tmp_path: Path, name: str, content: bytes) -> str:
    (tmp_path / name).write_bytes(content)
    return one(shape(f'<mesh filename="{name}"/>', "collision"))


def test_mesh_of_unknown_format(tmp_path: Path) -> None:
    message = refused_text(mesh_file(tmp_path, "part.step", b"ISO-10303-21;"), tmp_path)
    assert "mesh 'part.step': unknown format, expected .3mf, .dae," in message


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
        message = str(caught.value)
        assert message.isprintable()
        assert f"link 'upper': mesh {tmp_path / f'part{suffix}'} cannot be read: " in message


def test_mesh_that_is_a_folder(tmp_path: Path) -> None:
    (tmp_path / "part.stl").mkdir()
    assert "mesh 'part.stl': no such file" in refused_text(
        one(shape('<mesh filename="part.stl"/>')), tmp_path
    )


# ------------------------------------------------------------------------------------------------- files


def test_unknown_name() -> None:
    message = refused("unicycle_2R")
    assert "unknown robot 'unicycle_2R' (did you mean 'unicycle_2r'?)" in message
    assert "unicycle_3r" in message
    assert "path of a .urdf or .xacro" in message
    assert "unknown robot ''" in refused("")


@pytest.mark.parametrize("source", [None, 3, ["unicycle_2r"], b"unicycle_2r", pin.GeometryModel()])
def test_source_of_another_type(source: object) -> None:
    assert "expected a robot's name, a path or a pin.Model" in refused(source)


@pytest.mark.parametrize(
    "source",
    ["no.urdf", "~nobody-of-this-name/r.urdf", "./no.urdf.xacro", "/no/where.urdf", "unicycle_2r.urdf"],
)
def test_missing_file(source: str) -> None:
    assert refused(source) == f"{Path(source)}: no such file"
    assert refused(Path(source)) == f"{Path(source)}: no such file"


def test_impossible_file_name() -> None:
    message = refused("/" + "x" * 5000 + ".urdf")
    assert "cannot be read (File name too long)" in message
    assert len(message) < 300
    assert refused("a\0b.urdf") == r"a\x00b.urdf: no such file"


def test_names_with_control_characters(tmp_path: Path) -> None:
    """No name can break the line or reach the terminal as an escape sequence."""
    folder = tmp_path / "new\nline"
    folder.mkdir()
    path = write(folder / "\x1b[31mred.urdf", robot(link("a&#10;b"), link("c&#127;d"), link("e")))
    message = refused(path)
    assert message.isprintable()
    assert r"new\nline/\x1b[31mred.urdf" in message
    assert r"a\nb, c\x7fd, e" in message


@pytest.mark.parametrize("suffix", ["", ".urdf", ".xacro"])
def test_folder(suffix: str, tmp_path: Path) -> None:
    folder = tmp_path / f"robot{suffix}"
    folder.mkdir()
    assert refused(folder) == f"{folder}: expected a .urdf or .xacro file, this is a directory"


@pytest.mark.parametrize("name", ["robot.sdf", "robot.urdf.bak", "robot", "robot.xml"])
def test_other_suffix(name: str, tmp_path: Path) -> None:
    path = write(tmp_path / name, robot(link("a")))
    assert refused(path) == f"{path}: expected a name that ends in .urdf or .xacro"


@pytest.mark.parametrize("suffix", [".urdf", ".xacro"])
def test_unreadable(suffix: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = write(tmp_path / f"r{suffix}", robot(link("a")))

    def read_bytes(file: Path, most: int) -> bytes:
        raise PermissionError(13, "Permission denied", str(file))

    monkeypatch.setattr("nmm.robots.loading.text.read_bytes", read_bytes)
    assert refused(path) == f"{path}: cannot be read (Permission denied)"


@pytest.mark.parametrize("suffix", [".urdf", ".xacro"])
@pytest.mark.parametrize("encoding", ["latin-1", "utf-16"])
def test_not_utf_8(suffix: str, encoding: str, tmp_path: Path) -> None:
    path = tmp_path / f"r{suffix}"
    path.write_bytes('<robot name="r">\n<link name="é"/></robot>'.encode(encoding))
    assert re.fullmatch(rf"{re.escape(str(path))}: line \d: not UTF-8 text", refused(path))


# ------------------------------------------------------------------------------------------------- xacro


def xacro(*parts: str) -> str:
    return robot(*parts, attributes=XACRO)


BAD_XACRO = {
    "empty": ("", ["file is empty"]),
    "malformed": ("<robot>\n<link>", ["line 2: not well-formed XML"]),
    "doctype": ('<!DOCTYPE r [<!ENTITY a "b">]>\n' + xacro(link("&a;")), ["DOCTYPE"]),
    "unknown name": (xacro(link("${nothing}")), ["name 'nothing' is not defined", "expression 'nothing'"]),
    "bad expression": (xacro(link("${1 +}")), ["invalid syntax"]),
    "division": (xacro(link("${1/0}")), ["division by zero", "expression '1/0'"]),
    "unclosed": (xacro(link("${1")), ["invalid expression"]),
    "undeclared argument": (xacro(link("$(arg l1)")), ["xacro argument 'l1' has no default"]),
    "unknown macro": (xacro("<xacro:arm/>"), ["unknown macro name: xacro:arm"]),
    "macro parameter": (
        xacro('<xacro:macro name="arm" params="l"/>', "<xacro:arm/>"),
        ["Undefined parameters [l]"],
    ),
    "missing include": (
        xacro('<xacro:include filename="no.xacro"/>'),
        ["included file", "no.xacro", "does not exist"],
    ),
    "included folder": (xacro('<xacro:include filename="."/>'), ["directory"]),
    "missing package": (
        xacro('<xacro:include filename="$(find pk)/a"/>'),
        ["$(find pk)", "package 'pk' not found"],
    ),
    "eval": (xacro(link("$(eval 1 +)")), ["invalid syntax"]),
    "package name": (xacro(link("$(find ../..)")), ["'../..' not found"]),
    "unknown substitution": (xacro(link("$(finds p)")), ["Unknown substitution command"]),
    "environment": (xacro(link("$(env NMM_NOTHING)")), ["NMM_NOTHING"]),
    "condition": (xacro('<xacro:if value="maybe"/>'), ["maybe", "not a boolean"]),
    "fatal": (xacro("${xacro.fatal('arm too long')}"), ["arm too long"]),
    "printed": (xacro("${xacro.error('oh no')}", "${nothing}"), ["'nothing' is not defined"]),
    "no yaml": (xacro("${xacro.load_yaml('no.yaml')}"), ["no.yaml"]),
    "circular": (
        xacro('<xacro:property name="a" value="${b}"/><xacro:property name="b" value="${a}"/>', link("${a}")),
        ["circular variable definition: a -> b -> a"],
    ),
    "includes itself": (xacro('<xacro:include filename="bad.xacro"/>'), ["recursion without end"]),
    "calls itself": (
        xacro('<xacro:macro name="m"><xacro:m/></xacro:macro>', "<xacro:m/>"),
        ["recursion without end"],
    ),
    "bad include attribute": (xacro("<xacro:include/>"), ["filename"]),
    "expands to nothing": (xacro(), ["no links"]),
    "expands to a bad robot": (xacro(LINKS), ["expected one root link, found two: a, b"]),
    "expands to a bad number": (
        xacro('<xacro:property name="l" value="long"/>', LINKS, joint(origin='<origin xyz="${l} 0 0"/>')),
        ["joint 'j': <origin> xyz: expected 3 finite numbers, got 'long 0 0'"],
    ),
}


@pytest.mark.parametrize("case", list(BAD_XACRO))
def test_malformed_xacro(case: str, tmp_path: Path) -> None:
    text, parts = BAD_XACRO[case]
    message = refused_text(text, tmp_path, "bad.xacro")
    for part in parts:
        assert part in message


@pytest.mark.parametrize(
    ("content", "cause"),
    [
        (b"<robot>\n<link>", "line 2: not well-formed XML"),
        (b"", "file is empty"),
        (b"<!DOCTYPE a><robot/>", "DOCTYPE"),
        (b"<robot>\n\xff</robot>", "line 2: not UTF-8"),
        (robot("${nothing}").encode(), "'nothing' is not defined"),
    ],
)
def test_included_file_is_named(content: bytes, cause: str, tmp_path: Path) -> None:
    (tmp_path / "part.xacro").write_bytes(content)
    path = write(tmp_path / "whole.xacro", xacro('<xacro:include filename="part.xacro"/>', link("a")))
    message = refused(path)
    assert str(tmp_path / "part.xacro") in message
    assert cause in message


def test_lines_of_expanded_text_are_not_given(tmp_path: Path) -> None:
    """They are no lines of the file."""
    assert "line " not in refused_text(xacro("\n\n", LINKS, joint(kind="ball")), tmp_path, "bad.xacro")


def test_unknown_arguments(tmp_path: Path) -> None:
    message = refused("unicycle_2r", arguments={"l3": 0.3})
    assert "unicycle_2r.urdf.xacro: unknown xacro argument 'l3'" in message
    assert "available: d, h, l1, l2, wheel_radius, track" in message
    path = write(tmp_path / "r.xacro", xacro(link("a")))
    assert "unknown xacro argument 'l'; available: none" in refused(path, arguments={"l": 1})
    path = write(tmp_path / "r.urdf", robot(link("a")))
    assert (
        refused(path, arguments={"l": 1}) == f"{path}: arguments (l) are for .xacro files, a .urdf has none"
    )


def test_impossible_arguments() -> None:
    for name in ("l1", "h", "wheel_radius"):
        message = refused("unicycle_2r", arguments={name: 0})
        assert "unicycle_2r.urdf.xacro: " in message
        assert f"argument {name} must be greater than 0 (m), got 0" in message
    for value in (None, [0.3], {"a": 1}, 1j):
        assert "l1: expected a string, a number or a boolean" in refused(
            "unicycle_2r", arguments={"l1": value}
        )
    assert "expected names as strings" in refused("unicycle_2r", arguments={1: 2})
    assert "expected a value for each name" in refused("unicycle_2r", arguments=["l1"])


def test_options_that_do_not_fit(tmp_path: Path) -> None:
    model = pin.buildSampleModelManipulator()
    assert "are for files" in refused(model, arguments={"a": 1})
    assert "are for files" in refused(model, package_dirs=["/tmp"])
    assert "are for a pin.Model" in refused("unicycle_2r", visual_model=pin.GeometryModel())
    missing = tmp_path / "nothing"
    assert (
        refused("unicycle_2r", package_dirs=[missing])
        == f"package_dirs: expected a folder, {missing} is none"
    )


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


def loading_error(path: Path) -> str | None:
    try:
        load(path)
    except RobotError as error:
        return str(error)
    return None


def test_nothing_gets_past_the_checks(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    """Whatever is spoiled in a description: it loads, or one line says why not; never a word from C++."""
    path = tmp_path / "r.urdf"
    results = {True: 0, False: 0}
    for text in spoiled():
        message = loading_error(write(path, text))
        if message is not None:
            assert message.isprintable()
            assert message.startswith(f"{path}: ")
            # Pinocchio gets no description that it refuses.
            assert "Pinocchio" not in message, text
        assert capfd.readouterr() == ("", ""), text
        results[message is None] += 1
    assert min(results.values()) > 100


def test_pinocchio_alone_would_not_say(capfd: pytest.CaptureFixture[str]) -> None:
    """Why there is a check: the cause is on C's standard error, or nowhere (which may change)."""
    for text in (BAD["two roots"][0], BAD["revolute without limit"][0], BAD["unknown parent"][0]):
        with pytest.raises(ValueError, match="does not contain a valid URDF"):
            pin.buildModelFromXML(text)
        assert "Error" in capfd.readouterr().err
    for case in ("cycle beside the tree", "two parents", "zero axis"):
        pin.buildModelFromXML(BAD[case][0])
        assert capfd.readouterr().err == ""
