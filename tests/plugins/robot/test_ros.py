"""ROS 2's messages against those of the package rosbags, serialised and read back, and strict stand-ins."""

from __future__ import annotations

import math
import re
import runpy
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from gripping_cart import cart
from places import ROOT

import nmm
from nmm.base.errors import InputError
from nmm.model.robots.robot import Robot

typesys = pytest.importorskip("rosbags.typesys")
STORE = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)
ROBOTS = ("unicycle_2r", "trailer_base", "car_base", "omni_base")


def sent(message: Any) -> Any:
    """The message as another process gets it."""
    name = message.__msgtype__
    return STORE.deserialize_cdr(STORE.serialize_cdr(message, name), name)


def moving(robot: Robot, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    lower, upper = np.clip(robot.q_limits, -1.2, 1.2).T
    return robot.following.placed(rng.uniform(lower, upper)), rng.uniform(-1.0, 1.0, robot.n_u)


class Strict:
    """Message classes as rclpy makes them: they take keywords, floats for numbers, lists for arrays."""

    def __getitem__(self, name: str) -> Any:
        def made(**fields: Any) -> SimpleNamespace:
            kinds = {key: STORE.types[name].__dataclass_fields__[key].type for key in fields}
            for key, kind in kinds.items():
                value = fields[key]
                assert not isinstance(value, np.ndarray | np.generic), (name, key)
                if kind == "float":
                    assert type(value) is float, (name, key)
                elif "ndarray" in str(kind):
                    assert type(value) is list, (name, key)
                    assert all(type(one) is float for one in value), (name, key)
                elif kind == "int":
                    assert type(value) is int, (name, key)
            own = {key for key in STORE.types[name].__dataclass_fields__ if key.islower() and key[0] != "_"}
            assert {*fields} == own, name
            return SimpleNamespace(**fields)

        return made


@pytest.mark.parametrize("name", ROBOTS)
def test_what_is_sent_is_read_back(name: str) -> None:
    robot, rng = nmm.load(name), np.random.default_rng(0)
    messages = nmm.ros.Messages(robot, STORE.types)
    for _ in range(5):
        q, u = moving(robot, rng)
        q[2] *= 3.0
        q_dot = robot.S(q) @ u
        t = round(float(rng.uniform(0, 2e9)), 3)
        state, odometry = sent(messages.joint_state(t, q, q_dot)), sent(messages.odometry(t, q, q_dot))
        base = nmm.ros.base(odometry, "odom", nmm.ros.Messages(robot, STORE.types).base)
        np.testing.assert_allclose(robot.q_from(nmm.ros.joints(state), base, q), q, rtol=0, atol=1e-12)
        np.testing.assert_array_equal(list(nmm.ros.joints(state).values()), q[3:])
        np.testing.assert_array_equal(odometry.pose.pose.position.x, q[0])
        assert nmm.ros.stamp(state) == nmm.ros.stamp(odometry) == pytest.approx(t, abs=3e-7)
        found = nmm.ros.inputs(robot, q, nmm.ros.twist(odometry), nmm.ros.rates(state))
        np.testing.assert_allclose(found, u, rtol=0, atol=1e-12)
        command = sent(messages.twist_stamped(t, q, u))
        np.testing.assert_allclose(nmm.ros.twist(command), nmm.ros.twist(odometry), atol=1e-15)


def test_a_unicycle_s_inputs_are_its_cmd_vel() -> None:
    robot = nmm.load("unicycle_2r")
    twist = nmm.ros.Messages(robot, STORE.types).twist([0, 0, 0, 1, 2], [0.5, -0.2, 3, 4])
    assert (twist.linear.x, twist.linear.y, twist.angular.z) == (0.5, 0.0, -0.2)


def test_a_fixed_base_has_no_twist() -> None:
    """Its first three coordinates are joints of the arm."""
    robot = nmm.load(pin.buildSampleModelManipulator(), platform="fixed")
    messages = nmm.ros.Messages(robot, STORE.types)
    q, ones = robot.rest, np.ones(robot.n)
    assert robot.n > 3
    for twist in (messages.twist(q, ones), messages.odometry(0.0, q, ones).twist.twist):
        assert [twist.linear.x, twist.linear.y, twist.angular.z] == [0.0, 0.0, 0.0]


def test_poses_paths_and_trajectories() -> None:
    robot, rng = nmm.load("unicycle_3r"), np.random.default_rng(1)
    messages = nmm.ros.Messages(robot, STORE.types, odom="map")
    for _ in range(20):
        q, _ = moving(robot, rng)
        pose = nmm.Configuration(robot, q).placement("ee").homogeneous
        np.testing.assert_allclose(nmm.ros.placement(sent(messages.pose(1.0, pose))), pose, atol=1e-15)
    half = np.diag([-1.0, -1.0, 1.0, 1.0])  # a half turn, where w is 0
    np.testing.assert_allclose(nmm.ros.placement(messages.pose(1.0, half)), half, atol=1e-15)
    path = sent(messages.path(0.0, [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]))
    assert path.header.frame_id == path.poses[1].header.frame_id == "map"
    assert path.poses[1].pose.position.z == 6.0
    q = np.array([moving(robot, rng)[0] for _ in range(4)])
    t, found = nmm.ros.joint_trajectory(sent(messages.joint_trajectory([2.0, 2.5, 3.0, 4.0], q, q)))
    np.testing.assert_allclose(t, [0.0, 0.5, 1.0, 2.0])
    np.testing.assert_array_equal(np.array([found[name] for name in ("q1", "q2", "q3")]).T, q[:, 3:])


def test_frames_lead_from_map_to_base() -> None:
    robot, frames = nmm.load("unicycle_2r"), nmm.ros.Transforms()
    messages = nmm.ros.Messages(robot, STORE.types)
    frames.add(sent(messages.transforms(1.0, robot.q({"x": 1.0, "theta": 0.5}))))
    with pytest.raises(InputError) as error:
        frames.base("map", "base_footprint")
    assert error.value.available == ("base_footprint", "odom")
    turned = np.array([0.0, 0.0, math.sin(0.4), math.cos(0.4)])
    frames.add(messages.tf([(1.0, "map", "odom", np.array([0.0, 2.0, 0.0]), turned)]))
    expected = [math.cos(0.8), 2.0 + math.sin(0.8), 1.3]
    np.testing.assert_allclose(frames.base("map", "/base_footprint"), expected)
    frames.add(messages.tf([(1.0, "base_footprint", "map", np.zeros(3), turned)]))
    with pytest.raises(InputError, match="circle"):
        frames.base("map", "base_footprint")


def test_rclpys_classes_get_what_they_accept() -> None:
    """Lists, not arrays; Python's floats and ints; every field."""
    robot = nmm.load("unicycle_2r")
    strict, plain = nmm.ros.Messages(robot, Strict()), nmm.ros.Messages(robot, STORE.types)  # type: ignore[arg-type]
    q, u = moving(robot, np.random.default_rng(2))
    for made in (
        lambda one: one.joint_state(1.5, q, robot.S(q) @ u, {"left_wheel_joint": (np.float64(1.0), 2.0)}),
        lambda one: one.odometry(1.5, q, robot.S(q) @ u, np.eye(3)),
        lambda one: one.transforms(1.5, q),
        lambda one: one.twist_stamped(1.5, q, u),
        lambda one: one.pose(1.5, np.eye(4)),
        lambda one: one.path(1.5, np.ones((2, 3))),
        lambda one: one.joint_trajectory([0, 1], [q, q], [q, q]),
        lambda one: one.inputs(1.5, u),
        lambda one: one.log(1.5, "aim", "begins"),
        lambda one: one.numbers([1.0], ["x"]),
    ):
        assert told(made(strict)) == told(made(plain))


def told(message: Any) -> Any:
    """A message as plain data."""
    if hasattr(message, "__dict__"):
        return {
            name: told(value) for name, value in vars(message).items() if name.islower() and name[0] != "_"
        }
    return [told(one) for one in message] if isinstance(message, list | np.ndarray) else message


def test_without_ros_its_classes_are_asked_for_by_name() -> None:
    with pytest.raises(InputError, match="builtin_interfaces"):
        nmm.ros.Messages(nmm.load("unicycle_2r")).joint_state(0.0, np.zeros(5))


def pose(**numbers: float) -> SimpleNamespace:
    at = {"x": 0.0, "y": 0.0, "z": 0.0}
    turn = {"qx": 0.0, "qy": 0.0, "qz": 0.0, "qw": 1.0} | {k: v for k, v in numbers.items() if k[0] == "q"}
    return SimpleNamespace(
        position=SimpleNamespace(**at | {k: v for k, v in numbers.items() if k[0] != "q"}),
        orientation=SimpleNamespace(**{k[1:]: v for k, v in turn.items()}),
    )


@pytest.mark.parametrize(
    ("read", "message", "where"),
    [
        ("joints", SimpleNamespace(name=["a", "b"], position=[1.0]), "position"),
        ("joints", SimpleNamespace(name=["a", "a"], position=[1.0, 1.0]), "name"),
        ("joints", SimpleNamespace(name=["a", "b"], position=[1.0, math.nan]), "position of b"),
        ("joints", pose(), "SimpleNamespace"),
        ("base", pose(qw=0.0), "orientation"),
        ("base", pose(x=math.nan), "position"),
        ("base", pose(qz=math.nan), "orientation"),
        ("base", pose(qx=math.sin(0.5), qw=math.cos(0.5)), "orientation"),
        ("base", SimpleNamespace(), "SimpleNamespace"),
        ("twist", pose(), "SimpleNamespace"),
        ("stamp", pose(), "SimpleNamespace"),
        ("joint_trajectory", SimpleNamespace(joint_names=["a"], points=[]), "SimpleNamespace"),
    ],
)
def test_messages_that_say_nothing_are_refused(read: str, message: Any, where: str) -> None:
    with pytest.raises(InputError) as error:
        getattr(nmm.ros, read)(message)
    assert where in error.value.where


def test_a_pose_in_another_frame_is_refused() -> None:
    robot = nmm.load("unicycle_2r")
    odometry = nmm.ros.Messages(robot, STORE.types).odometry(0.0, robot.rest)
    for frame, child in (("map", None), ("odom", "base_link")):
        with pytest.raises(InputError):
            nmm.ros.base(odometry, frame, child)
    np.testing.assert_array_equal(nmm.ros.base(odometry, "/odom", "base_footprint"), np.zeros(3))


def test_a_missing_rate_is_asked_for_by_name() -> None:
    robot = nmm.load("unicycle_2r")
    with pytest.raises(InputError, match="q2"):
        nmm.ros.inputs(robot, robot.rest, [0.5, 0, 0], {"q1": 0.1})
    with pytest.raises(InputError):
        nmm.ros.inputs(robot, robot.rest, [0.5, 0, 0], {"q1": 0.1, "q2": math.nan})


def parts(state: Any) -> list[Any]:
    """Two messages of it, the first with a joint that is none of the robot's."""
    header, names, values = state.header, [*state.name, "lid"], [*state.position, 0.5]
    return [
        SimpleNamespace(header=header, name=names[some], position=values[some], velocity=[])
        for some in (slice(2, None), slice(0, 2))
    ]


def test_a_part_that_comes_no_more_is_noticed() -> None:
    robot = nmm.load("unicycle_2r")
    messages, states = nmm.ros.Messages(robot, STORE.types), nmm.ros.JointStates(robot)
    for t in (1.0, 2.0):
        states.add(
            messages.joint_state(t, robot.q({"q1": t, "q2": 0.5}), wheels={"left_wheel_joint": (t, 0.0)})
        )
    later = messages.joint_state(3.0, robot.q({"q1": 0.3}))
    first = SimpleNamespace(header=later.header, name=["q1"], position=[0.3])
    assert states.add(first)
    assert (states.joints["q1"], states.joints["q2"], states.stamp) == (0.3, 0.5, 2.0)
    with pytest.raises(InputError):
        states.add(SimpleNamespace(header=later.header, name=["q2", "q1"], position=[math.nan, 1.0]))
    assert states.joints["q1"] == 0.3


@pytest.mark.parametrize(
    "name", [pytest.param("unicycle_3r", marks=pytest.mark.thorough), "cart", "calibrated cart"]
)
def test_the_node_s_logic_leads_a_robot_by_messages_alone(name: str, tmp_path: Path) -> None:
    """docs/tutorials/follow.py: its robot is q_dot = S(q) u, which gets and sends messages. The cart is a car
    that steers as v and ω ask, with a mimic joint; its joints come in two messages, with others. A
    calibrated one's drivers are told what its encoders read."""
    folder = ROOT / "docs" / "tutorials"
    compile((folder / "ros_node.py").read_text("utf-8"), "ros_node.py", "exec")
    found = runpy.run_path(str(folder / "follow.py"))
    car, dt = name.endswith("cart"), 0.01
    robot = nmm.load(cart(tmp_path / "cart.urdf", mimic=True) if car else name)
    if name.startswith("calibrated"):
        robot = nmm.with_numbers(robot, {"ratio.lift": -1.0, "offset.bend": 0.1, "origin.tilt.x": 0.02})
    messages, frame = nmm.ros.Messages(robot, STORE.types), "grasp" if car else "ee"
    follow = found["Follow"](robot, frame, messages)
    q = robot.q({"lift": 0.6, "bend": 0.9, "tilt": 0.4} if car else {"q2": 0.6, "q3": 0.8, "theta": 9.0})
    goal = np.eye(4)
    goal[:3, 3] = (3.0, 0.5, 0.8) if car else (1.0, 0.3, 1.0)
    follow.on_target(sent(messages.pose(0.0, goal, "map")))
    twist, rates = follow.commands(0.0)
    assert not np.any([*nmm.ros.twist(twist), *rates.values()])  # nothing was measured
    follow.on_tf(sent(messages.tf([(0.0, "map", "odom", np.zeros(3), np.array([0.0, 0.0, 0.0, 1.0]))])))
    for k in range(1200):
        t = k * dt
        follow.on_tf(sent(messages.transforms(t, q)))
        for state in parts(sent(messages.joint_state(t, q))) if car else [sent(messages.joint_state(t, q))]:
            try:
                follow.on_joint_state(state)
            except InputError:  # as the node does
                assert k == 0
        twist, rates = follow.commands(t + 0.001)
        vx, _, omega = nmm.ros.twist(sent(twist))
        assert {*rates} == {*robot.u_names[2:]}
        u = nmm.ros.inputs(robot, q, [vx, 0.0, omega], rates)
        if car and vx:
            u[1] = (math.atan(robot.platform.wheelbase * omega / vx) - q[3]) / dt
        q = q + dt * robot.S(q) @ u
    tip = nmm.Configuration(robot, q).placement(frame).translation
    assert np.linalg.norm(tip - goal[:3, 3]) < 1e-3
    assert np.any(u)
    bad = messages.joint_state(9.0, q)
    bad.position[-1] = math.nan
    with pytest.raises(InputError):
        follow.on_joint_state(bad)
    for k in range(1200, 1300):
        twist, rates = follow.commands(k * dt)
    assert follow.loop.state == nmm.LoopState.STOPPED
    assert not np.any([*nmm.ros.twist(twist), *rates.values()])


def test_the_page_s_table_names_what_there_is() -> None:
    page = (ROOT / "docs" / "ros.md").read_text("utf-8")
    assert {*re.findall(r"`(\w+)\(m\)", page)} <= {*nmm.ros.__all__}
    for name in re.findall(r"`messages\.(\w+)\(", page):
        assert callable(getattr(nmm.ros.Messages, name))
