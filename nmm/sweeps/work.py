"""A chunk of a sweep's rows computed, here, in a child or on a cluster, with what is kept of its rollouts."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from nmm import __version__
from nmm.errors import RunError
from nmm.progress import Progress
from nmm.sweeps.definition import Definition
from nmm.sweeps.rows import rows_of

if TYPE_CHECKING:
    from nmm.runs.trajectory import Trajectory


class Computed(NamedTuple):
    """The rows of a chunk, and the files of the run folders that are kept, by row and name."""

    rows: list[dict[str, Any]]
    runs: dict[int, dict[str, bytes]]


def computed(chunk: int, progress: Progress | None, definition: Definition, threads: int = 1) -> Computed:
    """Chunk number `chunk` of a sweep, its rows by so many threads.

    Raises
    ------
    RunError : this process has another version of nmm than the one that began the sweep
    """
    if definition.version != __version__:
        raise RunError(
            f"a worker has nmm {__version__}, and the sweep is of nmm {definition.version}: expected the same"
        )
    runs: dict[int, dict[str, bytes]] = {}

    def keep(index: int, trajectory: Trajectory) -> None:
        with tempfile.TemporaryDirectory() as folder:
            html = definition.keep == "playback"
            saved = trajectory.save(Path(folder) / "run", figures=False, html=html)
            runs[index] = {path.name: path.read_bytes() for path in saved.iterdir()}

    rows = rows_of(
        definition, definition.indices(chunk), keep if definition.keep else None, progress, threads
    )
    return Computed(rows, runs)
