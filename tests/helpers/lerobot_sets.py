"""Data sets of LeRobot's, v3.0, by pyarrow alone: written as LeRobot does, and read by the format's rules."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

import nmm
from nmm.plugins.robot.ros.bag import as_trajectory

ARM = ("shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll", "gripper")
LEKIWI = (*(f"arm_{name}.pos" for name in ARM), "x.vel", "y.vel", "theta.vel")
COUNTED = ("timestamp", "frame_index", "episode_index", "index", "task_index")


def moved(robot: nmm.Robot, count: int = 20, dt: float = 0.05) -> nmm.Trajectory:
    """A made-up run without a task."""
    rng = np.random.default_rng(0)
    t = dt * np.arange(count)
    q = robot.rest + 0.1 * np.sin(np.outer(t, rng.uniform(1, 3, robot.n)))
    q = np.array([robot.following.placed(row) for row in q])
    u = rng.uniform(-1, 1, (count, robot.n_u))
    return as_trajectory(robot, t, q, u, (), frame=None, label="moved", resolver="bag")


def feature(dtype: str, names: Sequence[str] | None) -> dict[str, Any]:
    return {"dtype": dtype, "shape": [1 if names is None else len(names)], "names": names and list(names)}


def lerobot_set(
    folder: Path,
    states: Sequence[Any],
    actions: Sequence[Any] | None = None,
    names: Sequence[str] = LEKIWI,
    fps: int = 10,
    action_names: Sequence[str] | None = None,
) -> Path:
    """Episodes of states (N, k) and actions (N, k), without units, as LeRobot records them."""
    actions = states if actions is None else actions
    action_names = names if action_names is None else action_names
    features = {"action": feature("float32", action_names), "observation.state": feature("float32", names)}
    features |= {name: feature("float32" if name == "timestamp" else "int64", None) for name in COUNTED}
    lengths = [len(rows) for rows in states]
    counts = np.concatenate([np.arange(length) for length in lengths])
    columns = {
        "action": lists(actions, len(action_names)),
        "observation.state": lists(states, len(names)),
        "timestamp": pa.array(counts / fps, pa.float32()),
        "frame_index": pa.array(counts),
        "episode_index": pa.array(np.repeat(np.arange(len(lengths)), lengths)),
        "index": pa.array(np.arange(sum(lengths))),
        "task_index": pa.array(np.zeros(sum(lengths), np.int64)),
    }
    ends = np.cumsum(lengths)
    episodes = {
        "episode_index": np.arange(len(lengths)),
        "tasks": [["drive"]] * len(lengths),
        "length": lengths,
        "data/chunk_index": [0] * len(lengths),
        "data/file_index": [0] * len(lengths),
        "dataset_from_index": ends - lengths,
        "dataset_to_index": ends,
    }
    info = {
        "codebase_version": "v3.0", "robot_type": "lekiwi_client", "total_episodes": len(lengths),
        "total_frames": sum(lengths), "total_tasks": 1, "chunks_size": 1000, "data_files_size_in_mb": 100,
        "video_files_size_in_mb": 200, "fps": fps, "splits": {"train": f"0:{len(lengths)}"},
        "data_path": "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet", "video_path": None,
        "features": features,
    }  # fmt: skip
    (folder / "meta" / "episodes" / "chunk-000").mkdir(parents=True)
    (folder / "data" / "chunk-000").mkdir(parents=True)
    (folder / "meta" / "info.json").write_text(json.dumps(info))
    pq.write_table(
        pa.table({"task_index": [0], "__index_level_0__": ["drive"]}), folder / "meta" / "tasks.parquet"
    )
    pq.write_table(pa.table(episodes), folder / "meta" / "episodes" / "chunk-000" / "file-000.parquet")
    pq.write_table(pa.table(columns), folder / "data" / "chunk-000" / "file-000.parquet")
    return folder


def lists(rows: Sequence[Any], width: int) -> pa.Array:
    """Lists of `width` numbers; numbers where that is 1."""
    flat = pa.array(np.concatenate([np.asarray(part, np.float32).ravel() for part in rows]), pa.float32())
    return flat if width == 1 else pa.FixedSizeListArray.from_arrays(flat, width)


def changed(folder: Path, **values: Any) -> None:
    """Other values in info.json; None takes a key away."""
    file = folder / "meta" / "info.json"
    info = json.loads(file.read_text()) | values
    file.write_text(json.dumps({key: value for key, value in info.items() if value is not None}))


def column(file: Path, name: str, values: Any) -> None:
    """Another column in a file of Parquet; None takes it away."""
    table = pq.read_table(file, partitioning=None)
    i = table.schema.get_field_index(name)
    table = table.remove_column(i)
    pq.write_table(table if values is None else table.add_column(i, name, values), file)


class Checked:
    """A data set that keeps the rules of v3.0, which its files are held against.

    info, stats, tasks, episodes, frames : of all files
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.info = json.loads((folder / "meta" / "info.json").read_text("utf-8"))
        self.stats = json.loads((folder / "meta" / "stats.json").read_text("utf-8"))
        self.tasks = pq.read_table(folder / "meta" / "tasks.parquet")
        self.episodes = self._joined("meta/episodes")
        self.frames = self._joined("data")
        self._check_counts()
        self._check_features()
        self._check_episodes()

    def _joined(self, part: str) -> pa.Table:
        files = sorted((self.folder / part).glob("*/*.parquet"))
        return pa.concat_tables([pq.read_table(file, partitioning=None) for file in files])

    def rows(self, name: str) -> np.ndarray:
        """A feature's numbers (N,), or (N, k)."""
        values = self.frames.column(name).combine_chunks()
        lists = pa.types.is_fixed_size_list(values.type)
        return values.flatten().to_numpy().reshape(len(values), -1) if lists else values.to_numpy()

    def _check_counts(self) -> None:
        info = self.info
        assert info["codebase_version"] == "v3.0"
        assert info["total_episodes"] == len(self.episodes)
        assert info["total_frames"] == len(self.frames)
        assert info["total_tasks"] == len(self.tasks)
        assert info["splits"] == {"train": f"0:{len(self.episodes)}"}
        assert np.array_equal(self.rows("index"), np.arange(len(self.frames)))

    def _check_features(self) -> None:
        features = self.info["features"]
        assert {*features} == {*self.frames.column_names} == {*self.stats}
        for name, told in features.items():
            kind = self.frames.schema.field(name).type
            (width,) = told["shape"]
            if width > 1:
                assert kind.list_size == width
                kind = kind.value_type
            assert str(kind) == {"float32": "float", "int64": "int64"}[told["dtype"]], name
            assert told["names"] is None or len({*told["names"]}) == width
            rows = self.rows(name).reshape(len(self.frames), -1).astype(np.float64)
            assert np.isfinite(rows).all()
            _check_stats(self.stats[name], rows)

    def _check_episodes(self) -> None:
        words = self.tasks.column("task").to_pylist()
        assert json.loads(self.tasks.schema.metadata[b"pandas"])["index_columns"] == ["task"]
        assert self.tasks.column("task_index").to_pylist() == [*range(len(words))]
        ends = 0
        for k, told in enumerate(self.episodes.to_pylist()):
            assert (told["episode_index"], told["dataset_from_index"]) == (k, ends)
            first, ends = ends, told["dataset_to_index"]
            assert told["length"] == ends - first > 0
            own = slice(first, ends)
            assert np.all(self.rows("episode_index")[own] == k)
            counts = np.arange(told["length"])
            assert np.array_equal(self.rows("frame_index")[own], counts)
            assert np.abs(self.rows("timestamp")[own] - counts / self.info["fps"]).max() < 1e-4
            assert told["tasks"] == [words[index] for index in np.unique(self.rows("task_index")[own])]
            path = self.info["data_path"].format(
                chunk_index=told["data/chunk_index"], file_index=told["data/file_index"]
            )
            assert (
                k in pq.read_table(self.folder / path, partitioning=None).column("episode_index").to_pylist()
            )
            for name in self.info["features"]:
                rows = self.rows(name)[own].reshape(told["length"], -1).astype(np.float64)
                kinds = {
                    key.rpartition("/")[2]: value
                    for key, value in told.items()
                    if key.startswith(f"stats/{name}/")
                }
                _check_stats(kinds, rows)
        assert ends == len(self.frames)


def _check_stats(told: dict[str, list[float]], rows: np.ndarray) -> None:
    """Against the definitions: means by sums, quantiles by what is below and above them."""
    assert told["count"] == [len(rows)]
    scale = np.abs(rows).max(axis=0) + 1e-12
    assert np.array_equal(told["min"], rows.min(axis=0))
    assert np.array_equal(told["max"], rows.max(axis=0))
    mean = rows.sum(axis=0) / len(rows)
    assert np.all(np.abs(np.array(told["mean"]) - mean) < 1e-9 * scale)
    spread = np.sqrt(((rows - mean) ** 2).sum(axis=0) / len(rows))
    assert np.all(np.abs(np.array(told["std"]) - spread) < 1e-6 * scale)
    for share in (1, 10, 50, 90, 99):
        value = np.array(told[f"q{share:02d}"])
        assert np.all((rows < value - 1e-9 * scale).sum(axis=0) <= share / 100 * (len(rows) - 1) + 1)
        assert np.all((rows > value + 1e-9 * scale).sum(axis=0) <= (1 - share / 100) * (len(rows) - 1) + 1)
