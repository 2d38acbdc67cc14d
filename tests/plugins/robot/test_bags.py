"""Logs of runs: every number against the mcap and rosbags packages' own readers; read back; damaged ones."""

from __future__ import annotations

import shutil
import sys
from collections import defaultdict
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import nmm
from nmm.base.arrays import Array
from nmm.base.errors import InputError
from nmm.cli.exit_status import status_of
from nmm.model.robots.robot import Robot

rosbag2 = pytest.importorskip("rosbags.rosbag2")
typesys = pytest.importorskip("rosbags.typesys")
STORE = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)
Messages = Mapping[str, list[tuple[int, Any]]]


@pytest.fixture(scope="module")
def run() -> nmm.Trajectory:
    """With odometry that drifts, and a start that is not 0."""
    worn = {"odometry": True, "slip": {"v": 0.9, "omega": 0.95}}
    settings = {"duration": 0.5, "method": "zoh", "dt": 0.01, "disturbances": worn, "q0.theta": 9.0}
    return nmm.Scenario.load("unicycle_2r_position", settings).run()


@pytest.fixture(scope="module")
def log(run: nmm.Trajectory, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return run.save_mcap(tmp_path_factory.mktemp("log") / "run.mcap", start=1.7e9)


def by_mcap(path: Path) -> Messages:
    """By the readers of the packages mcap and mcap-ros2-support."""
    reader, decoder = pytest.importorskip("mcap.reader"), pytest.importorskip("mcap_ros2.decoder")
    found = defaultdict(list)
    with path.open("rb") as file:
        opened = reader.make_reader(file, decoder_factories=[decoder.DecoderFactory()])
        assert opened.get_header().profile == "ros2"
        for _, channel, message, decoded in opened.iter_decoded_messages():
            found[channel.topic].append((message.log_time, decoded))
    return found


def by_rosbags(path: Path) -> Messages:
    found = defaultdict(list)
    with rosbag2.Reader(path) as bag:
        for connection, time, data in bag.messages():
            found[connection.topic].append((time, STORE.deserialize_cdr(data, connection.msgtype)))
    return found


@pytest.mark.parametrize("read", [by_mcap, by_rosbags])
def test_every_number_is_the_runs(run: nmm.Trajectory, log: Path, read: Any) -> None:
    found, robot = read(log), run.robot
    assert run.believed is not None
    times = [1_700_000_000_000_000_000 + round(t * 1e9) for t in run.t]
    poses = ("/base_pose", "/end_effector_pose", "/desired_pose")
    for topic in ("/joint_states", "/odom", "/tf", "/cmd_vel", "/inputs", "/error", *poses):
        assert [time for time, _ in found[topic]] == times, topic
    rows: dict[str, list[Any]] = {topic: [one for _, one in many] for topic, many in found.items()}
    for k, t in enumerate(times):
        for topic in ("/joint_states", "/odom", "/cmd_vel", "/inputs", *poses):
            at = rows[topic][k].header.stamp
            assert at.sec * 10**9 + at.nanosec == t
    names = rows["/joint_states"][0].name
    assert [*names[:2]] == ["q1", "q2"]
    wheels = nmm.playback.wheel_angles(nmm.playback.Motion(robot, run.t, run.believed, run.u))
    position = np.array([one.position for one in rows["/joint_states"]])
    np.testing.assert_array_equal(position, np.column_stack([run.q[:, 3:], wheels]))
    rates = np.array([one.velocity for one in rows["/joint_states"]])
    np.testing.assert_array_equal(rates[:, :2], run.u[:, 2:])
    np.testing.assert_allclose(rates[:, 2:] @ [0.05, 0.05], run.u[:, 0], atol=1e-12)  # of radius 0.1 m
    np.testing.assert_array_equal([one.velocity for one in rows["/inputs"]], run.u)
    assert tuple(rows["/inputs"][0].name) == robot.u_names
    pose = [one.pose.pose for one in rows["/odom"]]
    np.testing.assert_array_equal([[p.position.x, p.position.y] for p in pose], run.believed[:, :2])
    half = 0.5 * run.believed[:, 2]
    turns = [[p.orientation.x, p.orientation.y, p.orientation.z, p.orientation.w] for p in pose]
    np.testing.assert_allclose(
        turns, np.column_stack([0 * half, 0 * half, np.sin(half), np.cos(half)]), atol=1e-15
    )
    for twists in ([one.twist.twist for one in rows["/odom"]], [one.twist for one in rows["/cmd_vel"]]):
        told = [[one.linear.x, one.linear.y, one.angular.z] for one in twists]
        np.testing.assert_allclose(told, np.insert(run.u[:, :2], 1, 0.0, axis=1), atol=1e-15)
    np.testing.assert_array_equal([one.data for one in rows["/error"]], run.error)
    for topic, points in (("/path", run.path), ("/desired_path", run.moving)):
        (path,) = rows[topic]
        told = [[p.pose.position.x, p.pose.position.y, p.pose.position.z] for p in path.poses]
        np.testing.assert_array_equal(told, points)
    assert "<robot" in rows["/robot_description"][0].data


def test_chunks_are_compressed_as_ros_and_its_viewers_read_them(run: nmm.Trajectory, log: Path) -> None:
    """By the reader of the package mcap: zstd, and the file a quarter of its messages."""
    with log.open("rb") as file:
        opened = pytest.importorskip("mcap.reader").make_reader(file)
        summary = opened.get_summary()
        messages = sum(len(message.data) for _, _, message in opened.iter_messages())
    assert {one.compression for one in summary.chunk_indexes} == {"zstd"}
    assert sum(one.compressed_size for one in summary.chunk_indexes) < messages / 4
    assert log.stat().st_size < messages / 2


@pytest.mark.parametrize("read", [by_mcap, by_rosbags])
def test_poses_are_told_alone_too(run: nmm.Trajectory, log: Path, read: Any) -> None:
    """The base's as in its Odometry, the end-effector's by Pinocchio, the desired path's points."""
    found = read(log)
    assert run.frame == "ee"
    assert run.desired is not None
    model = run.robot.model
    data, index = model.createData(), model.getFrameId("ee")
    for k, (base, odometry) in enumerate(zip(found["/base_pose"], found["/odom"], strict=True)):
        one, other = base[1].pose, odometry[1].pose.pose
        assert base[1].header.frame_id == odometry[1].header.frame_id == "odom"
        assert (one.position.x, one.position.y) == (other.position.x, other.position.y)
        assert one.orientation.z == pytest.approx(
            np.copysign(other.orientation.z, one.orientation.z), abs=1e-12
        )
        pin.framesForwardKinematics(model, data, run.q[k])
        reached, wanted = (found[topic][k][1] for topic in ("/end_effector_pose", "/desired_pose"))
        assert reached.header.frame_id == wanted.header.frame_id == "map"
        np.testing.assert_allclose(nmm.ros.placement(reached), data.oMf[index].homogeneous, atol=1e-12)
        np.testing.assert_array_equal(nmm.ros.placement(wanted)[:3, 3], run.desired[k])


def test_a_covariance_that_is_not_known_says_so(run: nmm.Trajectory, log: Path) -> None:
    """By -1 at its beginning, as sensor_msgs/Imu defines it; one that is given is in its place."""
    for _, one in by_rosbags(log)["/odom"]:
        for told in (one.pose.covariance, one.twist.covariance):
            assert told.tolist() == [-1.0] + 35 * [0.0]
    known = np.array([[0.1, 0.01, 0.02], [0.01, 0.2, 0.03], [0.02, 0.03, 0.3]])
    made = nmm.ros.Messages(run.robot, STORE.types).odometry(0.0, run.q[0], run.q_dot[0], known)
    rows = made.pose.covariance.reshape(6, 6)
    np.testing.assert_array_equal(rows[np.ix_([0, 1, 5], [0, 1, 5])], known)
    assert np.abs(rows).sum() == np.abs(known).sum()
    assert made.twist.covariance[0] == -1.0


def test_transforms_lead_to_every_link_where_pinocchio_has_it(run: nmm.Trajectory, log: Path) -> None:
    found, frames = by_rosbags(log), nmm.ros.Transforms()
    for _, message in found["/tf_static"]:
        frames.add(message)
    for k in (0, 20, 50):
        frames.add(found["/tf"][k][1])
        here = nmm.Configuration(run.robot, run.q[k])
        for link in ("base_footprint", "base_link", "link1", "link2", "ee"):
            expected = here.placement(link).homogeneous
            np.testing.assert_allclose(frames.placement("map", link), expected, atol=1e-12)
        assert run.believed is not None
        base = frames.base("odom", "base_footprint")
        np.testing.assert_allclose(base[:2], run.believed[k, :2], atol=1e-12)


def test_a_log_is_read_back(run: nmm.Trajectory, log: Path) -> None:
    found = nmm.read_bag(log, run.robot, frame="ee")
    np.testing.assert_allclose(found.t, run.t, atol=1e-9)
    np.testing.assert_array_equal(found.u, run.u)
    np.testing.assert_array_equal(found.q[:, 3:], run.q[:, 3:])
    turns = 2 * np.pi * np.round((run.q[0, 2] - found.q[0, 2]) / (2 * np.pi))  # a quaternion knows no turns
    assert turns == pytest.approx(2 * np.pi)
    assert found.believed is not None
    for one, expected in ((found.q, run.q), (found.believed, run.believed)):
        np.testing.assert_allclose(one + np.array([0, 0, turns, 0, 0]), expected, atol=1e-12)
    np.testing.assert_allclose(found.path, run.path, atol=1e-12)


def test_tasks_that_come_and_go_are_told(tmp_path: Path) -> None:
    robot = nmm.load("unicycle_2r")
    aim = nmm.Task(nmm.Posture("q1"), [0.5], name="aim", when=nmm.Between(0.05, 0.1))
    controller = nmm.SequencedController(robot, aim, nmm.ProjectedGradient())
    run = nmm.simulate(controller, robot.rest, 0.2, 0.01)
    told = by_rosbags(run.save_mcap(tmp_path / "run.mcap"))["/rosout"]
    assert [(time, one.name, one.msg.split(":")[0]) for time, one in told] == [
        (round(event.t * 1e9), event.task, event.what) for event in run.events
    ]
    assert len(told) == 2


def recorded(path: Path, robot: Robot, t: Array, q: Array, q_dot: Array, storage: str = "SQLITE3") -> Path:
    """A bag as a robot would record it: its base by TF, arm and wheels in messages of their own, other joints
    beside; odometry twice as often, out of order."""
    made = nmm.ros.Messages(robot, STORE.types)
    plugin = getattr(rosbag2.StoragePlugin, storage)
    with rosbag2.Writer(path, version=9, storage_plugin=plugin) as bag:

        def send(topic: str, time: float, message: Any, topics: dict[str, Any] = {}) -> None:  # noqa: B006
            kind = message.__msgtype__
            if (path, topic) not in topics:
                topics[path, topic] = bag.add_connection(topic, kind, typestore=STORE)
            bag.write(topics[path, topic], round(time * 1e9), STORE.serialize_cdr(message, kind))

        for k in np.random.default_rng(0).permutation(len(t)).tolist():
            state = made.joint_state(t[k], q[k])
            first, *others = state.name
            rest = {"name": [*others, "gripper"], "position": np.array([*state.position[1:], 0.3])}
            send("/tf", t[k], made.transforms(t[k], q[k]))
            for names in ({"name": [first], "position": state.position[:1]}, rest):
                part = STORE.types["sensor_msgs/msg/JointState"](
                    header=state.header, velocity=np.zeros(0), effort=np.zeros(0), **names
                )
                send("/joint_states", t[k], part)
    return path


@pytest.mark.parametrize("storage", ["SQLITE3", "MCAP"])
def test_a_robots_own_bag_is_a_trajectory(tmp_path: Path, storage: str) -> None:
    """Joined from messages of some joints each; inputs by differences, with an error of the second order."""
    robot = nmm.load("unicycle_2r")
    t = 100.0 + np.linspace(0.0, 1.0, 101)
    s = t - 100.0
    theta = 0.5 * np.sin(3 * s)
    q = np.column_stack([s, 0 * s, theta, np.sin(2 * s), 0.2 * s**2])
    v = np.exp(-s)
    for i, rate in ((0, v * np.cos(theta)), (1, v * np.sin(theta))):
        q[1:, i] = np.cumsum(0.005 * (rate[1:] + rate[:-1]))
    bag = recorded(tmp_path / "bag", robot, t, q, q, storage)
    found = nmm.read_bag(bag, robot)
    np.testing.assert_allclose(found.t, s, atol=1e-9)
    np.testing.assert_allclose(found.q[:, :3], q[:, :3], atol=1e-9)
    np.testing.assert_allclose(found.q, q, atol=1e-9)
    expected = np.column_stack([v, 1.5 * np.cos(3 * s), 2 * np.cos(2 * s), 0.4 * s])
    np.testing.assert_allclose(found.u[1:-1], expected[1:-1], atol=2e-3)
    assert found.believed is None


def test_a_run_beside_a_log(
    run: nmm.Trajectory, log: Path, tmp_path: Path, capsys: Any, monkeypatch: Any
) -> None:
    monkeypatch.chdir(tmp_path)
    folder = run.save("runs/first", figures=False)
    assert status_of(["export", str(folder), "--mcap"]) == 0
    assert nmm.read_bag(Path("runs/first.mcap"), run.robot).t.shape == run.t.shape
    shutil.copy(log, "robot.mcap")
    assert status_of(["compare", str(folder), "robot.mcap", "--out", "both"]) == 0
    assert Path("both/playback.html").exists()
    again = nmm.Trajectory.load("both/robot")
    assert len(again) == len(run)
    assert np.isnan(again.error_norm).all()  # it has no task
    assert again.summary()["settling_time"] is None
    told = capsys.readouterr().out
    assert "platform" in told
    from nmm.plugins.robot.ros.difference import difference

    moved = nmm.read_bag(log, run.robot)
    moved.q[:, 0] += 0.03
    moved.q[:, 1] += 0.04
    moved.q[:, 4] += np.linspace(0.0, 0.1, len(run))
    found = difference(run, moved)["differences"]
    assert found["platform"]["rms"] == pytest.approx(0.05, abs=1e-9)
    assert found["theta"]["max"] == pytest.approx(0.0, abs=1e-9)
    assert found["q2"]["max"] == pytest.approx(0.1, abs=1e-9)
    assert found["q2"]["t"] == pytest.approx(run.t[-1])
    with pytest.raises(InputError):
        difference(run, nmm.read_bag(log, nmm.load("unicycle_2r", arguments={"d": 0.5})))


def test_damaged_bags_are_refused_in_a_line(log: Path, tmp_path: Path) -> None:
    robot, whole = nmm.load("unicycle_2r"), log.read_bytes()
    bad = tmp_path / "bad.mcap"
    rng = np.random.default_rng(0)
    for content in (b"", b"no MCAP", whole[:20], whole[:2000], whole[:8] * 10):
        bad.write_bytes(content)
        with pytest.raises(InputError) as error:
            nmm.read_bag(bad, robot)
        assert "bad.mcap" in str(error.value)
        assert len(str(error.value)) <= 300
    for _ in range(40):  # some bytes are others: a line, or what was read all the same
        content = bytearray(whole)
        for at in rng.integers(len(whole), size=30):
            content[at] = rng.integers(256)
        bad.write_bytes(content)
        with suppress(InputError):
            nmm.read_bag(bad, robot)
    for there in (tmp_path / "none.mcap", tmp_path, tmp_path / "bad.txt"):
        (tmp_path / "bad.txt").touch()
        with pytest.raises(InputError):
            nmm.read_bag(there, robot)


def test_another_robots_bag_says_what_is_missing(log: Path, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="q3"):
        nmm.read_bag(log, nmm.load("unicycle_3r"))
    with pytest.raises(InputError) as error:
        nmm.read_bag(log, nmm.load("unicycle_2r"), joints="/others")
    assert any("/joint_states" in one for one in error.value.available or ())
    robot = nmm.load("unicycle_2r")
    t = np.array([1.0, 2.0])
    bag = recorded(tmp_path / "bag", robot, t, np.zeros((2, 5)), np.zeros((2, 5)))
    with pytest.raises(InputError, match="base_link"):
        nmm.read_bag(bag, robot, base="base_link_")


def test_nothing_half_written_is_left(
    run: nmm.Trajectory, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import nmm.plugins.robot.ros.log

    for wrong in (tmp_path / "run.bag", tmp_path):
        with pytest.raises(InputError):
            run.save_mcap(wrong)
    there = tmp_path / "there.mcap"
    there.write_bytes(b"before")

    def failing(*_: Any) -> Any:
        yield 0, "/a", STORE.types["std_msgs/msg/String"](data="a")
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(nmm.plugins.robot.ros.log, "messages_of", failing)
    with pytest.raises(nmm.NmmError):
        run.save_mcap(there)
    assert there.read_bytes() == b"before"
    assert [*tmp_path.iterdir()] == [there]


def test_without_rosbags_it_is_said_how_to_get_it(
    run: nmm.Trajectory, tmp_path: Path, monkeypatch: Any
) -> None:
    for part in ("rosbags.rosbag2", "rosbags.typesys"):
        monkeypatch.setitem(sys.modules, part, None)
    for use in (lambda: run.save_mcap(tmp_path / "run.mcap"), lambda: nmm.read_bag(tmp_path, run.robot)):
        with pytest.raises(InputError, match="pip install rosbags"):
            use()


def test_commands_refuse_what_is_no_bag_and_no_run(
    run: nmm.Trajectory, tmp_path: Path, monkeypatch: Any, capsys: Any
) -> None:
    monkeypatch.chdir(tmp_path)
    run.save("first", figures=False)
    Path("bad.mcap").write_bytes(b"no MCAP")
    for arguments in (
        ["compare", "first", "bad.mcap"],
        ["compare", "none", "bad.mcap"],
        ["export", "first"],
        ["export", "none", "--mcap"],
        ["export", "first", "--mcap", "run.bag"],
    ):
        assert status_of(arguments) == 2, arguments
        assert capsys.readouterr().err.count("\n") == 1, arguments
    assert {one.name for one in tmp_path.iterdir()} == {"first", "bad.mcap"}
