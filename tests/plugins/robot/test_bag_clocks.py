"""Joints in parts, clocks that fail, and logs that lack their end."""

from __future__ import annotations

import math
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from findings import of_code, the
from robot_logs import FIRST, STORE, Sent, bag, bag_of_ros1, joints, odom, tf, transform, wheeled

import nmm
from nmm.base.errors import InputError
from nmm.cli.exit_status import status_of
from nmm.plugins.robot import bag_findings as bag_words

pytestmark = pytest.mark.filterwarnings("ignore:.*:RuntimeWarning")
NAN = math.nan
STEPS = [10 + 0.02 * k for k in range(100)]


def driven(t: float) -> Sent:
    return t, "/odom", odom(t, (0.5 * (t - 10), 0, 0), (0.5, 0, 0, 0, 0, 0))


def test_each_joint_is_interpolated_between_its_own_stamps(tmp_path: Path) -> None:
    """j1 at 50 Hz, j2 at 7 Hz by another publisher: q is linear where they are, as what they do is."""
    sent = [driven(t) for t in STEPS]
    sent += [(t, "/joint_states", joints(t, {"j1": 0.4 * (t - 10), "fan": 1.0})) for t in STEPS]
    sent += [
        (t, "/joint_states", joints(t, {"j2": 0.2 - 0.3 * (t - 10)})) for t in np.arange(10.013, 11.9, 0.14)
    ]
    run = nmm.read_bag(bag(tmp_path, sent), wheeled(tmp_path))
    t = run.t + 0.013
    last = 10.013 + 0.14 * 13 - 10
    np.testing.assert_allclose(run.q[:, 3], 0.4 * t, atol=1e-9)
    np.testing.assert_allclose(run.q[:, 4], 0.2 - 0.3 * np.minimum(t, last), atol=1e-9)
    within = t < last - 0.02
    np.testing.assert_allclose(run.u[within, 2:], np.tile([0.4, -0.3], (within.sum(), 1)), atol=1e-6)
    assert not run.warnings


def test_velocities_of_the_messages_are_used_where_they_are_there(tmp_path: Path) -> None:
    """j1 says its velocity, in steps that positions do not show; j2 does not; a third message has velocities
    alone."""
    sent = [driven(t) for t in STEPS]
    for k, t in enumerate(STEPS):
        sent += [
            (t, "/joint_states", joints(t, {"j1": round(0.4 * (t - 10), 2)}, [0.4])),
            (t, "/joint_states", joints(t, {"j2": 0.2 * (t - 10)})),
            (t, "/joint_states", joints(t, {"left_wheel_joint": None, "fan": None}, [5.0 * k, 1.0])),
        ]
    run = nmm.read_bag(bag(tmp_path, sent), wheeled(tmp_path))
    np.testing.assert_allclose(run.u[:, 2:], np.tile([0.4, 0.2], (100, 1)), atol=1e-6)
    assert not run.warnings


@pytest.mark.parametrize(("factor", "zero"), [(0.0, True), (57.3, False), (-1.0, False)])
def test_velocities_that_contradict_positions_are_told(tmp_path: Path, factor: float, zero: bool) -> None:
    """All 0; degrees; another sign. j2 rests, which zeros do not contradict."""
    sent = [driven(t) for t in STEPS]
    sent += [
        (t, "/joint_states", joints(t, {"j1": math.sin(t - 10), "j2": 0.3}, [factor * math.cos(t - 10), 0.0]))
        for t in STEPS
    ]
    run = nmm.read_bag(bag(tmp_path, sent), wheeled(tmp_path))
    np.testing.assert_allclose(run.u[1:-1, 2], np.cos(run.t[1:-1]), atol=1e-4)
    assert the(run, "rates_contradict").values == {"names": ["j1"], "zero": zero}


def test_numbers_that_are_none(tmp_path: Path) -> None:
    """Of a wheel or a fan they do not matter; of a joint they are left out with a word; of all, refused."""
    robot, wheels = wheeled(tmp_path), {"left_wheel_joint": NAN, "right_wheel_joint": NAN}
    for missing, told in ((0, 0), (5, 5), (100, None)):
        sent = [driven(t) for t in STEPS]
        for k, t in enumerate(STEPS):
            j1 = NAN if k < missing else 0.4 * (t - 10)
            sent.append(
                (t, "/joint_states", joints(t, {**wheels, "fan": NAN, "j1": j1, "j2": 0.2}, [NAN] * 5))
            )
        path = bag(tmp_path, sent)
        if told is None:
            with pytest.raises(InputError, match="j1"):
                nmm.read_bag(path, robot)
            continue
        run = nmm.read_bag(path, robot)
        assert len(run) == 100 - missing
        np.testing.assert_allclose(run.q[:, 3], 0.4 * (run.t + 0.02 * missing), atol=1e-9)
        assert [one.values["count"] for one in of_code(run.findings, "values_not_finite")] == [told] * bool(
            told
        )


def test_live_joint_states_take_what_counts(tmp_path: Path) -> None:
    robot = wheeled(tmp_path)
    states = nmm.ros.JointStates(robot, prefix="r1/")
    assert not states.add(joints(1.0, {"left_wheel_joint": None, "right_wheel_joint": None}, [1, 2]))
    assert states.add(joints(2.0, {"r1/j1": 0.1, "r1/fan": NAN, "left_wheel_joint": 0.5}))
    assert states.add(joints(3.0, {"j2": 0.2, "left_wheel_joint": NAN}))
    assert states.joints == {"j1": 0.1, "j2": 0.2}  # of a wheel nothing is known any more
    assert states.stamp == 2.0
    assert states.add(joints(0.0, {"j1": 0.3, "j2": 0.2}), t=7.0)
    assert states.stamp == 7.0
    torques = joints(8.0, {"j1": None, "fan": None})
    torques.effort = np.array([1.0, 2.0])
    assert not states.add(torques)
    assert nmm.ros.joints(joints(1.0, {"fan": None}, [3.0])) == {}
    for wrong in (joints(4.0, {"j1": NAN, "j2": 0.5}), joints(4.0, {"j1": 0.5, "j2": None})):
        with pytest.raises(InputError, match="position"):
            states.add(wrong)
    assert states.joints["j2"] == 0.2


def test_mimic_joints_and_full_turns(tmp_path: Path) -> None:
    """A gripper says its follower alone, at another rate; j1 is continuous, said in (-π, π], fast."""
    follower = (
        '<link name="f"/><joint name="f_joint" type="revolute"><parent link="a2"/><child link="f"/>'
        '<mimic joint="j2" multiplier="-0.5" offset="0.1"/>'
        '<limit lower="-3" upper="3" effort="1" velocity="2"/></joint>'
    )
    robot = wheeled(tmp_path, kind="continuous", more=follower)
    sent = [driven(t) for t in STEPS]
    for k, t in enumerate(STEPS):
        j1 = math.remainder(9.0 * (t - 10), 2 * math.pi)
        sent.append((t, "/joint_states", joints(t, {"j1": j1})))
        if k % 9 == 0:
            sent.append((t, "/joint_states", joints(t, {"f_joint": 0.1 - 0.5 * 0.3 * (t - 10)})))
    run = nmm.read_bag(bag(tmp_path, sent), robot)
    np.testing.assert_allclose(run.q[:, 3], 9.0 * run.t, atol=1e-6)
    np.testing.assert_allclose(run.q[:, 4], 0.3 * run.t, atol=1e-9)


def test_a_joint_that_comes_no_more_is_told(tmp_path: Path) -> None:
    sent = [driven(t) for t in STEPS]
    sent += [(t, "/joint_states", joints(t, {"j1": 0.1})) for t in STEPS]
    sent += [(t, "/joint_states", joints(t, {"j2": 0.2 * (t - 10)})) for t in STEPS[:30]]
    run = nmm.read_bag(bag(tmp_path, sent), wheeled(tmp_path))
    np.testing.assert_allclose(run.q[:, 4], 0.2 * np.minimum(run.t, 0.58), atol=1e-9)
    found = the(run, "joint_silent")
    assert (found.values["name"], found.where["t"]) == ("j2", pytest.approx(0.58))


@pytest.mark.parametrize("of", ["all zero", "joints stand still", "odometry stands still midway", "TF zero",
                                "zero beside sim time", "zero until the clock came"])  # fmt: skip
def test_stamps_that_fail(tmp_path: Path, of: str) -> None:
    """The recorder's times are those of the drive: 0.5 m/s, j1 at 0.1 rad/s."""
    sent: list[Sent] = []
    for k, t in enumerate(STEPS):
        stamps = {"joints": t, "pose": t}
        if of == "all zero":
            stamps = {"joints": 0.0, "pose": 0.0}
        elif of == "joints stand still":
            stamps["joints"] = 3.25
        elif of == "odometry stands still midway":
            stamps["pose"] = min(t, 11.0)
        elif of == "TF zero":
            stamps["pose"] = 0.0
        elif of == "zero beside sim time":
            stamps = {"joints": 0.0, "pose": t - 7.5}
        else:
            stamps["joints"] = t if k > 4 else 0.0
        x = 0.5 * (t - 10)
        pose = (t, "/odom", odom(stamps["pose"], (x, 0, 0), (0.5, 0, 0, 0, 0, 0)))
        if of == "TF zero":
            pose = (t, "/tf", tf(transform(stamps["pose"], "odom", "base_link", (x, 0))))
        sent += [pose, (t, "/joint_states", joints(stamps["joints"], {"j1": 0.1 * (t - 10), "j2": 0.2}))]
    run = nmm.read_bag(bag(tmp_path, sent), wheeled(tmp_path))
    late = 0.1 * (of == "zero until the clock came")
    assert len(run) == 100 - round(late / 0.02)
    np.testing.assert_allclose(run.t, np.array(STEPS[100 - len(run) :]) - STEPS[100 - len(run)], atol=1e-9)
    np.testing.assert_allclose(run.q[:, 0], 0.5 * (run.t + late), atol=1e-9)
    np.testing.assert_allclose(run.q[:, 3], 0.1 * (run.t + late), atol=1e-9)
    told = {(one.code, one.values["topic"], one.values.get("why")) for one in run.findings}
    assert (
        told
        == {
            "all zero": {
                ("stamps_of_recording", "/joint_states", "zero"),
                ("stamps_of_recording", "/odom", "zero"),
            },
            "joints stand still": {("stamps_of_recording", "/joint_states", "standing")},
            "odometry stands still midway": {("stamps_of_recording", "/odom", "standing")},
            "TF zero": {("stamps_of_recording", "/tf", "zero")},
            "zero beside sim time": {
                ("stamps_of_recording", "/joint_states", "zero"),
                ("stamps_of_recording", "/odom", "another clock"),
            },
            "zero until the clock came": {("stamps_missing", "/joint_states", None)},
        }[of]
    )


def test_a_simulation_that_begins_at_0_has_its_stamps(tmp_path: Path) -> None:
    sent: list[Sent] = []
    for t in np.arange(0, 2, 0.02).tolist():
        sent += [
            (5e3 + 3 * t, "/odom", odom(t, (0.5 * t, 0, 0), (0.5, 0, 0, 0, 0, 0))),
            (5e3 + 3 * t, "/joint_states", joints(t, {"j1": 0.1 * t, "j2": 0})),
        ]
    run = nmm.read_bag(bag(tmp_path, sent), wheeled(tmp_path))
    np.testing.assert_allclose(run.t, np.arange(0, 2, 0.02), atol=1e-9)
    assert not run.warnings


@pytest.mark.parametrize("kind", ["tf2_msgs/msg/TFMessage", "tf/msg/tfMessage"])
def test_bags_of_ros1(tmp_path: Path, kind: str) -> None:
    """Frames with slashes; static transforms on /tf, dated ahead; before tf2, too."""
    robot, sent = wheeled(tmp_path, -0.2), list[Sent]()
    for t in STEPS:
        low = transform(t, "/odom", "/base_footprint", (0.5 * (t - 10), 0), store=FIRST)
        fixed = transform(t + 0.1, "/base_footprint", "/base_link", (0.2, 0), store=FIRST)
        sent += [
            (t, "/tf", tf(low, fixed, store=FIRST, kind=kind)),
            (t, "/joint_states", joints(t, {"j1": 0.1, "j2": 0.2}, store=FIRST)),
        ]
    path = bag_of_ros1(tmp_path, sent)
    run = nmm.read_bag(path, robot)
    np.testing.assert_allclose(run.q[:, 0], 0.5 * run.t, atol=1e-9)
    assert len(run) == 100
    cut = tmp_path / "cut.bag"
    content = bytearray(path.read_bytes())
    at = content.index(b"index_pos=") + len(b"index_pos=")
    content[at : at + 8] = bytes(8)  # as a recorder leaves it that was killed
    cut.write_bytes(content)
    with pytest.raises(InputError, match=r"rosbag reindex cut\.bag"):
        nmm.read_bag(cut, robot)


def written(
    path: Path, compression: Any, chunk: int = 4096, profile: str = "ros2", encoding: str = "cdr"
) -> Path:
    """Joints and odometry of `STEPS`, by the package mcap."""
    writer = pytest.importorskip("mcap.writer")
    store = STORE if encoding == "cdr" else FIRST
    with path.open("wb") as out:
        log = writer.Writer(out, chunk_size=chunk, compression=compression)
        log.start(profile=profile, library="test")
        channels: dict[str, int] = {}
        for t in STEPS:
            x = 0.5 * (t - 10)
            for topic, message in (
                ("/joint_states", joints(t, {"j1": 0.1, "j2": 0.2}, store=store)),
                ("/odom", odom(t, (x, 0, 0), (0.5, 0, 0, 0, 0, 0), store=store)),
            ):
                kind = message.__msgtype__
                if topic not in channels:
                    text = store.generate_msgdef(kind, ros_version=2 if store is STORE else 1)[0].encode()
                    name, of = (kind, "ros2msg") if store is STORE else (kind.replace("/msg", ""), "ros1msg")
                    channels[topic] = log.register_channel(
                        topic, encoding, log.register_schema(name, of, text)
                    )
                send = store.serialize_cdr if store is STORE else store.serialize_ros1
                log.add_message(channels[topic], round(t * 1e9), bytes(send(message, kind)), round(t * 1e9))
        log.finish()
    return path


def messages_of(path: Path) -> int:
    """How many joint states the package mcap's own stream reader gets."""
    reader, records = pytest.importorskip("mcap.stream_reader"), pytest.importorskip("mcap.records")
    count, first = 0, None
    with path.open("rb") as file:
        try:
            for record in reader.StreamReader(file).records:
                if isinstance(record, records.Message):
                    first = record.channel_id if first is None else first
                    count += record.channel_id == first
        except Exception:  # of its end
            return count
    return count


@pytest.mark.parametrize("compression", ["NONE", "LZ4", "ZSTD"])
@pytest.mark.parametrize("share", [0.3, 0.6, 0.97])
def test_an_mcap_without_its_end_is_read_as_far_as_it_goes(
    tmp_path: Path, compression: str, share: float
) -> None:
    """Cut within a chunk, compressed or not, or within its summary."""
    kinds = pytest.importorskip("mcap.writer").CompressionType
    path = written(tmp_path / "cut.mcap", kinds[compression])
    content = path.read_bytes()
    path.write_bytes(content[: int(share * len(content))])
    run = nmm.read_bag(path, wheeled(tmp_path))
    assert len(run) == messages_of(path) > 5
    np.testing.assert_allclose(run.q[:, 0], 0.5 * run.t, atol=1e-9)
    found = the(run, "bag_cut").values
    assert (found["reason"], found["mend"]) == ("it lacks its end", "mcap recover cut.mcap")


def test_a_chunk_of_other_bytes_ends_what_is_read(tmp_path: Path) -> None:
    kinds = pytest.importorskip("mcap.writer").CompressionType
    path = written(tmp_path / "bad.mcap", kinds.NONE)
    content = bytearray(path.read_bytes()[:-9])
    content[len(content) // 2] ^= 0xFF
    path.write_bytes(content)
    run = nmm.read_bag(path, wheeled(tmp_path))
    assert 10 < len(run) < 60
    assert the(run, "bag_cut").values["reason"] == "bytes of it are others than written"


def test_other_profiles_of_mcap(tmp_path: Path) -> None:
    """ROS 1's messages, as mcap convert makes them of a .bag; and a writer that names no profile."""
    kinds = pytest.importorskip("mcap.writer").CompressionType
    for profile, encoding in (("ros1", "ros1"), ("", "cdr")):
        path = written(tmp_path / f"{encoding}.mcap", kinds.ZSTD, profile=profile, encoding=encoding)
        run = nmm.read_bag(path, wheeled(tmp_path))
        assert len(run) == 100
        assert not run.warnings


def test_folders_whose_metadata_was_never_written(tmp_path: Path) -> None:
    robot = wheeled(tmp_path)
    sent = [
        one for t in STEPS for one in (driven(t), (t, "/joint_states", joints(t, {"j1": 0.1, "j2": 0.2})))
    ]
    for mcap in (False, True):
        folder = bag(tmp_path, sent, mcap)
        (folder / "metadata.yaml").unlink()
        run = nmm.read_bag(folder, robot)
        assert len(run) == 100
        assert the(run, "bag_cut").values["mend"] == f"ros2 bag reindex {folder.name}"
    (file,) = folder.glob("*.mcap")
    file.write_bytes(file.read_bytes()[:-40])
    assert len(nmm.read_bag(folder, robot)) == 100
    file.unlink()
    with pytest.raises(InputError, match="ros2 bag reindex"):
        nmm.read_bag(folder, robot)


def test_compare_takes_topics_and_frames(tmp_path: Path, monkeypatch: Any, capsys: Any) -> None:
    monkeypatch.chdir(tmp_path)
    settings = {"duration": 0.3, "dt": 0.01, "method": "zoh"}
    run = nmm.Scenario.load("unicycle_2r_position", settings).run()
    run.save("run", figures=False)
    sent: list[Sent] = []
    for t, q in zip(run.t, run.q, strict=True):
        place = transform(10 + t, "world", "r1_base_footprint", q[:2], q[2])
        state = joints(10 + t, {"q1": q[3], "q2": q[4]}, [0, 0])
        sent += [(10 + t, "/tf", tf(place)), (10 + t, "/r1/arm/joints", state)]
    folder = bag(tmp_path, sent)
    shutil.move(folder, "log")
    asked = ["--namespace", "r1", "--joints", "arm/joints", "--map", "world", "--prefix", "r1_"]
    assert status_of(["compare", "run", "log", *asked, "--out", "both"]) == 0
    heard = capsys.readouterr()
    assert heard.err.splitlines() == [
        "warning: log: q1 and q2 are all 0 while q moves: differences of q are taken"
    ]
    found = nmm.Trajectory.load("both/log")
    np.testing.assert_allclose(found.q, run.q, atol=1e-9)
    assert [one.code for one in found.findings] == ["rates_contradict"]
    assert status_of(["compare", "run", "log", "--out", "both"]) == 2
    assert "/r1/arm/joints" in capsys.readouterr().err
    assert status_of(["compare", "unicycle_2r_position", "--namespace", "r1"]) == 2
    assert "--namespace" in capsys.readouterr().err


WORDS = [
    (
        "bag_cut",
        {"file": "a.mcap", "reason": "it lacks its end", "mend": "mcap recover a.mcap"},
        {},
        "a.mcap is read as far as it goes (it lacks its end); to mend it: mcap recover a.mcap",
    ),
    (
        "stamps_of_recording",
        {"topic": "/odom", "why": "zero"},
        {},
        "/odom has stamps of 0: it goes by the times of recording",
    ),
    ("stamps_missing", {"topic": "/odom", "count": 1}, {}, "1 message of /odom without a stamp left out"),
    (
        "pose_jumps",
        {"edge": "map → odom", "count": 2, "m": 0.5, "rad": 0.25},
        {"t": 3.0},
        "map → odom jumps 2 times, by up to 0.5 m and 0.25 rad, first at t = 3 s: it stays until then, and "
        "no input is made of it",
    ),
    (
        "parents_differ",
        {"frame": "base", "parents": "map and odom", "edge": "map → base"},
        {},
        "base has several parents in TF: map and odom; read is map → base",
    ),
    (
        "rates_contradict",
        {"names": ["q1"], "zero": False},
        {},
        "q1 contradicts q: differences of q are taken",
    ),
    (
        "rates_contradict",
        {"names": ["q1", "q2"], "zero": True},
        {},
        "q1 and q2 are all 0 while q moves: differences of q are taken",
    ),
    (
        "joint_silent",
        {"name": "q1"},
        {"t": 1.0, "last": 9.0},
        "q1 comes no more after t = 1 s: it stays where it was until 9 s",
    ),
    ("values_not_finite", {"name": "q1", "count": 5}, {}, "q1 is no number in 5 messages, left out"),
    (
        "looks_lost",
        {"topic": "/tf", "count": 1},
        {},
        "1 message of /tf without a pose left out: numbers that are none, or a quaternion of zeros",
    ),
    (
        "child_unnamed",
        {"topic": "/odom"},
        {},
        "/odom does not say whose pose it is: taken for the reference point's",
    ),
    (
        "platform_silent",
        {},
        {"t": 1.0, "end": 3.0},
        "no pose of the platform from t = 1 to 3 s: a straight line in between",
    ),
    (
        "platform_unknown",
        {"s": 2.0},
        {},
        "2 s of joint states, in which the platform's pose is not known, are left out",
    ),
    (
        "actions_beyond",
        {"times": 2.0},
        {},
        "actions ask for up to 2 times the velocity measured of the platform: q and u are of what was "
        "measured",
    ),
    (
        "wheels_too_fast",
        {"times": 9.9},
        {},
        "velocities of the platform ask wheels for 9.9 times their limits: another unit?",
    ),
    (
        "velocity_impossible",
        {"share": 0.6, "platform": "DifferentialDrive"},
        {},
        "60% of a velocity is one that DifferentialDrive cannot have: another robot's data, or another unit?",
    ),
    (
        "joints_outside",
        {"names": ["q1"], "most": 1.5},
        {},
        "q1 is outside its limits by up to 1.5: another unit, or another zero?",
    ),
]


@pytest.mark.parametrize(("code", "values", "where", "sentence"), WORDS)
def test_what_a_log_s_findings_say(code: str, values: Any, where: Any, sentence: str) -> None:
    assert str(nmm.Finding(code, values, where)) == sentence
    assert {one for one, *_ in WORDS} == bag_words.WORDS.keys()
