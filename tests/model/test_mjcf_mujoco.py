"""MJCF files against MuJoCo's own compiler: where bodies and sites are, what they weigh, where joints end."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from findings import assert_found, holds, of_code, refused_for
from urdf_parts import write

import nmm
from nmm.model.robots.loading.mjcf_parts import ELEMENTS, _of_class, how_of, row_of
from nmm.model.robots.loading.report import file_report

mujoco: Any = pytest.importorskip("mujoco")


@pytest.fixture(autouse=True)
def _where_mujoco_writes_its_warnings(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


#: Wheels of radius 0.1, 0.2 m to the left and right of their body.
WHEELS = "".join(
    f'<body name="{side}_wheel" pos="0 {y} 0" euler="-90 0 0"><joint name="{side}_wheel_joint"/>'
    '<geom type="cylinder" size="0.1 0.02" mass="0.5"/></body>'
    for side, y in (("left", 0.2), ("right", -0.2))
)


def world(*parts: str, before: str = "", after: str = "") -> str:
    return f"<mujoco>{before}<worldbody>{''.join(parts)}</worldbody>{after}</mujoco>"


def name(kind: str, model: Any, index: int) -> str:
    return mujoco.mj_id2name(model, getattr(mujoco.mjtObj, f"mjOBJ_{kind}"), index) or ""


def agrees(path: Path, rng: np.random.Generator, **options: object) -> nmm.Robot:
    """The robot, whose bodies, sites, masses and limits were MuJoCo's at five configurations."""
    robot = nmm.load(path, **{"platform": "fixed", "wheels": (), **options})  # type: ignore[arg-type]
    model = mujoco.MjModel.from_xml_path(str(path))
    data, own = mujoco.MjData(model), robot.model.createData()
    joints = {name("JOINT", model, i): i for i in range(model.njnt)}
    moving = [one for one in robot.q_names if one in joints]
    for _ in range(5):
        low, high = np.clip(robot.q_limits.T, -2.0, 2.0)
        q = robot.following.placed(rng.uniform(low, high))
        for one in moving:
            data.qpos[model.jnt_qposadr[joints[one]]] = q[robot.coordinate(one)]
        if robot.platform.n_p:
            x, y, theta = q[:3]
            data.qpos[:7] = x, y, model.qpos0[2], *turned(theta, model.qpos0[3:7])
        mujoco.mj_forward(model, data)
        pin.framesForwardKinematics(robot.model, own, q)
        for kind, count, places, turns in (
            ("BODY", model.nbody, data.xpos, data.xmat),
            ("SITE", model.nsite, data.site_xpos, data.site_xmat),
        ):
            for i in range(count):
                if (frame := name(kind, model, i)) in robot.frames:
                    placement = own.oMf[robot.frame_id(frame)]
                    np.testing.assert_allclose(placement.translation, places[i], atol=2e-7, err_msg=frame)
                    np.testing.assert_allclose(placement.rotation.ravel(), turns[i], atol=2e-7, err_msg=frame)
        for one in moving:
            weighs(robot, own, one, model, data, joints[one])
    # The limits of followers and leaders are each other's, too.
    coupled = {end for one in robot.mimic_joints for end in (one.joint, one.leader)}
    for one in set(moving) - coupled:
        limited = model.jnt_limited[joints[one]]
        expected = model.jnt_range[joints[one]] if limited else [-np.inf, np.inf]
        np.testing.assert_allclose(robot.q_limits[robot.coordinate(one)], expected, atol=1e-12)
        np.testing.assert_allclose(
            robot.model.armature[robot.model.joints[robot.model.getJointId(one)].idx_v],
            model.dof_armature[model.jnt_dofadr[joints[one]]],
        )
    return robot


def turned(yaw: float, standing: np.ndarray) -> np.ndarray:
    """A quaternion, w first, turned about the world's z until its own yaw is `yaw`."""
    matrix, result = np.zeros(9), np.zeros(4)
    mujoco.mju_quat2Mat(matrix, standing)
    half = 0.5 * (yaw - np.arctan2(matrix[3], matrix[0]))
    mujoco.mju_mulQuat(result, np.array([np.cos(half), 0.0, 0.0, np.sin(half)]), standing)
    return result


def weighs(robot: nmm.Robot, own: pin.Data, joint: str, model: Any, data: Any, index: int) -> None:
    """Asserts that what moves with a joint has MuJoCo's mass, centre and moments."""
    body = model.jnt_bodyid[index]
    if index != model.body_jntadr[body] + model.body_jntnum[body] - 1:
        return
    group = np.flatnonzero(model.body_weldid == body)
    mass = model.body_mass[group].sum()
    center = model.body_mass[group] @ data.xipos[group] / mass
    moments = np.zeros((3, 3))
    for one in group:
        R, x = data.ximat[one].reshape(3, 3), data.xipos[one] - center
        moments += R @ np.diag(model.body_inertia[one]) @ R.T
        moments += model.body_mass[one] * (x @ x * np.eye(3) - np.outer(x, x))
    ours = own.oMi[robot.model.getJointId(joint)].act(robot.model.inertias[robot.model.getJointId(joint)])
    assert ours.mass == pytest.approx(mass, rel=1e-6)
    np.testing.assert_allclose(ours.lever, center, atol=1e-6)
    np.testing.assert_allclose(ours.inertia, moments, atol=1e-5 * np.abs(moments).max())


LINK = (
    '<body name="{0}" pos="0.1 0.2 0.3"><joint name="{0}_j" axis="1 2 0" pos="0.1 0 0" ref="20"/>{1}</body>'
)
BALL = '<geom size="0.1"/>'


@pytest.mark.parametrize(
    "text",
    [
        world(
            '<frame pos="1 0 0" euler="0 30 0" childclass="long"><body name="a"><joint name="j"/>'
            '<frame pos="0 1 0" axisangle="1 0 0 40"><frame zaxis="1 1 1"><geom/>'
            '<joint name="k" type="slide"/><site name="tip" pos="0 0 1"/><body name="b">'
            '<joint name="m" class="short"/><geom class="short"/></body></frame></frame></body></frame>',
            before='<default><default class="long"><geom type="capsule" size="0.1 0.5" euler="0 90 0"/>'
            '<joint axis="0 1 0" range="-90 30"/><default class="short"><geom quat="1 1 0 0" size="0.1 0.2"/>'
            "</default></default></default>",
        ),
        world(
            LINK.format(
                "a",
                BALL + '<replicate count="3" offset="0.5 0 0" euler="0 30 40" sep="-">'
                f"{LINK.format('b', BALL)}"
                '<geom type="box" size="0.1 0.2 0.3"/><site name="s"/></replicate>',
            )
        ),
        world(
            LINK.format(
                "a",
                BALL
                + '<replicate count="2" offset="1 0 0" sep="-"><replicate count="2" offset="0 1 0" sep="_">'
                f"{LINK.format('b', BALL)}</replicate></replicate>",
            )
        ),
        world(
            '<body name="a" euler="20 -30 50"><joint name="j" armature="0.2"/>'
            '<geom type="cylinder" fromto="0 0 0 1 0.5 0" size="0.1"/><body name="b" xyaxes="0 1 0 -1 0.5 0">'
            '<joint name="k" type="slide" axis="0 1 1" ref="0.3" range="-1 1"/>'
            '<inertial pos="0.1 0 0" mass="2" fullinertia="0.2 0.3 0.4 0.01 0.02 0.03"/></body></body>',
            before='<compiler eulerseq="ZYX" autolimits="false"/>'
            '<default><joint limited="true" range="-9 8"/></default>',
        ),
    ],
    ids=["frames", "replicas", "replicas of replicas", "compiler"],
)
def test_bodies_are_where_mujoco_has_them(tmp_path: Path, rng: np.random.Generator, text: str) -> None:
    agrees(write(tmp_path / "r.xml", text), rng)


def test_a_model_is_attached_with_its_own_units(tmp_path: Path, rng: np.random.Generator) -> None:
    (tmp_path / "arms").mkdir()
    inner = LINK.format("p", BALL + LINK.format("q", BALL)).replace('ref="20"', 'ref="0.2"')
    arm = world(
        f'<frame name="f" pos="0 0 1">{inner}</frame>',
        before='<compiler angle="radian"/><default><joint range="-1 1"/></default>',
        after='<equality><joint joint1="q_j" joint2="p_j" polycoef="0.1 2 0 0 0"/></equality>'
        '<actuator><velocity joint="p_j" ctrlrange="-3 4"/></actuator>',
    )
    write(tmp_path / "arms/arm.xml", arm)
    for chosen in ('body="p"', 'frame="f"', ""):
        text = world(
            f'<body name="base"><joint name="j"/>{BALL}<frame pos="0 1 0" euler="0 0 90">'
            f'<attach model="arm" {chosen} prefix="left_"/></frame>'
            '<attach model="arm" body="p" prefix="right_"/></body>',
            before='<asset><model name="arm" file="arms/arm.xml"/></asset>',
        )
        robot = agrees(write(tmp_path / "r.xml", text), rng)
        assert {(one.joint, one.leader, one.multiplier) for one in robot.mimic_joints} == {
            (f"{side}q_j", f"{side}p_j", 2.0) for side in ("left_", "right_")
        }
        assert robot.u_limits[robot.input("left_p_j")] == 3.0


def test_masses_of_shapes_are_mujocos(tmp_path: Path, rng: np.random.Generator) -> None:
    sizes = {
        "sphere": "0.3",
        "capsule": "0.1 0.4",
        "cylinder": "0.1 0.4",
        "ellipsoid": ".1 .2 .3",
        "box": ".1 .2 .3",
    }
    for said in ("", 'mass="2"', 'density="300"', 'shellinertia="true"', 'mass="2" shellinertia="true"'):
        bodies = "".join(
            f'<body name="{kind}"><joint name="j_{kind}"/>'
            f'<geom type="{kind}" size="{size}" pos="0.1 0.2 0" euler="10 20 30" {said}/>'
            '<geom type="sphere" size="0.1" mass="0"/></body>'
            for kind, size in sizes.items()
        )
        text = world(f'<body name="a"><joint name="j"/>{BALL}{bodies}</body>')
        robot = agrees(write(tmp_path / "r.xml", text), rng)
        assert robot.n == 6


@pytest.mark.parametrize("inertia", ["legacy", "convex", "exact", "shell", None])
@pytest.mark.parametrize("suffix", ["stl", "obj"])
def test_masses_of_meshes_are_mujocos(
    tmp_path: Path, rng: np.random.Generator, inertia: str | None, suffix: str
) -> None:
    """A mesh with a hollow side, scaled, mirrored and moved; and plain shapes that are fitted to it."""
    import trimesh

    outer, tower = trimesh.creation.box((1.0, 2.0, 0.5)), trimesh.creation.box((0.3, 0.3, 2.0))
    tower.apply_translation((0.2, 0.5, 1.25))
    trimesh.util.concatenate([outer, tower]).export(tmp_path / f"m.{suffix}")
    how = f'inertia="{inertia}"' if inertia else ""
    geoms = {
        "m": 'type="mesh" pos="1 2 3" euler="10 20 30"',
        "n": 'type="mesh" mass="3"',
        **{
            kind: f'type="{kind}" fitscale="1.1"'
            for kind in ("box", "sphere", "capsule", "cylinder", "ellipsoid")
        },
        "plain": "",
    }
    bodies = "".join(
        f'<body name="{one}"><joint name="j_{one}"/><geom mesh="m" {said}/></body>'
        for one, said in geoms.items()
    )
    assets = (
        f'<asset><mesh name="m" file="m.{suffix}" scale="0.1 -0.2 0.3" refpos="0.3 0.2 0.1" {how}/></asset>'
    )
    path = write(
        tmp_path / "r.xml", world(f'<body name="a"><joint name="j"/>{BALL}{bodies}</body>', before=assets)
    )
    robot = agrees(path, rng)
    model = mujoco.MjModel.from_xml_path(str(path))
    # Where they collide: what plain shapes are fitted to, MuJoCo has made.
    shapes = {robot.model.names[one.parentJoint]: one for one in robot.collision_model.geometryObjects}
    for kind, size in (("box", 2 * model.geom_size[3]), ("sphere", model.geom_size[4][:1])):
        shape = shapes[f"j_{kind}"].geometry
        ours = 2.0 * shape.halfSide if kind == "box" else np.array([shape.radius])
        np.testing.assert_allclose(ours, size, rtol=1e-5)


@pytest.mark.parametrize(
    "compiler",
    [
        'inertiafromgeom="true"',
        'inertiafromgeom="auto" inertiagrouprange="0 1"',
        'boundmass="3" boundinertia="0.05"',
        'balanceinertia="true" boundinertia="0.001"',
        'settotalmass="7" boundmass="3"',
    ],
)
def test_the_compilers_settings_of_masses_hold(
    tmp_path: Path, rng: np.random.Generator, compiler: str
) -> None:
    lopsided = "0.1 0.2 0.35" if "balance" in compiler else "0.1 0.2 0.25"
    text = world(
        f'<geom type="box" size="1 1 1"/><body name="table">{BALL}</body>'
        f'<body name="a"><joint name="j"/><inertial pos="0 0 .1" mass="1" diaginertia="{lopsided}"/>'
        '<geom size=".1 .2 .3" type="box" group="3"/><body name="b"><joint name="k"/>'
        f'{BALL}<geom size=".1" contype="0" conaffinity="0" pos="1 0 0" group="2"/></body></body>',
        before=f"<compiler {compiler}/>",
    )
    agrees(write(tmp_path / "r.xml", text), rng)


@pytest.mark.parametrize(
    "place",
    ['pos="1 0.5 0.1" euler="0 0 40"', 'pos="1 0.5 0.3" euler="5 10 40"', 'pos="0 0 0.1"', ""],
)
@pytest.mark.parametrize("around", ["", '<frame pos="0.3 0 0" euler="0 0 20">'])
def test_a_free_body_is_where_its_qpos_says(
    tmp_path: Path, rng: np.random.Generator, place: str, around: str
) -> None:
    """x, y and theta are those of MuJoCo's qpos; it starts, and on a fixed base is, where the file has it."""
    body = f'<body name="base" {place}><freejoint/><geom type="box" size=".2 .2 .05"/>{WHEELS}'
    text = world(
        f"{around}{body}{LINK.format('arm', BALL)}</body>{'</frame>' if around else ''}",
        after='<keyframe><key name="home" qpos="1 2 0.1 0.8 0 0 0.6 0 0 0.4"/></keyframe>',
    )
    path = write(tmp_path / "r.xml", text)
    robot = agrees(path, rng, platform=None, wheels=None)
    agrees(path, rng)
    model = mujoco.MjModel.from_xml_path(str(path))
    yaw = np.arctan2(*(2 * model.qpos0[3] * model.qpos0[6], 1 - 2 * model.qpos0[6] ** 2))
    np.testing.assert_allclose(robot.rest[:2], model.qpos0[:2], atol=1e-12)
    if "5 10" not in place:
        assert robot.rest[2] == pytest.approx(yaw)
    assert robot.rest[robot.coordinate("arm_j")] == pytest.approx(np.radians(20))
    assert robot.postures["home"]["theta"] == pytest.approx(2 * np.arctan2(0.6, 0.8))
    assert [robot.postures["home"][key] for key in ("x", "y", "arm_j")] == [1.0, 2.0, 0.4]


def test_wheels_touch_the_ground_below_a_free_body(tmp_path: Path) -> None:
    free = '<body name="base" pos="1 0.5 0.1" euler="0 0 40"><freejoint/>'
    body = f'{free}<geom type="box" size=".2 .2 .05"/>{WHEELS}'
    path = write(tmp_path / "r.xml", world(f"{body}{LINK.format('arm', BALL)}</body>"))
    report = file_report(path)
    assert report.facts["ground"] == "the wheels touch it at z = 0"
    assert report.robot is not None
    assert [one.radius for one in report.robot.wheels] == [0.1, 0.1]
    moved = nmm.load(path, axle=(0.3, -0.1))
    here = nmm.Configuration(moved, moved.rest).placement("base")
    np.testing.assert_allclose(here.translation, [1.0, 0.5, 0.1], atol=1e-12)


@pytest.mark.parametrize("order", ["xyt", "yxt", "txy", "xty"])
def test_slides_and_a_turn_stand_where_their_body_does(tmp_path: Path, order: str) -> None:
    """At qpos 0 and turned by a quarter; against MuJoCo, where the turn is the last joint, and by hand."""
    made = {
        "x": '<joint name="sx" type="slide" axis="1 0 0"/>',
        "y": '<joint name="sy" type="slide" axis="0 1 0"/>',
        "t": '<joint name="yaw" axis="0 0 1"/>',
    }
    joints = "".join(made[one] for one in order)
    arm = LINK.format("arm", BALL)
    text = world(f'<body name="base" pos="1 0.5 0.1" euler="0 0 40">{joints}{BALL}{WHEELS}{arm}</body>')
    path = write(tmp_path / "r.xml", text)
    robot, model = nmm.load(path), mujoco.MjModel.from_xml_path(str(path))
    assert robot.q_names == ("x", "y", "theta", "arm_j")
    assert nmm.load(path, platform="differential").platform.name == "differential"
    data = mujoco.MjData(model)
    values = {"sx": 0.3, "sy": -0.2} if order.endswith("t") else {}
    for one, value in {**values, "yaw": np.pi / 2}.items():
        data.joint(one).qpos[0] = value
    mujoco.mj_kinematics(model, data)
    q = robot.q(
        {"x": values.get("sx", 0.0), "y": values.get("sy", 0.0), "theta": np.pi / 2, "arm_j": model.qpos0[-1]}
    )
    for body in ("base", "arm"):
        placement = nmm.Configuration(robot, q).placement(body)
        np.testing.assert_allclose(placement.translation, data.body(body).xpos, atol=1e-12)
        np.testing.assert_allclose(placement.rotation.ravel(), data.body(body).xmat, atol=1e-12)


@pytest.mark.parametrize("ends", ["", 'range="0 3"'])
@pytest.mark.parametrize("apart", ["0 0 0", "0.2 0.1 0.3"])
def test_a_gantry_stands_and_keeps_its_slides(
    tmp_path: Path, rng: np.random.Generator, ends: str, apart: str
) -> None:
    text = world(
        f'<body name="rail" pos="0 0 1"><joint name="along" type="slide" axis="0 1 0" {ends}/>{BALL}'
        f'<body name="bridge" pos="{apart}"><joint name="across" type="slide" axis="1 0 0" {ends}/>{BALL}'
        f'<body name="arm" pos="0 0 -0.1"><joint name="turn" pos="-0.2 0 0"/>{BALL}</body></body></body>'
    )
    path = write(tmp_path / "r.xml", text)
    robot = agrees(path, rng, platform=None)
    assert (robot.platform.name, robot.q_names) == ("fixed", ("along", "across", "turn"))
    assert holds(*of_code(robot.notes, "gantry"), "gantry", names=["along", "across"])
    assert nmm.load(path, platform="unicycle").q_names[:3] == ("x", "y", "theta")


def test_actuators_set_limits_or_are_told(tmp_path: Path) -> None:
    """What MuJoCo lets an actuator ask of its joint, by its own tables of control and gear."""
    joints = "".join(
        f'<body><joint name="{one}" range="-90 90"/>{BALL}'
        for one in ("speed", "geared", "torque", "place", "twice", "free", "held")
    )
    actuators = (
        '<velocity joint="speed" ctrlrange="-2 3"/><velocity joint="geared" gear="4" ctrlrange="-2 2"/>'
        '<motor joint="torque" gear="10" ctrlrange="-1 1"/>'
        '<position joint="place" ctrlrange="-1 1" forcerange="-5 5"/>'
        '<velocity joint="twice" ctrlrange="-1 1"/><velocity joint="twice" ctrlrange="-1 1"/>'
        '<velocity joint="free" ctrlrange="-1 1" ctrllimited="false"/>'
    )
    text = world(
        f"{joints}{'</body>' * 7}",
        before='<default><joint actuatorfrcrange="-30 20"/></default>',
        after=f"<actuator>{actuators}</actuator>",
    )
    robot = nmm.load(write(tmp_path / "r.xml", text), platform="fixed")
    speeds = dict(zip(robot.u_names, robot.u_limits.tolist(), strict=True))
    assert speeds == {
        "speed": 2.0,
        "geared": 0.5,
        **dict.fromkeys(("torque", "place", "twice", "free", "held"), np.inf),
    }
    model = robot.model
    efforts = {one: model.effortLimit[model.joints[model.getJointId(one)].idx_v] for one in robot.q_names}
    assert (efforts["torque"], efforts["place"], efforts["held"]) == (10.0, 5.0, 20.0)
    assert holds(*of_code(robot.notes, "mjcf_speeds"), "mjcf_speeds", limits={"speed": 2.0, "geared": 0.5})
    assert holds(*of_code(robot.notes, "mjcf_controls"), "mjcf_controls", ranges={"place": [-1.0, 1.0]})


def test_findings_have_the_files_own_lines(tmp_path: Path) -> None:
    text = world(
        '\n<include file="part.xml"/>',
        '\n<body name="a">\n<joint name="j" range="1 -1" limited="true"/>'
        '\n<geom type="mesh" mesh="m"/></body>',
        before='\n<asset><mesh name="m" file="m.stl"/></asset>',
    )
    write(
        tmp_path / "part.xml",
        '<mujoco>\n<body name="b">\n<geom type="ellipsoid" size="1 1 1"/></body></mujoco>',
    )
    path = write(tmp_path / "r.xml", text)
    report = file_report(path)
    assert_found(report.problems, ("limits_crossed", {"line": 5, "joint": "j"}))
    assert not report.expanded
    path.write_text(text.replace('range="1 -1"', 'range="-1 1"'))
    with refused_for(
        *[("mesh_missing", {"line": 6, "link": "a", "part": part}) for part in ("visual", "collision")]
    ):
        nmm.load(path)
    (note,) = of_code(file_report(path).warnings, "mjcf_left_out")
    assert holds(note, "mjcf_left_out", names=["body b", "mass of mesh m"], file="part.xml", line=2)
    assert str(note) == (
        "in part.xml:2: left out of the MJCF file: body b (part.xml:2), mass of mesh m (line 6)"
    )


def test_a_root_that_was_fused_into_the_world_is_named(tmp_path: Path) -> None:
    """What MuJoCo saves of a URDF, with and without the setting that the message names."""
    inertial = (
        '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'
    )
    box = '<collision><geometry><box size="1 1 1"/></geometry></collision>'
    urdf = f'<robot name="r"><link name="base">{inertial}{box}</link>'
    for one in ("l", "r"):
        ends = f'<parent link="base"/><child link="{one}"/>'
        urdf += f'<link name="{one}">{inertial}</link><joint name="{one}j" type="continuous">{ends}</joint>'
    for setting in ("", '<mujoco><compiler fusestatic="false"/></mujoco>'):
        spec = mujoco.MjSpec.from_string(f"{urdf}{setting}</robot>")
        spec.compile()
        path = write(tmp_path / "saved.xml", spec.to_xml())
        if setting:
            assert nmm.load(path, platform="fixed").q_names == ("lj", "rj")
            continue
        with pytest.raises(nmm.RobotError, match='<compiler fusestatic="false"/>') as caught:
            nmm.load(path)
        assert holds(caught.value.findings[0], "mjcf_several_trees", names=["l", "r"], fused=True)


def schema() -> dict[str, list[str]]:
    """MuJoCo's own elements by path, with their attributes, as it prints them in columns."""
    found: dict[str, list[str]] = {}
    path: list[str] = []
    for line in mujoco.mj_printSchema(False, False).splitlines():
        words, more = line[:30].split(), line[30:].split()
        if not words:
            found["/".join(path)] += more
            continue
        depth = (len(line) - len(line.lstrip())) // 3
        tag = words[0].replace("(world)", "")
        path[depth:] = [tag]
        found["/".join(path)] = more
    return found


def test_every_element_and_attribute_of_mujoco_is_in_the_table() -> None:
    elements = schema()
    assert len(elements) > 150
    met, missing = {"include", "body/frame", "body/replicate", "body/composite"}, []
    for path, attributes in elements.items():
        below = path.partition("/")[2]
        if below.startswith("default/"):
            continue  # a class has its elements' attributes
        found = row_of(below)
        if found is None:
            missing.append(below)
            continue
        met.add(found[0])
        missing += [f"{below}: {one}" for one in attributes if how_of(found[1], one) is None]
    assert missing == []
    assert set(ELEMENTS) - met == set()
    for path, row in ELEMENTS.items():
        assert row.why, path
    # What a class gives, its elements have.
    for path, attributes in elements.items():
        if path.startswith("mujoco/default/") and path.count("/") == 2:
            row = _of_class(path.rpartition("/")[2])[1]
            assert [one for one in attributes if how_of(row, one) is None] == [], path


def test_what_is_not_taken_is_noted_with_its_line(tmp_path: Path) -> None:
    text = world(
        f'\n<body name="a" gravcomp="1"><joint name="j"/>{BALL}<site name="s"/>'
        f'\n<body name="b"><joint name="k"/>{BALL}</body></body>',
        before='<option gravity="0 0 -1"/><option timestep="0.1"/>',
        after='\n<tendon><fixed><joint joint="j" coef="1"/><joint joint="k" coef="1"/></fixed></tendon>'
        '\n<equality><connect body1="a" body2="b" anchor="0 0 0"/></equality>'
        '\n<sensor><jointpos joint="j"/></sensor>\n<contact><exclude body1="a" body2="b"/></contact>',
    )
    robot = nmm.load(write(tmp_path / "r.xml", text), platform="fixed")
    noted = {
        name: note.values["lines"][name]
        for note in of_code(robot.notes, "mjcf_noted")
        for name in note.values["names"]
    }
    assert noted == {"<option> gravity": 1, "<body> gravcomp": 2, "<fixed>": 4, "<connect>": 5}
    assert robot.semantics.disabled == (("a", "b"),)
