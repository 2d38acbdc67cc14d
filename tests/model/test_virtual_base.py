"""Bases that a file makes of joints: endless ones, planar and floating ones, and what is none."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from findings import assert_found, of_code
from urdf_parts import joint, link, robot, write

import nmm

TURN = ("revolute", "0 0 1")
AHEAD = ("prismatic", "1 0 0")
ASIDE = ("prismatic", "0 1 0")


def based(*joints: tuple[str, str], end: float = 999999.0, offset: str = "0 0 0", speed: float = 4.0) -> str:
    """An arm of one joint on a chain of joints, each between ±end (m, rad)."""
    parts, below = [link("root")], "root"
    limit = f'<limit lower="-{end}" upper="{end}" effort="1" velocity="{speed}"/>'
    for i, (kind, axis) in enumerate(joints):
        body = f'<axis xyz="{axis}"/>{limit}'
        parts += [joint(f"base{i}", below, f"b{i}", kind, body, f'<origin xyz="{offset}"/>'), link(f"b{i}")]
        below = f"b{i}"
    return robot(*parts, joint("q1", below, "hand", origin='<origin xyz="0.3 0 0.5"/>'), link("hand"))


@pytest.mark.parametrize(
    ("joints", "platform"),
    [
        ((TURN, AHEAD), "unicycle"),
        ((TURN, AHEAD, TURN), "omnidirectional"),
        ((AHEAD, ASIDE, TURN), "omnidirectional"),
    ],
)
@pytest.mark.parametrize("end", [1e5, 999999.0, 1e9])
def test_a_base_of_endless_joints_is_the_platform(
    tmp_path: Path, joints: tuple[tuple[str, str], ...], platform: str, end: float
) -> None:
    path = write(tmp_path / "frankie.urdf", based(*joints, end=end))
    loaded = nmm.load(path)
    assert loaded.platform.name == platform
    assert loaded.q_names == ("x", "y", "theta", "q1")
    names = [f"base{i}" for i in range(len(joints))]
    found = of_code(loaded.notes, "base_of_joints")
    assert_found(found, ("base_of_joints", {"names": names, "platform": platform, "limits": {}}))
    assert nmm.load(path, platform="omnidirectional").q_names == ("x", "y", "theta", "q1")
    # The hand is where the file has it, and driving straight ahead moves it as the file's slide would.
    q = loaded.q({"x": 0.7, "q1": 0.4})
    at = nmm.Configuration(loaded, q).placement("hand")
    kept = nmm.load(path, platform="fixed")
    assert kept.q_names == (*(f"base{i}" for i in range(len(joints))), "q1")
    ahead = next(f"base{i}" for i, one in enumerate(joints) if one == AHEAD)
    there = nmm.Configuration(kept, kept.q({ahead: 0.7, "q1": 0.4})).placement("hand")
    np.testing.assert_allclose(at.homogeneous, there.homogeneous, atol=1e-12)


@pytest.mark.parametrize("joints", [(AHEAD, ASIDE, TURN), (ASIDE, AHEAD, TURN), (TURN, AHEAD)])
def test_a_base_of_joints_turns_where_it_stands(tmp_path: Path, joints: tuple[tuple[str, str], ...]) -> None:
    """A first joint that is away from the root link and turned: against the file's own joints."""
    place = '<origin xyz="1 0.5 0.1" rpy="0 0 0.7"/>'
    text = based(*joints).replace('<origin xyz="0 0 0"/>', place, 1)
    path = write(tmp_path / "placed.urdf", text)
    loaded, kept = nmm.load(path), nmm.load(path, platform="fixed")
    turn = f"base{joints.index(TURN)}"
    at = nmm.Configuration(loaded, loaded.q({"theta": np.pi / 2, "q1": 0.4}))
    there = nmm.Configuration(kept, kept.q({turn: np.pi / 2, "q1": 0.4}))
    for frame in ("hand", f"b{len(joints) - 1}"):
        expected = there.placement(frame).homogeneous
        np.testing.assert_allclose(at.placement(frame).homogeneous, expected, atol=1e-12)
    ahead = nmm.Configuration(loaded, loaded.q({"x": 0.3})).placement("hand")
    slid = nmm.Configuration(kept, kept.q({f"base{joints.index(AHEAD)}": 0.3})).placement("hand")
    np.testing.assert_allclose(ahead.homogeneous, slid.homogeneous, atol=1e-12)


@pytest.mark.parametrize(
    ("end", "joints"),
    [
        (0.3, (AHEAD, ASIDE)),
        (20.0, (AHEAD, ASIDE)),
        (999999.0, (ASIDE, AHEAD)),
        (0.3, (AHEAD, ("prismatic", "1 1 0"))),
        (999999.0, (AHEAD, ("prismatic", "1 1 0"))),
    ],
)
def test_two_slides_without_a_turn_are_a_gantry(
    tmp_path: Path, end: float, joints: tuple[tuple[str, str], ...]
) -> None:
    path = write(tmp_path / "gantry.urdf", based(*joints, end=end, offset="0.1 0 0.2"))
    loaded = nmm.load(path)
    assert (loaded.platform.name, loaded.q_names) == ("fixed", ("base0", "base1", "q1"))
    assert_found(of_code(loaded.notes, "gantry"), ("gantry", {"names": ["base0", "base1"]}))
    assert nmm.load(path, platform="unicycle").q_names[:3] == ("x", "y", "theta")
    draft = nmm.first_scenario(path, file=tmp_path / "first.yaml")
    assert draft.trajectory.robot.platform.name == "fixed"


@pytest.mark.parametrize("end", [0.6, 20.0])
def test_two_slides_and_a_turn_are_a_base_whatever_their_limits(tmp_path: Path, end: float) -> None:
    path = write(tmp_path / "fetch.urdf", based(AHEAD, ASIDE, TURN, end=end))
    loaded = nmm.load(path)
    assert (loaded.platform.name, loaded.q_names) == ("omnidirectional", ("x", "y", "theta", "q1"))
    (found,) = of_code(loaded.notes, "base_of_joints")
    assert found.values["limits"] == {f"base{i}": [-end, end] for i in range(3)}
    draft = nmm.first_scenario(path, file=tmp_path / "first.yaml")
    assert draft.trajectory.robot.q_names == loaded.q_names


def test_the_first_scenario_keeps_a_base_of_joints(tmp_path: Path) -> None:
    draft = nmm.first_scenario(write(tmp_path / "frankie.urdf", based(TURN, AHEAD)), file=tmp_path / "a.yaml")
    robot_made = draft.trajectory.robot
    assert (robot_made.platform.name, robot_made.q_names) == ("unicycle", ("x", "y", "theta", "q1"))
    assert draft.chosen[0] == "platform: unicycle, by its base of joints"


def test_slides_that_no_arm_has_are_told(tmp_path: Path) -> None:
    """A hand that floats on x, y, z: a base in space, which no platform is."""
    floating = based(AHEAD, ASIDE, ("prismatic", "0 0 1"), end=20.0)
    loaded = nmm.load(write(tmp_path / "hand.urdf", floating))
    rooms = {f"base{i}": 40.0 for i in range(3)}
    assert_found(of_code(loaded.notes, "slides_long"), ("slides_long", {"rooms": rooms}))
    held = nmm.load(tmp_path / "hand.urdf", lock=dict.fromkeys(rooms, 0.0))
    assert not of_code(held.notes, "slides_long")


def test_its_velocity_limits_are_those_of_v_and_omega(tmp_path: Path) -> None:
    path = write(tmp_path / "frankie.urdf", based(TURN, AHEAD, speed=2.5))
    assert nmm.load(path).u_limits[:2].tolist() == [2.5, 2.5]
    assert nmm.load(path, limits={"v": 1.0}).u_limits[:2].tolist() == [1.0, 2.5]
    assert nmm.load(path, platform="omnidirectional").u_limits[0] == np.inf


@pytest.mark.parametrize(
    "text",
    [
        based(TURN, AHEAD, end=50.0),  # a gantry
        based(AHEAD, ASIDE, TURN, end=0.4),  # a table
        based(AHEAD),  # a rail
        based(TURN),  # a waist
        based(AHEAD, TURN),
        based(TURN, ASIDE),
        based(TURN, AHEAD, offset="0.2 0 0"),
        based(TURN, ("prismatic", "0 0 1")),
    ],
    ids=["limits", "table", "slide", "turn", "slide first", "aside", "apart", "upright"],
)
def test_what_is_no_base_stays(tmp_path: Path, text: str) -> None:
    loaded = nmm.load(write(tmp_path / "arm.urdf", text))
    assert "base0" in loaded.q_names
    assert not of_code(loaded.notes, "base_of_joints")


@pytest.mark.parametrize(("kind", "axis"), [("planar", "0 0 1"), ("planar", "0 0 -1"), ("floating", "")])
def test_a_planar_or_floating_root_is_the_chain(tmp_path: Path, kind: str, axis: str) -> None:
    """x, y and theta count from the joint, and the world's link stays; against a fixed joint there."""
    place = '<origin xyz="1 2 0.1" rpy="0 0 0.5"/>'
    parts = [
        link("world"),
        link("pad"),
        link("base"),
        link("hand"),
        joint("pad_joint", "world", "pad", "fixed", ""),
    ]
    arm = joint("q1", "base", "hand")
    body = f'<axis xyz="{axis}"/>' if axis else ""
    loaded = nmm.load(
        write(tmp_path / "a.urdf", robot(*parts, joint("root", "pad", "base", kind, body, place), arm)),
        platform="omnidirectional",
    )
    assert loaded.q_names == ("x", "y", "theta", "q1")
    moved = nmm.Configuration(loaded, loaded.q([0.3, -0.2, 0.4, 0.6]))
    model = pin.buildModelFromXML(robot(*parts, joint("root", "pad", "base", "fixed", "", place), arm))
    data = model.createData()
    pin.framesForwardKinematics(model, data, np.array([0.6]))
    pad = data.oMf[model.getFrameId("pad")]
    base, hand = (pad.inverse() * data.oMf[model.getFrameId(name)] for name in ("base", "hand"))
    drive = pin.SE3(pin.utils.rotate("z", 0.4), np.array([0.3, -0.2, 0.0]))
    expected = pad * base * drive * base.inverse() * hand
    np.testing.assert_allclose(moved.placement("hand").homogeneous, expected.homogeneous, atol=1e-12)
    np.testing.assert_allclose(moved.placement("pad").homogeneous, pad.homogeneous, atol=1e-12)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (joint("root", "a", "b", "screw"), "joint 'root': a screw joint is refused: it turns and slides"),
        (joint("root", "a", "b", "helical"), "joint 'root': a helical joint is refused: it turns and slides"),
        (joint("root", "a", "b", "planar", '<axis xyz="1 0 0"/>'), "expected it upright, 0 0 1, got 1 0 0"),
        (
            joint("root", "a", "b", "planar", "") + link("c") + joint("arm", "a", "c"),
            "joint 'root': a planar joint is refused inside the tree",
        ),
    ],
)
def test_joints_that_are_no_base_are_refused_by_name(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(nmm.RobotError, match=message):
        nmm.load(write(tmp_path / "r.urdf", robot(link("a"), link("b"), text)))


@pytest.mark.parametrize(("end", "limited"), [(9e4, True), (1e5, False), (999999.0, False)])
def test_a_hundred_kilometres_are_no_limit(tmp_path: Path, end: float, limited: bool) -> None:
    loaded = nmm.load(write(tmp_path / "rail.urdf", based(AHEAD, end=end)))
    i = loaded.coordinate("base0")
    assert loaded.limited[i].tolist() == [limited, limited]
    assert np.isfinite(nmm.Limits().on(loaded).coordinates[i]).tolist() == [limited, limited]
