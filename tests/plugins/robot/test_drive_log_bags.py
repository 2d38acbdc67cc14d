"""Logs of drives from bags: wheels by JointStates, beside a localisation, motion capture or a tracker."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("rosbags")

from drives import Drive, drive
from robot_logs import FIRST, STORE, Sent, bag, bag_of_ros1, header, joints, odom, tf, transform, wheeled

import nmm
from nmm.base.arrays import Array
from nmm.base.errors import InputError
from nmm.model.robots.robot import Robot

LEFT, RIGHT = "left_wheel_joint", "right_wheel_joint"
START = 1.7e9
TYPES = STORE.types


@pytest.fixture(scope="module")
def robot(tmp_path_factory: pytest.TempPathFactory) -> Robot:
    return wheeled(tmp_path_factory.mktemp("robot"))


@pytest.fixture(scope="module")
def driven(robot: Robot) -> Drive:
    return drive(robot, lambda t: (0.45 + 0.1 * np.sin(t), 0.2 + 0.3 * np.cos(t)), duration=6.0, dt=0.05)


def states(driven: Drive, late: float = 0.0, store: Any = STORE) -> list[Sent]:
    rows = zip(driven.t.tolist(), *(driven.wheels[one].tolist() for one in (LEFT, RIGHT)), strict=True)
    return [
        (
            START + t + late,
            "/joint_states",
            joints(START + t, {"lid": 0.1, LEFT: left, RIGHT: right}, store=store),
        )
        for t, left, right in rows
    ]


def quaternion(yaw: float) -> Any:
    return TYPES["geometry_msgs/msg/Quaternion"](x=0.0, y=0.0, z=np.sin(yaw / 2), w=np.cos(yaw / 2))


def pose(row: Array) -> Any:
    point = TYPES["geometry_msgs/msg/Point"](x=float(row[0]), y=float(row[1]), z=0.3)
    return TYPES["geometry_msgs/msg/Pose"](position=point, orientation=quaternion(float(row[2])))


def stamped(t: float, row: Array, frame: str) -> Any:
    return TYPES["geometry_msgs/msg/PoseStamped"](header=header(t, frame), pose=pose(row))


def covered(t: float, row: Array, frame: str) -> Any:
    whole = TYPES["geometry_msgs/msg/PoseWithCovariance"](pose=pose(row), covariance=np.zeros(36))
    return TYPES["geometry_msgs/msg/PoseWithCovarianceStamped"](header=header(t, frame), pose=whole)


def point(t: float, row: Array, frame: str) -> Any:
    at = TYPES["geometry_msgs/msg/Point"](x=float(row[0]), y=float(row[1]), z=0.3)
    return TYPES["geometry_msgs/msg/PointStamped"](header=header(t, frame), point=at)


def placed(t: float, row: Array, frame: str) -> Any:
    return transform(t, frame, "tracker", row[:2], float(row[2]))


def odometry(t: float, row: Array, frame: str) -> Any:
    return odom(t, row, frame=frame)


def looks(driven: Drive, made: Any, topic: str, frame: str = "world", late: float = 0.013) -> list[Sent]:
    return [
        (START + t, topic, made(START + t + late, row, frame))
        for t, row in zip(driven.t[::2].tolist(), driven.q[::2, :3], strict=True)
    ]


def test_wheels_are_those_of_joint_states(tmp_path: Path, robot: Robot, driven: Drive) -> None:
    """By their stamps, not by when they were recorded; other joints are left out, an arm is not needed."""
    sent = states(driven, late=0.4) + looks(driven, stamped, "/mocap/base")
    for file in (bag(tmp_path, sent), bag(tmp_path, sent, mcap=True)):
        log = nmm.DriveLog.from_bag(file, robot, reference="/mocap/base")
        assert (log.name, log.kind, [*log.readings]) == (file.name, "poses", [LEFT, RIGHT])
        np.testing.assert_allclose(log.t, driven.t, atol=1e-6)
        for name in (LEFT, RIGHT):
            np.testing.assert_array_equal(log.readings[name], driven.wheels[name])
        np.testing.assert_allclose(log.reference_t, driven.t[::2] + 0.013, atol=1e-6)
        np.testing.assert_allclose(log.reference, driven.q[::2, :3], atol=1e-9)


@pytest.mark.parametrize(
    ("made", "columns"), [(stamped, 3), (covered, 3), (placed, 3), (odometry, 3), (point, 2)]
)
def test_a_reference_is_any_topic_of_poses_or_points(
    made: Any, columns: int, tmp_path: Path, robot: Robot, driven: Drive
) -> None:
    file = bag(tmp_path, states(driven) + looks(driven, made, "/seen"))
    log = nmm.DriveLog.from_bag(file, robot, reference="seen", name="first")
    assert (log.name, log.kind) == ("first", {3: "poses", 2: "positions"}[columns])
    np.testing.assert_allclose(log.reference, driven.q[::2, :columns], atol=1e-9)


def test_odometry_of_another_link_is_brought_to_the_reference_point(tmp_path: Path) -> None:
    robot = wheeled(tmp_path, axle=0.3)
    driven = drive(robot, lambda t: (0.45, 0.2 + 0.3 * np.cos(t)), duration=3.0, dt=0.05)
    x, y, theta = driven.q[:, :3].T
    of_link = np.column_stack([x - 0.3 * np.cos(theta), y - 0.3 * np.sin(theta), theta])
    seen = Drive(driven.t, of_link, driven.wheels)
    file = bag(tmp_path, states(driven) + looks(seen, odometry, "/localised", "map"))
    log = nmm.DriveLog.from_bag(file, robot, reference="localised")
    np.testing.assert_allclose(log.reference, driven.q[::2, :3], atol=1e-9)


def test_motion_capture_in_transforms(tmp_path: Path, robot: Robot, driven: Drive) -> None:
    def moved(t: float, row: Array, frame: str) -> Any:
        return tf(transform(t, frame, "base_link", row[:2], float(row[2])))

    file = bag(tmp_path, states(driven) + looks(driven, moved, "/tf", "optitrack"))
    log = nmm.DriveLog.from_bag(file, robot, map="optitrack")
    np.testing.assert_allclose(log.reference, driven.q[::2, :3], atol=1e-9)
    np.testing.assert_allclose(log.reference_t, driven.t[::2] + 0.013, atol=1e-6)


def localised(driven: Drive, ahead: float = 0.0, every: int = 10) -> list[Sent]:
    """Odometry that drifts, corrected now and then, to where the robot is."""
    sent: list[Sent] = []
    correction = np.zeros(3)
    for k, (t, row) in enumerate(zip((START + driven.t).tolist(), driven.q[:, :3], strict=True)):
        drift = np.array([0.9 * row[0], 0.9 * row[1], row[2]])
        sent.append((t, "/tf", tf(transform(t, "odom", "base_link", drift[:2], drift[2]))))
        if k % every == 0:
            correction = row - drift
        sent.append((t, "/tf", tf(transform(t + ahead, "map", "odom", correction[:2], 0.0))))
    return sent


@pytest.mark.parametrize("ahead", [0.0, 0.5])
def test_a_localisation_tells_poses_at_its_corrections(
    ahead: float, tmp_path: Path, robot: Robot, driven: Drive
) -> None:
    """In between they are odometry's; those that are dated ahead, for tf2, are dated back."""
    file = bag(tmp_path, states(driven) + localised(driven, ahead))
    log = nmm.DriveLog.from_bag(file, robot)
    np.testing.assert_allclose(log.reference_t, driven.t[10::10], atol=1e-6)
    np.testing.assert_allclose(log.reference, driven.q[10::10, :3], atol=1e-6)


def refused(file: Path, robot: Robot, **options: Any) -> str:
    with pytest.raises(InputError) as caught:
        nmm.DriveLog.from_bag(file, robot, **options)
    text = str(caught.value)
    assert len(text) <= 300
    assert file.name in text
    return text


def test_what_wheels_counted_is_no_reference(tmp_path: Path, robot: Robot, driven: Drive) -> None:
    still = [(START, "/tf_static", tf(transform(START, "map", "odom", (1.0, 0.0), 0.2)))]
    own = looks(driven, odometry, "/odom", "odom") + looks(driven, stamped, "/base_pose", "odom")
    other = looks(driven, odometry, "/wheels/odom", "wheels_odom")
    file = bag(tmp_path, states(driven) + own + other + still)
    text = refused(file, robot, reference="odom")
    assert "reference: /odom is what the wheels counted (base_link in odom)" in text
    assert "/base_pose is what the wheels counted (a pose in odom)" in refused(
        file, robot, reference="base_pose"
    )
    text = refused(file, robot, reference="wheels/odom", odometry="wheels/odom")
    assert "/wheels/odom is what the wheels counted (base_link in wheels_odom)" in text
    for world in ("world", "odom"):
        assert "in odom it is where wheels counted it" in refused(file, robot, map=world)
    assert "map → odom never changes: the poses are those that wheels counted" in refused(file, robot)


def test_wheels_without_positions_are_integrated(tmp_path: Path, robot: Robot, driven: Drive) -> None:
    v, omega = 0.45 + 0.1 * np.sin(driven.t), 0.2 + 0.3 * np.cos(driven.t)
    rates = (v - 0.25 * omega) / 0.1, (v + 0.25 * omega) / 0.1
    kind = TYPES["sensor_msgs/msg/JointState"]
    sent = looks(driven, stamped, "/seen")
    for t, left, right in zip(driven.t.tolist(), *np.array(rates).tolist(), strict=True):
        values = np.array([left, right])
        state = kind(header=header(START + t, ""), name=[LEFT, RIGHT], position=np.zeros(0),
                     velocity=values, effort=np.zeros(0))  # fmt: skip
        sent.append((START + t, "/joint_states", state))
    log = nmm.DriveLog.from_bag(bag(tmp_path, sent), robot, reference="seen")
    for name in (LEFT, RIGHT):
        np.testing.assert_allclose(log.readings[name], driven.wheels[name], atol=2.0 * 6.0 * 0.05**2 / 12)


def test_wheels_on_topics_and_stamps_of_their_own(tmp_path: Path, robot: Robot, driven: Drive) -> None:
    """Both are known from the later one's first to the earlier one's last stamp, linear in between."""
    sent = looks(driven, stamped, "/seen")
    for k, t in enumerate(driven.t.tolist()):
        sent.append((START + t, "/left", joints(START + t, {LEFT: driven.wheels[LEFT][k]})))
        sent.append((START + t, "/right", joints(START + t + 0.02, {RIGHT: driven.wheels[RIGHT][k]})))
    log = nmm.DriveLog.from_bag(bag(tmp_path, sent), robot, reference="seen", joints=["left", "right"])
    assert log.t[0] == 0.0
    np.testing.assert_allclose(log.t[-1], driven.t[-1] - 0.02, atol=1e-9)
    at = log.t + 0.02
    np.testing.assert_allclose(log.readings[LEFT], np.interp(at, driven.t, driven.wheels[LEFT]), atol=1e-6)
    np.testing.assert_allclose(
        log.readings[RIGHT], np.interp(log.t, driven.t, driven.wheels[RIGHT]), atol=1e-6
    )


def test_wheels_that_begin_anew_are_counted_on(tmp_path: Path, robot: Robot, driven: Drive) -> None:
    turned = {name: (values + np.pi) % (2 * np.pi) - np.pi for name, values in driven.wheels.items()}
    file = bag(tmp_path, states(Drive(driven.t, driven.q, turned)) + looks(driven, stamped, "/seen"))
    with pytest.warns(RuntimeWarning, match="left_wheel_joint and right_wheel_joint begin anew"):
        log = nmm.DriveLog.from_bag(file, robot, reference="seen")
    for name in (LEFT, RIGHT):
        np.testing.assert_allclose(log.readings[name], driven.wheels[name], atol=1e-9)
    stated = nmm.DriveLog.from_bag(file, robot, reference="seen", wrapped=True)
    np.testing.assert_array_equal(stated.readings[LEFT], log.readings[LEFT])


def test_a_namespace_a_prefix_and_ros_1(tmp_path: Path, robot: Robot, driven: Drive) -> None:
    sent: list[Sent] = []
    for t, topic, message in states(driven, store=FIRST):
        message.name = [f"r1/{name}" for name in message.name]
        sent.append((t, f"/r1{topic}", message))
    for t, row in zip((START + driven.t).tolist(), driven.q[:, :3], strict=True):
        moved = transform(t, "/map", "/r1/base_link", row[:2], float(row[2]), store=FIRST)
        sent.append((t, "/tf", tf(moved, store=FIRST)))
    log = nmm.DriveLog.from_bag(bag_of_ros1(tmp_path, sent), robot, namespace="r1", prefix="r1/")
    np.testing.assert_allclose(log.reference, driven.q[:, :3], atol=1e-9)
    np.testing.assert_array_equal(log.readings[LEFT], driven.wheels[LEFT])


def test_numbers_that_are_none_are_left_out_with_a_warning(
    tmp_path: Path, robot: Robot, driven: Drive
) -> None:
    wheels = {LEFT: driven.wheels[LEFT].copy(), RIGHT: driven.wheels[RIGHT]}
    wheels[LEFT][7] = np.nan
    file = bag(tmp_path, states(Drive(driven.t, driven.q, wheels)) + looks(driven, stamped, "/seen"))
    with pytest.warns(RuntimeWarning, match="left_wheel_joint is no number in 1 message, left out") as caught:
        log = nmm.DriveLog.from_bag(file, robot, reference="seen")
    assert caught[0].filename == __file__
    assert np.isfinite(log.readings[LEFT]).all()
    assert len(log) == len(driven.t)


def test_stamps_of_zero_are_those_of_recording(tmp_path: Path, robot: Robot, driven: Drive) -> None:
    sent = states(driven)
    for _, _, message in sent:
        message.header = header(0.0, "")
    file = bag(tmp_path, sent + looks(driven, stamped, "/seen", late=0.0))
    with pytest.warns(RuntimeWarning, match="/joint_states has stamps of 0"):
        log = nmm.DriveLog.from_bag(file, robot, reference="seen")
    np.testing.assert_allclose(log.t, driven.t, atol=1e-6)
    np.testing.assert_allclose(log.reference_t, driven.t[::2], atol=1e-6)


def test_what_no_bag_of_a_drive_has_is_named(tmp_path: Path, robot: Robot, driven: Drive) -> None:
    mine, seen = states(driven), looks(driven, stamped, "/seen")
    whole = bag(tmp_path, mine + seen)
    text = refused(whole, robot, reference="nothing")
    assert "reference: expected poses or points on /nothing, or 'tf'; available: /seen (geometry" in text
    assert "expected a topic of sensor_msgs/msg/JointState on /other" in refused(
        whole, robot, reference="seen", joints="other"
    )
    assert "expected a topic of tf2_msgs/msg/TFMessage on /tf, or reference=" in refused(whole, robot)
    assert "poses or points on /joint_states" in refused(whole, robot, reference="joint_states")
    late = looks(driven, stamped, "/seen", late=3.2e8)
    text = refused(bag(tmp_path, mine + late), robot, reference="seen")
    assert "the reference's stamps begin 3.2e+08 s after the counters'" in text
    assert "at least two messages, got 1" in refused(bag(tmp_path, mine + seen[:1]), robot, reference="seen")
    two = seen + looks(driven, stamped, "/seen", "map")
    assert "poses in several frames on one topic" in refused(
        bag(tmp_path, mine + two), robot, reference="seen"
    )
    half = Drive(driven.t, driven.q, {LEFT: driven.wheels[LEFT], RIGHT: driven.wheels[RIGHT]})
    alone = [
        (t, topic, joints(START + k, {LEFT: float(half.wheels[LEFT][k])}))
        for k, (t, topic, _) in enumerate(mine[:3])
    ]
    text = refused(bag(tmp_path, alone + seen), robot, reference="seen")
    assert "do not determine v, omega" in text
    assert "readings of right_wheel_joint too" in text
    arm = [(t, topic, joints(t, {"j1": 0.1})) for t, topic, _ in mine]
    assert "no wheel's position or velocity on /joint_states" in refused(
        bag(tmp_path, arm + seen), robot, reference="seen"
    )
    still = Drive(driven.t, driven.q, {name: 1e-4 * values for name, values in driven.wheels.items()})
    assert "it stands still: of its counters" in refused(
        bag(tmp_path, states(still) + seen), robot, reference="seen"
    )
    degrees = Drive(driven.t, driven.q, {name: np.rad2deg(values) for name, values in driven.wheels.items()})
    assert "deg or ticks" in refused(bag(tmp_path, states(degrees) + seen), robot, reference="seen")
    (tmp_path / "none.mcap").write_bytes(b"nothing")
    assert "it lacks its end" in refused(tmp_path / "none.mcap", robot)


def test_a_car_steers_by_its_joints(tmp_path: Path) -> None:
    car = nmm.load("car_base")
    driven = drive(car, lambda t: (0.8, 0.4 * np.cos(0.9 * t)), duration=4.0, dt=0.05)
    wheelbase, track = 0.7, 0.56
    inner = np.tan(driven.q[:, 3]) / wheelbase
    steer = {
        f"front_{side}_steer_joint": np.arctan(wheelbase * inner / (1.0 - sign * 0.5 * track * inner))
        for side, sign in (("left", 1), ("right", -1))
    }
    told = driven.wheels | steer
    sent = looks(driven, stamped, "/seen")
    for k, t in enumerate(driven.t.tolist()):
        state = joints(START + t, {name: float(values[k]) for name, values in told.items()})
        sent.append((START + t, "/joint_states", state))
    log = nmm.DriveLog.from_bag(bag(tmp_path, sent), car, reference="seen")
    assert {*log.readings} == {*told}
    for name, values in told.items():
        np.testing.assert_array_equal(log.readings[name], values)
