"""Transforms are read from a TFMessage's bytes as rosbags reads them, and placed as one by one."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("rosbags")

from command_line import refused
from robot_logs import STORE, bag, joints, tf, transform, wheeled
from rosbags import rosbag2

import nmm
from nmm.base.errors import InputError
from nmm.plugins.robot.ros.frames import Tree
from nmm.plugins.robot.ros.reading import placement, placements
from nmm.plugins.robot.ros.transforms import told_in, told_in_cdr

KIND = "tf2_msgs/msg/TFMessage"
NAMES = ("", "a", "map", "odom", "/tf", "base_link", "robot1/gelenk_ä", "x" * 300)


def message(rng: np.random.Generator, count: int) -> Any:
    """Transforms with names of several lengths, so that what follows them is aligned in several ways."""
    made = []
    for _ in range(count):
        frame, child = rng.choice(NAMES, 2).tolist()
        one = transform(float(rng.uniform(0.0, 2e9)), frame, child, rng.normal(size=3))
        turn = rng.normal(size=4)
        turn /= np.linalg.norm(turn)
        one.transform.rotation = STORE.types["geometry_msgs/msg/Quaternion"](*turn.tolist())
        made.append(one)
    return tf(*made)


def written(some: Any, little: bool = True) -> bytes:
    return bytes(STORE.serialize_cdr(some, KIND, little_endian=little))


@pytest.mark.parametrize("little", [True, False])
@pytest.mark.parametrize("count", [0, 1, 2, 7, 40])
def test_bytes_tell_what_rosbags_reads_in_them(count: int, little: bool) -> None:
    rng = np.random.default_rng(count)
    for _ in range(20):
        data = written(message(rng, count), little)
        read = [*told_in(STORE.deserialize_cdr(data, KIND))]
        told = told_in_cdr(data)
        assert told == read
        assert len(told) == count


def refuses(read: Any) -> bool:
    try:
        read()
    except ValueError:
        return True
    except Exception as error:
        return type(error).__name__ == "SerdeError"
    return False


def test_bytes_that_rosbags_refuses_are_refused() -> None:
    data = written(message(np.random.default_rng(0), 2))
    others = [data[:size] for size in range(len(data))]
    others += [data + b"\0" * size for size in range(9)]
    others += [data[:k] + bytes([value]) + data[k + 1 :] for k in range(24) for value in (0, 1, 7, 255)]
    refused = 0
    for some in others:
        expected = refuses(lambda some=some: STORE.deserialize_cdr(some, KIND))
        assert refuses(lambda some=some: told_in_cdr(some)) == expected, some[:24]
        refused += expected
    assert 0 < refused < len(others)


def damaged(folder: Path, change: Callable[[bytes], bytes], mcap: bool) -> Path:
    """A bag of which the bytes of one TFMessage are others than written, and nothing else."""
    path = folder / "drive"
    plugin = rosbag2.StoragePlugin.MCAP if mcap else rosbag2.StoragePlugin.SQLITE3
    with rosbag2.Writer(path, version=9, storage_plugin=plugin) as out:
        kinds = {"/joint_states": "sensor_msgs/msg/JointState", "/tf": KIND}
        topics = {name: out.add_connection(name, kind, typestore=STORE) for name, kind in kinds.items()}
        for k in range(5):
            t = 1.7e9 + 0.1 * k
            sent = {
                "/joint_states": joints(t, {"j1": 0.0, "j2": 0.0}),
                "/tf": tf(transform(t, "odom", "base_link", (0.1 * k, 0.0))),
            }
            for name, one in sent.items():
                data = bytes(STORE.serialize_cdr(one, kinds[name]))
                data = change(data) if name == "/tf" and k == 3 else data
                out.write(topics[name], round(1e9 * t), data)
    return path


@pytest.mark.parametrize("streamed", [True, False])
@pytest.mark.parametrize("mcap", [True, False])
@pytest.mark.parametrize(
    ("change", "told"),
    [
        (lambda data: data[:40], "a name without its end"),
        (lambda data: data[:-9], "a message ends within its transforms"),
        (lambda data: data[:3], "a message ends within its transforms"),
        (lambda data: b"\0\x07" + data[2:], "its encoding is 00 07, not plain CDR"),
        (lambda data: data.replace(b"odom", b"od\xff\xfe"), "'utf-8' codec can't decode byte 0xff"),
    ],
)
def test_bytes_that_are_no_transforms_are_refused_by_file_and_topic(
    change: Callable[[bytes], bytes],
    told: str,
    mcap: bool,
    streamed: bool,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    robot = wheeled(tmp_path)
    file = damaged(tmp_path, change, mcap)
    if streamed:
        (file / "metadata.yaml").unlink()
    with pytest.raises(InputError) as caught:
        nmm.read_bag(file, robot)
    text = str(caught.value)
    assert text.startswith(str(file))
    assert f"is no bag of ROS, or a damaged one (/tf: {told}" in text
    urdf = next(tmp_path.glob("*.urdf"))
    result = refused(capsys, "calibrate", str(urdf), str(file))
    assert result.status != 0
    assert f"(/tf: {told}" in result.err
    assert "Traceback" not in result.err


def test_many_poses_are_those_of_one_each() -> None:
    some = message(np.random.default_rng(3), 50).transforms
    rows = np.array([numbers for *_, numbers in told_in(tf(*some))])
    expected = np.array([placement(one) for one in some])
    np.testing.assert_allclose(placements(rows, "here"), expected, rtol=0.0, atol=1e-15)
    for column, value, told in ((5, 0.2, "a quaternion of length 1"), (1, 2e9, "at most 1e+09 m"),
                                (0, np.nan, "finite"), (6, np.inf, "finite")):  # fmt: skip
        bad = rows.copy()
        bad[7, column] = value
        with pytest.raises(InputError, match=r"here: (orientation|position)") as caught:
            placements(bad, "here")
        assert told in str(caught.value)


def test_a_frame_with_a_slash_before_it_is_the_same() -> None:
    tree = Tree()
    for k, frame in enumerate(("map", "/map", "map")):
        tree.add(tf(transform(float(k), frame, "base", (float(k), 0.0))), "/tf", False, k)
    tree.place()
    (edge,) = tree.edges.values()
    assert (edge.parent, edge.child) == ("map", "base")
    times, poses = edge.poses
    np.testing.assert_array_equal(times, [0, 1_000_000_000, 2_000_000_000])
    np.testing.assert_array_equal(poses[:, 0, 3], [0.0, 1.0, 2.0])


def test_a_transform_that_nobody_filled_is_refused_by_name(tmp_path: Path) -> None:
    robot = wheeled(tmp_path)
    empty = transform(1.0, "odom", "base_link", (0.0, 0.0))
    empty.transform.rotation = STORE.types["geometry_msgs/msg/Quaternion"](0.0, 0.0, 0.0, 0.0)
    sent = [(1.0, "/tf", tf(empty)), (1.0, "/joint_states", joints(1.0, {"j1": 0.0, "j2": 0.0}))]
    with pytest.raises(InputError, match="odom → base_link: orientation: expected a quaternion of length 1"):
        nmm.read_bag(bag(tmp_path, sent), robot)


def test_a_transform_of_many_that_tells_nothing_is_left_out(tmp_path: Path) -> None:
    robot, sent = wheeled(tmp_path), []
    for k in range(21):
        t = 1.7e9 + 0.1 * k
        one = transform(t, "odom", "base_link", (0.1 * k, 0.0))
        if k in (0, 7):
            one.transform.translation.x = np.nan
        sent += [(t, "/tf", tf(one)), (t, "/joint_states", joints(t, {"j1": 0.0, "j2": 0.0}))]
    with pytest.warns(RuntimeWarning, match="2 messages of odom → base_link without a pose left out"):
        run = nmm.read_bag(bag(tmp_path, sent), robot)
    np.testing.assert_allclose(run.q[:, 0], 0.1 * np.arange(1, 21), atol=1e-9)


def test_a_quaternion_that_a_last_bit_decides_hides_no_other() -> None:
    rows = np.tile([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0], (3, 1))
    rows[0, 3:] = [
        float.fromhex(x)
        for x in (
            "-0x1.da7c4580016eap-2",
            "-0x1.626c6c38a0d15p-1",
            "-0x1.7faf40fe886c5p-2",
            "0x1.a35b3b3549b3dp-2",
        )
    ]
    placements(rows, "here")
    rows[2, 6] = np.nan
    with pytest.raises(InputError, match="finite"):
        placements(rows, "here")
