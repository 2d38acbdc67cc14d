"""Mounting against Pinocchio's own composition and against a URDF that holds both robots."""

from __future__ import annotations

import copy
import re
from collections.abc import Mapping
from itertools import combinations
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pinocchio as pin
import pytest
from findings import assert_found, carries, of_code, the
from numpy.typing import NDArray
from places import PANDA, ROOT, UR5
from urdf_parts import inertial, joint, link, numbers, random_tree, robot, shape, write

import nmm
from nmm import RobotError, Scenario, ScenarioError
from nmm.model.platforms import FixedBase
from nmm.model.robots.configuration import Configuration
from nmm.model.robots.robot import Robot

Array = NDArray[np.float64]

BOX = shape('<box size="0.4 0.3 0.2"/>', "collision") + shape('<box size="0.4 0.3 0.2"/>')
XYZ, RPY = (0.1, -0.2, 0.3), (0.4, -0.5, 0.6)


def base_text(more: str = "") -> str:
    """A platform with two wheels, a mast that turns and an oblique frame `top` on its deck."""
    wheel = shape('<cylinder radius="0.1" length="0.05"/>', "collision")
    wheels = [
        link(f"wheel_{side}", inertial(0.5) + wheel)
        + joint(
            f"wheel_{side}_joint",
            "deck",
            f"wheel_{side}",
            "continuous",
            '<axis xyz="0 1 0"/>',
            f'<origin xyz="0 {y} 0.1"/>',
        )
        for side, y in (("left", 0.2), ("right", -0.2))
    ]
    return robot(
        link("deck", inertial(5.0) + BOX),
        *wheels,
        link("mast", inertial(1.0) + BOX),
        joint("mast_joint", "deck", "mast"),
        link("top"),
        joint("top_joint", "deck", "top", "fixed", "", '<origin xyz="0.2 0.1 0.4" rpy="0.3 -0.2 0.1"/>'),
        more,
        attributes='name="rover"',
    )


def composed(base: str, arm: str, at: str, prefix: str) -> str:
    """One URDF text of both, with a fixed joint at XYZ, RPY from `at` to the arm's root."""
    whole, part = ElementTree.fromstring(base), ElementTree.fromstring(arm)
    children = {element.get("link") for element in part.iterfind("joint/child")}
    for element in (*part.iterfind("link"), *part.iterfind("joint")):
        if element.tag == "link" and element.get("name") not in children:
            root = prefix + element.get("name", "")
        element.set("name", prefix + element.get("name", ""))
        for end in (*element.iterfind("parent"), *element.iterfind("child")):
            end.set("link", prefix + end.get("link", ""))
        whole.append(element)
    weld = f'<origin xyz="{numbers(XYZ)}" rpy="{numbers(RPY)}"/>'
    whole.append(ElementTree.fromstring(joint("weld", at, root, "fixed", "", weld)))
    return ElementTree.tostring(whole, encoding="unicode")


def random_q(robot: Robot, rng: np.random.Generator) -> Array:
    return rng.uniform(-2, 2, robot.n) * np.where(np.arange(robot.n) == 2, 5, 1)


def by_name(robot: Robot, q: Array) -> dict[str, float]:
    return dict(zip(robot.q_names, q, strict=True))


def pair_names(robot: Robot) -> set[frozenset[str]]:
    shapes = robot.collision_model.geometryObjects
    return {
        frozenset((shapes[p.first].name, shapes[p.second].name)) for p in robot.collision_model.collisionPairs
    }


def shape_poses(model: pin.Model, shapes: pin.GeometryModel, q: Array) -> dict[str, Array]:
    placed = shapes.createData()
    pin.updateGeometryPlacements(model, model.createData(), shapes, placed, q)
    return {s.name: m.homogeneous for s, m in zip(shapes.geometryObjects, placed.oMg, strict=True)}


def assert_same_robot(one: Robot, other: Robot, rng: np.random.Generator, less: tuple[str, ...] = ()) -> None:
    """Same coordinates, frames, shapes, masses, limits and pairs; `less` are frames that only `other` has."""
    assert set(one.q_names) == set(other.q_names)
    assert set(one.frames) == set(other.frames) - set(less)
    for _ in range(10):
        q = random_q(one, rng)
        here, there = Configuration(one, q), Configuration(other, other.q(by_name(one, q)))
        for frame in one.frames:
            np.testing.assert_allclose(
                here.placement(frame).homogeneous,
                there.placement(frame).homogeneous,
                atol=1e-12,
                err_msg=frame,
            )
        np.testing.assert_allclose(here.center_of_mass()[0], there.center_of_mass()[0], atol=1e-12)
        mine = shape_poses(one.model, one.collision_model, here.q)
        its = shape_poses(other.model, other.collision_model, there.q)
        assert set(mine) == set(its)
        for name in mine:
            np.testing.assert_allclose(mine[name], its[name], atol=1e-12, err_msg=name)
    shown, reference = (
        shape_poses(r.display_model, r.visual_model, np.zeros(r.display_model.nq)) for r in (one, other)
    )
    assert set(shown) == set(reference)
    for name in shown:
        np.testing.assert_allclose(shown[name], reference[name], atol=1e-12, err_msg=name)
    limits = [dict(zip(r.q_names, map(tuple, r.q_limits), strict=True)) for r in (one, other)]
    assert limits[0] == limits[1]
    speeds = [dict(zip(r.u_names, r.u_limits, strict=True)) for r in (one, other)]
    assert speeds[0] == speeds[1]
    for name in ("armature", "damping", "upperEffortLimit", "upperDryFrictionLimit", "rotorGearRatio"):
        values = [dict(zip(r.q_names, np.array(getattr(r.model, name)), strict=True)) for r in (one, other)]
        assert values[0] == values[1], name
    assert pair_names(one) == pair_names(other)
    assert {w.joint: w.radius for w in one.wheels} == {w.joint: w.radius for w in other.wheels}


# ------------------------------------------------------------------------------------------ composition


@pytest.mark.parametrize("prefix", ["", "tool_"])
def test_mounted_is_the_file_that_holds_both(prefix: str, tmp_path: Path, rng: np.random.Generator) -> None:
    arm = random_tree(rng, 8)
    base, tool = write(tmp_path / "base.urdf", base_text()), write(tmp_path / "arm.urdf", arm)
    both = write(tmp_path / "both.urdf", composed(base_text(), arm, "top", prefix))
    mounted = nmm.mount(base, tool, at="top", placement=(XYZ, RPY), prefix=prefix or None)
    assert_same_robot(mounted, nmm.load(both), rng, less=("weld",))
    assert mounted.q_names[:4] == ("x", "y", "theta", "mast_joint")
    assert mounted.collision_model.collisionPairs
    assert mounted.arms == {prefix.rstrip("_") or "tree": mounted.q_names[4:]}


def test_mounted_is_what_pinocchio_appends(tmp_path: Path, rng: np.random.Generator) -> None:
    """Raw models, appended by Pinocchio alone, and moved by the platform's pose written out."""
    arm, base = random_tree(rng, 12), base_text()
    raw, tool = pin.buildModelFromXML(base), pin.buildModelFromXML(arm)
    place = pin.SE3.Random()
    whole = pin.appendModel(raw, tool, raw.getFrameId("top", pin.FrameType.BODY), place)
    mounted = nmm.mount(
        write(tmp_path / "base.urdf", base), write(tmp_path / "arm.urdf", arm), at="top", placement=place
    )
    data = whole.createData()
    for _ in range(20):
        q = random_q(mounted, rng)
        values, there = by_name(mounted, q), pin.neutral(whole)
        for i in range(1, whole.njoints):
            j, value = whole.joints[i], values.get(str(whole.names[i]), 0.0)
            there[j.idx_q : j.idx_q + j.nq] = [np.cos(value), np.sin(value)] if j.nq == 2 else [value]
        pin.framesForwardKinematics(whole, data, there)
        moved = pin.SE3(pin.exp3(np.array([0, 0, q[2]])), np.array([q[0], q[1], 0]))
        here = Configuration(mounted, q)
        for i, frame in enumerate(whole.frames):
            if frame.name != "universe":
                np.testing.assert_allclose(
                    here.placement(frame.name).homogeneous, (moved * data.oMf[i]).homogeneous, atol=1e-12
                )


@pytest.mark.parametrize("placement", ["SE3", "matrix", "pair"])
def test_forms_of_a_placement(placement: str, tmp_path: Path) -> None:
    pose = pin.SE3(pin.rpy.rpyToMatrix(np.array(RPY)), np.array(XYZ))
    form = {"SE3": pose, "matrix": pose.homogeneous.tolist(), "pair": [np.array(XYZ), RPY]}[placement]
    base = write(tmp_path / "base.urdf", base_text())
    mounted = Configuration(nmm.mount(base, UR5, placement=form), np.zeros(10))
    found = mounted.placement("top").actInv(mounted.placement("world"))
    np.testing.assert_allclose(found.homogeneous, pose.homogeneous, atol=1e-14)


def test_two_arms(tmp_path: Path, rng: np.random.Generator) -> None:
    """Each as its own file says, wherever the base is; every pair of one with the other but the bases'."""
    base = write(tmp_path / "base.urdf", base_text())
    places = {"left": ((0, 0.3, 0), (0, 0, 0.5)), "right": ((0, -0.3, 0), (0, 0, -0.5))}
    both = nmm.load(base)
    for side, place in places.items():
        both = nmm.mount(both, UR5, at="top", placement=place, prefix=f"{side}_")
    alone = nmm.load(UR5)
    joints = alone.q_names[3:]
    assert both.q_names[3:] == ("mast_joint", *(f"{side}_{name}" for side in places for name in joints))
    assert both.arms == {side: tuple(f"{side}_{name}" for name in joints) for side in places}
    assert both.groups["left"] == both.arms["left"]
    q = random_q(both, rng)
    here, values = Configuration(both, q), by_name(both, q)
    for side, (xyz, rpy) in places.items():
        part = Configuration(alone, alone.q({name: values[f"{side}_{name}"] for name in joints}))
        root = here.placement("top") * pin.SE3(pin.rpy.rpyToMatrix(np.array(rpy)), np.array(xyz))
        for frame in alone.frames[3:]:
            np.testing.assert_allclose(
                here.placement(f"{side}_{frame}").homogeneous,
                (root * part.placement(frame)).homogeneous,
                atol=1e-12,
            )
    pairs = pair_names(both)
    assert frozenset(("left_wrist_3_link_0", "right_wrist_3_link_0")) in pairs
    assert frozenset(("left_base_link_0", "right_base_link_0")) not in pairs
    assert both.parts.provenance.prefixed == {"left": "left_", "right": "right_"}


def test_names_are_kept_apart_without_being_asked(tmp_path: Path) -> None:
    base = write(tmp_path / "base.urdf", base_text())
    once = nmm.mount(base, UR5)
    twice = nmm.mount(once, UR5, at="top")
    thrice = nmm.mount(twice, UR5, at="top")
    assert list(thrice.arms) == ["ur5", "ur5_2", "ur5_3"]
    assert [names[0] for names in thrice.arms.values()] == [
        "shoulder_pan_joint",
        "ur5_2_shoulder_pan_joint",
        "ur5_3_shoulder_pan_joint",
    ]
    assert [one.values["prefix"] for one in of_code(twice.notes, "arm_mounted")] == ["", "ur5_2_"]
    assert [one.values["prefix"] for one in of_code(once.notes, "arm_mounted")] == [""]
    assert (once.name, once.source) == ("rover with ur5", f"{base} + {UR5}")
    assert nmm.mount(base, UR5, name="mine").model.name == "mine"
    # "arm" is what all the joints are called together.
    arms = [nmm.mount(base, nmm.load(UR5, name="arm")), nmm.mount(base, UR5, prefix="arm_")]
    assert [list(mounted.arms) for mounted in arms] == [["arm_1"], ["arm_1"]]
    assert arms[1].q_names[-1] == "arm_wrist_3_joint"


def test_options_of_the_parts_are_kept(tmp_path: Path, rng: np.random.Generator) -> None:
    """Locked and followed joints, the reference point, chosen wheels; the robots given stay as they were."""
    base = nmm.load(
        write(tmp_path / "base.urdf", base_text()),
        lock={"mast_joint": 0.5},
        axle=(0.2, 0.1),
        wheels={"wheel_left_joint": 0.2, "wheel_right_joint": 0.2},
    )
    arm = nmm.load(PANDA, lock={"panda_finger_joint1": 0.03, "panda_joint7": 1.0})
    before = [m.copy() for m in (base.model, arm.display_model, arm.visual_model, arm.collision_model)]
    mounted = nmm.mount(base, arm)
    assert before == [base.model, arm.display_model, arm.visual_model, arm.collision_model]
    assert mounted.q_names == ("x", "y", "theta", *(f"panda_joint{i}" for i in range(1, 7)))
    assert [wheel.radius for wheel in mounted.wheels] == [0.2, 0.2]
    provenance = mounted.parts.provenance
    assert provenance.locked == {"mast_joint": 0.5, "panda_finger_joint1": 0.03, "panda_joint7": 1.0}
    assert provenance.mimicked == {"panda_finger_joint2": ("panda_finger_joint1", 0.03)}
    assert provenance.reduced == ("wheel_left_joint", "wheel_right_joint")
    q = random_q(mounted, rng)
    here, there = Configuration(mounted, q), Configuration(arm, [0, 0, 0, *q[3:]])
    for frame in arm.frames[3:]:
        found = here.placement("top").actInv(here.placement(frame))
        np.testing.assert_allclose(found.homogeneous, there.placement(frame).homogeneous, atol=1e-12)
    deck = Configuration(mounted, np.zeros(9)).placement("deck")
    np.testing.assert_allclose(deck.translation, [-0.2, -0.1, 0])


def test_mobile_robot_as_an_arm(tmp_path: Path, rng: np.random.Generator) -> None:
    """All but its x, y and theta is mounted; its wheels stand still and stay in the picture."""
    base = write(tmp_path / "base.urdf", base_text())
    mounted = nmm.mount(base, "unicycle_2r", at="top")
    assert mounted.q_names == ("x", "y", "theta", "mast_joint", "q1", "q2")
    assert [wheel.joint for wheel in mounted.wheels] == ["wheel_left_joint", "wheel_right_joint"]
    alone = nmm.load("unicycle_2r")
    q = random_q(mounted, rng)
    here, there = Configuration(mounted, q), Configuration(alone, [0, 0, 0, *q[4:]])
    for frame in ("ee", "left_wheel", "base_footprint"):
        found = here.placement("top").actInv(here.placement(frame))
        np.testing.assert_allclose(found.homogeneous, there.placement(frame).homogeneous, atol=1e-12)
    assert mounted.visual_model.ngeoms == alone.visual_model.ngeoms + nmm.load(base).visual_model.ngeoms


def test_models_that_have_pairs_of_their_own(rng: np.random.Generator, tmp_path: Path) -> None:
    """The caller's pairs of a pin.Model are kept; pairs between the two robots are added."""
    text = random_tree(rng, 4)
    model = pin.buildModelFromXML(text)
    shapes = pin.buildGeomFromUrdfString(model, text, pin.COLLISION)
    shapes.addCollisionPair(pin.CollisionPair(0, 1))
    model.armature[:] = np.arange(1, model.nv + 1)
    model.referenceConfigurations["home"] = pin.neutral(model)
    arm = nmm.load(model, collision_model=shapes)
    assert len(arm.collision_model.collisionPairs) == 1
    base = nmm.load(write(tmp_path / "base.urdf", base_text()))
    mounted = nmm.mount(base, arm, at="top")
    own = {frozenset((shapes.geometryObjects[0].name, shapes.geometryObjects[1].name))}
    joints = [mounted.coordinate(str(name)) for name in list(model.names)[1:]]
    np.testing.assert_array_equal(mounted.model.armature[joints], model.armature)
    assert mounted.model.referenceConfigurations["home"].shape == (mounted.n,)
    arms = {shape.name for shape in shapes.geometryObjects}
    assert {pair for pair in pair_names(mounted) if pair <= arms} == own
    assert {pair for pair in pair_names(mounted) if not pair & arms} == pair_names(base)
    assert any(pair & arms and not pair <= arms for pair in pair_names(mounted))


def test_pairs_are_those_of_bodies_apart(tmp_path: Path, rng: np.random.Generator) -> None:
    """By the definition: not on one body, not on two that a joint connects."""
    for text in (random_tree(rng, 9), base_text()):
        loaded = nmm.load(write(tmp_path / "r.urdf", text))
        model, shapes = loaded.model, loaded.collision_model.geometryObjects
        expected = set()
        for one, two in combinations(shapes, 2):
            i, j = one.parentJoint, two.parentJoint
            if i != j and model.parents[i] != j and model.parents[j] != i:
                expected.add(frozenset((one.name, two.name)))
        assert pair_names(loaded) == expected
        counts = [note.values["count"] for note in of_code(loaded.notes, "collision_pairs")]
        assert counts == ([len(expected)] if expected else [])


# ------------------------------------------------------------------------------------------ fixed base


def test_arm_on_a_fixed_base(tmp_path: Path, rng: np.random.Generator) -> None:
    """Without x, y and theta: q is the arm's, and its frames are where the file has them."""
    text = random_tree(rng, 6)
    path = write(tmp_path / "arm.urdf", text)
    for platform in ("fixed", FixedBase()):
        loaded = nmm.load(path, platform=platform)
        assert loaded.n == loaded.n_u == nmm.load(path).n - 3
        assert "theta" not in loaded.frames
        q = rng.uniform(-2, 2, loaded.n)
        here, there = Configuration(loaded, q), Configuration(nmm.load(path), [0, 0, 0, *q])
        for frame in loaded.frames:
            np.testing.assert_allclose(
                here.placement(frame).homogeneous, there.placement(frame).homogeneous, atol=1e-12
            )
            np.testing.assert_allclose(here.jacobian(frame), there.jacobian(frame)[:, 3:], atol=1e-12)
        assert pair_names(loaded) == pair_names(nmm.load(path))


def test_wheels_of_a_fixed_base(tmp_path: Path) -> None:
    path = write(tmp_path / "base.urdf", base_text())
    wheels = ["wheel_left_joint", "wheel_right_joint"]
    for held in (nmm.load(path, platform="fixed"), nmm.load(path, platform="fixed", wheels=wheels)):
        assert held.q_names == ("mast_joint",)
        assert held.wheels == ()
        assert held.display_model.nq == 1
        (note,) = of_code(held.notes, "wheels_held")
        assert note.values["names"] == wheels
    assert "wheel_left_joint" in nmm.load(path, platform="fixed", wheels=()).q_names
    with pytest.raises(RobotError) as caught:
        nmm.load(path, platform="fixed", wheels=["mast_joint"])
    assert_found(caught.value.findings, ("no_wheel", {"name": "mast_joint", "why": "axis_not_level"}))


def test_mounted_on_a_fixed_base(tmp_path: Path, rng: np.random.Generator) -> None:
    table = nmm.load(
        write(
            tmp_path / "table.urdf",
            robot(link("leg", BOX), link("top"), joint("j", "leg", "top", "fixed", "")),
        ),
        platform="fixed",
    )
    assert table.n == 0
    assert of_code(table.notes, "nothing_moves")
    mounted = nmm.mount(nmm.mount(table, UR5, prefix="a_"), UR5, at="top", prefix="b_")
    assert mounted.n == mounted.n_u == 12
    alone = nmm.load(UR5, platform=FixedBase())
    q = rng.uniform(-2, 2, 12)
    here = Configuration(mounted, q)
    for k, prefix in enumerate(("a_", "b_")):
        part = Configuration(alone, q[6 * k : 6 * k + 6])
        for frame in alone.frames:
            np.testing.assert_allclose(
                here.placement(prefix + frame).homogeneous,
                (here.placement("top") * part.placement(frame)).homogeneous,
                atol=1e-12,
            )


# ------------------------------------------------------------------------------------------ bad input


def refused(*arguments: object, **keywords: object) -> RobotError:
    with pytest.raises(RobotError) as caught:
        nmm.mount(*arguments, **keywords)  # type: ignore[arg-type]  # wrong on purpose
    assert str(caught.value).isprintable()
    return caught.value


def test_bad_mounting(tmp_path: Path) -> None:
    base = nmm.load(write(tmp_path / "base.urdf", base_text()))
    stiff = write(tmp_path / "stiff.urdf", robot(link("post"), attributes='name="post"'))
    assert refused(base, stiff).where == "post"
    elbow = write(tmp_path / "e.urdf", robot(link("a"), link("b"), joint(), attributes='name="elbow"'))
    assert refused(base, nmm.load(elbow, lock={"j": 0.2})).where == "elbow"
    carries(refused(base, UR5, at="tpo"), "at: rover", got="tpo", available=("top",))
    carries(refused(base, UR5, at=3), "at: rover", got=3)
    carries(refused("unicycle_2r", UR5), "at", available=("base_footprint",))
    two = write(tmp_path / "two.urdf", base_text(link("mount") + joint("m", "deck", "mount", "fixed", "")))
    carries(refused(two, UR5), "at", available=("mount", "top"))
    carries(refused(base, "nothing.urdf"), "nothing.urdf")
    carries(refused(base, 5), got=5)


def test_mounted_on_a_wheel(tmp_path: Path) -> None:
    base = write(tmp_path / "base.urdf", base_text())
    found = refused(base, UR5, at="wheel_left").findings
    assert_found(found, ("no_wheel", {"name": "wheel_left_joint", "why": "joint_below"}))


@pytest.mark.parametrize(
    ("placement", "part", "got"),
    [
        ([1, 2, 3], "", [1, 2, 3]),
        (np.eye(3), "", np.eye(3)),
        (np.zeros((4, 4)), "", np.zeros((4, 4))),
        (np.diag([1, 1, -1, 1]), "", np.diag([1, 1, -1, 1])),
        (((0, 0), (0, 0, 0)), ": xyz", (0, 0)),
        (((0, 0, 0), (0, 0, np.nan)), ": rpy", (0, 0, np.nan)),
        ("above", "", "above"),
    ],
)
def test_placements_that_are_none(placement: object, part: str, got: object, tmp_path: Path) -> None:
    error = refused(write(tmp_path / "base.urdf", base_text()), UR5, placement=placement)
    assert error.where == f"placement{part}"
    np.testing.assert_array_equal(error.got, got)


def test_clashing_prefixes(tmp_path: Path) -> None:
    base = nmm.mount(write(tmp_path / "base.urdf", base_text()), UR5, prefix="left_")
    error = refused(base, UR5, at="top", prefix="left_")
    carries(error, "prefix", got="left_")
    assert "left_base_link" in error.what
    assert "and 19 more" in error.what
    carries(refused(base, UR5, at="top", prefix=3), "prefix", got=3)
    # A joint gives an input its name: it cannot be called as the platform's inputs are.
    text = robot(link("a"), link("b"), joint("v"))
    arm = write(tmp_path / "arm.urdf", text)
    assert refused(base, arm, at="top", prefix="").what.endswith(" v")
    assert nmm.mount(base, arm, at="top").u_names[-1] == "r_v"
    # Links that end in the same name after the prefix.
    arm = write(tmp_path / "arm.urdf", robot(link("top"), link("b"), joint("j", "top")))
    assert refused(base, arm, at="top", prefix="").what.endswith(" top")


def test_robot_not_made_by_loading(robot_2r: Robot) -> None:
    bare = copy.copy(robot_2r)
    object.__setattr__(bare, "parts", None)
    assert refused(bare, UR5, at="arm_base").where == bare.name
    alone = nmm.load("unicycle_2r", wheels=())
    object.__setattr__(alone, "parts", None)
    assert nmm.mount(alone, UR5, at="arm_base").n == alone.n + 6


# ------------------------------------------------------------------------------------------ documentation


def test_the_pages_examples_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """docs/robots.md from top to bottom."""
    monkeypatch.chdir(tmp_path)
    page = ROOT / "docs" / "robots.md"
    names: dict[str, object] = {}
    blocks = re.findall(r"```python\n(.*?)```", page.read_text(encoding="utf-8"), flags=re.DOTALL)
    assert len(blocks) >= 6
    for block in blocks:
        exec(block, names)


# ------------------------------------------------------------------------------------------ scenarios

TASK = (
    "task: {kind: position, frame: ee, axes: xy, reference: [1, 1]}\nresolver: {kind: rg}\nduration: 0.02\n"
)


def scenario(folder: Path, robot: str, frame: str = "ee_link", **settings: str) -> Scenario:
    (folder / "robots").mkdir(exist_ok=True)
    write(folder / "robots" / "base.urdf", base_text())
    path = write(
        folder / "given.yaml", f"robot: {robot}\n{TASK.replace('ee', frame, 1)}q0: {{mast_joint: 0.1}}\n"
    )
    return Scenario.load(path, {key.replace("__", "."): value for key, value in settings.items()})


def test_mounted_in_a_scenario(tmp_path: Path, rng: np.random.Generator) -> None:
    given = scenario(
        tmp_path,
        f"{{platform: robots/base.urdf, arm: {{source: '{UR5}', lock: {{elbow_joint: pi/4}}}}, at: top, "
        "xyz: [0.1, -0.2, 0.3], rpy: [0.4, -0.5, 0.6], prefix: a_}",
        "a_ee_link",
    )
    arm = nmm.load(UR5, lock={"elbow_joint": np.pi / 4})
    expected = nmm.mount(tmp_path / "robots/base.urdf", arm, at="top", placement=(XYZ, RPY), prefix="a_")
    assert_same_robot(given.robot(), expected, rng)
    run = given.run()
    (tmp_path / "elsewhere").mkdir()
    again = Scenario.load(write(tmp_path / "elsewhere" / "again.yaml", yaml_text(run.scenario)))
    assert again.resolved() == run.scenario == given.resolved()
    assert np.array_equal(again.run().q, run.q)


def yaml_text(data: Mapping[str, object] | None) -> str:
    import yaml

    return str(yaml.safe_dump(data, sort_keys=False))


def test_arms_in_a_scenario(tmp_path: Path) -> None:
    text = (
        f"{{platform: {{source: robots/base.urdf, platform: {{kind: unicycle, limits: {{v: 1/2}}}}}}, arms: "
        f"[{{arm: '{UR5}', at: top, prefix: l_}}, "
        f"{{arm: {{source: '{UR5}'}}, at: top, xyz: [0, 1, 0], prefix: r_}}]}}"
    )
    given = scenario(tmp_path, text, "l_ee_link")
    assert list(given.robot().arms) == ["l", "r"]
    assert given.robot().u_limits[0] == 0.5
    assert given.resolved()["robot"]["platform"]["source"] == str(tmp_path / "robots" / "base.urdf")
    assert given.override("dt", "0.001").robot() is given.robot()
    moved = given.override("robot.arms.0.xyz", "[0, 0, 2]")
    assert moved.robot() is not given.robot()
    heights = [
        Configuration(s.robot(), s.robot().q()).placement("l_world").translation for s in (given, moved)
    ]
    assert np.linalg.norm(heights[1] - heights[0]) == pytest.approx(2.0)


@pytest.mark.parametrize(
    ("key", "value", "where", "fields"),
    [
        ("robot.arms.0.xyz", "[1, 2]", "set robot.arms.0.xyz", {}),
        ("robot.arms.0.rpx", "0", "set robot.arms.0.rpx", {"got": "rpx"}),
        ("robot.arms.0.at", "tpo", "set robot.arms.0.at: rover", {"got": "tpo"}),
        ("robot.arms.0.arm", "nothing", "set robot.arms.0.arm", {"got": "nothing"}),
        ("robot.arms.0.arm", "{}", "set robot.arms.0.arm.source", {}),
        ("robot.arms.1.prefix", "l_", "set robot.arms.1.prefix", {"got": "l_"}),
        ("robot.arms.2.at", "top", "set robot.arms.2.at", {"got": "2"}),
        ("robot.arms", "[]", "set robot.arms", {}),
        ("robot.xyz", "[0, 0, 0]", "set robot.xyz", {}),
        ("robot.platform", "{kind: car}", "set robot.platform.kind", {"got": "kind"}),
        ("robot", "{arm: small_arm}", "set robot.platform", {}),
        (
            "robot.platform",
            "{source: robots/base.urdf, platform: {kind: unicycle, limits: {w: 1}}}",
            "set robot.platform.platform: limits of platform unicycle",
            {"got": "w"},
        ),
        (
            "robot.platform",
            "{source: robots/base.urdf, platform: {kind: unicycle, wheelbase: 1}}",
            "set robot.platform.platform.wheelbase",
            {"got": "wheelbase"},
        ),
        ("robot", "{source: unicycle_2r, platform: {wheelbase: 1}}", "set robot.platform.kind", {}),
        (
            "robot",
            "{source: unicycle_2r, platform: {kind: tank}}",
            "set robot.platform.kind",
            {"got": "tank"},
        ),
        (
            "robot",
            "{source: unicycle_2r, platform: {kind: differential, radius: 0, track: 1}}",
            "set robot.platform.radius",
            {"got": 0.0},
        ),
        (
            "robot",
            "{source: unicycle_2r, platform: {kind: differential, radius: 1}}",
            "set robot.platform.track",
            {},
        ),
        ("robot", "{source: unicycle_2r, axle: [1]}", "set robot.axle", {}),
        ("robot", "{source: unicycle_2r, axle: nowhere}", "set robot: unicycle_2r: axle", {"got": "nowhere"}),
        ("robot", "{source: unicycle_2r, lock: {q1: a}}", "set robot.lock.q1", {"got": "a"}),
    ],
)
def test_bad_robots_of_scenarios(
    key: str, value: str, where: str, fields: dict[str, object], tmp_path: Path
) -> None:
    arms = f"[{{arm: '{UR5}', prefix: l_}}, {{arm: '{UR5}', at: top, prefix: r_}}]"
    text = f"{{platform: robots/base.urdf, arms: {arms}}}"
    with pytest.raises(ScenarioError) as caught:
        scenario(tmp_path, text).override(key, value.replace("robots/", f"{tmp_path}/robots/")).robot()
    carries(caught.value, where, **fields)


def test_axle_and_lock_of_a_scenario(tmp_path: Path) -> None:
    given = scenario(tmp_path, "{source: robots/base.urdf, axle: [0.2, 0.1], lock: {mast_joint: 1/2}}")
    assert given.robot().q_names == ("x", "y", "theta")
    deck = Configuration(given.robot(), np.zeros(3)).placement("deck")
    np.testing.assert_allclose(deck.translation, [-0.2, -0.1, 0.0])


MOUNTED = """\
robot: {platform: car_base, arm: small_arm, limits: {v: 0.2}}
q0: {q1: 0.3, q2: 0.4, q3: 0.8}
duration: 0.4
task: {kind: position, frame: ee, axes: x, reference: 4}
resolver: {kind: pg}
"""


def test_limits_beside_a_mount_are_the_platforms(tmp_path: Path) -> None:
    """As docs/robots.md has them: a run that exceeds them says so; one that keeps limits keeps them."""
    path = tmp_path / "given.yaml"
    path.write_text(MOUNTED, encoding="utf-8")
    scenario = Scenario.load(path)
    robot = scenario.robot()
    assert dict(zip(robot.u_names, robot.u_limits, strict=True))["v"] == 0.2
    free = scenario.run()
    assert np.abs(free.u[:, 0]).max() > 0.3
    assert the(free, "inputs_beyond_limits").values["inputs"][0]["name"] == "v"
    kept = scenario.override("limits", True).run()
    assert np.abs(kept.u[:, 0]).max() <= 0.2 * (1 + 1e-9)
    # As resolved they are the platform's own, and it can be set by either path.
    assert scenario.resolved()["robot"]["platform"]["limits"] == {"v": 0.2}
    faster = scenario.override("robot.limits.v", 0.5).robot()
    assert faster.u_limits[faster.input("v")] == 0.5
    listed = scenario.override(
        "robot", {"platform": "car_base", "arms": [{"arm": "small_arm"}], "limits": {"v": 1}}
    )
    assert listed.robot().u_limits[0] == 1.0


@pytest.mark.parametrize(
    ("platform", "limits", "fields"),
    [
        ("car_base", {"w": 1}, {"got": "w", "available": ("v", "steering_rate")}),
        ("car_base", {"v": "fast"}, {"where": "set robot.limits.v"}),
        ({"source": "car_base", "limits": {"v": 1}}, {"v": 2}, {"where": "set robot.limits.v"}),
    ],
)
def test_limits_beside_a_mount_that_are_none(
    platform: object, limits: dict[str, object], fields: dict[str, Any], tmp_path: Path
) -> None:
    path = tmp_path / "given.yaml"
    path.write_text(MOUNTED, encoding="utf-8")
    robot = {"platform": platform, "arm": "small_arm", "limits": limits}
    with pytest.raises(ScenarioError) as caught:
        Scenario.load(path, {"robot": robot}).robot()
    carries(caught.value, **fields)
