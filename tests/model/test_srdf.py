"""SRDFs beside robots: postures, groups, links that may touch; against Pinocchio's own reader."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from command_line import Result
from findings import assert_found, holds, of_code, refused, refused_for
from places import DATA
from thinned import thinned
from urdf_parts import joint, link, robot, write

import nmm
from nmm.cli.exit_status import status_of
from nmm.model.robots.loading.packages import package_file
from nmm.model.robots.loading.srdf import read_srdf

#: The robots of example-robot-data that have postures, and which.
POSTURES = {
    "a1_description/urdf/a1.urdf": {"standing"},
    "alex_description/urdf/alex_nub_hands.urdf": {"default"},
    "alex_description/urdf/alex_sake_hands.urdf": {"default"},
    "alexander_description/urdf/alexander_v1.lowerBodyOnly.urdf": {"default"},
    "anymal_b_simple_description/robots/anymal-kinova.urdf": {"standing_with_arm_up"},
    "anymal_b_simple_description/robots/anymal.urdf": {"standing"},
    "anymal_c_simple_description/urdf/anymal.urdf": {"standing"},
    "b1_description/urdf/b1-z1.urdf": {"standing_with_arm_up", "standing_with_arm_home"},
    "b1_description/urdf/b1.urdf": {"standing"},
    "baxter_description/urdf/baxter.urdf": set(),  # its states speak of joints with a prefix
    "bolt_description/robots/bolt.urdf": {"standing"},
    "borinot_description/urdf/borinot_flying_arm_2.urdf": {"home"},
    "centauro_description/urdf/centauro.urdf": {"homing_nominal", "homing_balanced"},
    "finger_edu_description/robots/finger_edu.urdf": {"hanging"},
    "go1_description/urdf/go1.urdf": {"standing"},
    "go2_description/urdf/go2.urdf": {"standing"},
    "hextilt_description/urdf/hextilt_flying_arm_5.urdf": {"home"},
    "hyq_description/robots/hyq_no_sensors.urdf": {"standing", "straight_standing"},
    "icub_description/robots/icub.urdf": {"half_sitting"},
    "icub_description/robots/icub_reduced.urdf": {"half_sitting"},
    "kinova_description/robots/kinova.urdf": {"arm_up"},
    "panda_description/urdf/panda.urdf": {"default"},
    "panda_description/urdf/panda_collision.urdf": {"default"},
    "pr2_description/urdf/pr2.urdf": {"tuck_right_arm", "tuck_left_arm"},
    "romeo_description/urdf/romeo.urdf": {"half_sitting"},
    "romeo_description/urdf/romeo_small.urdf": {"half_sitting"},
    "simple_humanoid_description/urdf/simple_humanoid.urdf": {"half_sitting"},
    "simple_humanoid_description/urdf/simple_humanoid_classical.urdf": {"half_sitting"},
    "solo_description/robots/solo.urdf": {"standing", "straight_standing"},
    "solo_description/robots/solo12.urdf": {"standing", "straight_standing"},
    "talos_data/robots/talos_full_v2.urdf": {"half_sitting"},
    "talos_data/robots/talos_full_v2_box.urdf": {"half_sitting"},
    "talos_data/robots/talos_left_arm.urdf": {"half_sitting"},
    "talos_data/robots/talos_reduced.urdf": {"half_sitting"},
    "talos_data/robots/talos_reduced_box.urdf": {"half_sitting"},
    "talos_data/robots/talos_reduced_corrected.urdf": {"half_sitting"},
    "ur_description/urdf/ur5_robot.urdf": set(),  # pairs of links alone
    "xarm_description/urdf/xarm7.urdf": {"home", "hold-up"},
    "z1_description/urdf/z1.urdf": {"home", "arm_up"},
}


@pytest.mark.parametrize("file", thinned(POSTURES, lambda file: file in [*POSTURES][::3]))
def test_postures_are_pinocchios(file: str) -> None:
    """`loadReferenceConfigurations` on Pinocchio's own model of the file, joint by joint."""
    ours = nmm.load(DATA + file, missing_meshes="skip")
    assert set(ours.postures) == POSTURES[file]
    model = pin.buildModelFromUrdf(str(package_file(DATA + file)), pin.JointModelFreeFlyer())
    pin.loadReferenceConfigurations(model, str(ours.semantics.files[0]), False)
    compared = 0
    for name, values in ours.postures.items():
        configuration = model.referenceConfigurations[name]
        q = ours.q({"posture": name})
        for joint_name in ours.q_names[3:]:
            there = model.joints[model.getJointId(joint_name)]
            part = configuration[there.idx_q : there.idx_q + there.nq]
            expected = part[0] if there.nq == 1 else np.arctan2(part[1], part[0])
            difference = q[ours.coordinate(joint_name)] - expected
            if any(one.joint == joint_name for one in ours.mimic_joints):
                continue  # Pinocchio's reader moves no followers along
            assert np.sin(difference / 2) == pytest.approx(0.0, abs=1e-12), joint_name
            compared += joint_name in values
        base = pin.XYZQUATToSE3(configuration[:7]) if "x" in values else pin.SE3.Identity()
        np.testing.assert_allclose(q[:2], base.translation[:2], atol=1e-12)
        turned = pin.rpy.rpyToMatrix(0.0, 0.0, q[2])  # iCub's root looks backwards
        np.testing.assert_allclose(turned, base.rotation, atol=1e-12)
        assert set(values) <= {*ours.q_names}
    assert compared >= len(ours.postures)


UP = '<axis xyz="0 0 1"/><limit lower="-2" upper="2" effort="1" velocity="2"/>'
LEVEL = '<axis xyz="0 1 0"/><limit effort="1" velocity="9"/>'


def small(folder: Path, srdf: str | None = None, name: str = "urdf/own.urdf") -> Path:
    """Wheels, two joints, a third that follows the second; and its SRDF."""
    parts = [link(one) for one in ("base", "left_wheel", "right_wheel", "upper", "lower", "finger")]
    for side, y in (("left", 0.3), ("right", -0.3)):
        parts.append(
            joint(
                f"{side}_wheel_joint",
                "base",
                f"{side}_wheel",
                "continuous",
                LEVEL,
                f'<origin xyz="0 {y} 0.1"/>',
            )
        )
    parts.append(joint("shoulder", "base", "upper", "revolute", UP, '<origin xyz="0.2 0 0.4"/>'))
    parts.append(joint("elbow", "upper", "lower", "revolute", UP, '<origin xyz="0.3 0 0"/>'))
    follow = UP + '<mimic joint="elbow" multiplier="-0.5" offset="0.1"/>'
    parts.append(joint("grip", "lower", "finger", "revolute", follow, '<origin xyz="0.3 0 0"/>'))
    file = folder / name
    file.parent.mkdir(parents=True, exist_ok=True)
    write(file, robot(*parts))
    if srdf is not None:
        beside(folder / "srdf" / "own.srdf", srdf)
    return file


def beside(path: Path, text: str, name: str = "r") -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(f'<robot name="{name}">{text}</robot>', encoding="utf-8")
    return path


def state(name: str, **values: object) -> str:
    inside = "".join(f'<joint name="{joint}" value="{value}"/>' for joint, value in values.items())
    return f'<group_state name="{name}" group="all">{inside}</group_state>'


def test_a_posture_sets_its_joints_and_those_that_follow(tmp_path: Path) -> None:
    mine = nmm.load(small(tmp_path, state("home", elbow=0.4, left_wheel_joint=3) + state("fold", grip=-0.2)))
    assert dict(mine.postures) == {"home": {"elbow": 0.4}, "fold": {"elbow": pytest.approx(0.6)}}
    q = mine.q({"posture": "home", "x": 2, "shoulder": 0.3})
    assert dict(zip(mine.q_names, q.tolist(), strict=True)) == pytest.approx(
        {"x": 2, "y": 0, "theta": 0, "shoulder": 0.3, "elbow": 0.4, "grip": 0.1 - 0.5 * 0.4}
    )
    np.testing.assert_array_equal(mine.q({"posture": "home", "elbow": 1}), mine.q({"elbow": 1}))
    np.testing.assert_allclose(mine.q({"posture": ["home", "fold"]}), mine.q({"elbow": 0.6}), atol=1e-15)
    mine.check_limits(q)


def test_states_of_one_name_are_one_posture(tmp_path: Path) -> None:
    mine = nmm.load(small(tmp_path, state("home", elbow=0.4) + state("home", shoulder=0.1)))
    assert mine.postures["home"] == {"elbow": 0.4, "shoulder": 0.1}


@pytest.mark.parametrize(
    ("values", "yaw"),
    [
        ("1 2 0.5", 0.5),
        ("1 2 0.8775825618903728 0.479425538604203", 0.5),
        ("1 2 0.3 0 0 0.6 0.8", 2 * np.arctan2(0.6, 0.8)),
    ],
)
def test_a_place_of_the_platform_is_taken(tmp_path: Path, values: str, yaw: float) -> None:
    srdf = '<virtual_joint name="odom" type="planar" parent_frame="map" child_link="base"/>'
    file = small(tmp_path, srdf + state("home", odom=values, elbow=0.4))
    assert nmm.load(file).postures["home"] == {
        "x": 1.0,
        "y": 2.0,
        "theta": pytest.approx(yaw, abs=1e-14),
        "elbow": 0.4,
    }
    assert nmm.load(file, platform="fixed").postures["home"] == {"elbow": 0.4}


def test_locked_joints_are_not_set_and_told_where_they_differ(tmp_path: Path) -> None:
    file = small(tmp_path, state("home", shoulder=0.4, elbow=0.4))
    locked = nmm.load(file, lock={"elbow": 0.0})
    assert locked.postures["home"] == {"shoulder": 0.4}
    about = {"posture": "home", "name": "elbow", "locked": 0.0, "wanted": 0.4}
    assert_found([one for one in locked.notes if "srdf" in one.where], ("posture_locked", about))
    same = nmm.load(file, lock={"elbow": 0.4})
    assert not [one for one in same.notes if "srdf" in one.where]


def test_groups_are_those_of_inputs(tmp_path: Path) -> None:
    groups = (
        '<group name="arm"><chain base_link="base" tip_link="lower"/></group>'
        '<group name="hand"><link name="finger"/></group>'
        '<group name="first"><joint name="shoulder"/><joint name="left_wheel_joint"/></group>'
        '<group name="all"><group name="hand"/><group name="first"/><group name="all"/></group>'
    )
    mine = nmm.load(small(tmp_path, groups))
    assert mine.semantics.groups == {
        "arm_1": ("shoulder", "elbow"),  # arm is every robot's word for all of its joints
        "first": ("shoulder",),
        "all": ("shoulder",),
    }
    task = nmm.Task(nmm.Position("finger", "xy"), nmm.Circle([0.5, 0], 1, 1))
    nmm.Controller(mine, task, nmm.ProjectedGradient(weights={"first": 3.0}))(0.0, mine.q())


@pytest.mark.parametrize(
    ("place", "urdf"),
    [
        ("urdf/own.srdf", "urdf/own.urdf"),
        ("srdf/own.srdf", "urdf/own.urdf"),
        ("srdf/other.srdf", "urdf/own.urdf"),  # the robot's name tells
        ("config/own.srdf", "urdf/own.urdf"),
        ("own_moveit_config/config/own.srdf", "own_description/urdf/own.urdf"),
        ("srdf/own.srdf", "urdf/own.urdf.xacro"),
    ],
)
def test_it_is_found_in_the_usual_places(tmp_path: Path, place: str, urdf: str) -> None:
    file = small(tmp_path, name=urdf)
    assert not nmm.load(file).postures
    path = beside(tmp_path / place, state("home", elbow=0.4))
    assert nmm.load(file).semantics.files == (path,)


def test_the_srdf_of_another_robot_is_left_alone(tmp_path: Path) -> None:
    file = small(tmp_path)
    beside(tmp_path / "srdf/other.srdf", state("home", elbow=0.4), "another")
    assert nmm.load(file).semantics.files == ()
    for name in ("one", "two"):  # which of the two is not for us to say
        beside(tmp_path / f"srdf/{name}.srdf", state("home", elbow=0.4))
    assert nmm.load(file).semantics.files == ()
    assert nmm.load(file, srdf=tmp_path / "srdf/two.srdf").postures


def test_a_mounted_arm_brings_its_postures_and_pairs(tmp_path: Path) -> None:
    pairs = '<disable_collisions link1="upper" link2="finger"/>'
    arm = nmm.load(small(tmp_path, state("home", elbow=0.4, root_joint="1 2 3") + pairs))
    assert arm.postures["home"]["x"] == 1
    z1 = DATA + "z1_description/urdf/z1.urdf"
    both = nmm.mount(nmm.mount("car_base", arm, prefix="left_"), arm, at="arm_mount", prefix="right_")
    assert both.postures == {"left_home": {"left_elbow": 0.4}, "right_home": {"right_elbow": 0.4}}
    assert both.semantics.disabled == (("left_upper", "left_finger"), ("right_upper", "right_finger"))
    q = both.q({"posture": ["left_home", "right_home"], "left_elbow": 1.0})
    assert q[both.coordinate("left_elbow")] == 1.0
    assert q[both.coordinate("right_grip")] == pytest.approx(-0.1)
    plain = nmm.mount("car_base", z1)
    assert set(plain.postures) == {"home", "arm_up"}
    merged = nmm.mount(arm, z1, at="upper")
    assert set(merged.postures["home"]) == {"x", "y", "theta", "elbow", *plain.postures["home"]}


BAD = {
    "urdf": ("<link name='base'/>", "not_srdf", {"got": "robot"}),
    "number": (state("home", elbow="ten"), "state_not_numbers", {"name": "elbow", "got": "ten"}),
    "nan": (state("home", elbow="nan"), "state_not_numbers", {"name": "elbow", "got": "nan"}),
    "nameless": (
        "<group_state><joint name='elbow' value='1'/></group_state>",
        "attribute_missing",
        {"element": "group_state", "attribute": "name"},
    ),
    "xml": ("<group_state", "not_xml", {}),
}


@pytest.mark.parametrize("kind", BAD)
def test_a_given_one_has_to_be_right_a_found_one_is_told(tmp_path: Path, kind: str) -> None:
    text, code, values = BAD[kind]
    file = small(tmp_path, text)
    with refused_for((code, values)):
        nmm.load(file, srdf=tmp_path / "srdf/own.srdf")
    found = nmm.load(file)
    assert not found.postures
    (note,) = of_code(found.notes, "srdf_unused")
    assert note.where == {"srdf": "own.srdf"}
    assert holds(nmm.Finding.from_json(note.values["reason"]), code, **values)


def test_a_given_one_speaks_of_the_robots_joints(tmp_path: Path) -> None:
    file = small(tmp_path, state("home", elbo=1))
    srdf = tmp_path / "srdf/own.srdf"
    with refused(f"srdf: {srdf}: state home", kind=nmm.RobotError, got="elbo", available=("elbow",)):
        nmm.load(file, srdf=srdf)
    about = {"srdf": "own.srdf", "posture": "home", "names": ["elbo"]}
    assert_found(of_code(nmm.load(file).notes, "posture_joints_unknown"), ("posture_joints_unknown", about))


def test_other_bad_input_is_refused_in_words(tmp_path: Path) -> None:
    file = small(tmp_path, state("home", elbow=1))
    mine = nmm.load(file)
    with refused(got="hom", available=("home",)):
        mine.q({"posture": "hom"})
    with refused(got="fold", available=("home",)):
        mine.postures["fold"]
    with refused(got=3):
        mine.q({"posture": 3})  # type: ignore[dict-item]  # on purpose
    with pytest.raises(nmm.InputError, match="no SRDF was found beside the robot's file"):
        nmm.load("unicycle_2r").q({"posture": "home"})
    with refused("srdf", kind=nmm.RobotError, got=str(tmp_path / "none.srdf")):
        nmm.load(file, srdf=tmp_path / "none.srdf")
    with refused_for(("not_srdf", {"got": "robot"})):
        nmm.load(file, srdf=file)
    with refused("srdf", kind=nmm.RobotError, got=3):
        nmm.load(file, srdf=3)  # type: ignore[arg-type]  # on purpose
    with refused_for(("not_srdf", {"got": "robot"})):
        nmm.Collisions(srdf=file).on(nmm.load("unicycle_3r"))


def test_a_pinocchio_model_takes_one(tmp_path: Path) -> None:
    file = small(tmp_path, state("home", elbow=0.4))
    made = nmm.load(pin.buildModelFromUrdf(str(file)), srdf=tmp_path / "srdf/own.srdf")
    assert made.postures["home"] == {"elbow": 0.4}


SCENARIO = """
robot: {{source: {file}{more}}}
q0: {q0}
duration: 0.1
task: {{kind: position, frame: finger, axes: xy, reference: [0.8, 0]}}
resolver: {{kind: pg}}
"""


def written(folder: Path, q0: str, more: str = "") -> Path:
    path = folder / "made.yaml"
    path.write_text(SCENARIO.format(file=folder / "urdf/own.urdf", q0=q0, more=more), encoding="utf-8")
    return path


def test_a_scenario_starts_in_a_posture(tmp_path: Path) -> None:
    small(tmp_path, state("home", elbow=0.4))
    scenario = nmm.Scenario.load(written(tmp_path, "{posture: home, x: 0.5}"))
    run = scenario.run()
    np.testing.assert_array_equal(run.q[0], scenario.robot().q({"elbow": 0.4, "x": 0.5}))
    run.save(tmp_path / "out")
    again = nmm.Scenario.load(tmp_path / "out" / "scenario.yaml").run()
    np.testing.assert_array_equal(again.q, run.q)
    other = scenario.override("q0.elbow", 0.7).override("q0.x", 0)
    np.testing.assert_array_equal(other.run().q[0], scenario.robot().q({"elbow": 0.7}))
    beside(tmp_path / "given.srdf", state("home", elbow=0.2))
    given = nmm.Scenario.load(written(tmp_path, "{posture: home}", ", srdf: given.srdf"))
    assert given.run().q[0, 4] == 0.2
    assert given.resolved()["robot"]["srdf"] == str(tmp_path / "given.srdf")


@pytest.mark.parametrize(
    ("q0", "said"),
    [
        ("{posture: hom}", "q0.posture: unknown posture 'hom' (did you mean 'home'?); available: home"),
        (
            "{posture: {home: 1}}",
            "q0.posture: expected a posture's name, or a list of such, got {'home': '1'}",
        ),
        ("{posture: [home, [1]]}", "q0.posture: expected a posture's name, or a list of such"),
        ("{posture: true}", "q0.posture: expected a posture's name"),
        ("{posture: home, elbo: 1}", "q0.elbo: robot r: unknown coordinate 'elbo'"),
        ("{posture: home, elbow: up}", "q0: elbow: "),
        ("{posture: far}", "q0: r: outside its limits: elbow = 3"),
    ],
)
def test_a_scenario_says_what_is_wrong_with_its_start(tmp_path: Path, q0: str, said: str) -> None:
    small(tmp_path, state("home", elbow=0.4) + state("far", elbow=3))
    with pytest.raises(nmm.ScenarioError) as error:
        nmm.Scenario.load(written(tmp_path, q0)).run()
    assert said in str(error.value)


def test_collisions_take_the_robots_own_pairs() -> None:
    ur5 = DATA + "ur_description/urdf/ur5_robot.urdf"
    mounted = nmm.mount("differential_base", ur5, prefix="ur5_")
    own = nmm.Collisions(srdf=True).on(mounted)
    wrists = {"ur5_forearm_link", "ur5_wrist_3_link"}
    assert wrists not in [{*pair} for pair in own.names]
    assert wrists in [{*pair} for pair in nmm.Collisions().on(mounted).names]
    alone = nmm.load(ur5, platform="fixed")
    given = nmm.Collisions(srdf=read_srdf(alone.semantics.files[0]).path).on(alone)
    assert nmm.Collisions(srdf=True).on(alone).names == given.names
    with refused("srdf"):
        nmm.Collisions(srdf=True).on(nmm.load("unicycle_3r"))


def test_info_tells_postures_and_where_they_are_from(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    file = small(tmp_path, state("home", elbow=0.4))

    def info(*more: str) -> Result:
        status = status_of(["info", str(file), *more])
        return Result(status, *capfd.readouterr())

    said = info().out
    assert "posture home: elbow 0.4" in said
    assert f"SRDF: {tmp_path / 'srdf/own.srdf'}" in said
    other = beside(tmp_path / "given.srdf", state("rest", shoulder=0.2))
    assert "posture rest: shoulder 0.2" in info("--srdf", str(other)).out
    wrong = info("--srdf", str(file))
    assert (wrong.status, wrong.err.count("\n")) == (2, 1)
    assert "this is a URDF" in wrong.err
