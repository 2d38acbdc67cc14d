"""`nmm check`: every problem with its line, warnings about what is odd, and what the file holds."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
import trimesh
from command_line import Result
from findings import assert_found, holds, of_code
from urdf_parts import AXIS, inertial, joint, link, robot, shape, write

import nmm
from nmm import Finding
from nmm.base.bundled import bundled_robots
from nmm.base.errors import RobotError
from nmm.cli.exit_status import status_of
from nmm.model.collisions.pairs import SAMPLES, link_names, query_shapes, touching, touching_links
from nmm.model.robots.loading.packages import package_file
from nmm.model.robots.loading.report import FileReport, file_report

pytestmark = pytest.mark.usefixtures("xacro_each_time")

Command = Callable[..., Result]
TIAGO = "robots/tiago_description/robots/tiago_no_hand.urdf"
XACRO = 'name="r" xmlns:xacro="http://www.ros.org/wiki/xacro"'
HEAVY_LINKS = link("a", inertial()) + link("b", inertial())


@pytest.fixture
def run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> Command:
    """Run a command line in an empty folder, in this process."""
    monkeypatch.chdir(tmp_path)
    return lambda *arguments: Result(status_of(arguments), *capfd.readouterr())


def printed(run: Command, *arguments: str) -> dict[str, list[Finding]]:
    """What a command prints with --json: problems and warnings."""
    result = run(*arguments, "--json")
    told = json.loads(result.out)
    assert result.status == (2 if told["problems"] else 0)
    return {key: [Finding.from_json(one) for one in told[key]] for key in ("problems", "warnings")}


def reported(tmp_path: Path, text: str, name: str = "robot.urdf", **options: object) -> FileReport:
    return file_report(write(tmp_path / name, text), **options)  # type: ignore[arg-type]  # each test gives its own


def warned(tmp_path: Path, text: str, **options: object) -> list[Finding]:
    """The warnings about a file that has no problems, but that it has no wheels."""
    made = reported(tmp_path, text, **options)
    assert made.problems == ()
    return [one for one in made.warnings if one.code != "no_wheels"]


def moments(xx: float, yy: float, zz: float, xy: float = 0.0, mass: float = 1.0) -> str:
    values = f'ixx="{xx}" ixy="{xy}" ixz="0" iyy="{yy}" iyz="0" izz="{zz}"'
    return f'<inertial><mass value="{mass}"/><inertia {values}/></inertial>'


# Options


def test_missing_meshes_are_what_the_option_says(run: Command, tmp_path: Path) -> None:
    mesh = shape('<mesh filename="none.stl"/>')
    write(tmp_path / "r.urdf", robot(link("a", inertial() + mesh), link("b", inertial()), joint()))
    given = [[], ["--missing-meshes", "skip"], ["--missing-meshes", "error"]]
    as_it_is, skipped, refused = (run("check", "r.urdf", *more) for more in given)
    assert (as_it_is.status, skipped.status, refused.status) == (0, 0, 2)
    for more, key, becomes in zip(
        given, ("warnings",) * 2 + ("problems",), ("refused", "left_out", ""), strict=True
    ):
        (found,) = of_code(printed(run, "check", "r.urdf", *more)[key], "mesh_missing")
        assert holds(found, "mesh_missing", mesh="none.stl", line=1, shape=becomes)
    wrong = run("check", "r.urdf", "--missing-meshes", "maybe")
    assert wrong.status == 2
    assert "'maybe'" in wrong.out + wrong.err


def test_the_srdf_is_the_one_given(run: Command, tmp_path: Path) -> None:
    state = '<group_state name="up" group="arm"><joint name="j" value="{}"/></group_state>'
    write(tmp_path / "r.urdf", robot(link("a", inertial()), link("b", inertial()), joint()))
    for name, value in (("good", 0.1), ("far", 99.0)):
        write(tmp_path / f"{name}.srdf", f'<robot name="r">{state.format(value)}</robot>')
    assert "SRDF" not in run("check", "r.urdf").out
    good = run("check", "r.urdf", "--srdf", "good.srdf")
    assert good.value("SRDF") == "good.srdf: 1 posture"
    far = run("check", "r.urdf", "--srdf", "far.srdf")
    assert far.status == 0
    bare, beyond = printed(run, "check", "r.urdf", "--srdf", "far.srdf")["warnings"]
    assert holds(bare, "no_wheels")
    assert holds(beyond, "posture_beyond", srdf="far.srdf", posture="up", beyond={"j": [99.0, -1.0, 1.0]})
    none = run("check", "r.urdf", "--srdf", "none.srdf")
    assert none.status == 2
    assert "none.srdf" in none.out + none.err


# Problems


def test_every_problem_is_named_with_its_line(run: Command, tmp_path: Path) -> None:
    lines = [
        '<robot name="r">',
        '<link name="a"/>',
        '<link name="b"/>',
        '<joint name="x" type="revolute"><parent link="a"/><child link="b"/>',
        '  <limit lower="2" upper="1" effort="1" velocity="1"/></joint>',
        '<joint name="k" type="floating"><parent link="b"/><child link="c"/></joint>',
        '<link name="c"><visual><geometry><sphere radius="-1"/></geometry></visual></link>',
        '<link name="c"/>',
        "</robot>",
    ]
    write(tmp_path / "bad.urdf", "\n".join(lines))
    result = run("check", "bad.urdf")
    assert result.status == 2
    assert result.err == "nmm check: bad.urdf: 4 problems, no warnings\n"
    found = printed(run, "check", "bad.urdf")["problems"]
    assert_found(
        found,
        ("limits_crossed", {"line": 5, "joint": "x", "lower": 2.0, "upper": 1.0}),
        ("base_inside_tree", {"line": 6, "joint": "k", "kind": "floating"}),
        ("negative_length", {"line": 7, "link": "c", "part": "visual", "got": "-1"}),
        ("name_twice", {"line": 8, "kind": "link", "name": "c"}),
    )
    assert result.out.splitlines() == [f"bad.urdf:{one.where['line']}: {one}" for one in found]


@pytest.mark.parametrize(
    "text", ["", "hello", "<sdf/>", '<robot name="r">\n<link name="a"/>', "\x00", "<!DOCTYPE r>\n<robot/>"]
)
@pytest.mark.parametrize("suffix", ["urdf", "xacro"])
def test_what_is_no_urdf_is_said_in_a_line(run: Command, tmp_path: Path, text: str, suffix: str) -> None:
    write(tmp_path / f"bad.{suffix}", text)
    result = run("check", f"bad.{suffix}")
    assert result.status == 2
    assert result.err.startswith(f"nmm check: bad.{suffix}: 1 problem, ")
    assert len(result.out.splitlines()) == 1
    assert "Traceback" not in result.out + result.err


def test_bytes_that_are_no_text_are_a_problem(run: Command, tmp_path: Path) -> None:
    (tmp_path / "bad.urdf").write_bytes(b'<robot name="r">\n\xff\xfe</robot>')
    result = run("check", "bad.urdf")
    assert result.status == 2
    assert result.out.startswith("bad.urdf:2: ")
    assert_found(printed(run, "check", "bad.urdf")["problems"], ("not_text", {"line": 2}))


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["nowhere.urdf"], "nowhere.urdf: no such file"),
        (["."], "directory"),
        (["notes.txt"], "expected a name that ends in .urdf, .xacro, .xml or .mjcf"),
        (["unicycle_2r", "-a", "d"], "--set: expected ARG=VALUE, as in d=0.5, got 'd'"),
        (["unicycle_2r", "-a", "dd=1"], "unknown xacro argument 'dd' (did you mean 'd'?)"),
        (["unicycle_2r", "--package-dir", "nowhere"], "package_dirs: "),
        (["unicycle_2r", "--nonsense"], "No such option"),
        ([], "Missing argument 'FILE'"),
    ],
)
def test_wrong_usage_is_one_line(run: Command, tmp_path: Path, arguments: Sequence[str], words: str) -> None:
    write(tmp_path / "notes.txt", "")
    result = run("check", *arguments)
    assert (result.status, result.out) == (2, "")
    assert result.err.startswith("nmm check: ")
    assert words in result.err
    assert len(result.err.splitlines()) == 1


def test_of_a_xacro_file_the_lines_are_said_to_be_the_expanded_ones(run: Command, tmp_path: Path) -> None:
    text = robot(
        '<xacro:arg name="n" default="b"/>', link("a"), link("$(arg n)"), joint(child="bb"), attributes=XACRO
    )
    write(tmp_path / "bad.xacro", text)
    result = run("check", "bad.xacro")
    assert result.status == 2
    first = result.out.splitlines()[0]
    assert re.search(r"^bad\.xacro: .*\(line \d+ of the expanded file\)$|one root link", first)
    (found, _) = sorted(printed(run, "check", "bad.xacro")["problems"], key=lambda one: one.code)
    assert holds(found, "name_unknown", kind="child link", got="bb")
    assert f"(line {found.where['line']} of the expanded file)" in result.out
    assert run("check", "bad.xacro", "-a", "n=bb").status == 0


def test_every_missing_package_is_named_with_where_it_was_looked_for(tmp_path: Path) -> None:
    mesh = '<mesh filename="file://$(find {})/m.stl"/>'
    text = robot(
        link("a", shape(mesh.format("lost_one"))), link("b", shape(mesh.format("lost_two"))),
        joint(kind="odd"), attributes=XACRO,
    )  # fmt: skip
    made = reported(tmp_path, text, "robot.xacro", package_dirs=[tmp_path])
    lost = of_code(made.problems, "package_missing")
    assert [one.values["package"] for one in lost] == ["lost_one", "lost_two"]
    assert all(str(tmp_path) in one.values["searched"] for one in lost)
    (kind,) = of_code(made.problems, "name_unknown")
    assert holds(kind, "name_unknown", kind="joint type", got="odd")
    (tmp_path / "lost_one").mkdir()
    again = reported(tmp_path, text, "robot.xacro", package_dirs=[tmp_path])
    assert [one.values["package"] for one in of_code(again.problems, "package_missing")] == ["lost_two"]


def test_xacro_in_a_urdf_is_expanded(tmp_path: Path) -> None:
    named = robot('<xacro:arg name="part" default="a"/>', link("$(arg part)"), attributes=XACRO)
    assert reported(tmp_path, named).robot is not None
    made = reported(
        tmp_path, robot(link("a", shape('<mesh filename="file://$(find nowhere_description)/m.stl"/>')))
    )
    (problem,) = made.problems
    assert holds(problem, "package_missing", package="nowhere_description")
    assert reported(tmp_path, robot(link("a"), "<!-- $(find p) -->")).robot is not None


def test_what_only_loading_notices_is_a_problem(tmp_path: Path) -> None:
    text = robot('<nmm platform="car"/>', HEAVY_LINKS, joint())
    made = reported(tmp_path, text)
    (problem,) = made.problems
    with pytest.raises(nmm.InputError) as caught:
        nmm.load(made.file)
    assert holds(problem, "refused", what=caught.value.what)
    assert caught.value.where == f"{made.file}: r: platform car"


# Warnings


@pytest.mark.parametrize(
    ("inertia", "code", "values"),
    [
        (moments(1, 1, 3), "inertia_impossible", {"moments": [1.0, 1.0, 3.0]}),
        (moments(1, 1, 1, xy=2), "inertia_indefinite", {}),
        (moments(0, 0, 0), "inertia_missing", {"mass": 1.0}),
        (moments(1, 1, 1, mass=0), "mass_missing", {}),
        (moments(1, 1, 1, mass=5000), "mass_large", {"mass": 5000.0}),
    ],
)
def test_inertias_that_no_body_has(
    tmp_path: Path, inertia: str, code: str, values: dict[str, object]
) -> None:
    text = robot(link("a", inertia), "\n", link("b", inertial()), joint())
    assert_found(warned(tmp_path, text), (code, {"link": "a", "line": 1, **values}))


def test_inertias_of_bodies_are_taken(tmp_path: Path) -> None:
    """Boxes turned at random, thin rods and plates among them: the triangle inequality is met, or just so."""
    rng = np.random.default_rng(3)
    parts = [link("a", inertial())]
    for k in range(20):
        sides = rng.uniform(0.0, 1.0, 3) * (1.0, 1.0, k % 2)
        turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        square = np.sum(sides**2)
        tensor = turn @ np.diag((square - sides**2) / 12.0) @ turn.T
        axes = "xyz"
        values = " ".join(
            f'i{axes[i]}{axes[j]}="{float(tensor[i, j])!r}"' for i in range(3) for j in range(i, 3)
        )
        parts.append(link(f"b{k}", f'<inertial><mass value="1"/><inertia {values}/></inertial>'))
        parts.append(joint(f"j{k}", "a", f"b{k}"))
    assert warned(tmp_path, robot(*parts)) == []


def test_bodies_that_move_without_mass(tmp_path: Path) -> None:
    fixed = joint("f", "b", "c", "fixed", body="")
    light = robot(link("a"), link("b"), link("c"), joint(), fixed)
    about = {"link": "b", "moved_by": "j", "inertial": False}
    assert_found(warned(tmp_path, light), ("body_without_mass", about))
    # What is fixed to it has the mass.
    assert warned(tmp_path, robot(link("a"), link("b"), link("c", inertial()), joint(), fixed)) == []


def test_joints_without_a_limit_of_velocity(tmp_path: Path) -> None:
    zero = '<limit lower="-1" upper="1" effort="1" velocity="0"/>'
    text = robot(
        HEAVY_LINKS, link("c", inertial()),
        joint("j", body=AXIS + zero), joint("k", "b", "c", "continuous", AXIS),
    )  # fmt: skip
    assert_found(
        warned(tmp_path, text), ("velocity_zero", {"joint": "j"}), ("velocity_unlimited", {"joint": "k"})
    )
    loaded = nmm.load(tmp_path / "robot.urdf")
    assert np.isinf(loaded.u_limits[-2:]).all()


def test_a_joint_that_its_limits_hold_is_told(tmp_path: Path) -> None:
    found = warned(tmp_path, robot(HEAVY_LINKS, joint(body=AXIS + '<limit effort="1" velocity="1"/>')))
    assert_found(found, ("joint_held", {"joint": "j", "value": 0.0}))
    np.testing.assert_array_equal(nmm.load(tmp_path / "robot.urdf").q_limits[-1], 0.0)


@pytest.mark.parametrize(
    ("lower", "upper", "is_told"),
    [(-100, 230, True), (-170, 0, True), (-10, 10, False), (-1e16, 1e16, False), (-12.5, 12.5, False)],
)
def test_limits_in_degrees_are_told(tmp_path: Path, lower: float, upper: float, is_told: bool) -> None:
    """10 rad are the widest limits of known robots, 1e16 stands for none."""
    limit = f'<limit lower="{lower}" upper="{upper}" effort="1" velocity="1"/>'
    found = warned(tmp_path, robot(HEAVY_LINKS, joint(body=AXIS + limit)))
    expected = ("limits_large", {"joint": "j", "lower": lower, "upper": upper})
    assert_found(found, *([expected] if is_told else []))


def test_places_turned_by_degrees_are_told(tmp_path: Path) -> None:
    def turned(angle: float) -> str:
        at = f'<origin rpy="0 {angle} 0"/>'
        box = f'<visual>{at}<geometry><box size="1 1 1"/></geometry></visual>'
        return robot(link("a", inertial() + box), link("b", inertial()), joint(origin=at))

    assert warned(tmp_path, turned(-6.2832)) == []
    places = {"link": "a", "part": "visual"}, {"joint": "j"}
    told = [("rpy_large", {**place, "rpy": [0.0, 90.0, 0.0]}) for place in places]
    assert_found(warned(tmp_path, turned(90)), *told)


def test_followers_are_told(tmp_path: Path) -> None:
    mimic = '<mimic joint="{}" multiplier="{}"/>'
    up = '<limit lower="0" upper="1" effort="1" velocity="1"/>'
    text = robot(
        HEAVY_LINKS, link("c", inertial()), link("d", inertial()),
        joint("lead", "a", "b", body=AXIS + up),
        joint("first", "b", "c", body=AXIS + up + mimic.format("lead", 2)),
        joint("second", "c", "d", body=AXIS + up + mimic.format("first", -0.5)),
    )  # fmt: skip
    made = reported(tmp_path, text)
    assert made.facts["followers"] == "first = 2 lead, second = -lead"
    bare, warning = made.warnings
    assert holds(bare, "no_wheels")
    limits = {"lower": 0.0, "upper": 1.0}
    assert holds(warning, "mimic_limits_ignored", name="second", leader="lead", **limits)
    robot_read = nmm.load(made.file)
    assert warning in robot_read.notes
    np.testing.assert_array_equal(robot_read.q_limits[3:], [[0, 0.5], [0, 1], [-0.5, 0]])


def test_names_of_a_link_and_a_joint(tmp_path: Path) -> None:
    assert_found(warned(tmp_path, robot(HEAVY_LINKS, joint("b"))), ("name_shared", {"joint": "b"}))
    # As it says.
    loaded = nmm.load(tmp_path / "robot.urdf")
    assert loaded.model.frames[loaded.frame_id("b")].type.name == "BODY"


def test_meshes_that_are_not_there(tmp_path: Path) -> None:
    meshes = [shape(f'<mesh filename="{name}"/>') for name in ("package://nowhere/m.stl", "gone.stl")]
    text = robot(link("a", "\n".join(meshes)))
    made = reported(tmp_path, text)
    assert made.problems == ()
    assert made.facts["meshes"] == "0 of 2 found"
    lost = {"line": 1, "mesh": "package://nowhere/m.stl", "cause": "package", "package": "nowhere"}
    assert_found(
        [one for one in made.warnings if one.code != "no_wheels"],
        ("package_missing", {"package": "nowhere", "by": "package://nowhere"}),
        ("mesh_missing", {**lost, "shape": "refused"}),
        ("mesh_missing", {"line": 2, "mesh": "gone.stl", "cause": "file", "shape": "refused"}),
    )
    assert str(tmp_path) in made.warnings[0].values["searched"]
    with pytest.raises(RobotError) as caught:
        nmm.load(made.file)
    assert [one.values["mesh"] for one in caught.value.findings] == [lost["mesh"], "gone.stl"]
    nmm.load(made.file, missing_meshes="skip")


def test_a_mesh_of_an_unknown_format_is_a_problem(tmp_path: Path) -> None:
    write(tmp_path / "shape.step", "")
    made = reported(tmp_path, robot(link("a", shape('<mesh filename="shape.step"/>'))))
    assert_found(made.problems, ("mesh_format_unknown", {"mesh": "shape.step"}))


def wheeled(x: float = 0.0, left: str = "left_wheel", right: str = "right_wheel", more: str = "") -> str:
    """A body on two wheels whose axle is at x."""
    parts = [link("base", inertial())]
    for name, y in ((left, 0.2), (right, -0.2)):
        at = f'<origin xyz="{x} {y} 0.1"/>'
        limit = '<limit effort="1" velocity="1"/>'
        parts += [link(f"{name}_link", inertial())]
        parts += [joint(name, "base", f"{name}_link", "continuous", f'<axis xyz="0 1 0"/>{limit}', at)]
    return robot(*parts, more)


def on_wheels(*wheels: tuple[str, float, float], footprint: float | None = None) -> str:
    """A body on wheels with round shapes: name, height of the centre and radius of each, m."""
    parts = [link("base", inertial())]
    if footprint is not None:
        parts.append(link("base_footprint"))
        parts.append(
            joint("at_foot", "base", "base_footprint", "fixed", "", f'<origin xyz="0 0 {footprint}"/>')
        )
    for k, (name, z, radius) in enumerate(wheels):
        tyre = '<origin rpy="1.5707963 0 0"/>'
        tyre += f'<geometry><cylinder radius="{radius}" length="0.04"/></geometry>'
        parts.append(link(f"{name}_link", inertial() + f"<collision>{tyre}</collision>"))
        at, limit = f'<origin xyz="0 {(0.2, -0.2, 0.0)[k]} {z}"/>', '<limit effort="1" velocity="1"/>'
        parts.append(joint(name, "base", f"{name}_link", "continuous", f'<axis xyz="0 1 0"/>{limit}', at))
    return robot(*parts)


def test_where_the_wheels_touch_the_ground_is_told(tmp_path: Path) -> None:
    """From their shapes: a root link at the axle is seen to be there. A footprint must be on it."""
    pair = [("left_wheel", 0.1), ("right_wheel", 0.1)]
    for z, words in ((0.1, "at z = 0"), (0.0, "at z = -0.1 m in link 'base'"), (-0.02, "at z = -0.12 m in")):
        made = reported(tmp_path, on_wheels(*((name, z, radius) for name, radius in pair)))
        assert (made.problems, made.warnings) == ((), ())
        assert words in made.facts["ground"]
    assert "--axle 0,0,-0.12" in made.facts["ground"]
    low = [(name, 0.0, radius) for name, radius in pair]
    assert warned(tmp_path, on_wheels(*low, footprint=-0.1)) == []
    (warning,) = warned(tmp_path, on_wheels(*low, footprint=-0.05))
    assert holds(warning, "footprint_off_ground", frame="base_footprint")
    assert warning.values["off"] == pytest.approx(0.05)
    moved = reported(tmp_path, on_wheels(*low), axle=(0.0, 0.0, -0.1))
    assert "at z = 0" in moved.facts["ground"]


def test_wheels_touch_one_level_ground(tmp_path: Path) -> None:
    """Within 5 mm, or 1 % of a large wheel's radius."""
    for off, count in ((0.004, 0), (-0.004, 0), (-0.008, 1)):
        text = on_wheels(
            ("left_wheel", 0.0, 0.1), ("right_wheel", 0.0, 0.1), ("caster_wheel", off - 0.06, 0.04)
        )
        assert len(warned(tmp_path, text)) == count, off
    (warning,) = warned(tmp_path, text)
    assert holds(warning, "ground_uneven", near=0.005)
    heights = {"caster_wheel": -0.108, "left_wheel": -0.1, "right_wheel": -0.1}
    assert warning.values["heights"] == pytest.approx(heights)
    large = [("left_wheel", 0.0, 2.0), ("right_wheel", -0.015, 2.0)]
    assert warned(tmp_path, on_wheels(*large)) == []


def tyre(folder: Path, radius: float) -> str:
    """A wheel's mesh on the y axis, as a shape of a link."""
    mesh = trimesh.creation.cylinder(radius, 0.04, sections=24)
    mesh.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2, [1, 0, 0]))
    mesh.export(folder / "tyre.stl")
    return '<collision><geometry><mesh filename="tyre.stl"/></geometry></collision>'


def test_a_mesh_of_another_radius_puts_the_ground_where_it_ends(tmp_path: Path) -> None:
    wheels = [("left_wheel", 0.05, 0.1), ("right_wheel", 0.05, 0.1)]
    round_ones = on_wheels(*wheels)
    assert warned(tmp_path, round_ones) == []
    assert "at z = -0.05 m" in reported(tmp_path, round_ones).facts["ground"]
    meshes = re.sub("<collision>.*?</collision>", tyre(tmp_path, 0.1), round_ones)
    assert warned(tmp_path, meshes) == []
    given = reported(tmp_path, meshes, wheels={"left_wheel": 0.1, "right_wheel": 0.1})
    assert given.warnings == ()
    assert "at z = -0.05 m" in given.facts["ground"]


def boxed(folder: Path, height: float, radius: float) -> str:
    """Two wheels of mesh, each within a box of 8 corners that stands for it where things collide."""
    mesh = trimesh.creation.box((2 * radius, 0.04, 2 * radius))
    mesh.export(folder / "box.stl")
    box = '<collision><geometry><mesh filename="box.stl"/></geometry></collision>'
    parts = tyre(folder, radius).replace("collision", "visual") + box
    wheels = on_wheels(("left_wheel", height, radius), ("right_wheel", height, radius))
    return re.sub("<collision>.*?</collision>", parts, wheels)


@pytest.mark.parametrize("kind", ["cylinder", "boxed"])
@pytest.mark.parametrize("height", [0.05, 0.0, -0.13, 0.21])
@pytest.mark.parametrize("axle", [None, (0.3, 0.1, -0.02071)])
def test_advice_about_the_ground_that_is_followed_puts_it_at_zero(
    tmp_path: Path, kind: str, height: float, axle: tuple[float, float, float] | None
) -> None:
    """Wherever the wheels are, whatever stands for them, and also where the advice followed was another."""
    pair = [(name, height, 0.05) for name in ("left_wheel", "right_wheel")]
    text = on_wheels(*pair) if kind == "cylinder" else boxed(tmp_path, height, 0.05)
    made = reported(tmp_path, text, axle=axle)
    advice = re.search(r"--axle ([\d.e,-]+) ", made.facts["ground"])
    assert (advice is None) == (axle is None and height == 0.05)
    if advice is not None:
        point = [*map(float, advice[1].split(","))]
        assert point == pytest.approx([*(axle or (0.0, 0.0))[:2], height - 0.05], abs=5e-4)
        made = reported(tmp_path, text, axle=point)
    assert "at z = 0" in made.facts["ground"]
    assert "--axle" not in made.facts["ground"]


def test_of_shapes_that_disagree_the_one_that_touches_the_root_links_plane_counts(tmp_path: Path) -> None:
    """A coarse collision cylinder around the wheel that is drawn; without such a height it counts itself."""
    for height, radius in ((0.05, 0.05), (0.0, 0.06), (0.2, 0.06)):
        wheels = on_wheels(("left_wheel", height, 0.06), ("right_wheel", height, 0.06))
        drawn = tyre(tmp_path, 0.05).replace("collision", "visual")
        made = reported(tmp_path, wheels.replace("<collision>", f"{drawn}<collision>"))
        assert made.robot is not None
        assert [wheel.radius for wheel in made.robot.wheels] == [radius, radius]


@pytest.mark.thorough
def test_sound_robots_stand_on_their_wheels() -> None:
    """The bundled ones, and PAL's."""
    pal = "package://example-robot-data/robots/tiago{0}_description/robots/tiago{1}.urdf"
    files = [pal.format(*names) for names in (("", ""), ("", "_dual"), ("", "_no_hand"), ("_pro", "_pro"))]
    found = [*bundled_robots().values(), *(package_file(file, ()) for file in files)]
    on_ground = 0
    for made in map(file_report, found):
        on_ground += made.facts.get("ground") == "the wheels touch it at z = 0"
        odd = {"ground_uneven", "footprint_off_ground"}
        assert not odd & {one.code for one in made.warnings}
    assert on_ground == 11


def test_the_root_link_belongs_on_the_wheels_axle(tmp_path: Path) -> None:
    assert warned(tmp_path, wheeled()) == []
    assert warned(tmp_path, wheeled(-0.25)) == []  # for the reference point is moved there
    for options in ({}, {"axle": (-0.25, 0)}):
        moved = nmm.load(tmp_path / "robot.urdf", **options)
        (note,) = of_code(moved.notes, "reference_moved")
        np.testing.assert_allclose([*note.values["at"], note.values["yaw"]], [-0.25, 0, 0, 0], atol=1e-12)
        middle = np.mean([wheel.center for wheel in moved.wheels], axis=0)
        np.testing.assert_allclose(middle[:2], 0.0, atol=1e-15)
    (warning,) = warned(tmp_path, wheeled(-0.25), axle=(0.1, 0.05, 0.02))
    assert holds(warning, "wheels_slide", platform="unicycle", several_axles=False, roll="ahead")


def test_wheels_that_are_not_recognised_are_told_and_why(tmp_path: Path) -> None:
    found = warned(tmp_path, wheeled(left="left", right="right"))
    assert_found(found, ("wheel_unnamed", {"name": "left"}), ("wheel_unnamed", {"name": "right"}))
    upright = joint("spare_wheel", "base", "spare", "continuous", AXIS + '<limit effort="1" velocity="1"/>')
    found = warned(tmp_path, wheeled(more=link("spare", inertial()) + upright))
    assert_found(found, ("not_a_wheel", {"name": "spare_wheel", "why": "axis_not_level"}))


def test_wheels_that_could_steer_and_are_casters_are_told(tmp_path: Path) -> None:
    """Once, not as coordinates too, which they are not; no word of casters that trail or are named so."""

    def steered(trail: float, name: str = "L_wheel_j1") -> str:
        up = joint(name, "base", "fork", "continuous", AXIS + '<limit velocity="5" effort="5"/>', "")
        at, spin = f'<origin xyz="{-trail} 0.01 0.1"/>', '<axis xyz="0 1 0"/><limit velocity="9" effort="5"/>'
        rolling = joint("L_wheel_j2", "fork", "tyre", "continuous", spin, at)
        return wheeled(more=link("fork", inertial()) + link("tyre", inertial()) + up + rolling)

    made = reported(tmp_path, steered(0.0))
    assert_found(made.warnings, ("taken_for_casters", {"names": ["L_wheel_j1"]}))
    assert made.robot is not None
    assert made.robot.q_names == ("x", "y", "theta")
    assert not of_code(made.robot.notes, "not_a_wheel")
    assert warned(tmp_path, steered(0.04)) == []
    assert warned(tmp_path, steered(0.0, "L_caster_wheel")) == []
    assert not of_code(warned(tmp_path, steered(0.0), platform="omnidirectional"), "taken_for_casters")


# Files that are right


@pytest.mark.parametrize("name", ["unicycle_2r", "unicycle_3r", "differential_base", "car_base", "omni_base"])
def test_the_bundled_robots_have_nothing_wrong(run: Command, name: str) -> None:
    result = run("check", name)
    assert (result.status, result.err) == (0, "")
    assert result.out.splitlines()[0] == f"{name}: no problems, no warnings"
    assert result.value("robot") == name


def test_the_summary_counts_what_the_file_holds(run: Command) -> None:
    result = run("check", f"package://example-robot-data/{TIAGO}")
    assert (result.status, result.err) == (0, "")
    text = package_file(f"package://example-robot-data/{TIAGO}").read_text(encoding="utf-8")
    kinds = re.findall(r'<joint name="[^"]+" type="(\w+)"', text)
    assert result.value("links") == str(len(re.findall(r"<link name=", text)))
    for kind in set(kinds):
        assert f"{kinds.count(kind)} {kind}" in result.value("joints")
    found, of, total, _ = result.value("meshes").split()
    assert (found, of) == (total, "of")
    assert result.value("packages").startswith("example-robot-data in ")
    assert result.value("wheels") == "wheel_left_joint, wheel_right_joint"


def test_links_that_touch_are_counted_and_named(run: Command) -> None:
    """The same configurations, one pair of shapes at a time, by distances."""
    result = run("check", f"package://example-robot-data/{TIAGO}")
    made = nmm.load(package_file(f"package://example-robot-data/{TIAGO}"))
    shapes = query_shapes(made)
    links = link_names(made, shapes)
    pairs = [(pair.first, pair.second) for pair in made.collision_model.collisionPairs]
    found = touching_links(made, count=SAMPLES)
    shares = touching(made, shapes, pairs, 0.0)
    for pair, share in found.shares.items():
        own = [shares[i, j] for i, j in pairs if (links[i], links[j]) == pair]
        assert max(own) <= share <= sum(own)
        assert len(own) > 1 or share == own[0]
    found = touching_links(made)
    never, sometimes, always = len(found.never), len(found.sometimes), len(found.always)
    said = f"{len(found.shares)} pairs of links: {never} never, {sometimes} sometimes, {always} always touch"
    assert result.value("collisions") == f"{said}, in 1000 random configurations"
    assert 0 < sometimes < never
    (one, other), share = max(found.sometimes.items(), key=lambda item: item[1])
    assert re.search(rf"{one} and {other} +{share:.1%}", result.out)
    assert re.search(rf"… {sometimes + always - 10} more \(.*--json\) +[0-9.]+% at most", result.out)


def test_of_findings_alike_ten_are_shown(run: Command, tmp_path: Path) -> None:
    write(tmp_path / "many.urdf", robot(*(link(f"l{i}", "<visual/>") for i in range(30)), "<link/>"))
    result = run("check", str(tmp_path / "many.urdf"))
    lines = result.out.splitlines()
    assert sum("no shape" in line for line in lines) == 10
    assert sum("a link without a name" in line for line in lines) == 1
    assert lines[-1].endswith("… 20 more like these (shape_missing; all of them: --json)")


def test_a_robot_without_collision_shapes_says_so(run: Command, tmp_path: Path) -> None:
    write(tmp_path / "bare.urdf", robot(HEAVY_LINKS + joint()))
    result = run("check", "bare.urdf")
    assert result.value("collisions") == "no shapes: nothing keeps it from touching anything"


def test_what_is_drawn_into_one_another_touches_always(tmp_path: Path) -> None:
    """Balls of 1 m at joints 0.1 m apart: those that no joint connects overlap at every angle."""
    ball = inertial() + shape('<sphere radius="1"/>', "collision")
    joints = [joint(a + b, a, b, "continuous", AXIS, '<origin xyz="0.1 0 0"/>') for a, b in ("ab", "bc")]
    text = robot(*(link(name, ball) for name in "abc"), *joints)
    found = touching_links(nmm.load(write(tmp_path / "balls.urdf", text), platform="fixed"))
    assert found.always == [("a", "c")]
    assert found.shares == {("a", "c"): 1.0}


def test_all_pairs_that_touch_are_in_json(run: Command, tmp_path: Path) -> None:
    """More than are shown: a row of 8 balls, each inside all of the others."""
    names, ball = "abcdefgh", inertial() + shape('<sphere radius="1"/>', "collision")
    near = '<origin xyz="0.01 0 0"/>'
    joints = [joint(f"{a}_{b}", a, b, "continuous", AXIS, near) for a, b in pairwise(names)]
    write(tmp_path / "balls.urdf", robot(*(link(name, ball) for name in names), *joints))
    facts = json.loads(run("check", "balls.urdf", "--platform", "fixed", "--json").out)["facts"]
    pairs = {(a, b) for i, a in enumerate(names) for b in names[i + 2 :]}
    assert len(pairs) == 21
    assert {tuple(one["links"]) for one in facts["touching"]} == pairs
    assert {one["share"] for one in facts["touching"]} == {1.0}
    assert "21 always" in facts["collisions"]


def test_a_report_says_what_was_used(tmp_path: Path) -> None:
    made = file_report(bundled_robots()["unicycle_2r"], {"d": 0.5})
    assert made.expanded
    assert "d=0.5" in made.facts["xacro arguments"]
    assert made.text.startswith("<?xml")
