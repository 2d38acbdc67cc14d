"""MJCF files as robots: where MuJoCo has their bodies, and what is refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from findings import holds, of_code, refused_for
from urdf_parts import write

import nmm
from nmm.model.robots.configuration import Configuration
from nmm.model.robots.loading.report import file_report

ARM = """<mujoco model="arm">
  <compiler angle="degree" eulerseq="XYZ" meshdir="meshes"/>
  <default class="main">
    <joint axis="0 1 0" range="-90 45"/>
    <default class="slow"><joint type="slide" axis="1 1 0" range="-0.5 0.25"/></default>
  </default>
  <worldbody>
    <body name="base" pos="0.1 0.2 0.3" quat="1 0.5 0 0">
      <body name="upper" pos="0 0 0.4" euler="10 20 30">
        <joint name="shoulder"/><joint name="twist" axis="0 0 2"/>
        <body name="lower" pos="0.3 0 0" axisangle="1 1 0 40" childclass="slow">
          <joint name="lift"/>
          <body name="hand" xyaxes="0 1 0 -1 0 0.2" pos="0 0.1 0">
            <joint name="wrist" class="main"/>
            <inertial pos="0.1 0 0" mass="2" diaginertia="0.1 0.2 0.25"/>
          </body>
        </body>
      </body>
    </body>
  </worldbody>
</mujoco>"""

JOINTS = {"shoulder": 0.3, "twist": -0.2, "lift": 0.1, "wrist": 0.4}
#: Where MuJoCo 3.17 has the bodies of ARM at JOINTS: `xpos` (m) and `xquat` (w first).
MUJOCO = {
    "base": ([0.1, 0.2, 0.3], [0.8944271909999159, 0.4472135954999579, 0.0, 0.0]),
    "upper": (
        [0.1, -0.12, 0.54],
        [0.8476296857182326, 0.3892153129615341, 0.22622877528916507, 0.2808129222037861],
    ),
    "lower": (
        [0.35309020891731113, 0.15989555797241825, 0.5345018504300733],
        [0.6476694313824121, 0.5028244231238764, 0.4854934454234247, 0.30329527133441453],
    ),
    "hand": (
        [0.3626267860571756, 0.19093147355168322, 0.6290842253241948],
        [0.15926287811250261, 0.5719174461574446, 0.08744859181245551, 0.7999365688766126],
    ),
}


def loaded(folder: Path, text: str, **options: object) -> nmm.Robot:
    return nmm.load(write(folder / "r.xml", text), **{"platform": "fixed", **options})  # type: ignore[arg-type]


def world(*parts: str, before: str = "") -> str:
    return f"<mujoco>{before}<worldbody>{''.join(parts)}</worldbody></mujoco>"


def test_bodies_are_where_mujoco_has_them(tmp_path: Path) -> None:
    robot = loaded(tmp_path, ARM)
    assert robot.q_names == ("shoulder", "twist", "lift", "wrist")
    here = Configuration(robot, robot.q(JOINTS))
    for name, (position, quaternion) in MUJOCO.items():
        placement = here.placement(name)
        np.testing.assert_allclose(placement.translation, position, atol=1e-14)
        w, x, y, z = quaternion
        np.testing.assert_allclose(placement.rotation, pin.Quaternion(w, x, y, z).matrix(), atol=1e-14)
    limits = dict(zip(robot.q_names, robot.q_limits.tolist(), strict=True))
    assert limits["shoulder"] == pytest.approx([-np.pi / 2, np.pi / 4])
    assert limits["lift"] == [-0.5, 0.25]
    assert robot.model.inertias[-1].mass == 2.0


def test_joints_turn_about_a_point_of_the_body_from_where_the_file_draws_them(tmp_path: Path) -> None:
    """At its `ref` a joint stands as drawn; a frame around a body counts; a site is a frame."""
    text = world(
        '<frame pos="0 0 1" euler="0 0 90"><body name="a">'
        '<joint name="j" pos="1 0 0" ref="30"/><site name="tip" pos="1 1 0"/>'
        '<body name="b"><joint name="s" type="slide" ref="0.5"/></body></body></frame>'
    )
    robot = loaded(tmp_path, text)
    drawn = Configuration(robot, robot.q({"j": np.pi / 6, "s": 0.5}))
    np.testing.assert_allclose(drawn.placement("b").translation, [0, 0, 1], atol=1e-15)
    np.testing.assert_allclose(drawn.placement("tip").translation, [-1, 1, 1], atol=1e-15)
    turned = Configuration(robot, robot.q({"j": np.pi / 6 + np.pi / 2, "s": 0.7}))
    # By a quarter about the point (1, 0, 0) of a, which lies at (0, 1, 1).
    np.testing.assert_allclose(turned.placement("a").translation, [1, 1, 1], atol=1e-15)
    np.testing.assert_allclose(turned.placement("b").translation, [1, 1, 1.2], atol=1e-15)


def test_limits_hold_where_the_compiler_says_so(tmp_path: Path) -> None:
    body = '<body><joint name="j" range="-1 1"/><body><joint name="k" type="slide"/></body></body>'
    for before, ends in (
        ('<compiler angle="radian"/>', [-1.0, 1.0]),
        ('<compiler angle="radian" autolimits="false"/>', [-np.inf, np.inf]),
        (
            '<compiler angle="radian" autolimits="false"/><default><joint limited="true"/></default>',
            [-1.0, 1.0],
        ),
    ):
        robot = loaded(
            tmp_path, world(body.replace('type="slide"', 'type="slide" limited="false"'), before=before)
        )
        assert robot.q_limits[robot.coordinate("j")].tolist() == ends
        assert np.isinf(robot.q_limits[robot.coordinate("k")]).all()


def test_a_file_is_put_together_from_others(tmp_path: Path) -> None:
    write(tmp_path / "arm.xml", '<mujocoinclude><body name="a"><joint name="j"/></body></mujocoinclude>')
    assert loaded(tmp_path, world('<include file="arm.xml"/>')).q_names == ("j",)
    with refused_for(("mjcf_included_twice", {"file": "arm.xml"})):
        loaded(tmp_path, world('<include file="arm.xml"/><include file="arm.xml"/>'))
    with refused_for(("file_unreadable", {"file": "leg.xml"})):
        loaded(tmp_path, world('<include file="leg.xml"/>'))


@pytest.mark.parametrize(
    ("text", "code", "values"),
    [
        (
            world('<body name="a"><joint/></body><body name="b"><freejoint/></body>'),
            "mjcf_several_trees",
            {"names": ["a", "b"]},
        ),
        (world('<body name="a"><joint type="ball"/></body>'), "name_unknown", {"got": "ball"}),
        (world('<body name="a"><joint class="none"/></body>'), "name_unknown", {"got": "none"}),
        (world('<body name="a"><joint/><composite type="cable"/></body>'), "mjcf_unread", {}),
        (world("<body><joint/></body>", before='<compiler coordinate="global"/>'), "mjcf_unread", {}),
        (world('<body name="a" pos="0 0"><joint/></body>'), "not_numbers", {"attribute": "pos"}),
        (world('<geom type="plane"/>'), "no_links", {}),
        ("<sdf/>", "not_robot", {"got": "sdf"}),
    ],
)  # fmt: skip
def test_what_is_not_understood_is_refused(
    tmp_path: Path, text: str, code: str, values: dict[str, object]
) -> None:
    with refused_for((code, values)):
        loaded(tmp_path, text)


def test_what_stands_still_beside_the_robot_is_left_out_and_told(tmp_path: Path) -> None:
    text = world('<body name="table"/><body name="a"><joint/><geom type="ellipsoid" size="1 1 1"/></body>')
    (note,) = of_code(loaded(tmp_path, text).notes, "mjcf_left_out")
    assert holds(note, "mjcf_left_out", names=["body table", "shape ellipsoid"])


def test_a_joint_that_another_drags_follows_it(tmp_path: Path) -> None:
    bodies = '<body><joint name="j"/><body><joint name="k" type="slide" ref="0.2"/></body></body>'
    equality = '<equality><joint joint1="k" joint2="j" polycoef="0.1 0.5 0 0 0"/></equality></mujoco>'
    robot = loaded(tmp_path, world(bodies).replace("</mujoco>", equality))
    (mimic,) = robot.mimic_joints
    assert (mimic.joint, mimic.leader) == ("k", "j")
    assert (mimic.multiplier, mimic.offset) == pytest.approx((0.5, 0.3))


def test_shapes_collide_and_are_shown(tmp_path: Path) -> None:
    (tmp_path / "meshes").mkdir()
    write(tmp_path / "meshes/m.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    text = world(
        '<body name="a"><joint/><geom type="mesh" mesh="m" contype="0" conaffinity="0" pos="0 0 1"/>'
        '<geom type="capsule" fromto="0 0 0 0 0 2" size="0.1"/><geom type="box" size="1 2 3"/></body>',
        before='<compiler meshdir="meshes"/><asset><mesh file="m.obj" scale="2 2 2"/></asset>',
    )
    robot = loaded(tmp_path, text)
    (mesh,) = robot.visual_model.geometryObjects
    assert mesh.meshPath == str(tmp_path / "meshes/m.obj")
    assert mesh.meshScale.tolist() == [2.0, 2.0, 2.0]
    assert mesh.placement.translation.tolist() == [0.0, 0.0, 1.0]
    capsule, box = robot.collision_model.geometryObjects
    assert (capsule.geometry.radius, capsule.geometry.halfLength) == (0.1, 1.0)
    assert capsule.placement.translation.tolist() == [0.0, 0.0, 1.0]
    assert box.geometry.halfSide.tolist() == [1.0, 2.0, 3.0]


def test_a_base_on_wheels_drives(tmp_path: Path) -> None:
    """A free joint is replaced by x, y, theta; wheels are found by their names, lw and rw among them."""
    wheels = "".join(
        f'<body name="{side}w" pos="0 {y} 0" quat="1 1 0 0"><joint name="{side}w_joint"/>'
        '<geom type="cylinder" size="0.1 0.02"/></body>'
        for side, y in (("l", 0.2), ("r", -0.2))
    )
    arm = '<body name="arm" pos="0 0 0.3"><joint name="lift" type="slide" range="0 0.5"/></body>'
    robot = loaded(
        tmp_path, world(f'<body name="base" pos="0 0 0.1"><freejoint/>{wheels}{arm}</body>'), platform=None
    )
    assert robot.q_names == ("x", "y", "theta", "lift")
    assert [wheel.joint for wheel in robot.wheels] == ["lw_joint", "rw_joint"]
    assert [wheel.radius for wheel in robot.wheels] == [0.1, 0.1]
    report = file_report(tmp_path / "r.xml")
    assert report.robot is not None
    assert report.problems == ()
