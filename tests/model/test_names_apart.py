"""Joints and links that have names of the platform's coordinates or inputs, against Pinocchio's own model."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from findings import holds, of_code
from urdf_parts import AXIS, LIMIT, joint, link, robot, write

import nmm

FAR = '<limit lower="-100" upper="100" effort="1" velocity="1"/>'


def chain(*names: str, base: str = "base_link", below: tuple[str, str] = ("upper", "lower")) -> str:
    """Two joints of those names, each turned and moved against the one before."""
    links = [base, *below]
    joints = [joint(name, *links[i : i + 2]) for i, name in enumerate(names)]
    return robot(*map(link, links), *joints)


def gantry(x: str, y: str, theta: str) -> str:
    """A base of two slides and a turn with a joint on it."""
    ends = [link(name) for name in ("world", "along", "across", "base_link", "ee")]
    return robot(
        *ends,
        joint(x, "world", "along", "prismatic", '<axis xyz="1 0 0"/>' + FAR, ""),
        joint(y, "along", "across", "prismatic", '<axis xyz="0 1 0"/>' + FAR, ""),
        joint(theta, "across", "base_link", "continuous", AXIS, ""),
        joint("j1", "base_link", "ee"),
    )


def right_place(text: str, values: dict[str, float], frame: str) -> np.ndarray:
    """Pinocchio's pose (4, 4) of a frame in its own model of the text."""
    model = pin.buildModelFromXML(text)
    q = pin.neutral(model)
    for name, value in values.items():
        one = model.joints[model.getJointId(name)]
        q[one.idx_q : one.idx_q + one.nq] = [value] if one.nq == 1 else [np.cos(value), np.sin(value)]
    data = model.createData()
    pin.framesForwardKinematics(model, data, q)
    return np.array(data.oMf[model.getFrameId(frame, pin.FrameType.BODY)].homogeneous)


@pytest.mark.parametrize("names", [("theta", "x"), ("v", "omega"), ("y", "y_joint"), ("j1", "v")])
def test_joints_with_names_of_the_platforms(tmp_path: Path, names: tuple[str, str]) -> None:
    text = chain(*names)
    file = write(tmp_path / "arm.urdf", text)
    values = dict(zip(names, (0.3, -0.4), strict=True))
    right = right_place(text, values, "lower")
    mobile = nmm.load(file)
    (note,) = of_code(mobile.notes, "names_taken")
    taken = {"x", "y", "theta", "v", "omega"}.intersection(names)
    assert {*note.values["names"]} == taken == {*mobile.renamed}
    assert len({*mobile.q_names, *mobile.u_names[:2]}) == mobile.n + 2
    q = mobile.q_from(values, base=(0, 0, 0))  # encoders have the file's names
    np.testing.assert_allclose(nmm.Configuration(mobile, q).placement("lower").homogeneous, right, atol=1e-12)
    np.testing.assert_array_equal(
        nmm.load(file, lock={names[1]: -0.4}).q_from({names[0]: 0.3}, base=(0, 0, 0)), q[:4]
    )
    still = nmm.load(file, platform="fixed")
    assert still.q_names == names
    assert not still.renamed
    place = nmm.Configuration(still, still.q(values)).placement("lower")
    np.testing.assert_allclose(place.homogeneous, right, atol=1e-12)
    planar = nmm.PinocchioLayout(mobile, pin.buildModelFromXML(text, pin.JointModelFreeFlyer()))
    np.testing.assert_allclose(planar.coordinates(planar.configuration(q)), q, atol=1e-12)
    np.testing.assert_array_equal(nmm.PinocchioLayout(still, "chain").configuration([0.3, -0.4]), [0.3, -0.4])


def test_links_with_names_of_coordinates(tmp_path: Path) -> None:
    file = write(tmp_path / "arm.urdf", chain("j1", "j2", below=("theta", "v")))
    mobile = nmm.load(file)
    (note,) = of_code(mobile.notes, "names_taken")
    assert holds(note, "names_taken", names={"theta": "theta_link"})  # v is no frame of the platform's
    assert {"theta_link", "v"} <= {*mobile.frames}
    right = right_place(file.read_text(encoding="utf-8"), {"j1": 0.5}, "theta")
    place = nmm.Configuration(mobile, mobile.q({"j1": 0.5})).placement("theta_link")
    np.testing.assert_allclose(place.homogeneous, right, atol=1e-12)
    assert "theta" in nmm.load(file, platform="fixed").frames
    for platform in ("unicycle", "fixed"):
        world = write(tmp_path / "world.urdf", chain("j1", "j2", below=("universe", "lower")))
        assert "universe_link" in nmm.load(world, platform=platform).frames
        assert of_code(nmm.load(world, platform=platform).notes, "names_taken")


@pytest.mark.parametrize("names", [("px", "py", "turn"), ("x", "y", "theta"), ("y", "x", "omega")])
def test_a_base_of_joints_is_one_by_any_name(tmp_path: Path, names: tuple[str, str, str]) -> None:
    text = gantry(*names)
    file = write(tmp_path / "gantry.urdf", text)
    mobile = nmm.load(file)
    assert (mobile.platform.name, mobile.q_names) == ("omnidirectional", ("x", "y", "theta", "j1"))
    assert not of_code(mobile.notes, "names_taken")  # they are gone
    (note,) = of_code(mobile.notes, "base_of_joints")
    assert holds(note, "base_of_joints", names=[*names])
    q = [1.0, 2.0, 0.5, 0.3]
    right = right_place(text, dict(zip((*names, "j1"), q, strict=True)), "ee")
    np.testing.assert_allclose(nmm.Configuration(mobile, q).placement("ee").homogeneous, right, atol=1e-12)
    still = nmm.load(file, platform="fixed")
    assert still.q_names == (*names, "j1")
    np.testing.assert_allclose(nmm.Configuration(still, q).placement("ee").homogeneous, right, atol=1e-12)
    ours = nmm.PinocchioLayout(still, pin.buildModelFromXML(text)).configuration(q)
    np.testing.assert_allclose(ours, [1.0, 2.0, np.cos(0.5), np.sin(0.5), 0.3], atol=1e-15)
    # On it an arm, and it on a base.
    arm = nmm.load(write(tmp_path / "arm.urdf", chain("a", "b", base="post")), platform="fixed")
    assert nmm.mount(still, arm, at="ee", prefix="").q_names == (*names, "j1", "a", "b")
    mounted = nmm.mount("unicycle_2r", still, at="arm_base", prefix="on_")
    assert mounted.q_names[-4:] == (*(f"on_{name}" for name in names), "on_j1")


def test_a_model_of_ones_own(tmp_path: Path) -> None:
    text = chain("theta", "x")
    mobile = nmm.load(pin.buildModelFromXML(text))
    assert mobile.q_names[3:] == ("theta_joint", "x_joint")
    assert nmm.load(pin.buildModelFromXML(text), platform="fixed").q_names == ("theta", "x")


def test_followers_and_wheels_go_along(tmp_path: Path) -> None:
    follow = AXIS + LIMIT + '<mimic joint="x" multiplier="-0.5"/>'
    roll = '<axis xyz="0 1 0"/>'
    text = robot(
        *map(link, ("base_link", "upper", "lower", "left", "right")),
        joint("x", "base_link", "upper"), joint("theta", "upper", "lower", body=follow),
        joint("v", "base_link", "left", "continuous", roll, '<origin xyz="0 0.2 0.1"/>'),
        joint("y", "base_link", "right", "continuous", roll, '<origin xyz="0 -0.2 0.1"/>'),
    )  # fmt: skip
    mobile = nmm.load(write(tmp_path / "r.urdf", text), wheels={"v": 0.1, "y": 0.1})
    assert [str(one) for one in mobile.mimic_joints] == ["theta_joint = -0.5 x_joint"]
    assert [wheel.joint for wheel in mobile.wheels] == ["v_joint", "y_joint"]
    speeds = mobile.wheel_speeds([1.0, 0.0, 0.0])
    assert speeds == pytest.approx({"v_joint": 10.0, "y_joint": 10.0})
    still = nmm.load(tmp_path / "r.urdf", platform="fixed", wheels=["v", "y"])
    assert [str(one) for one in still.mimic_joints] == ["theta = -0.5 x"]
    assert still.q_names == ("x", "theta")


@pytest.mark.parametrize("suffix", ["urdf", "xacro", "xml"])
def test_white_space_ahead_of_the_declaration(tmp_path: Path, suffix: str) -> None:
    """Lines are still the file's; urdfdom, yourdfpy and MuJoCo read it, too."""
    declared = '\n \t\n<?xml version="1.0"?>\n'
    if suffix == "xml":
        text = '<mujoco><worldbody><body><joint name="j1"/><geom size="1"/></body></worldbody></mujoco>'
    else:
        text = chain("j1", "j2")
        assert pin.buildModelFromXML(declared + text).nq == 2
    assert "j1" in nmm.load(write(tmp_path / f"r.{suffix}", declared + text)).q_names
    bad = declared + text.replace("<link", "<<link", 1).replace("<body", "<<body", 1)
    with pytest.raises(nmm.RobotError) as caught:
        nmm.load(write(tmp_path / f"bad.{suffix}", bad))
    assert holds(caught.value.findings[0], "not_xml", line=4)
    doctype = "\n" + '<?xml version="1.0"?><!DOCTYPE robot [<!ENTITY a "b">]>' + text
    with pytest.raises(nmm.RobotError) as caught:
        nmm.load(write(tmp_path / f"worse.{suffix}", doctype))
    assert caught.value.findings[0].code == "doctype"
