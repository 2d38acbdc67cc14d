"""What an SRDF's groups, joints without a motor and pairs of links mean, as MoveIt has it; SRDFs in xacro."""

from __future__ import annotations

from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
from findings import holds, of_code
from urdf_parts import AXIS, LIMIT, joint, link, robot, shape, write

import nmm
from nmm.model.robots.loading.report import file_report
from nmm.model.robots.loading.srdf import Group
from nmm.model.robots.loading.srdf_fitting import _groups

SOLID = shape('<box size="0.1 0.1 0.1"/>', "collision")
BASE = '<virtual_joint name="odom" type="{}" parent_frame="map" child_link="{}"/>'


def tree(folder: Path, *more: str) -> Path:
    """shoulder, elbow and a fixed flange; a finger and one that follows it; a camera on a fixed mast."""
    links = ("base_link", "upper", "lower", "flange", "finger", "other", "mast", "camera")
    follow = AXIS + LIMIT + '<mimic joint="grip"/>'
    parts = [
        joint("shoulder", "base_link", "upper"),
        joint("elbow", "upper", "lower"),
        joint("flange_joint", "lower", "flange", "fixed", ""),
        joint("grip", "flange", "finger", "prismatic"),
        joint("grip_2", "flange", "other", "prismatic", follow),
        joint("mast_joint", "base_link", "mast", "fixed", ""),
        joint("pan", "mast", "camera", "continuous"),
    ]
    return write(folder / "r.urdf", robot(*(link(one, SOLID) for one in links), *parts, *more))


def with_srdf(folder: Path, text: str, **options: object) -> nmm.Robot:
    srdf = write(folder / "given.srdf", f'<robot name="r">{text}</robot>')
    return nmm.load(tree(folder), srdf=srdf, **options)  # type: ignore[arg-type]  # load's own


def group(inside: str, name: str = "g") -> str:
    return f'<group name="{name}">{inside}</group>'


def links(*names: str) -> str:
    return "".join(f'<link name="{name}"/>' for name in names)


def chained(base: str, tip: str) -> str:
    return f'<chain base_link="{base}" tip_link="{tip}"/>'


@pytest.mark.parametrize(
    ("inside", "right"),
    [
        (links("flange", "finger"), ("grip",)),  # the flange is fixed to the arm
        (links("lower"), ("elbow",)),
        (links("mast"), ()),
        (links("other"), ()),  # it follows
        (links("base_link"), ()),  # no joint carries it
        ('<joint name="flange_joint"/><joint name="pan"/>', ("pan",)),
        (chained("base_link", "flange"), ("shoulder", "elbow")),
        (chained("upper", "finger"), ("elbow", "grip")),
        (chained("lower", "camera"), ("pan", "shoulder", "elbow")),  # up to where both meet, and down
        (chained("flange", "base_link"), ("shoulder", "elbow")),
        (chained("nowhere", "flange"), ()),
    ],
)
def test_a_link_stands_for_the_joint_that_carries_it(
    tmp_path: Path, inside: str, right: tuple[str, ...]
) -> None:
    made = with_srdf(tmp_path, group(inside))
    assert made.semantics.groups.get("g", ()) == right
    assert bool(of_code(made.notes, "groups_without_inputs")) is not bool(right)
    still = with_srdf(tmp_path, group(inside), platform="fixed")
    assert still.semantics.groups.get("g", ()) == right
    locked = with_srdf(tmp_path, group(inside), lock={"elbow": 0.3})
    assert locked.semantics.groups.get("g", ()) == tuple(name for name in right if name != "elbow")


@pytest.mark.parametrize("kind", ["planar", "floating", "fixed"])
@pytest.mark.parametrize("inside", ['<joint name="odom"/>', links("base_link")])
def test_a_virtual_joint_means_the_platform(tmp_path: Path, kind: str, inside: str) -> None:
    text = (
        BASE.format(kind, "base_link") + group(inside, "wheels") + group(chained("base_link", "lower"), "a")
    )
    text += '<group name="whole"><group name="a"/><group name="wheels"/></group>'
    made = with_srdf(tmp_path, text)
    base = () if kind == "fixed" else ("v", "omega")
    assert made.semantics.groups.get("wheels", ()) == base
    assert made.semantics.groups["a"] == ("shoulder", "elbow")
    assert made.semantics.groups["whole"] == (*base, "shoulder", "elbow")
    assert "wheels" not in with_srdf(tmp_path, text, platform="fixed").semantics.groups
    # A group of them has its own weight, as any.
    if base:
        task = nmm.Task(nmm.Position("flange", "xy"), nmm.Circle([0.5, 0], 1, 1))
        nmm.Controller(made, task, nmm.ProjectedGradient(weights={"wheels": 3.0}))(0.0, made.q())


def test_joints_of_a_base_in_the_file_mean_the_platform(tmp_path: Path) -> None:
    far = '<limit lower="-100" upper="100" effort="1" velocity="1"/>'
    for names in (("px", "py", "turn"), ("x", "y", "theta")):
        parts = [
            joint(names[0], "world", "along", "prismatic", '<axis xyz="1 0 0"/>' + far, ""),
            joint(names[1], "along", "across", "prismatic", '<axis xyz="0 1 0"/>' + far, ""),
            joint(names[2], "across", "base_link", "continuous", AXIS, ""),
        ]
        file = tree(tmp_path, *map(link, ("world", "along", "across")), *parts)
        joints = "".join(f'<joint name="{name}"/>' for name in names)
        values = f'<joint name="{names[0]}" value="1"/><joint name="pan" value="2"/>'
        home = f'<group_state name="home" group="g">{values}'
        text = group(joints) + group(chained("world", "upper"), "reach") + home + "</group_state>"
        srdf = write(tmp_path / "given.srdf", f'<robot name="r">{text}</robot>')
        made = nmm.load(file, srdf=srdf)
        assert made.semantics.groups == {
            "g": ("vx", "vy", "omega"),
            "reach": ("vx", "vy", "omega", "shoulder"),
        }
        assert made.postures["home"] == {"pan": 2.0}
        assert of_code(made.notes, "posture_of_base")
        still = nmm.load(file, srdf=srdf, platform="fixed")
        assert still.semantics.groups == {"g": names, "reach": (*names, "shoulder")}
        assert still.postures["home"] == {names[0]: 1.0, "pan": 2.0}


def test_a_planar_joint_of_the_file_means_the_platform(tmp_path: Path) -> None:
    file = tree(
        tmp_path, link("odom_link"), joint("planar_joint", "odom_link", "base_link", "planar", "", "")
    )
    planar = group('<joint name="planar_joint"/>')
    srdf = write(tmp_path / "given.srdf", f'<robot name="r">{planar}</robot>')
    assert nmm.load(file, srdf=srdf).semantics.groups == {"g": ("v", "omega")}


def test_a_steering_joint_means_the_rate_of_its_angle() -> None:
    car = nmm.load("car_base")
    steering = car.q_names[3]
    assert car.u_names[1] == "steering_rate"
    assert _groups({"g": Group((steering,), (), (), ())}, car, set()) == {"g": ("steering_rate",)}


def test_joints_without_a_motor_have_no_input(tmp_path: Path) -> None:
    text = '<passive_joint name="elbow"/><passive_joint name="grip_2"/><passive_joint name="mast_joint"/>'
    text += '<group_state name="home" group="g"><joint name="elbow" value="0.4"/></group_state>'
    made = with_srdf(tmp_path, text)
    assert made.u_names == ("v", "omega", "pan", "shoulder", "grip")
    (note,) = of_code(made.notes, "passive_held")
    assert holds(note, "passive_held", values={"elbow": 0.0}, srdf="given.srdf")
    assert made.locked["elbow"] == 0.0
    assert of_code(made.notes, "posture_locked")
    moved = with_srdf(tmp_path, text, lock={"elbow": 0.3})
    assert moved.locked["elbow"] == 0.3
    assert not of_code(moved.notes, "passive_held")
    # What follows it stands, and it stands within its limits.
    up = AXIS + '<limit lower="0.2" upper="1" effort="1" velocity="1"/>'
    follow = AXIS + LIMIT + '<mimic joint="tilt" multiplier="0.5"/>'
    file = tree(
        tmp_path, link("m"), link("n"),
        joint("tilt", "camera", "m", body=up), joint("nod", "m", "n", body=follow),
    )  # fmt: skip
    srdf = write(tmp_path / "given.srdf", '<robot name="r"><passive_joint name="tilt"/></robot>')
    both = nmm.load(file, srdf=srdf)
    assert (both.locked["tilt"], both.locked["nod"]) == (0.2, 0.1)
    mounted = nmm.mount(
        "unicycle_2r", nmm.load(file, srdf=srdf, platform="fixed"), at="arm_base", prefix="on_"
    )
    assert mounted.locked["on_tilt"] == 0.2


def test_names_that_are_not_there_are_noted(tmp_path: Path) -> None:
    text = group(links("lwer") + '<joint name="shouder"/><group name="none"/>' + chained("base", "upper"))
    text += '<passive_joint name="elbw"/><disable_collisions link1="uper" link2="lower"/>'
    text += BASE.format("planar", "flange")
    made = with_srdf(tmp_path, text)
    (note,) = of_code(made.notes, "srdf_names_unknown")
    assert note.values["names"] == ["shouder", "lwer", "base", "none", "uper", "elbw"]
    (note,) = of_code(made.notes, "virtual_joint_unused")
    assert holds(note, "virtual_joint_unused", name="odom", child="flange")


def test_elements_that_do_not_count_are_noted_with_their_line(tmp_path: Path) -> None:
    text = (
        '\n<link_sphere_approximation link="upper"/>\n<end_effector name="e" parent_link="flange" group="g"/>'
    )
    text += '\n<pasive_joint name="elbow"/><disable_collisions link1="upper" link2="lower" because="Never"/>'
    found = [one for one in with_srdf(tmp_path, text).notes if "srdf" in one.where]
    codes = ["element_unread", "element_unknown", "attribute_unknown"]
    assert [(one.code, one.where["line"]) for one in found] == [*zip(codes, (2, 4, 4), strict=True)]
    assert found[1].values["near"] == "passive_joint"
    write(tmp_path / "r.srdf", f'<robot name="r">{text}</robot>')
    assert {*codes} <= {one.code for one in file_report(tmp_path / "r.urdf").warnings}


@pytest.mark.parametrize(
    ("model", "platform", "differs"),
    [
        ("diff_drive", None, False),
        ("holonomic", None, True),
        ("diff_drive", "omnidirectional", True),
        ("holonomic", "omnidirectional", False),
        ("holonomic", "fixed", False),
    ],
)
def test_the_motion_of_a_virtual_joint_against_the_platform(
    tmp_path: Path, model: str, platform: str | None, differs: bool
) -> None:
    text = BASE.format("planar", "base_link")
    text += f'<joint_property joint_name="odom" property_name="motion_model" value="{model}"/>'
    made = with_srdf(tmp_path, text, platform=platform)
    assert bool(of_code(made.notes, "motion_model_differs")) is differs


def allowed(
    names: list[str], defaults: set[str], enabled: set[frozenset[str]], disabled: set[frozenset[str]]
) -> set[frozenset[str]]:
    """The pairs that MoveIt lets touch: by default, but for what is enabled, and what is disabled."""
    pairs = {frozenset(pair) for pair in combinations(names, 2)}
    free = {pair for pair in pairs if pair & defaults}
    return (free - enabled) | disabled


def test_pairs_that_may_touch_by_default(tmp_path: Path) -> None:
    rng = np.random.default_rng(5)
    names = ["base_link", "upper", "lower", "flange", "finger", "other", "mast", "camera"]
    pairs = [frozenset(pair) for pair in combinations(names, 2)]
    for _ in range(5):
        defaults = {*map(str, rng.choice(names, 2, replace=False))}
        enabled, disabled = ({pairs[i] for i in rng.choice(len(pairs), 6, replace=False)} for _ in range(2))
        text = "".join(f'<disable_default_collisions link="{name}"/>' for name in sorted(defaults))
        for tag, chosen in (("enable_collisions", enabled), ("disable_collisions", disabled)):
            text += "".join('<{} link1="{}" link2="{}"/>'.format(tag, *sorted(pair)) for pair in chosen)
        made = with_srdf(tmp_path, text)
        found = {frozenset(pair) for pair in made.semantics.disabled}
        assert found == allowed(names, defaults, enabled, disabled)
        own = nmm.Collisions(srdf=True).on(made)
        given = nmm.Collisions(srdf=tmp_path / "given.srdf").on(made)
        assert own.names == given.names
        assert not found & {frozenset(pair) for pair in own.names}


XACRO = """<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro">
<xacro:arg name="up" default="0.5"/><xacro:macro name="state" params="name value">
<group_state name="${name}" group="g"><joint name="elbow" value="${value}"/></group_state></xacro:macro>
<xacro:state name="home" value="${2 * float('$(arg up)')}"/><odd/></robot>"""


@pytest.mark.parametrize("name", ["given.srdf", "given.srdf.xacro", "given.xacro"])
def test_an_srdf_that_is_xacro_is_expanded(tmp_path: Path, name: str) -> None:
    srdf = write(tmp_path / name, XACRO)
    made = nmm.load(tree(tmp_path), srdf=srdf)
    assert made.postures == {"home": {"elbow": 1.0}}
    (note,) = of_code(made.notes, "element_unknown")
    assert note.where == {"srdf": name}  # no line, which would be another text's
    with pytest.raises(nmm.RobotError, match="srdf"):
        nmm.load(tree(tmp_path), srdf=write(srdf, XACRO.replace("$(arg up)", "$(arg upp)")))


def test_a_xacro_beside_the_file_gets_the_robots_arguments(tmp_path: Path) -> None:
    text = tree(tmp_path).read_text(encoding="utf-8")
    head = '<robot xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:arg name="up" default="0.5"/>'
    file = write(
        tmp_path / "own.urdf.xacro",
        text.replace('<robot name="r">', head.replace("<robot", '<robot name="r"')),
    )
    write(tmp_path / "own.srdf.xacro", XACRO)
    assert nmm.load(file).postures["home"] == {"elbow": 1.0}
    assert nmm.load(file, arguments={"up": 0.25}).postures["home"] == {"elbow": 0.5}
    write(tmp_path / "own.srdf.xacro", XACRO.replace("2 *", "2 **"))
    broken = nmm.load(file, arguments={"up": "one"})
    assert of_code(broken.notes, "srdf_unused")
    assert not broken.postures


def test_white_space_ahead_of_an_srdfs_declaration(tmp_path: Path) -> None:
    text = f'\n<?xml version="1.0"?><robot name="r">{group(links("lower"))}</robot>'
    made = nmm.load(tree(tmp_path), srdf=write(tmp_path / "given.srdf", text))
    assert made.semantics.groups == {"g": ("elbow",)}


def test_groups_in_groups_are_resolved_once(tmp_path: Path) -> None:
    """Each of 60 holds the one before twice, and each of 3,000 the one before: no more work than groups."""
    inner = '<joint name="elbow"/>'
    text = group(inner, "a0") + group('<joint name="shoulder"/>', "b0")
    text += "".join(group(f'<group name="a{k}"/><group name="a{k}"/>', f"a{k + 1}") for k in range(60))
    text += "".join(group(f'<group name="b{k}"/>', f"b{k + 1}") for k in range(3_000))
    groups = with_srdf(tmp_path, text).groups
    assert groups["a60"] == ("elbow",)
    assert groups["b3000"] == ("shoulder",)


def test_groups_in_a_circle_hold_all_of_it(tmp_path: Path) -> None:
    names = [f"c{k}" for k in range(4)]
    joints = ["shoulder", "elbow", "grip", "pan"]
    text = "".join(
        group(f'<joint name="{joint}"/><group name="{after}"/>', name)
        for name, after, joint in zip(names, [*names[1:], names[0]], joints, strict=True)
    )
    groups = with_srdf(tmp_path, text).groups
    assert all({*groups[name]} == {*joints} for name in names)
