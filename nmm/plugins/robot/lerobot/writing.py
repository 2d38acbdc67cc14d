"""Runs written as a data set of LeRobot's, an episode a run."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from nmm.base.arrays import Array, counted
from nmm.base.errors import InputError, expect, one_or_several
from nmm.motion.trajectory import Trajectory
from nmm.plugins.robot.lerobot import layout
from nmm.plugins.robot.lerobot.frames import check_same, features_of, frames_of
from nmm.plugins.robot.lerobot.layout import COUNTED, FASTEST, Feature, arrow, is_data_set, parquet, places
from nmm.plugins.robot.lerobot.stats import statistics
from nmm.plugins.robot.lerobot.videos import EpisodeVideos
from nmm.views.folders.whole import check_folder, replaced_folder

#: What a task may be as long as, characters.
LONGEST = 10_000


def write_lerobot(
    runs: Trajectory | Iterable[Trajectory],
    folder: str | Path,
    *,
    task: str | Sequence[str] | None = None,
    fps: int = 30,
    video: str | Sequence[str] = (),
    size: tuple[int, int] = (640, 480),
) -> Path:
    """Write runs of one robot as a data set of LeRobot's, v3.0, an episode a run (docs/data_sets.md).

    A frame has `observation.state`, q, by names such as "x.pos" and "q1.pos"; `action`, the inputs u, "v.vel"
    and "q1.vel"; where the runs' task wants a point of the robot, that point, as
    `observation.environment_state`; and LeRobot's timestamp, frame_index, episode_index, index, task_index.
    Units are SI; meta/info.json states each beside its name (`units`). Joints are coordinates, with the
    robot's corrections, not what encoders read (`robot.reading`). Pictures, where they are wanted, are drawn
    by Chromium without a window: `observation.images.iso` and so on, a video of each episode.

    Parameters
    ----------
    runs : one or several; any iterable. Of each only its frames stay in memory, for what is told of all
    folder : new, empty or a data set that this wrote and nobody changed; it appears whole or not at all
    task : what is done, in words, of all runs or of each; the title of each run's scenario when not given
    fps : frames a second, no more than the runs have samples. q is linear between samples
    video : the side from which each frame is seen, or several: iso, top, front, wall; none unless given
    size : of a picture, width and height, px, even numbers

    Raises
    ------
    InputError : no run; runs of several robots; one that is shorter than two frames, has fewer samples than
        frames, a gap, or a number that is not finite; a folder with something else; no such side or size.
        None of it is written then
    RunError : pictures are wanted, and there is no Chromium, or no ffmpeg

    Examples
    --------
    >>> scenario = nmm.Scenario.load("unicycle_2r_position", {"duration": 0.5})
    >>> folder = nmm.write_lerobot([scenario.run()], "circles", task="follow the circle", fps=20)
    >>> nmm.read_lerobot(folder, scenario.robot())[0].t[-1]
    np.float64(0.5)
    """
    rate = counted(fps, "fps")
    expect(rate <= FASTEST, "fps", f"at most {FASTEST}", fps)
    arrow(), parquet()
    check_folder(Path(folder), is_untouched)
    several = (runs,) if isinstance(runs, Trajectory) else runs
    if video:
        EpisodeVideos(Path(folder), rate, video, size)  # before anything is written
    with replaced_folder(folder, is_untouched) as temporary:
        seen = EpisodeVideos(temporary, rate, video, size) if video else None
        _DataSet(temporary, rate, seen).write(_named(several, task))
    return Path(folder)


def is_untouched(folder: Path) -> bool:
    """Whether all files are those that nmm wrote, by their sizes."""
    own = layout.told_by_nmm(folder)
    return own is not None and own.files == _sizes(folder)


def _sizes(folder: Path) -> dict[str, int]:
    """Bytes of all files but nmm's own, by their place in the folder; links are none of nmm's."""
    files = [path for path in folder.rglob("*") if path.is_symlink() or not path.is_dir()]
    sizes = {path.relative_to(folder).as_posix(): path.lstat().st_size for path in files}
    sizes.pop(is_data_set.file, None)
    return sizes


def _named(
    runs: Iterable[Trajectory], task: str | Sequence[str] | None
) -> Iterator[tuple[str, Trajectory, str]]:
    """Each run with what errors call it, and its task."""
    words_of = () if task is None else one_or_several(task, str, "task", "words, or words for each run")
    each = None if task is None or isinstance(task, str) else words_of
    count = 0
    for k, run in enumerate(runs):
        where = f"runs[{k}]"
        if not isinstance(run, Trajectory):
            raise InputError(where=where, expected="a run (a Trajectory)", got=run)
        where += f" ({run.called})"
        if each is None:
            words = words_of[0] if words_of else _title(run)
        else:
            expect(k < len(each), "task", "a task for each run", len(each))
            words = each[k]
        expect(
            words.strip() and len(words) <= LONGEST,
            f"{where}: task",
            f"words, at most {LONGEST} characters",
            words,
        )
        expect(words.isprintable(), f"{where}: task", "words on one line", words)
        yield where, run, words
        count += 1
    expect(count, "runs", "at least one run")
    expect(each is None or len(each) == count, "task", f"a task for each of {count} runs", each)


def _title(run: Trajectory) -> str:
    scenario = run.scenario or {}
    return str(scenario.get("title") or scenario.get("name") or run.called)


class _DataSet:
    """The files of one data set, written from the first episode on."""

    def __init__(self, folder: Path, fps: int, videos: EpisodeVideos | None) -> None:
        self.folder, self.fps, self.videos = folder, fps, videos
        self.features: dict[str, Feature] = {}
        self.tasks: dict[str, int] = {}
        self.episodes: list[dict[str, Any]] = []
        self.frames = 0
        self._all: dict[str, list[Array]] = {}
        self._places = places()
        self._writer: Any = None
        self._place, self._rows, self._rows_a_file = (0, 0), 0, 0

    def write(self, runs: Iterator[tuple[str, Trajectory, str]]) -> None:
        """Take all episodes, and then write what is told of them."""
        first = None
        (self.folder / "meta").mkdir()
        try:
            for where, run, task in runs:
                try:
                    first = self._begin(run) if first is None else first
                    check_same(run, first, self.features)
                    self._add(frames_of(run, self.fps, self.features), task)
                    if self.videos is not None:
                        last = self.episodes[-1]
                        last |= self.videos.add(run, last["length"])
                except InputError as error:
                    raise error.at(where) from None
        finally:
            self._close()
        assert first is not None
        self._finish(first)

    def _begin(self, run: Trajectory) -> Trajectory:
        self.features = features_of(run)
        features = {**self.features, **COUNTED}.values()
        each = sum(feature.width * np.dtype(feature.dtype).itemsize for feature in features)
        self._rows_a_file = max(1, layout.MB_A_FILE * 1_000_000 // each)
        return run

    def _add(self, frames: dict[str, Array], task: str) -> None:
        length, episode = len(frames[layout.STATE]), len(self.episodes)
        index = self.tasks.setdefault(task, len(self.tasks))
        counts = np.arange(length)
        columns: dict[str, Any] = {name: rows.astype(np.float32) for name, rows in frames.items()}
        columns |= {
            "timestamp": (counts / self.fps).astype(np.float32),
            "frame_index": counts,
            "episode_index": np.full(length, episode),
            "index": self.frames + counts,
            "task_index": np.full(length, index),
        }
        self._write(columns, length)
        chunk, file = self._place
        told = {
            "episode_index": episode,
            "tasks": [task],
            "length": length,
            "data/chunk_index": chunk,
            "data/file_index": file,
            "dataset_from_index": self.frames,
            "dataset_to_index": self.frames + length,
            "meta/episodes/chunk_index": 0,
            "meta/episodes/file_index": 0,
        }
        for name, rows in columns.items():
            rows = rows.reshape(length, -1)
            self._all.setdefault(name, []).append(rows)
            told |= {f"stats/{name}/{kind}": values for kind, values in statistics(rows).items()}
        self.episodes.append(told)
        self.frames += length

    def _write(self, columns: dict[str, Any], length: int) -> None:
        """An episode's frames as a group of rows, in a new file where the last one is full."""
        pa, features = arrow(), {**self.features, **COUNTED}
        if self._writer is None or self._rows + length > self._rows_a_file:
            self._close()
            self._place, self._rows = next(self._places), 0
            path = self.folder / layout.data_file(layout.DATA, *self._place, layout.INFO)
            path.parent.mkdir(parents=True, exist_ok=True)
            schema = pa.schema([pa.field(name, feature.arrow) for name, feature in features.items()])
            self._writer = parquet().ParquetWriter(path, schema)
        arrays = [_column(columns[name], feature) for name, feature in features.items()]
        self._writer.write_table(pa.table(arrays, schema=self._writer.schema))
        self._rows += length

    def _close(self) -> None:
        if self._writer is not None:
            self._writer.close()
            self._writer = None

    def _finish(self, first: Trajectory) -> None:
        features, count = {**self.features, **COUNTED}, len(self.episodes)
        info: dict[str, Any] = {
            "codebase_version": layout.VERSION,
            "robot_type": first.robot.name,
            "total_episodes": count,
            "total_frames": self.frames,
            "total_tasks": len(self.tasks),
            "chunks_size": layout.FILES_A_CHUNK,
            "data_files_size_in_mb": layout.MB_A_FILE,
            "video_files_size_in_mb": 200,
            "fps": self.fps,
            "splits": {"train": f"0:{count}"},
            "data_path": layout.DATA,
            "video_path": None if self.videos is None else layout.VIDEO,
            "features": {name: feature.told() for name, feature in features.items()},
        }
        stats = {name: statistics(np.concatenate(rows)) for name, rows in self._all.items()}
        if self.videos is not None:
            info["features"] |= self.videos.features()
            stats |= self.videos.statistics()
        for path, content in ((layout.INFO, info), (layout.STATS, stats)):
            text = json.dumps(content, indent=4, ensure_ascii=False)
            (self.folder / path).write_text(text + "\n", encoding="utf-8")
        self._write_tasks()
        file = self.folder / layout.EPISODES / "chunk-000" / "file-000.parquet"
        file.parent.mkdir(parents=True)
        parquet().write_table(arrow().Table.from_pylist(self.episodes), file)
        of_nmm = {
            "robot": {"name": first.robot.name, "fingerprint": first.robot.fingerprint},
            "episodes": count,
            "frames": self.frames,
            "files": _sizes(self.folder),
        }
        is_data_set.write(self.folder, of_nmm)

    def _write_tasks(self) -> None:
        """Tasks by number; pandas, by which LeRobot reads them, makes the words its index."""
        columns = {"task_index": [*self.tasks.values()], "task": [*self.tasks]}
        described = [
            {"name": name, "field_name": name, "pandas_type": kind, "numpy_type": dtype, "metadata": None}
            for name, kind, dtype in (("task_index", "int64", "int64"), ("task", "unicode", "object"))
        ]
        pandas = {
            "index_columns": ["task"],
            "column_indexes": [],
            "columns": described,
            "pandas_version": "2.0",
        }
        table = arrow().table(columns).replace_schema_metadata({"pandas": json.dumps(pandas)})
        parquet().write_table(table, self.folder / layout.TASKS)


def _column(rows: Array, feature: Feature) -> Any:
    """Rows (N,) or (N, k) as Parquet's column: numbers where there is one a frame, else lists of k."""
    pa = arrow()
    values = pa.array(np.ascontiguousarray(rows).ravel(), type=getattr(pa, feature.dtype)())
    return values if feature.width == 1 else pa.FixedSizeListArray.from_arrays(values, feature.width)
