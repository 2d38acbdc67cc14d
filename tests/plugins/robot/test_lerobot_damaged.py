"""Data sets that are damaged, or claim more than they hold: one line with the file and the key, and no more."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from planar_arms import planar_arm

pa = pytest.importorskip("pyarrow")
pq = pytest.importorskip("pyarrow.parquet")
from lerobot_sets import changed, column, lerobot_set, lists  # noqa: E402

import nmm  # noqa: E402
from nmm.base.errors import InputError  # noqa: E402
from nmm.plugins.robot.lerobot import stored  # noqa: E402
from nmm.plugins.robot.lerobot.layout import data_file  # noqa: E402

NAMES = ("q1.pos", "q2.pos")
DATA, EPISODES = "data/chunk-000/file-000.parquet", "meta/episodes/chunk-000/file-000.parquet"
FILES = ("meta/info.json", "meta/tasks.parquet", EPISODES, DATA)


def made(folder: Path) -> Path:
    rng = np.random.default_rng(0)
    return lerobot_set(folder / "set", [rng.uniform(-1, 1, (k, 2)) for k in (5, 7)], names=NAMES)


def refusal(folder: Path) -> str:
    arm = planar_arm(folder.parent, 0.5, 0.4)
    with pytest.raises(InputError) as caught:
        nmm.read_lerobot(folder, arm, units={"*": "deg"})
    assert len(str(caught.value)) <= 300
    return str(caught.value)


@pytest.mark.parametrize("name", FILES)
@pytest.mark.parametrize("damage", ["missing", "empty", "cut", "other bytes", "folder", "pipe"])
def test_a_file_that_is_damaged_or_missing_is_named(name: str, damage: str, tmp_path: Path) -> None:
    file = made(tmp_path) / name
    content = file.read_bytes()
    file.unlink()
    if damage == "folder":
        file.mkdir()
    elif damage == "pipe":
        os.mkfifo(file)
    elif damage != "missing":
        half = len(content) // 2
        others = {
            "empty": b"",
            "cut": content[:half],
            "other bytes": content[:4] + b"\xff" * half + content[-8:],
        }
        file.write_bytes(others[damage])
    said = refusal(tmp_path / "set")
    assert Path(name).name in said
    if damage == "missing":
        assert "missing" in said


@pytest.mark.parametrize("name", FILES)
def test_bytes_that_changed_are_read_or_refused(name: str, tmp_path: Path) -> None:
    """Any byte of a file another one: the motion, or one line."""
    place, arm = made(tmp_path), planar_arm(tmp_path, 0.5, 0.4)
    file = place / name
    content = file.read_bytes()
    rng = np.random.default_rng(1)
    for k in rng.integers(len(content), size=60).tolist():
        file.write_bytes(content[:k] + bytes([content[k] ^ int(rng.integers(1, 256))]) + content[k + 1 :])
        try:
            read = nmm.read_lerobot(place, arm, units={"*": "deg"})
        except InputError:
            continue
        assert all(np.isfinite(episode.q).all() for episode in read)


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ({"codebase_version": "v2.1"}, "codebase_version: expected v3.0; LeRobot's convert_dataset_v21_to_v30 converts it, got 'v2.1'"),
        ({"codebase_version": None}, "codebase_version"),
        ({"codebase_version": "v4.0"}, "codebase_version: expected v3.0, got 'v4.0'"),
        ({"fps": 0}, "fps"),
        ({"fps": "thirty"}, "fps"),
        ({"fps": None}, "fps"),
        ({"fps": float("inf")}, "fps"),
        ({"fps": float("nan")}, "fps"),
        ({"fps": 10_001}, "fps: input should be less than or equal to 10000, got 10001"),
        ({"total_frames": 10**9}, "total_frames: expected 12, as meta/episodes has, got 1000000000"),
        ({"total_episodes": 10**9}, "total_episodes: expected 2, as meta/episodes has, got 1000000000"),
        ({"total_frames": -1}, "total_frames"),
        ({"features": None}, "features"),
        ({"features": {}}, "features.observation.state: expected names of what was observed"),
        ({"features": {"observation.state": {"dtype": "float32"}}}, "features.observation.state.shape"),
        ({"features": {"observation.state": {"dtype": "float32", "shape": [2], "names": None}}}, "features.observation.state.names: expected 2 names"),
        ({"features": {"observation.state": {"dtype": "float32", "shape": [3], "names": ["a", "b"]}}}, "features.observation.state.names: expected 3 names"),
        ({"features": {"observation.state": {"dtype": "float32", "shape": [2], "names": ["a", "a"]}}}, "names: expected 2 names that differ"),
        ({"features": {"observation.state": {"dtype": "float32", "shape": [10**9], "names": list(NAMES)}}}, "features.observation.state.shape"),
        ({"features": {"observation.state": {"dtype": "float32", "shape": [2, 2], "names": list(NAMES)}}}, "features.observation.state.shape"),
        ({"features": {"observation.state": {"dtype": "float32", "shape": [2], "names": list(NAMES), "units": ["rad"]}}}, "features.observation.state.units: expected 2 units"),
        ({"data_path": "../{chunk_index}.parquet"}, "data_path: expected a file in this folder"),
        ({"data_path": "/etc/passwd"}, "data_path: expected a file in this folder"),
        ({"data_path": "data/{chunk_index.__class__}"}, "data_path: expected a file in this folder"),
        ({"data_path": "data/{chunk_index:0999999999d}"}, "data_path: expected a file in this folder"),
        ({"data_path": "{0}"}, "data_path"),
        ({"data_path": ""}, "data_path"),
        ({"data_path": "data/chunk-{chunk_index:03d}/another.parquet"}, "another.parquet: this file is missing"),
    ],
)  # fmt: skip
def test_what_info_says_is_checked(values: dict[str, object], said: str, tmp_path: Path) -> None:
    place = made(tmp_path)
    changed(place, **values)
    assert said in refusal(place)
    assert "info.json" in refusal(place) or "another" in said


@pytest.mark.parametrize(
    ("file", "name", "values", "said"),
    [
        (EPISODES, "length", None, "length: this column is missing"),
        (EPISODES, "length", [5, 10**12], "total_frames"),
        (EPISODES, "length", [5, 0], "length: expected at least one frame"),
        (EPISODES, "length", [5, -7], "length: expected numbers from 0"),
        (EPISODES, "length", [5.0, 7.0], "length: expected whole numbers, got 'double'"),
        (EPISODES, "length", [5, None], "length: expected whole numbers"),
        (EPISODES, "length", [6, 6], "episode 0: expected 6 frames, as meta/episodes has, got 5"),
        (EPISODES, "episode_index", [0, 0], "episode_index: expected each episode once"),
        (EPISODES, "data/file_index", [0, 3], "file-003.parquet: this file is missing"),
        (EPISODES, "data/chunk_index", [0, 2**62], "this file is missing"),
        ("meta/tasks.parquet", "task_index", None, "task_index: this column is missing"),
        ("meta/tasks.parquet", "task_index", ["one"], "task_index: expected whole numbers"),
        (DATA, "observation.state", None, "observation.state: this column is missing"),
        (DATA, "observation.state", lists([np.zeros((12, 3))], 3), "episode 0: observation.state: expected 2 numbers a frame"),
        (DATA, "observation.state", [[1.0, 2.0]] * 11 + [[1.0]], "episode 1: observation.state: expected 2 numbers a frame"),
        (DATA, "observation.state", [[1.0, 2.0]] * 11 + [None], "episode 1: observation.state: expected 2 numbers a frame"),
        (DATA, "observation.state", [["a", "b"]] * 12, "observation.state: expected 2 numbers a frame"),
        (DATA, "observation.state", [1.0] * 12, "observation.state: expected 2 numbers a frame, got 'double'"),
        (DATA, "timestamp", [np.nan] * 12, "episode 0: timestamp: expected finite numbers"),
        (DATA, "timestamp", [1.0] * 12, "episode 0: timestamp: expected numbers that increase"),
        (DATA, "frame_index", [1] * 12, "episode 0: frame_index: expected 0, 1, 2"),
        (DATA, "frame_index", None, "frame_index: this column is missing"),
        (DATA, "episode_index", [0] * 12, "episode 0: expected 5 frames, as meta/episodes has, got 12"),
    ],
)  # fmt: skip
def test_tables_that_contradict_are_refused(
    file: str, name: str, values: object, said: str, tmp_path: Path
) -> None:
    place = made(tmp_path)
    column(
        place / file,
        name,
        None if values is None else values if isinstance(values, pa.Array) else pa.array(values),
    )
    found = refusal(place)
    assert said in found
    assert Path(file).name in found or "total_frames" in said or "file is missing" in said


def test_a_small_file_of_many_rows_is_refused_before_it_is_read(tmp_path: Path) -> None:
    """Runs of one number take no room in a file: 20 million rows are 100 kB."""
    place = made(tmp_path)
    count = 20_000_000
    same = pa.DictionaryArray.from_arrays(pa.array(np.zeros(count, np.int8)), pa.array([0]))
    names = ("episode_index", "frame_index", "timestamp", "observation.state", "action")
    pq.write_table(pa.table(dict.fromkeys(names, same)), place / DATA)
    assert (place / DATA).stat().st_size < 1_000_000
    del same
    pool = pa.default_memory_pool()
    before, most = pool.bytes_allocated(), pool.max_memory()
    said = refusal(place)
    assert pool.max_memory() == most or pool.max_memory() - before < 50_000_000
    assert re.search(r"file-000.parquet: expected at most [\d,]+ rows, got 20000000", said)


def test_columns_that_claim_gigabytes_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    place = made(tmp_path)
    monkeypatch.setattr(stored, "MOST_BYTES", 100)
    assert "expected at most" in refusal(place)


def test_a_list_that_is_long_is_refused_before_it_is_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A run of one number takes no room in a list, either; there are no more rows than usual."""
    place, count = made(tmp_path), 1_000_000
    numbers = pa.DictionaryArray.from_arrays(pa.array(np.zeros(count, np.int8)), pa.array([0.5]))
    ends = pa.array([*range(0, 24, 2), count], pa.int32())
    column(place / DATA, "observation.state", pa.ListArray.from_arrays(ends, numbers))
    assert (place / DATA).stat().st_size < 10_000
    monkeypatch.setattr(stored, "MOST_BYTES", 8 * count)
    assert re.search(r"file-000.parquet: expected at most 0.008 GB of 5 columns, got 8[\d,]+", refusal(place))


def test_a_folder_that_is_no_data_set_is_called_so(tmp_path: Path) -> None:
    assert "nowhere: is no data set of LeRobot's: meta/info.json is missing" in refusal(tmp_path / "nowhere")
    assert "is no name of a file" in refusal(tmp_path / "a\0b")


def test_data_sets_of_older_recorders_are_read(tmp_path: Path) -> None:
    """Names in a mapping, links to files elsewhere, as a hub's cache has them, frames in another order."""
    place, arm = made(tmp_path), planar_arm(tmp_path, 0.5, 0.4)
    (usual,) = nmm.read_lerobot(place, arm, units={"*": "deg"}, episodes=1)
    info = json.loads((place / "meta" / "info.json").read_text())
    info["features"]["observation.state"]["names"] = {"motors": list(NAMES)}
    info["features"]["observation.images.front"] = {
        "dtype": "video",
        "shape": [480, 640, 3],
        "names": ["h", "w", "c"],
        "info": {"video.fps": 30},
    }
    (place / "meta" / "info.json").write_text(json.dumps(info))
    table = pq.read_table(place / DATA, partitioning=None)
    pq.write_table(table.take(np.random.default_rng(0).permutation(12)), tmp_path / "blob")
    (place / DATA).unlink()
    (place / DATA).symlink_to(tmp_path / "blob")
    (read,) = nmm.read_lerobot(place, arm, units={"*": "deg"}, episodes=1)
    assert np.array_equal(read.q, usual.q)


@pytest.mark.parametrize(
    ("template", "expected"),
    [
        ("data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet", "data/chunk-002/file-1234.parquet"),
        ("data/{chunk_index}-{file_index:05d}.parquet", "data/2-01234.parquet"),
    ],
)
def test_templates_are_filled_in(template: str, expected: str) -> None:
    assert data_file(template, 2, 1234, "here") == Path(expected)


def test_stamps_that_go_back_by_a_frame_are_not_even(tmp_path: Path) -> None:
    """2000 frames a second: they are nearer to one another than stamps of 30 may be to their times."""
    place = made(tmp_path)
    changed(place, fps=2000)
    counts = np.array([*range(5), 0, 1, 3, 2, 4, 5, 6])
    column(place / DATA, "timestamp", pa.array(counts / 2000))
    assert "episode 1: timestamp: expected numbers that increase" in refusal(place)


def test_stamps_of_32_bits_are_even_late_in_a_fast_episode(tmp_path: Path) -> None:
    """After five minutes at 10,000 frames a second, those that are cut are a third of a frame too early."""
    count = 3_000_000
    place = lerobot_set(tmp_path / "set", [np.zeros((count, 1))], names=NAMES[:1], fps=10_000)
    even = np.arange(count) / 10_000
    stamps = even.astype(np.float32)
    stamps = np.where(stamps > even, np.nextafter(stamps, np.float32(0)), stamps)
    assert np.abs(stamps - even).max() > 0.25 / 10_000
    column(place / DATA, "timestamp", pa.array(stamps))
    ((_, frames),) = stored.DataSet(place).frames([0], ["observation.state"])
    assert np.array_equal(frames.t, even)


def test_stamps_that_are_not_even_count_as_they_are(tmp_path: Path) -> None:
    place, arm = made(tmp_path), planar_arm(tmp_path, 0.5, 0.4)
    late: Callable[[int], list[float]] = lambda count: [3.0 + 0.15 * k for k in range(count)]  # noqa: E731
    column(place / DATA, "timestamp", pa.array(late(5) + late(7)))
    for count, read in zip((5, 7), nmm.read_lerobot(place, arm, units={"*": "deg"}), strict=True):
        assert read.t == pytest.approx(0.15 * np.arange(count))
