"""Joints that follow others: placements and Jacobians against other readers, limits, starts, and runs."""

from __future__ import annotations

import logging
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
import yourdfpy
from findings import assert_found, holds, of_code, refused
from gripping import FINGERS, folding, hitched, panda
from numpy.typing import NDArray
from places import DATA, PANDA
from short_scenario import scenario
from thinned import thinned
from urdf_parts import inertial, joint, link, robot, write

import nmm
from nmm.analysis.maps.coordinates import singularity_map
from nmm.analysis.maps.workspace import workspace_map
from nmm.analysis.null_space import redundancy
from nmm.analysis.singular.jacobians import Jacobians
from nmm.analysis.singular.singularity import analyse
from nmm.base.errors import InputError, RobotError
from nmm.cli.exit_status import status_of
from nmm.model.robots.configuration import Configuration
from nmm.model.robots.loading.packages import package_file
from nmm.model.robots.mimic_joints import MimicJoint
from nmm.model.robots.robot import Robot
from nmm.plugins.live.viewer import viewer_scene
from nmm.plugins.symbolic import symbolic
from nmm.plugins.symbolic.search.many_starts import find_singularities
from nmm.plugins.symbolic.search.nearest import nearest_singularity

Array = NDArray[np.float64]

#: Every file of example-robot-data in which joints follow others, how many do among its coordinates, and how
#: many inputs are left on a fixed base.
FILES = {
    "baxter_description/urdf/baxter.urdf": (2, 17),
    "panda_description/urdf/panda.urdf": (1, 8),
    "panda_description/urdf/panda_collision.urdf": (1, 8),
    "pr2_description/urdf/pr2.urdf": (10, 20),
    "romeo_description/urdf/romeo.urdf": (22, 33),
    "talos_data/robots/talos_full_v2.urdf": (12, 32),
    "talos_data/robots/talos_full_v2_box.urdf": (12, 32),
    "talos_data/robots/talos_left_arm.urdf": (0, 7),  # on a leader that is fixed
    "talos_data/robots/talos_reduced.urdf": (0, 32),
    "talos_data/robots/talos_reduced_box.urdf": (0, 32),
    "talos_data/robots/talos_reduced_corrected.urdf": (0, 32),
    "tiago_pro_description/robots/tiago_pro.urdf": (10, 19),
}
#: Its followers name joints that it does not have.
BROKEN = "alex_description/urdf/alex_psyonic_hands.urdf"
SAME = 1e-10


def random_q(robot: Robot, rng: np.random.Generator) -> Array:
    """Within the limits, followers where their leaders have them."""
    lower, upper = np.clip(robot.q_limits, -3.0, 3.0).T
    return robot.following.placed(rng.uniform(lower, upper))


def test_no_file_with_followers_is_left_out() -> None:
    root = package_file(DATA + "panda_description/urdf/panda.urdf", ()).parents[2]
    found = {
        str(file.relative_to(root))
        for file in root.rglob("*.urdf")
        if b"<mimic " in file.read_bytes() and yourdfpy_knows_followers(file)
    }
    assert found == {*FILES, BROKEN}


def yourdfpy_knows_followers(file: Path) -> bool:
    """Whether a <mimic> is not commented out."""
    from xml.etree import ElementTree

    return ElementTree.parse(file).getroot().find("joint/mimic") is not None


@pytest.mark.parametrize("name", thinned(FILES, lambda name: "talos" not in name or name.endswith("v2.urdf")))
def test_placements_and_jacobians_are_those_of_other_readers(name: str, rng: np.random.Generator) -> None:
    """Placements against yourdfpy; J_q S against central differences of yourdfpy and Pinocchio's mimic."""
    robot = nmm.load(DATA + name, platform="fixed", missing_meshes="skip")
    assert (len(robot.mimic_joints), robot.n_u) == FILES[name]
    file = package_file(DATA + name, ())
    logging.getLogger("yourdfpy.urdf").setLevel(logging.ERROR)
    other = yourdfpy.URDF.load(str(file), load_meshes=False)
    groups = {name: moving_together(robot, file, name) for name in robot.u_names}
    model = pin.buildModelFromUrdf(str(file))
    for primary, others in groups.values():
        for one in others:
            ids = model.getJointId(primary.joint), model.getJointId(one.joint)
            m = one.multiplier / primary.multiplier
            model = pin.transformJointIntoMimic(model, *ids, m, one.offset - m * primary.offset)
    assert model.nv == robot.n_u + sum(name not in robot.q_names for name in list(model.names)[1:])
    data = model.createData()
    for _ in range(3):
        q = random_q(robot, rng)
        at = {name: float(q[robot.coordinate(name)]) for name in robot.u_names}
        other.update_cfg({name: at.get(name, 0.0) for name in other.actuated_joint_names})
        pin_q, columns = pin.neutral(model), []
        for name, (primary, _) in groups.items():
            one, value = model.joints[model.getJointId(primary.joint)], primary.value(at[name])
            pin_q[one.idx_q : one.idx_q + one.nq] = [value] if one.nq == 1 else [np.cos(value), np.sin(value)]
            columns.append(one.idx_v)
        by_leader = [primary.multiplier for primary, _ in groups.values()]
        pin.computeJointJacobians(model, data, pin_q)
        pin.updateFramePlacements(model, data)
        here = Configuration(robot, q)
        for frame in other.link_map:
            found = here.placement(frame).homogeneous
            np.testing.assert_allclose(found, other.get_transform(frame), atol=SAME)
            index = model.getFrameId(frame, pin.FrameType.BODY)
            theirs = pin.getFrameJacobian(model, data, index, pin.LOCAL_WORLD_ALIGNED)[:, columns]
            np.testing.assert_allclose(here.jacobian(frame) @ here.S, theirs * by_leader, atol=SAME)


def moving_together(robot: Robot, file: Path, leader: str) -> tuple[MimicJoint, list[MimicJoint]]:
    """What moves with an input: the joint that Pinocchio's model has first, and the others.

    Pinocchio asks that a joint is before those that follow it, which not every file has: there the first of
    them takes the leader's part, by whose rate its own is divided.
    """
    model = pin.buildModelFromUrdf(str(file))
    members = [MimicJoint(leader, leader), *(one for one in robot.mimic_joints if one.leader == leader)]
    members.sort(key=lambda one: model.getJointId(one.joint))
    return members[0], members[1:]


@pytest.mark.parametrize("name", ["baxter_description/urdf/baxter.urdf", "pr2_description/urdf/pr2.urdf"])
def test_jacobians_are_those_of_pinocchios_own_reader(name: str, rng: np.random.Generator) -> None:
    """`mimic=True`, where Pinocchio's reader takes the file."""
    robot = nmm.load(DATA + name, platform="fixed", missing_meshes="skip")
    model = pin.buildModelFromUrdf(str(package_file(DATA + name, ())), mimic=True)
    data = model.createData()
    q = random_q(robot, rng)
    pin_q, columns = pin.neutral(model), []
    for joint_name in robot.u_names:
        one, value = model.joints[model.getJointId(joint_name)], q[robot.coordinate(joint_name)]
        pin_q[one.idx_q : one.idx_q + one.nq] = [value] if one.nq == 1 else [np.cos(value), np.sin(value)]
        columns.append(one.idx_v)
    pin.computeJointJacobians(model, data, pin_q)
    here = Configuration(robot, q)
    for frame in robot.frames:
        if model.existFrame(frame, pin.FrameType.BODY):
            index = model.getFrameId(frame, pin.FrameType.BODY)
            theirs = pin.getFrameJacobian(model, data, index, pin.LOCAL_WORLD_ALIGNED)[:, columns]
            np.testing.assert_allclose(here.jacobian(frame) @ here.S, theirs, atol=SAME)


def test_a_follower_of_a_joint_that_is_not_there_moves_by_itself() -> None:
    loaded = nmm.load(DATA + BROKEN, platform="fixed", missing_meshes="skip")
    lost = {"joint": "Left_index_q2", "leader": "index_q1"}
    assert any(holds(one, "leader_unknown", **lost) for one in loaded.notes)
    assert "Left_index_q2" in loaded.u_names


# ------------------------------------------------------------------------------------------- from the file

TURN = '<axis xyz="0 0 1"/><limit lower="{}" upper="{}" effort="1" velocity="{}"/>'
MIMIC = '<mimic joint="{}" multiplier="{}" offset="{}"/>'


def chained(path: Path, *, first: str = TURN.format(-1, 1, 4)) -> Path:
    """k follows l follows j: l = 2 j + 0.1, k = -0.5 l + 0.3 (sliding); m moves on its own, after all."""
    text = robot(
        *(link(name, inertial()) for name in "abcde"),
        joint("k", "c", "d", "prismatic", TURN.format(-2, 0.55, 1) + MIMIC.format("l", -0.5, 0.3)),
        joint("l", "b", "c", "revolute", TURN.format(-1.5, 3, 3) + MIMIC.format("j", 2, 0.1)),
        joint("j", "a", "b", "revolute", first),
        joint("m", "d", "e", "revolute", TURN.format(-1, 1, 1)),
    )
    return write(path, text)


def test_a_chain_of_followers(tmp_path: Path) -> None:
    loaded = nmm.load(chained(tmp_path / "r.urdf"))
    assert loaded.q_names == ("x", "y", "theta", "j", "l", "k", "m")
    assert loaded.u_names == ("v", "omega", "j", "m")
    assert loaded.u_units == ("m/s", "rad/s", "rad/s", "rad/s")
    assert loaded.groups == {"platform": ("v", "omega"), "arm": ("j", "m")}
    assert {str(one) for one in loaded.mimic_joints} == {"l = 2 j + 0.1", "k = -j + 0.25"}
    (note,) = of_code(loaded.notes, "mimic_joints")
    assert note.values["names"] == ["l = 2 j + 0.1", "k = -j + 0.25"]
    q = loaded.q({"theta": 0.4, "j": 0.2, "m": -0.3})
    np.testing.assert_allclose(q, [0, 0, 0.4, 0.2, 0.5, 0.05, -0.3], atol=1e-15)
    np.testing.assert_allclose(loaded.q(), loaded.q({}))
    np.testing.assert_allclose(loaded.q()[3:], [0, 0.1, 0.25, 0], atol=1e-15)
    S = np.zeros((7, 4))
    S[:3, :2] = loaded.platform.G(q[:3])
    S[3:, 2:] = [[1, 0], [2, 0], [-1, 0], [0, 1]]
    np.testing.assert_allclose(loaded.S(q), S, atol=1e-15)
    A = loaded.platform.A(q[:3])
    np.testing.assert_allclose(A @ loaded.S(q)[:3], 0.0, atol=1e-15)


def test_limits_are_narrowed_to_what_followers_allow(tmp_path: Path) -> None:
    """l from -1.5 lets j go down to -0.8; k up to 0.55 only to -0.3; and l's 3 rad/s j's to 1.5, k's to 1."""
    loaded = nmm.load(chained(tmp_path / "r.urdf"))
    np.testing.assert_allclose(
        loaded.q_limits[3:], [[-0.3, 1], [-0.5, 2.1], [-0.75, 0.55], [-1, 1]], atol=1e-12
    )
    np.testing.assert_array_equal(loaded.u_limits[2:], [1.0, 1.0])
    assert loaded.unheeded == ()
    # Whatever the leader does within its limits, followers stay within theirs, and reach one of them.
    own = np.column_stack([loaded.model.lowerPositionLimit, loaded.model.upperPositionLimit])
    ends = [loaded.q({"j": end}) for end in loaded.q_limits[3]]
    assert all(np.all((q >= own[:, 0] - 1e-12) & (q <= own[:, 1] + 1e-12)) for q in ends)
    loaded.check_limits(loaded.rest)


def test_limits_that_leave_no_room_do_not_count() -> None:
    """PR2's file has one finger turn the other way, within the limits of the others."""
    loaded = nmm.load(DATA + "pr2_description/urdf/pr2.urdf", platform="fixed", missing_meshes="skip")
    assert {one.joint for one in loaded.unheeded} == {
        "r_gripper_r_parallel_root_joint",
        "l_gripper_r_parallel_root_joint",
    }
    opening = loaded.coordinate("l_gripper_l_finger_joint")
    np.testing.assert_array_equal(loaded.q_limits[opening], [0.0, 0.548])
    ignored = of_code(loaded.notes, "mimic_limits_ignored")
    assert [one.values["leader"] for one in ignored].count("l_gripper_l_finger_joint") == 1


def test_a_start_that_breaks_a_follower_is_refused_by_name(tmp_path: Path) -> None:
    loaded = nmm.load(chained(tmp_path / "r.urdf"))
    task = nmm.Task(nmm.LinearCoordinates("m"), nmm.Constant(0.2, "rad"), 1.0)
    controller = nmm.Controller(loaded, task, nmm.ProjectedGradient())
    q = loaded.q({"j": 0.2})
    for broken in ({"j": 0.2, "l": 0.6}, [*q[:4], 0.6, *q[5:]]):
        for call in (lambda: nmm.simulate(controller, broken, 0.1), lambda: analyse(controller, broken)):  # noqa: B023
            with refused(loaded.name, got={"l": 0.6}):
                call()
        controller(0.0, loaded.q(broken))  # a vector is taken as it is
    assert nmm.simulate(controller, {"j": 0.2}, 0.1).complete
    with refused(loaded.name, got={"j": 1.2}):
        loaded.check_limits({"j": 1.2})  # once, not for those that follow


@pytest.mark.parametrize(
    "followers",
    [
        (MimicJoint("q3", "q9"),),
        (MimicJoint("q9", "q1"),),
        (MimicJoint("q3", "q2"), MimicJoint("q2", "q1")),
        (MimicJoint("q3", "q3"),),
        (MimicJoint("q3", "q1"), MimicJoint("q3", "q2")),
    ],
)
def test_followers_that_are_none(followers: tuple[MimicJoint, ...], robot_3r: Robot) -> None:
    with pytest.raises(InputError, match=r"q3|q9"):
        replace(robot_3r, mimic_joints=followers)


def test_the_platform_moves_its_own_coordinates() -> None:
    with refused("trailer_base with small_arm: hitch1 = q1", got="hitch1"):
        replace(
            nmm.mount("trailer_base", "small_arm", at="arm_mount"), mimic_joints=(MimicJoint("hitch1", "q1"),)
        )


def test_a_locked_leader_takes_its_followers_along(tmp_path: Path) -> None:
    path = chained(tmp_path / "r.urdf")
    locked = nmm.load(path, lock={"j": 0.2})
    assert locked.q_names == ("x", "y", "theta", "m")
    assert not locked.mimic_joints
    # One that is locked itself follows nobody, and those behind it stand still with it.
    between = nmm.load(path, lock={"l": 0.5})
    assert between.u_names == ("v", "omega", "j", "m")
    assert not between.mimic_joints
    free = nmm.load(path)
    for frame in ("c", "d", "e"):
        expected = Configuration(free, free.q({"j": 0.2, "m": 0.7})).placement(frame)
        assert Configuration(locked, [0, 0, 0, 0.7]).placement(frame).isApprox(expected, 1e-12)
        assert Configuration(between, [0, 0, 0, 0.2, 0.7]).placement(frame).isApprox(expected, 1e-12)


def wheeled(path: Path, *more: str, right: str = "") -> Path:
    rolls = '<axis xyz="0 1 0"/><limit effort="1" velocity="9"/>'
    text = robot(
        *(link(name, inertial()) for name in ("base", "left", "right", "top", "cover")),
        joint("left_wheel", "base", "left", "continuous", rolls, '<origin xyz="0 0.3 0.1"/>'),
        joint("right_wheel", "base", "right", "continuous", rolls + right, '<origin xyz="0 -0.3 0.1"/>'),
        joint("shoulder", "base", "top", "revolute", TURN.format(-1, 1, 1)),
        *(more or (joint("lid", "base", "cover", "fixed", ""),)),
    )
    return write(path, text)


def test_wheels_that_follow_and_are_followed(tmp_path: Path) -> None:
    """A wheel is turned by the ground; nothing can follow it, but on a base that stands still."""
    rolling = nmm.load(wheeled(tmp_path / "a.urdf", right=MIMIC.format("left_wheel", 1, 0)))
    assert rolling.u_names == ("v", "omega", "shoulder")
    assert not rolling.mimic_joints
    assert_found(of_code(rolling.notes, "mimics_of_ground"), ("mimics_of_ground", {"names": ["right_wheel"]}))
    lid = joint(
        "lid", "top", "cover", "revolute", TURN.format(-1, 1, 1) + MIMIC.format("left_wheel", 0.1, 0.2)
    )
    path = wheeled(tmp_path / "b.urdf", lid)
    with refused(str(path), kind=RobotError, got="lid"):
        nmm.load(path)
    assert nmm.load(path, lock={"lid": 0.1}).u_names == rolling.u_names
    standing = nmm.load(path, platform="fixed")
    assert standing.q_names == ("shoulder",)
    assert standing.parts.provenance.mimicked == {"lid": ("left_wheel", 0.2)}


def test_a_follower_of_the_platforms_own_joint_moves_with_it(rng: np.random.Generator) -> None:
    """Its row of S is that of the hitch, which depends on q: against the way that coordinates go in time."""
    robot = hitched()
    assert robot.u_names == ("v", "omega", "q1", "q2", "q5")
    task = nmm.Task(nmm.Position("ee", "xy"), nmm.Circle([2, 2], 3, 0.08), 1.0)
    controller = nmm.Controller(robot, task, nmm.ProjectedGradient())
    run = nmm.simulate(controller, {"hitch1": 0.3, "q1": 0.4, "q2": 0.6}, 2.0, 0.01)
    assert run.complete
    i, hitch = robot.coordinate("q3"), robot.coordinate("hitch1")
    assert np.ptp(run.q[:, hitch]) > 0.01
    np.testing.assert_array_equal(run.q[:, i], 0.8 * run.q[:, hitch] + 0.1)
    np.testing.assert_allclose(run.q_dot[:, i], 0.8 * run.q_dot[:, hitch], atol=1e-15)


# ---------------------------------------------------------------------------------------------- closed loops


def grasping(robot: Robot, q0: Array, duration: float) -> list[nmm.Task]:
    """The hand along a line, turning, while the fingers close from 4 cm to 1 cm."""
    frame = next(name for name in robot.frames if name.endswith("panda_hand"))
    here = Configuration(robot, q0).placement(frame)
    begin = here.translation + np.array([0.01, -0.01, 0.01])
    line = nmm.Line(begin, begin + np.array([0.1, 0.06, -0.05]), duration, "smooth")
    turned = nmm.rotation_vector(matrix=here.rotation @ pin.exp3(np.array([0.2, 0.1, -0.2])))
    slerp = nmm.Slerp(nmm.rotation_vector(matrix=here.rotation), turned, duration)
    # By the follower: it moves with the finger that it follows.
    closing = nmm.Line([0.04], [0.01], duration, "smooth")
    return [
        nmm.Task(nmm.Pose(frame), nmm.PoseReference(line, slerp), 3.0),
        nmm.Task(nmm.LinearCoordinates(FINGERS[1]), closing, 3.0),
    ]


PG, RG = nmm.ProjectedGradient(1.0), nmm.ReducedGradient(1.0)


@pytest.mark.parametrize(
    ("method", "resolver"), [("rk4", PG), ("midpoint", PG), ("adaptive", PG), ("euler", RG), ("zoh", RG)]
)
def test_a_gripper_closes_while_the_hand_moves(method: str, resolver: nmm.control.resolvers.Resolver) -> None:
    robot = panda("omni_base")
    assert (robot.n, robot.n_u) == (12, 11)
    q0 = robot.q({"panda_joint2": -0.4, "panda_joint4": -2.0, "panda_joint6": 1.8, FINGERS[0]: 0.035})
    names = [name for name in robot.u_names[3:] if name not in FINGERS]
    posture = nmm.Quadratic(*(nmm.QuadraticTerm(name, q0[robot.coordinate(name)]) for name in names))
    controller = nmm.Controller(robot, grasping(robot, q0, 3.0), resolver, posture)
    run = nmm.simulate(controller, q0, 3.0, 0.02, method)
    assert run.complete, run.message
    assert np.linalg.norm(run.error[0]) > 0.015
    # Euler's method and inputs held constant are of first order in dt.
    assert np.abs(run.error[-1]).max() < (1e-3 if method in ("euler", "zoh") else 1e-5)
    assert run.residual.max() < 1e-9
    finger, follower = (run.q[:, robot.coordinate(name)] for name in FINGERS)
    np.testing.assert_array_equal(finger, follower)
    assert follower[-1] == pytest.approx(0.01, abs=1e-3)


def test_an_offset_holds_exactly_over_a_long_run(tmp_path: Path) -> None:
    """Some 10 000 steps: what is rounded in one does not add up."""
    loaded = nmm.load(chained(tmp_path / "r.urdf"), platform="fixed")
    breaks = np.linspace(0.0, 20.0, 201)
    swing = nmm.Spline(breaks, 0.3 + 0.2 * np.sin(3.0 * breaks)[:, np.newaxis], unit="rad")
    controller = nmm.Controller(
        loaded, nmm.Task(nmm.LinearCoordinates("j"), swing, 5.0), nmm.ProjectedGradient()
    )
    run = nmm.simulate(controller, {"j": 0.3}, 20.0, 0.002)
    j, second, k = run.q[:, :3].T
    np.testing.assert_array_equal(second, 2.0 * j + 0.1)
    np.testing.assert_array_equal(k, -1.0 * j + (-0.5 * 0.1 + 0.3))
    assert run.complete
    assert not [one for one in run.findings if "limits" in one.code]


def test_J_and_h_are_those_of_the_coordinates_through_S(rng: np.random.Generator) -> None:
    """A second way: the same robot without followers, whose J and h are multiplied by S in numpy."""
    robot = folding()
    free = replace(robot, mimic_joints=())
    task = nmm.Task(nmm.Position("ee", "xy"), nmm.Circle([2, 2], 3, 0.08), 1.0)
    objective = nmm.Quadratic(nmm.QuadraticTerm({"theta": 1, "q1": 2, "q3": -1}, 0.3))
    ours, theirs = (nmm.Controller(one, task, nmm.ProjectedGradient(), objective) for one in (robot, free))
    C = np.zeros((5, 4))
    C[[0, 1, 2, 3], [0, 1, 2, 3]], C[4, 2] = 1.0, -0.7  # of v, omega, q1, q2, q3
    for _ in range(5):
        q = rng.uniform(-2, 2, robot.n)
        found, expected = ours.evaluate(0.7, q), theirs.evaluate(0.7, q)
        np.testing.assert_allclose(found.J, expected.J @ C, atol=1e-13)
        np.testing.assert_allclose(found.h, expected.h @ C, atol=1e-13)
        np.testing.assert_allclose(found.q_dot, robot.S(q) @ found.u, atol=1e-13)


# ------------------------------------------------------------------------------- other tools, mounting, files


def test_a_pinocchio_model_with_followers_of_its_own(rng: np.random.Generator, tmp_path: Path) -> None:
    """Built with mimic=True: the same robot, but for limits, which Pinocchio has dropped."""
    for file in (package_file(PANDA, ()), chained(tmp_path / "r.urdf")):
        text = file.read_text()
        theirs = pin.buildModelFromXML(text, mimic=True) if file.stem == "panda" else None
        if theirs is None:
            theirs = pin.buildModelFromXML(text)
            for leader, follower, m, b in (("j", "l", 2.0, 0.1), ("j", "k", -1.0, 0.25)):
                ids = theirs.getJointId(leader), theirs.getJointId(follower)
                theirs = pin.transformJointIntoMimic(theirs, *ids, m, b)
        of_file, of_model = (
            nmm.load(file, platform="fixed", missing_meshes="skip"),
            nmm.load(theirs, platform="fixed"),
        )
        assert set(of_model.q_names) == set(of_file.q_names)
        assert of_model.u_names == of_file.u_names
        assert {str(one) for one in of_model.mimic_joints} == {str(one) for one in of_file.mimic_joints}
        for _ in range(3):
            at = dict(zip(of_file.u_names, rng.uniform(-1, 1, of_file.n_u), strict=True))
            one, two = (Configuration(robot, robot.q(at)) for robot in (of_file, of_model))
            for frame in set(of_file.frames) & set(of_model.frames):
                assert one.placement(frame).isApprox(two.placement(frame), 1e-12)
                np.testing.assert_allclose(
                    one.jacobian(frame) @ one.S, two.jacobian(frame) @ two.S, atol=1e-12
                )
            layout = nmm.PinocchioLayout(of_file, theirs)
            pin_q = layout.configuration(one.q)
            assert pin_q.shape == (theirs.nq,) == (of_file.n_u,)
            np.testing.assert_allclose(layout.coordinates(pin_q), one.q, atol=1e-14)
            u = rng.normal(size=of_file.n_u)
            v = layout.velocity(one.q, one.S @ u)
            np.testing.assert_allclose(layout.rates(pin_q, v), one.S @ u, atol=1e-13)
        locked = nmm.load(theirs, platform="fixed", lock={of_file.mimic_joints[0].leader: 0.02})
        assert not locked.mimic_joints
        assert locked.n == of_file.n_u - 1
        layout = nmm.PinocchioLayout(locked, theirs)
        configuration = layout.configuration(locked.q())
        assert 0.02 in configuration
        np.testing.assert_array_equal(layout.coordinates(configuration), locked.q())


def test_layouts_of_models_made_here_have_followers_as_joints(rng: np.random.Generator) -> None:
    robot = panda("omni_base")
    layout = nmm.PinocchioLayout(robot)
    q = random_q(robot, rng)
    assert layout.model.nv == robot.n
    np.testing.assert_allclose(layout.coordinates(layout.configuration(q)), q, atol=1e-12)


def test_a_mounted_arm_keeps_its_followers(rng: np.random.Generator) -> None:
    base = nmm.load("omni_base")
    two = nmm.mount(
        nmm.mount(base, panda(), at="arm_mount", prefix="left_"), panda(), at="arm_mount", prefix="right_"
    )
    assert [str(one) for one in two.mimic_joints] == [
        f"{side}_panda_finger_joint2 = {side}_panda_finger_joint1" for side in ("left", "right")
    ]
    assert len(two.arms["left"]) == 9
    assert len(two.groups["left"]) == 8
    assert two.n == 3 + 18
    assert two.n_u == 3 + 16
    q = random_q(two, rng)
    J = Configuration(two, q).jacobian("right_panda_rightfinger") @ two.S(q)
    alone = panda()
    own = alone.q({name: q[two.coordinate(f"right_{name}")] for name in alone.u_names})
    expected = Configuration(alone, own).jacobian("panda_rightfinger") @ alone.S(own)
    columns = [two.input(f"right_{name}") for name in alone.u_names]
    turned = Configuration(two, q).placement("right_panda_link0").rotation
    np.testing.assert_allclose(J[:3, columns], turned @ expected[:3], atol=1e-12)
    assert two.fingerprint != replace(two, mimic_joints=two.mimic_joints[:1]).fingerprint
    # An arm that is mounted once more, with its followers: its names get a second prefix.
    again = nmm.mount("omni_base", replace(alone, name="other"), at="arm_mount", prefix="p_")
    assert again.mimic_joints == (MimicJoint("p_panda_finger_joint2", "p_panda_finger_joint1"),)


SCENARIO = f"""
robot: {{platform: omni_base, arm: {{source: {PANDA}}}}}
q0: {{panda_joint4: -2, panda_joint6: 1.8, {FINGERS[0]}: 0.03}}
duration: 0.5
dt: 0.01
task:
  - {{kind: position, frame: panda_hand, reference: [0.5, 0.1, 0.9]}}
  - {{kind: coordinates, of: [{FINGERS[0]}], reference: [0.01]}}
objective: {{kind: joint_range}}
resolver: {{kind: pg}}
"""


def test_a_scenario_runs_is_stored_and_read(tmp_path: Path) -> None:
    """Of the start, only the finger that leads is named; the arm's range counts each input's joint once."""
    given = scenario(tmp_path, SCENARIO)
    run = given.run()
    assert run.complete
    finger, follower = (run.q[:, run.robot.coordinate(name)] for name in FINGERS)
    assert finger[0] == 0.03
    assert finger[-1] < 0.03
    np.testing.assert_array_equal(finger, follower)
    run.save(tmp_path / "run", figures=False)
    again = nmm.Trajectory.load(tmp_path / "run")
    np.testing.assert_array_equal(again.q, run.q)
    assert again.robot.mimic_joints == run.robot.mimic_joints
    assert again.robot.fingerprint == run.robot.fingerprint
    with refused("omni_base with panda", kind=nmm.ScenarioError, got={FINGERS[1]: 0.02}):
        scenario(tmp_path, SCENARIO, **{f"q0__{FINGERS[1]}": 0.02}).run()


# --------------------------------------------------------------------------------------------------- analysis


def planar(robot: Robot) -> nmm.Task:
    return nmm.Task(nmm.Position("ee", "xy"), nmm.Circle([2, 2], 3, 0.08), 1.0)


def test_formulas_know_followers(rng: np.random.Generator) -> None:
    """J of the formulas is that of the compiled functions, with followers anywhere."""
    held = nmm.load("small_arm", platform="fixed", lock={"q2": 0.0, "q4": 0.0, "q5": 0.0})
    led = replace(
        nmm.mount("trailer_base", held, at="arm_mount"), mimic_joints=(MimicJoint("q3", "hitch1", 0.8, 0.1),)
    )
    for given in (folding(), led):
        task = nmm.Position("ee", "xy")
        analysis = symbolic(given, task)
        assert analysis.J.shape == (2, given.n_u)
        mimics = {note.values["joint"] for note in of_code(analysis.notes, "mimic_joint")}
        assert {one.joint for one in given.mimic_joints} <= mimics
        functions, jacobians = analysis.functions(), Jacobians((given, task))
        for _ in range(5):
            q = given.following.placed(rng.uniform(-1, 1, given.n))
            np.testing.assert_allclose(functions.J(q), jacobians.J(0.0, q), atol=1e-10)


def test_what_is_free_is_counted_without_followers() -> None:
    robot = folding()  # x, y, theta, q1, q2, and q3 after q1
    report = redundancy((robot, planar(robot)), {"theta": 0.3, "q1": 0.4, "q2": 0.5})
    assert (report.static, report.kinematic, report.rank_F, report.manifold, report.free) == (3, 2, 2, 3, 2)
    assert "n = 5 coordinates (and 1 that follow others), n_u = 4 inputs" in report.text()
    assert len(report.withheld) == 1
    # What no input gives leaves the task at rest all the same, with the follower where it belongs.
    np.testing.assert_allclose(report.F @ report.withheld.T, 0.0, atol=1e-12)
    np.testing.assert_allclose(report.withheld[:, 5], -0.7 * report.withheld[:, 3], atol=1e-15)
    both = np.vstack([report.readable @ report.S.T, report.withheld])
    assert np.linalg.matrix_rank(both) == report.manifold
    run = nmm.simulate(
        nmm.Controller(robot, planar(robot), nmm.ProjectedGradient()), {"q1": 0.4, "q2": 0.5}, 0.1, 0.05
    )
    assert run.summary()["redundancy"] == {"static": 3, "kinematic": 2}


def test_singularities_are_where_the_inputs_lose_rank(rng: np.random.Generator) -> None:
    """On a fixed base, by a second way: det J of the two inputs, J taken by differences along the motion."""
    robot = replace(
        nmm.load(package_file(DATA + "ur_description/urdf/ur5_robot.urdf", ()), platform="fixed"),
        mimic_joints=(
            MimicJoint("elbow_joint", "shoulder_lift_joint", -1.5, 0.4),
            MimicJoint("wrist_1_joint", "shoulder_lift_joint", 0.5),
        ),
    )
    task, names = nmm.Position("wrist_3_link"), ("shoulder_pan_joint", "shoulder_lift_joint", "wrist_2_joint")
    found = find_singularities((robot, task), starts=20, seed=1)
    assert not {"elbow_joint", "wrist_1_joint"} & {*found.ranges, *found.fixed, *found.indifferent}
    assert found.families

    def J(q: Array) -> Array:
        columns = []
        for name in names:
            ends = []
            for step in (1e-6, -1e-6):
                at = {one: q[robot.coordinate(one)] for one in robot.u_names}
                at[name] += step
                ends.append(Configuration(robot, robot.q(at)).placement("wrist_3_link").translation)
            columns.append((ends[0] - ends[1]) / 2e-6)
        return np.column_stack(columns)

    for family in found.families:
        for q in family.examples:
            robot.check_followers(q)
            assert np.linalg.svd(J(q), compute_uv=False)[-1] < 1e-7
    near = nearest_singularity((robot, task), robot.rest, starts=10)
    assert near is not None
    robot.check_followers(near.q)
    assert np.linalg.svd(J(near.q), compute_uv=False)[-1] < 1e-7
    report = analyse((robot, task), robot.rest)
    assert set(report.by_coordinate.names) == set(robot.u_names)
    for what in ("among", "ranges"):
        given = ["elbow_joint"] if what == "among" else {"elbow_joint": (0.0, 1.0)}
        with refused(f"robot {robot.name}", got="elbow_joint"):
            find_singularities((robot, task), starts=2, **{what: given})  # type: ignore[arg-type]  # of two types


def test_maps_move_followers_along() -> None:
    robot = folding()
    task = nmm.Position("ee", "xy")
    held = {"theta": 0.2}
    made = singularity_map((robot, task), ("q1", "q2"), samples=(7, 5), at=held)
    jacobians = Jacobians((robot, task))
    for row, q2 in enumerate(made.axes[1]):
        for column, q1 in enumerate(made.axes[0]):
            J = jacobians.J(0.0, robot.q({**held, "q1": q1, "q2": q2}))
            expected = np.linalg.svd(J, compute_uv=False)[-1]
            assert made.values["sigma_min"][row, column] == pytest.approx(expected, abs=1e-10)
    with refused(f"robot {robot.name}", got="q3"):
        singularity_map((robot, task), ("q1", "q3"))
    whole = workspace_map((robot, nmm.Position("ee")), plane="xy", samples=24, configurations=256)
    assert whole.best_q is not None
    postures = whole.best_q["sigma_min"].reshape(-1, robot.n)
    postures = postures[np.isfinite(postures).all(axis=1)]
    assert len(postures) > 50
    for q in postures:
        robot.check_followers(q)


def test_info_and_the_viewer_tell_who_follows(capsys: pytest.CaptureFixture[str]) -> None:
    assert status_of(["info", PANDA, "--platform", "fixed"]) == 0
    assert capsys.readouterr().out.count("panda_finger_joint2 = panda_finger_joint1") == 1
    robot = folding()
    (follower,) = robot.mimic_joints
    (joints,) = [command for command in viewer_scene(robot, robot.rest) if command["type"] == "joints"]
    listed = {one["name"]: one["follows"] for one in joints["coordinates"]}
    assert listed.pop(follower.joint) == asdict(follower)
    assert not any(listed.values())
