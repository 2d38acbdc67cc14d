"""A data set of LeRobot's as it lies in its folder: what it says of itself, and the frames of its episodes.

Everything is a stranger's: sizes are looked at before anything is decoded; templates are not formatted, no
objects are unpickled. No path leads out of the folder; symbolic links in it are followed, as a hub's cache
has them.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, NonNegativeInt, PositiveFloat, PositiveInt

from nmm.base.arrays import Array, Integers
from nmm.base.errors import InputError, expect, expect_known
from nmm.base.files import expect_file
from nmm.base.text_format import one_line, printable
from nmm.plugins.robot.lerobot import layout
from nmm.plugins.robot.lerobot.layout import INFO, arrow, compute, data_file, parquet
from nmm.views.folders.schema import read_json

#: Frames of a file, rows of another table, and bytes of the columns of a file that are read.
MOST_FRAMES, MOST_ROWS, MOST_BYTES = 10_000_000, 1_000_000, 1_000_000_000
#: Numbers of a frame under one name.
MOST_NUMBERS = 1000
#: How far stamps may be from frame_index / fps, s, and in frames; and, as they have 32 bits, of their size.
APART, APART_FRAMES, ROUNDED = 1e-3, 0.25, float(np.finfo(np.float32).eps)


class ToldFeature(BaseModel):
    """Of info.json; what else LeRobot says of pictures is ignored."""

    model_config = ConfigDict(strict=True, frozen=True)
    dtype: str
    shape: tuple[NonNegativeInt, ...]
    names: list[Any] | dict[str, Any] | None = None
    units: list[str] | None = None

    @property
    def columns(self) -> list[str]:
        """The names of its numbers; of older data sets, in a list of their own: {"motors": [...]}."""
        names = self.names
        if isinstance(names, dict):
            (names,) = names.values() if len(names) == 1 else ([],)
        return [str(name) for name in names] if isinstance(names, list) else []


class ToldInfo(BaseModel):
    """info.json; other keys are ignored."""

    model_config = ConfigDict(strict=True, frozen=True)
    codebase_version: str
    fps: Annotated[PositiveFloat, Field(le=layout.FASTEST)]
    total_episodes: NonNegativeInt
    total_frames: NonNegativeInt
    data_path: str
    robot_type: str | None = None
    chunks_size: PositiveInt = layout.FILES_A_CHUNK
    features: dict[str, ToldFeature]


class Episode(NamedTuple):
    number: int
    length: int
    chunk: int
    file: int


class EpisodeFrames(NamedTuple):
    """Of one episode: t (N,), s, and rows (N, k) of the features asked for."""

    t: Array
    rows: dict[str, Array]


class DataSet:
    """A data set in a folder; `InputError` names the file and the key that is wrong.

    info, episodes : what it says of itself
    ours : whether nmm wrote it, all its episodes
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        if not os.path.exists(folder / INFO):
            raise InputError(f"is no data set of LeRobot's: {INFO} is missing", where=folder)
        version = read_json(folder / INFO, _Version).codebase_version
        if not version.startswith("v3."):
            mend = "; LeRobot's convert_dataset_v21_to_v30 converts it" if version.startswith("v2") else ""
            where = f"{folder / INFO}: codebase_version"
            raise InputError(where=where, expected=f"{layout.VERSION}{mend}", got=version)
        self.info = read_json(folder / INFO, ToldInfo)
        self.ours = layout.told_by_nmm(folder) is not None
        self.episodes = self._episodes()

    def columns(self, feature: str) -> list[str]:
        """The names of a feature's numbers; [] where there is no such feature."""
        told = self.info.features.get(feature)
        if told is None:
            return []
        where = f"{self.folder / INFO}: features.{feature}"
        expect(
            len(told.shape) == 1 and 0 < told.shape[0] <= MOST_NUMBERS,
            f"{where}.shape",
            "[a number]",
            told.shape,
        )
        count, names = told.shape[0], told.columns
        fits = len(names) == count and len({*names}) == count
        expect(fits, f"{where}.names", f"{count} names that differ", told.names)
        return names

    def _episodes(self) -> dict[int, Episode]:
        wanted = ["episode_index", "length", "data/chunk_index", "data/file_index"]
        folder, rows = self.folder / layout.EPISODES, list[Episode]()
        files = sorted(folder.glob("*/*.parquet")) or [folder / "chunk-000" / "file-000.parquet"]
        for path in files:
            table = _read(path, wanted, MOST_ROWS, MOST_ROWS)
            numbers = [_whole(table, name, path).tolist() for name in wanted]
            expect(min(numbers[1], default=1) > 0, f"{path}: length", "at least one frame", 0)
            rows += [Episode(*row) for row in zip(*numbers, strict=True)]
            expect(len(rows) <= MOST_ROWS, folder, f"at most {MOST_ROWS:,} episodes", len(rows))
        episodes = {row.number: row for row in rows}
        expect(len(episodes) == len(rows), f"{path}: episode_index", "each episode once")
        frames = sum(row.length for row in rows)
        for key, claimed, there in (
            ("total_episodes", self.info.total_episodes, len(rows)),
            ("total_frames", self.info.total_frames, frames),
        ):
            where = f"{self.folder / INFO}: {key}"
            expect(claimed == there, where, f"{there}, as {layout.EPISODES} has", claimed)
        self._check_tasks()
        return episodes

    def _check_tasks(self) -> None:
        """That the tasks are there: LeRobot looks each frame's up."""
        path = self.folder / layout.TASKS
        table = _read(path, ["task_index"], MOST_ROWS, MOST_ROWS)
        numbers = _whole(table, "task_index", path)
        expect(len({*numbers.tolist()}) == len(numbers), f"{path}: task_index", "each number once")

    def frames(
        self, numbers: Sequence[int], features: Sequence[str]
    ) -> Iterator[tuple[Episode, EpisodeFrames]]:
        """The episodes' frames in order; each file is read once for those that follow one another."""
        last: tuple[Path, Any] | None = None
        for number in numbers:
            expect_known("episode", number, self.episodes, f"{self.folder}: episodes")
            episode = self.episodes[number]
            name = data_file(
                self.info.data_path, episode.chunk, episode.file, f"{self.folder / INFO}: data_path"
            )
            path = self.folder / name
            if last is None or last[0] != path:
                last = path, self._table(path, features)
            yield episode, self._one(path, last[1], episode, features)

    def _table(self, path: Path, features: Sequence[str]) -> Any:
        width = 3 + sum(len(self.columns(feature)) for feature in features)
        wanted = ["episode_index", "frame_index", "timestamp", *features]
        return _read(path, wanted, MOST_FRAMES, MOST_BYTES // (8 * width))

    def _one(self, path: Path, table: Any, episode: Episode, features: Sequence[str]) -> EpisodeFrames:
        at = np.flatnonzero(_whole(table, "episode_index", path) == episode.number)
        where = f"{path}: episode {episode.number}"
        expect(
            len(at) == episode.length, where, f"{episode.length} frames, as {layout.EPISODES} has", len(at)
        )
        with _damaged(path):
            part = table.take(at)
            counts = _whole(part, "frame_index", path)
            order = np.argsort(counts)
            part = part.take(order)
        fits = np.array_equal(counts[order], np.arange(len(at)))
        expect(fits, f"{where}: frame_index", "0, 1, 2, …", counts)
        rows = {feature: _rows(part, feature, len(self.columns(feature)), where) for feature in features}
        return EpisodeFrames(self._times(_rows(part, "timestamp", 1, where)[:, 0], where), rows)

    def _times(self, stamps: Array, where: str) -> Array:
        expect(np.isfinite(stamps).all(), f"{where}: timestamp", "finite numbers")
        even = np.arange(len(stamps)) / self.info.fps
        apart = max(min(APART, APART_FRAMES / self.info.fps), ROUNDED * even[-1])
        if np.abs(stamps - stamps[0] - even).max() <= apart:
            return even
        expect(np.all(np.diff(stamps) > 0.0), f"{where}: timestamp", "numbers that increase", stamps)
        return stamps - stamps[0]


class _Version(BaseModel):
    codebase_version: str


@contextmanager
def _damaged(where: object) -> Iterator[None]:
    """What pyarrow says of a stranger's bytes is an `InputError`."""
    try:
        yield
    except InputError:
        raise
    except FileNotFoundError:
        raise InputError("this file is missing", where=where) from None
    except Exception as error:  # OSError and pyarrow's own, of damaged bytes
        raise InputError(f"damaged, or no file of Parquet: {_words(error)}", where=where) from None


def _words(error: Exception) -> str:
    said = getattr(error, "strerror", None) or str(error) or type(error).__name__
    return printable(one_line(said, 120))


def _read(path: Path, columns: Sequence[str], most: int, most_rows: int) -> Any:
    """Columns of a table of at most so many rows; what its footer claims is checked before one is read."""
    arrow()
    with _damaged(path):
        expect_file(path)
        with path.open("rb") as opened, parquet().ParquetFile(opened) as file:
            known = file.schema_arrow.names
            for name in columns:
                if name not in known:
                    raise InputError("this column is missing", where=f"{path}: {name}", available=known)
            told = file.metadata
            rows = min(most, most_rows)
            expect(told.num_rows <= rows, path, f"at most {rows:,} rows", told.num_rows)
            parts = [
                column
                for group in map(told.row_group, range(told.num_row_groups))
                for column in map(group.column, range(group.num_columns))
                if any(f"{column.path_in_schema}.".startswith(f"{name}.") for name in columns)
            ]
            size = sum(column.total_uncompressed_size for column in parts)
            decoded = 8 * sum(column.num_values for column in parts)  # one row may be a list of millions
            expected = f"at most {MOST_BYTES / 1e9:g} GB of {len(columns)} columns"
            expect(max(size, decoded) <= MOST_BYTES, path, expected, max(size, decoded))
            table = file.read(columns=[*columns])
            table.validate(full=True)
            return table


def _whole(table: Any, name: str, path: Path) -> Integers:
    column = table.column(name)
    fits = arrow().types.is_integer(column.type) and column.null_count == 0
    expect(fits, f"{path}: {name}", "whole numbers", str(column.type))
    numbers: Integers = column.to_numpy().astype(np.int64)
    expect((numbers >= 0).all(), f"{path}: {name}", "numbers from 0")
    return numbers


def _rows(table: Any, name: str, width: int, where: str) -> Array:
    """A column's numbers (N, width): one a row, or lists of as many."""
    pa, column = arrow(), table.column(name)
    place = f"{where}: {name}"
    lists = (
        pa.types.is_list(column.type)
        or pa.types.is_large_list(column.type)
        or pa.types.is_fixed_size_list(column.type)
    )
    kind = column.type.value_type if lists else column.type
    real = pa.types.is_floating(kind) or pa.types.is_integer(kind)
    expect(real and (lists or width == 1), place, f"{width} numbers a frame", str(column.type))
    with _damaged(place):
        flat = compute().list_flatten(column) if lists else column
        values = flat.combine_chunks().to_numpy(zero_copy_only=False).astype(np.float64)
        lengths = compute().list_value_length(column).to_numpy() if lists else np.ones(len(column))
    expect(column.null_count == 0 and np.all(lengths == width), place, f"{width} numbers a frame", lengths)
    return values.reshape(len(column), width)
