"""How a data set of LeRobot's, v3.0, is laid out: files, features, their names and units."""

from __future__ import annotations

import re
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

from pydantic import NonNegativeInt

from nmm.base.errors import InputError
from nmm.base.extras import needed
from nmm.views.folders.schema import Told, read_json
from nmm.views.folders.whole import FolderKind

VERSION = "v3.0"
INFO, STATS, TASKS, EPISODES = "meta/info.json", "meta/stats.json", "meta/tasks.parquet", "meta/episodes"
#: What info.json says of the files of frames.
DATA = "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
#: The same of videos, a file an episode.
VIDEO, VIDEOS = "videos/{video_key}/chunk-{chunk_index:03d}/file-{file_index:03d}.mp4", "observation.images"
#: Files of a chunk, and MB of a file, as LeRobot has them.
FILES_A_CHUNK, MB_A_FILE = 1000, 100
#: Frames a second: more is no camera's and no policy's.
FASTEST = 10_000
STATE, ACTION, TARGET = "observation.state", "action", "observation.environment_state"
#: How the names of columns end, of where something is and of how fast it moves.
PLACE, RATE = ".pos", ".vel"

arrow = partial(needed, "pyarrow", "a data set of LeRobot's")
compute = partial(needed, "pyarrow.compute", "a data set of LeRobot's")
parquet = partial(needed, "pyarrow.parquet", "a data set of LeRobot's")
#: The data sets that nmm wrote, by a file of its own: LeRobot warns of keys of info.json unknown to it.
is_data_set = FolderKind("nmm lerobot 1", "meta/nmm.json")


class ToldByNmm(Told):
    """meta/nmm.json; the other files' sizes, bytes, by their place in the folder."""

    episodes: NonNegativeInt
    frames: NonNegativeInt
    files: dict[str, NonNegativeInt]


class _ToldCounts(Told):
    total_episodes: NonNegativeInt
    total_frames: NonNegativeInt


def told_by_nmm(folder: Path) -> ToldByNmm | None:
    """What nmm says of a data set that it wrote; None where it wrote none, or where episodes have been added
    or taken out since."""
    if not is_data_set(folder):
        return None
    try:
        own, info = read_json(folder / is_data_set.file, ToldByNmm), read_json(folder / INFO, _ToldCounts)
    except InputError:
        return None
    same = (own.episodes, own.frames) == (info.total_episodes, info.total_frames)
    return own if same else None


class Feature(NamedTuple):
    """What a frame has under one name: numbers of one kind, each with a name and a unit.

    A feature of one number has the shape [1] in info.json and is a number in Parquet, not a list of one: so
    LeRobot reads and writes it.
    """

    dtype: str
    names: tuple[str, ...] | None = None
    units: tuple[str, ...] = ()

    @property
    def width(self) -> int:
        return len(self.units) or 1

    def told(self) -> dict[str, Any]:
        """As info.json has it. LeRobot keeps `units`, and makes nothing of them; its own features have none,
        or its tools would find them to differ from those that they make."""
        names = None if self.names is None else list(self.names)
        units = {"units": list(self.units)} if self.units else {}
        return {"dtype": self.dtype, "shape": [self.width], "names": names, **units}

    @property
    def arrow(self) -> Any:
        kind = getattr(arrow(), self.dtype)()
        return kind if self.width == 1 else arrow().list_(kind, self.width)


#: What every frame has, in LeRobot's order; timestamps in s, the rest are counts.
COUNTED = {
    "timestamp": Feature("float32"),
    **{name: Feature("int64") for name in ("frame_index", "episode_index", "index", "task_index")},
}


def places() -> Iterator[tuple[int, int]]:
    """Chunk and file, one after the other."""
    count = 0
    while True:
        yield divmod(count, FILES_A_CHUNK)
        count += 1


_FIELD = re.compile(r"\{(chunk_index|file_index)(?::0?([1-9])d)?\}")


def data_file(template: str, chunk: int, file: int, where: object) -> Path:
    """The file of frames, in the data set's folder, that info.json's template speaks of. It is filled in by
    hand: `str.format` would do what a stranger's template asks for.

    Raises
    ------
    InputError : anything else in braces, or a way out of the folder
    """
    numbers = {"chunk_index": chunk, "file_index": file}
    path = _FIELD.sub(lambda found: f"{numbers[found[1]]:0{found[2] or 1}d}", template)
    parts = Path(path).parts
    if {"{", "}", "\0"} & {*path} or Path(path).is_absolute() or ".." in parts or not parts:
        raise InputError(where=where, expected=f"a file in this folder, as in {DATA}", got=template)
    return Path(path)
