"""A robot's file with other numbers: the corrected file, loaded, has them, and differs in nothing else."""

from __future__ import annotations

import math
import re
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from ackermann_car import car
from helpers.bundled_bases import BASES
from places import DATA
from rolling_law import base as on_base
from rolling_law import turns, wheel
from urdf_parts import joint, link, shape, vehicle, write
from urdf_parts import robot as of_parts

import nmm
from nmm.base.errors import InputError
from nmm.model.robots.loading.description import describe
from nmm.model.robots.loading.source import source_path
from nmm.model.robots.robot import Robot
from nmm.plugins.robot.calibration.text_edits import XmlText, unified_diff

#: Bundled robots as URDF, with what they are loaded as; and URDF texts.
CASES: dict[str, dict[str, str]] = {
    **BASES,
    "car_base by its wheels": {"platform": "wheeled"},
    "unicycle_3r": {},
    "kiwi": {"platform": "omnidirectional"},
    "ackermann": {},
    "axes down": {},
    "hitch": {"platform": "tractor"},
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("files")


@cache
def _file(case: str, folder: Path) -> Path:
    if case == "kiwi":
        spokes = [(math.cos(a), math.sin(a)) for a in 2.0 * math.pi * np.arange(3) / 3.0]
        wheels = [
            wheel(f"omni_wheel_{k}", "base_link", f"{0.2 * x!r} {0.2 * y!r} 0.1", f"{-x!r} {-y!r} 0")
            for k, (x, y) in enumerate(spokes)
        ]
        text = on_base(*wheels, name="kiwi")
    elif case == "ackermann":
        text = car()
    elif case in ("axes down", "hitch"):
        text = vehicle(*(("steering", 0.7) if case == "axes down" else ("hitch", -0.2)), up=case == "hitch")
    else:
        text = describe(source_path(case.split()[0], ())).xml
    text = text.replace("><", ">\n<")
    return write(folder / f"{case.replace(' ', '_')}.urdf", text)


def loaded(case: str, folder: Path) -> Robot:
    return nmm.load(_file(case, folder), **CASES[case])  # type: ignore[arg-type]  # of the keyword platform


def other_values(robot: Robot) -> dict[str, float]:
    """What a URDF can say, changed by some thousandths, radii each by others."""
    return {
        name: number.value * (1.004 + 0.001 * (k % 4))
        for k, (name, number) in enumerate(nmm.robot_numbers(robot).items())
        if number.kind not in ("offset", "ratio", "centre")
    }


def by_file(path: Path, **keywords: Any) -> dict[str, float]:
    return {name: number.value for name, number in nmm.robot_numbers(nmm.load(path, **keywords)).items()}


@pytest.mark.parametrize("case", CASES)
def test_the_corrected_file_gives_the_numbers(case: str, folder: Path, tmp_path: Path) -> None:
    robot = loaded(case, folder)
    values = other_values(robot)
    assert values
    patch = nmm.description_patch(robot, values, **CASES[case])
    assert patch.left == {}, patch.left
    corrected, diff = patch.save(tmp_path)
    found = by_file(corrected, **CASES[case])
    expected = {name: number.value for name, number in nmm.robot_numbers(robot).items()} | values
    assert found.keys() == expected.keys()
    for name, value in expected.items():
        if "skid" not in case or name not in ("left", "right"):
            assert found[name] == pytest.approx(value, rel=1e-6), name
    assert patch.numbers == found
    # nothing but radii of shapes and places of joints has changed, line by line
    before, after = (path.read_text(encoding="utf-8") for path in (_file(case, folder), corrected))
    assert len(before.splitlines()) == len(after.splitlines())
    assert re.sub(r' (xyz|radius)="[^"]*"', "", before) == re.sub(r' (xyz|radius)="[^"]*"', "", after)
    assert applied(before, diff.read_text(encoding="utf-8")) == after
    # the robot as a whole moves as the one with these numbers
    changed, again = nmm.with_numbers(robot, values), nmm.load(corrected, **CASES[case])  # type: ignore[arg-type]
    np.testing.assert_allclose(again.platform.parameters, changed.platform.parameters, rtol=1e-7, atol=1e-8)
    speeds = changed.wheel_speeds(np.full(robot.platform.p, 0.7))
    others = again.wheel_speeds(np.full(robot.platform.p, 0.7))
    assert others == pytest.approx(speeds, rel=1e-6)


def applied(text: str, diff: str) -> str:
    """What `patch` makes of it."""
    lines, made, at = text.splitlines(keepends=True), list[str](), 0
    for line in diff.splitlines(keepends=True)[2:]:
        if line.startswith("@@"):
            first = int(line.split()[1].removeprefix("-").split(",")[0]) - 1
            made += lines[at:first]
            at = first
        elif line.startswith("+"):
            made.append(line[1:])
        elif line.startswith((" ", "-")):
            assert lines[at].rstrip("\n") == line[1:].rstrip("\n")
            made += [lines[at]] if line.startswith(" ") else []
            at += 1
    whole = "".join([*made, *lines[at:]])
    return whole if text.endswith("\n") else whole.removesuffix("\n")


@pytest.mark.parametrize(
    ("file", "lines"),
    [("tiago_description/robots/tiago.urdf", 4), ("tiago_pro_description/robots/tiago_pro.urdf", 8)],
)
def test_files_of_real_robots(file: str, lines: int, tmp_path: Path) -> None:
    """A differential base and a mecanum one, whose joints are turned and hang on suspensions."""
    robot = nmm.load(DATA + file, missing_meshes="skip")
    arm = {*robot.q_names[robot.platform.n_p :]}
    numbers = nmm.robot_numbers(robot)
    values = {name: number.value * 1.003 for name, number in numbers.items() if number.of not in arm}
    patch = nmm.description_patch(nmm.with_numbers(robot, values))
    assert patch.left == {}
    added = [line for line in patch.diff.splitlines() if line.startswith("+") and line[1] != "+"]
    assert len(added) == lines
    assert all("radius=" in line or "<origin" in line for line in added)
    corrected, _ = patch.save(tmp_path)
    found = by_file(corrected, missing_meshes="skip")
    assert {name: found[name] for name in values} == pytest.approx(values, rel=1e-6)
    before = source_path(robot.source, ()).read_bytes().splitlines()
    after = corrected.read_bytes().splitlines()
    assert len(before) == len(after)
    assert sum(one != other for one, other in zip(before, after, strict=True)) == lines


def test_what_urdf_has_no_words_for_stays(folder: Path) -> None:
    robot = loaded("car_base", folder)
    patch = nmm.description_patch(robot, {"offset.steering": 0.02, "ratio.steering": 1.1, "wheelbase": 0.71})
    assert [*patch.left] == ["offset.steering", "ratio.steering"]
    assert "no word" in patch.left["offset.steering"]
    assert patch.numbers["wheelbase"] == pytest.approx(0.71)
    assert "offset.steering = 0.02 stays in calibration.yaml" in str(patch)
    skid = loaded("omni_base with skid steering", folder)
    patch = nmm.description_patch(skid, {"left": 0.3, "ahead": -0.02})
    assert {*patch.left} == {"left", "ahead"}
    assert (patch.text, patch.diff) == ("", "")
    nothing = nmm.description_patch(robot)
    assert str(nothing).endswith("nothing is to change")
    assert nothing.left == {}
    bare = nmm.load(_file("unicycle_3r", folder), platform=nmm.DifferentialDrive(0.1, 0.4), wheels=())
    settings = {"platform": nmm.DifferentialDrive(0.1, 0.4), "wheels": ()}
    patch = nmm.description_patch(bare, {"radius": 0.11}, **settings)
    assert patch.left == {"radius": "the file shows no wheels"}


def test_radii_that_differ_too_much_become_their_mean(folder: Path, tmp_path: Path) -> None:
    """Whoever has one radius takes files whose radii differ by up to 5 mm."""
    robot = loaded("differential_base", folder)
    values = {"radius.left_wheel_joint": 0.096, "radius.right_wheel_joint": 0.104, "track": 0.51}
    patch = nmm.description_patch(robot, values)
    assert {*patch.left} == {"radius.left_wheel_joint", "radius.right_wheel_joint"}
    assert "the mean, 0.1 m" in patch.left["radius.left_wheel_joint"]
    found = by_file(patch.save(tmp_path)[0])
    assert found == pytest.approx({**values, **dict.fromkeys(patch.left, 0.1)})
    near = {"radius.left_wheel_joint": 0.098, "radius.right_wheel_joint": 0.1025}
    assert nmm.description_patch(robot, near).left == {}
    # no other platform minds
    unicycle = loaded("differential_base as a unicycle", folder)
    patch = nmm.description_patch(unicycle, {k: v for k, v in values.items() if "radius" in k})
    assert patch.left == {}


def test_a_calibration_of_the_corrected_file_has_the_rest(folder: Path, tmp_path: Path) -> None:
    robot = loaded("car_base", folder)
    values = {"offset.steering": 0.02, "wheelbase": 0.71, "radius.rear_left_wheel_joint": 0.1185}
    learned = nmm.CalibrationFile.of(robot, values, dict.fromkeys(values, 0.001), logs=["one.mcap"])
    patch = nmm.description_patch(nmm.load(_file("car_base", folder), calibration=learned))
    rest = patch.calibration(learned)
    assert [*rest.numbers] == ["offset.steering"]
    assert rest.numbers["offset.steering"] == nmm.Calibrated(0.0, 0.02, 0.001)
    corrected, _ = patch.save(tmp_path)
    whole = nmm.load(corrected, calibration=rest.save(tmp_path / "calibration.yaml"))
    for name, number in nmm.robot_numbers(nmm.with_numbers(robot, values)).items():
        assert nmm.robot_numbers(whole)[name].value == pytest.approx(number.value, rel=1e-6), name
    with pytest.raises(InputError) as error:  # what was learned of the file before is of another one
        nmm.load(corrected, calibration=learned)
    assert "its file has changed" in str(error.value)


def test_a_radius_that_a_mesh_has_is_not_expressible(tmp_path: Path) -> None:
    trimesh.creation.cylinder(radius=0.1, height=0.04, sections=180).export(tmp_path / "tyre.stl")
    mesh = shape(f'<mesh filename="{tmp_path}/tyre.stl"/>', more='<origin rpy="1.5707963 0 0"/>')
    sides = [("left", 0.25), ("right", -0.25)]
    wheels = [turns(f"{name}_wheel", "base_link", f"0 {y} 0", "0 1 0", body=mesh) for name, y in sides]
    file = write(tmp_path / "r.urdf", on_base(*wheels))
    robot = nmm.load(file)
    assert nmm.robot_numbers(robot)["radius.left_wheel"].value == pytest.approx(0.1, rel=1e-3)
    patch = nmm.description_patch(robot, {"radius.left_wheel": 0.104, "track": 0.51})
    assert [*patch.left] == ["radius.left_wheel"]
    assert "mesh" in patch.left["radius.left_wheel"]
    assert patch.numbers["track"] == pytest.approx(0.51)
    assert patch.text.count("0.255") == 2


@pytest.mark.parametrize(
    ("name", "values", "arguments"),
    [
        ("differential_base", {"track": 0.56}, {"track": 0.56}),
        (
            "differential_base",
            {"radius.left_wheel_joint": 0.098, "radius.right_wheel_joint": 0.098},
            {"wheel_radius": 0.098},
        ),
        ("car_base", {"wheelbase": 0.72, "track": 0.55}, {"wheelbase": 0.72, "track": 0.55}),
        ("omni_base", {"half_length_plus_width": 0.52}, {"length": 0.54}),
        ("trailer_base", {"L1": 0.72, "L2": 0.72}, {"length": 0.72}),
    ],
)
def test_arguments_of_a_xacro_file(name: str, values: dict[str, float], arguments: dict[str, float]) -> None:
    robot = nmm.load(name)
    patch = nmm.description_patch(robot, values)
    assert (patch.text, patch.diff, patch.save("nowhere")) == ("", "", [])
    assert {key: float(text) for key, text in patch.arguments.items()} == pytest.approx(arguments)
    again = nmm.load(name, arguments=patch.arguments)
    for number, value in values.items():
        assert nmm.robot_numbers(again)[number].value == pytest.approx(value, rel=1e-6)
        assert number not in patch.left
    assert all(f"{key}:=" in str(patch) for key in arguments)


def test_what_one_argument_gives_twice_is_told() -> None:
    robot = nmm.load("differential_base", arguments={"track": 0.6})
    values = {"radius.left_wheel_joint": 0.098, "radius.right_wheel_joint": 0.1, "track": 0.62}
    patch = nmm.description_patch(robot, values)
    given = {name: float(text) for name, text in patch.arguments.items()}
    assert given == pytest.approx({"wheel_radius": 0.099, "track": 0.62})
    assert {*patch.left} == {"radius.left_wheel_joint", "radius.right_wheel_joint"}
    assert "0.099" in patch.left["radius.left_wheel_joint"]
    only_left = nmm.description_patch(robot, {"radius.left_wheel_joint": 0.098})
    assert only_left.numbers["radius.left_wheel_joint"] == pytest.approx(0.098, rel=1e-4)
    assert "radius.right_wheel_joint" in only_left.left  # which goes with it
    learned = nmm.CalibrationFile.of(robot, {"radius.left_wheel_joint": 0.098})
    rest = only_left.calibration(learned)
    whole = nmm.load("differential_base", arguments={"track": 0.6, **only_left.arguments}, calibration=rest)
    assert [number.value for number in nmm.robot_numbers(whole).values()] == pytest.approx([0.098, 0.1, 0.6])


XACRO = """<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro">
  <xacro:property name="wheel_radius" value="0.1"/>
  <xacro:include filename="sides.xacro"/>
  <link name="base_link"/>
  <xacro:macro name="wheel" params="name y">
    <link name="${name}"><visual><origin rpy="1.5707963267948966 0 0"/>
      <geometry><cylinder radius="${wheel_radius}" length="0.04"/></geometry></visual></link>
    <joint name="${name}_joint" type="continuous"><parent link="base_link"/><child link="${name}"/>
      <origin xyz="0 ${y} 0"/><axis xyz="0 1 0"/></joint>
  </xacro:macro>
  <xacro:wheel name="left_wheel" y="${half}"/>
  <xacro:wheel name="right_wheel" y="${-half}"/>
</robot>
"""


def test_literals_of_a_xacro_file_are_told_by_file_and_line(tmp_path: Path) -> None:
    include = '<robot xmlns:xacro="http://www.ros.org/wiki/xacro">\n{}\n</robot>\n'
    write(tmp_path / "sides.xacro", include.format('<xacro:property name="half" value="0.25"/>'))
    file = write(tmp_path / "r.urdf.xacro", XACRO)
    robot = nmm.load(file)
    both = {f"radius.{side}_wheel_joint": 0.098 for side in ("left", "right")}
    patch = nmm.description_patch(robot, {"track": 0.52, **both})
    assert patch.arguments == {}
    assert patch.places["track"] == "sides.xacro:2: 0.25 -> 0.26"
    assert patch.places["radius.left_wheel_joint"] == "r.urdf.xacro:2: 0.1 -> 0.098"
    assert "sides.xacro:2" in str(patch)
    assert {*patch.left} == {"track", *both}
    write(tmp_path / "sides.xacro", include.format('<xacro:property name="half" value="${sqrt(0.0625)}"/>'))
    patch = nmm.description_patch(nmm.load(file), {"track": 0.52})
    assert "computed" in patch.places["track"]


def test_nothing_is_written_where_the_robot_s_file_is(folder: Path, tmp_path: Path) -> None:
    robot = loaded("differential_base", folder)
    patch = nmm.description_patch(robot, {"track": 0.52})
    before = _file("differential_base", folder).read_bytes()
    with pytest.raises(InputError) as error:
        patch.save(folder)
    assert "the robot's own file is there" in str(error.value)
    with pytest.raises(InputError):
        patch.save(tmp_path / "nowhere")
    assert _file("differential_base", folder).read_bytes() == before
    assert [*tmp_path.iterdir()] == []


def test_robots_that_are_of_no_file_are_refused(folder: Path) -> None:
    mounted = nmm.mount("differential_base", "small_arm")
    for robot, told in ((mounted, "no file"), (loaded("car_base", folder), "platform=")):
        with pytest.raises(InputError) as error:
            nmm.description_patch(
                robot, {"track": 0.5}, **({"platform": "unicycle"} if told != "no file" else {})
            )
        assert told in str(error.value)
        assert len(str(error.value)) <= 300
    with pytest.raises(InputError) as error:
        nmm.description_patch(loaded("differential_base", folder), {"trak": 0.5})
    assert "trak" in str(error.value)
    with pytest.raises(InputError):
        nmm.description_patch("differential_base", {"track": 0.5})  # type: ignore[arg-type]


def test_a_joint_without_origin_gets_one(tmp_path: Path) -> None:
    wheels = [turns(f"{side}_wheel", f"{side}_arm", "0 0 0", "0 1 0") for side in ("left", "right")]
    places = {
        side: f"<origin xyz='0 {y} 0' rpy='0 0 0.3'/>" for side, y in (("left", 0.25), ("right", -0.25))
    }
    arms = [joint(f"{s}_fix", "base_link", f"{s}_arm", "fixed", "", at) for s, at in places.items()]
    text = of_parts(link("base_link"), link("left_arm"), link("right_arm"), *arms, *wheels)
    text = text.replace('<origin xyz="0 0 0" rpy="0 0 0"/>', "")
    text = re.sub(r'(<joint name="\w+_wheel".*?)<axis xyz="0 1 0"/>',
                  r'\1<axis xyz="0.29552020666134 0.95533648912561 0"/>', text)  # fmt: skip
    file = write(tmp_path / "r.urdf", text)
    keywords = {"wheels": {"left_wheel": 0.1, "right_wheel": 0.1}, "platform": "differential"}
    robot = nmm.load(file, **keywords)  # type: ignore[arg-type]
    patch = nmm.description_patch(robot, {"track": 0.52}, **keywords)
    assert patch.left == {}
    assert patch.text.count("<origin xyz=") == text.count("<origin xyz=") + 2
    assert patch.numbers["track"] == pytest.approx(0.52, rel=1e-6)


def test_edits_keep_all_else() -> None:
    text = (
        "\ufeff<?xml version='1.0'?>\r\n<!-- <a x='1'/> -->\r\n<r>\r\n"
        "  <a  x = '1  2\t3' y=\"&gt;\" />\r\n  <b>é</b><a/>\r\n</r>"
    )
    xml = XmlText(text.encode())
    first, second = xml.root.every("a")
    assert (xml.line(first), xml.line(second)) == (4, 5)
    xml.write_parts(first, "x", {1: "7"})
    xml.write(first, "y", "8")
    xml.write(second, "z", "9")
    xml.write_parts(xml.root, "xyz", {2: "5"})
    (b,) = xml.root.every("b")
    xml.insert(b, "<c/>")
    expected = (
        "\ufeff<?xml version='1.0'?>\r\n<!-- <a x='1'/> -->\r\n<r xyz=\"0 0 5\">\r\n"
        '  <a  x = \'1  7\t3\' y="8" />\r\n  <b><c/>é</b><a z="9"/>\r\n</r>'
    )
    assert xml.edited().decode() == expected
    assert XmlText(text.encode()).edited() == text.encode()
    assert unified_diff("r", b"a\nb", b"a\nb") == ""
    assert unified_diff("r", b"a\nb", b"a\nc").endswith("+c\n\\ No newline at end of file\n")
