"""Logs that claim more than they hold: refused by their sizes, before they fill the memory."""

from __future__ import annotations

import bz2
import io
import math
import os
import sqlite3
import struct
import zipfile
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from robot_logs import FIRST, STORE, bag, joints, odom, tf, transform, wheeled
from rosbags import rosbag1, rosbag2

import nmm
from nmm.base.errors import InputError
from nmm.plugins.robot.ros import chunks
from nmm.views.folders.schema import read_arrays


@pytest.mark.parametrize("kind", ["zstd", "lz4", "bz2"])
def test_chunks_are_decompressed_as_far_as_they_claim(kind: str) -> None:
    data = b"0" * 100_000
    if kind == "bz2":
        packed = bz2.compress(data)
    else:
        packed = pytest.importorskip("lz4.frame" if kind == "lz4" else "backports.zstd").compress(data)
    assert chunks.decompressed(kind, packed, 100_000) == data
    with pytest.raises(InputError):
        chunks.decompressed(kind, packed, 99_999)
    with pytest.raises(ValueError, match="lacks its end"):  # as of other damage
        chunks.decompressed(kind, packed[:-3], 200_000)


def test_claims_are_bounded_before_anything_is_read(tmp_path: Path) -> None:
    file = tmp_path / "a.mcap"
    file.write_bytes(b"0" * 10)
    chunks.check_claims(file, [chunks.MOST_OF_A_CHUNK] * 20)
    with pytest.raises(InputError, match="8 GB"):
        chunks.check_claims(file, [10, 8_000_000_000])
    with pytest.raises(InputError, match="21 GB"):
        chunks.check_claims(file, [chunks.MOST_OF_A_CHUNK] * 21)


def logged(folder: Path, mcap: bool = True) -> Path:
    sent = [(0.1 * k, "/joint_states", joints(0.1 * k, {"j1": 0.1, "j2": 0.2})) for k in range(20)]
    sent += [(0.1 * k, "/odom", odom(0.1 * k, (0.0, 0.0, 0.0))) for k in range(20)]
    return bag(folder, sent, mcap)


@pytest.mark.parametrize("size", [8_000_000_000, 2**63])
@pytest.mark.parametrize("whole", [True, False])
def test_a_chunk_that_claims_gigabytes_is_refused(tmp_path: Path, size: int, whole: bool) -> None:
    folder = logged(tmp_path)
    (file,) = folder.glob("*.mcap")
    with rosbag2.Reader(folder) as log:
        claims = {size for _, sizes in chunks.claims_of(log) for size in sizes}
    assert claims
    content = file.read_bytes()
    for claim in claims:
        # An uncompressed chunk's length has the same bytes; the claim comes first.
        content = content.replace(struct.pack("<Q", claim), struct.pack("<Q", size), -1 if whole else 1)
    file.write_bytes(content if whole else content[:-20])
    with pytest.raises(InputError, match="chunks of at most 1 GB") as error:
        nmm.read_bag(folder if whole else file, wheeled(tmp_path))
    assert len(str(error.value)) <= 300


@pytest.mark.parametrize("name", ["metadata.yaml", "more.mcap", "more.db3"])
def test_pipes_in_a_folder_are_refused(tmp_path: Path, name: str) -> None:
    folder = logged(tmp_path, mcap=name != "more.db3")
    (folder / name).unlink(missing_ok=True)
    os.mkfifo(folder / name)
    with pytest.raises(InputError, match="a device or a pipe"):
        nmm.read_bag(folder, wheeled(tmp_path))


def test_metadata_of_megabytes_is_refused(tmp_path: Path) -> None:
    folder = logged(tmp_path)
    (folder / "metadata.yaml").write_text("#" * (chunks.MOST_OF_METADATA + 1), encoding="utf-8")
    with pytest.raises(InputError, match=r"metadata\.yaml"):
        nmm.read_bag(folder, wheeled(tmp_path))


def test_an_array_whose_header_claims_more_is_refused(tmp_path: Path) -> None:
    """numpy would reserve 8 TB, which Linux may grant, before it reads what is there."""
    made = io.BytesIO()
    np.lib.format.write_array_header_1_0(made, {"descr": "<f8", "fortran_order": False, "shape": (10**12,)})
    with zipfile.ZipFile(tmp_path / "a.npz", "w") as archive:
        archive.writestr("t.npy", made.getvalue() + bytes(80))
    with pytest.raises(InputError, match="its header claims") as error:
        read_arrays(tmp_path / "a.npz")
    assert "t" in str(error.value)


def packed(folder: Path, kind: str) -> Path:
    """A log that is compressed by message, by file, or as ROS 1 does."""
    first = kind in ("bz2", "lz4")
    store = FIRST if first else STORE
    if first:
        log = rosbag1.Writer(folder / "a.bag")
        log.set_compression(getattr(rosbag1.Writer.CompressionFormat, kind.upper()))
    else:
        log = rosbag2.Writer(folder / "a", version=9, storage_plugin=rosbag2.StoragePlugin.SQLITE3)
        log.set_compression(getattr(rosbag2.CompressionMode, kind.upper()), rosbag2.CompressionFormat.ZSTD)
    with log:
        kinds = {"/joint_states": "sensor_msgs/msg/JointState", "/odom": "nav_msgs/msg/Odometry"}
        topics = {name: log.add_connection(name, kind, typestore=store) for name, kind in kinds.items()}
        serialize = store.serialize_ros1 if first else store.serialize_cdr
        for k in range(50):
            t = 0.1 * k
            position = {"j1": 0.1, "j2": 0.01 * k}
            for name, message in (
                ("/joint_states", joints(t, position, store=store)),
                ("/odom", odom(t, (0.0, 0.0, 0.0), store=store)),
            ):
                log.write(topics[name], round(t * 1e9), serialize(message, kinds[name]))
    return log.path


@pytest.mark.parametrize("kind", ["message", "file", "bz2", "lz4"])
def test_what_is_decompressed_in_all_is_bounded(
    tmp_path: Path, kind: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    path, robot = packed(tmp_path, kind), wheeled(tmp_path)
    read = nmm.read_bag(path, robot)
    np.testing.assert_allclose(read.q[-1, -1], 0.49, atol=1e-12)
    monkeypatch.setattr(chunks, "MOST_OF_ALL", 3_000)
    monkeypatch.setattr(chunks, "MOST_TIMES", 0)
    with pytest.raises(InputError, match="decompressed") as error:
        nmm.read_bag(path, robot)
    assert len(str(error.value)) <= 300


def test_messages_are_bounded_by_the_files_bytes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A few bytes, compressed, may say the same message for hours."""
    folder, robot = logged(tmp_path), wheeled(tmp_path)
    monkeypatch.setattr(chunks, "MESSAGES_A_BYTE", 0)
    monkeypatch.setattr(chunks, "FEW_MESSAGES", 40)
    assert len(nmm.read_bag(folder, robot))
    monkeypatch.setattr(chunks, "FEW_MESSAGES", 39)
    with pytest.raises(InputError, match="a message a byte"):
        nmm.read_bag(folder, robot)


def test_a_file_is_decompressed_as_far_as_the_disk_has_room(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path, robot = packed(tmp_path, "file"), wheeled(tmp_path)
    monkeypatch.setattr(chunks, "SHARE_OF_DISK", 0.0)
    with pytest.raises(InputError, match="decompressed"):
        nmm.read_bag(path, robot)


@pytest.mark.parametrize(
    "change",
    [
        "ALTER TABLE messages RENAME TO m; CREATE VIEW messages AS WITH RECURSIVE n(i) AS "
        "(VALUES (1) UNION ALL SELECT i + 1 FROM n) SELECT m.id, topic_id, timestamp, data FROM m, n",
        "ALTER TABLE messages ADD COLUMN more AS (zeroblob(1000000000))",
        "CREATE VIRTUAL TABLE more USING dbstat",
    ],
    ids=["view", "computed column", "virtual table"],
)
def test_rows_that_are_computed_are_refused(tmp_path: Path, change: str) -> None:
    """They may be without end, and fill no file."""
    folder, robot = logged(tmp_path, mcap=False), wheeled(tmp_path)
    assert len(nmm.read_bag(folder, robot))
    (file,) = folder.glob("*.db3")
    with closing(sqlite3.connect(file)) as database:
        try:
            database.executescript(change)
        except sqlite3.OperationalError as error:
            pytest.skip(f"this sqlite cannot write it: {error}")
    with pytest.raises(InputError, match="computed"):
        nmm.read_bag(folder, robot)


@pytest.mark.parametrize("value", [1e308, -1e20, math.inf])
@pytest.mark.parametrize("what", ["pose", "twist", "transform", "joint"])
@pytest.mark.filterwarnings("error:overflow", "error:invalid value")
def test_numbers_that_no_robot_reaches_are_refused(tmp_path: Path, what: str, value: float) -> None:
    """A joint's is left out, as those are that are no number."""
    robot, sent = wheeled(tmp_path), list[Any]()
    for k in range(20):
        t = 0.1 * k
        x = {what: value} if k == 10 else {}
        sent.append((t, "/joint_states", joints(t, {"j1": x.get("joint", 0.1), "j2": 0.2})))
        sent.append(
            (t, "/odom", odom(t, (x.get("pose", 0.0), 0.0, 0.0), (x.get("twist", 0.0), 0, 0, 0, 0, 0)))
        )
        sent.append((t, "/tf", tf(transform(t, "odom", "base_link", (x.get("transform", 0.0), 0.0, 0.0)))))
    if what == "joint":
        with pytest.warns(RuntimeWarning, match="left out"):
            assert np.abs(nmm.read_bag(bag(tmp_path, sent), robot).q).max() < 1.0
        return
    with pytest.raises(InputError, match=r"expected (at most 1e\+09|finite numbers)"):
        nmm.read_bag(bag(tmp_path, sent), robot)
