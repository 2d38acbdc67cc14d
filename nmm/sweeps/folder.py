"""A sweep's folder: what the sweep is, the chunks that are done, and the table at the end."""

from __future__ import annotations

import json
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from nmm.errors import InputError
from nmm.files import taken
from nmm.folders.whole import check_folder, has_format
from nmm.machine import made_with
from nmm.scenario.numbers import shown
from nmm.sweeps.columns import columns_of
from nmm.sweeps.definition import Definition
from nmm.sweeps.table import join_parts, rows_in, schema_of, write_part
from nmm.sweeps.work import Computed
from nmm.writing import whole_file

#: Marks a folder as one of ours.
FORMAT = "nmm sweep 1"
MANIFEST, TABLE = "sweep.json", "rows.parquet"


def is_sweep(folder: Path) -> bool:
    """Whether a folder holds a sweep that nmm wrote."""
    return has_format(folder / MANIFEST, FORMAT)


class SweepFolder:
    """The folder of one sweep.

        sweep.json          what the sweep is (`Definition.plain`), its columns, whether it is complete
        parts/000042.parquet  rows of a chunk, while there are chunks to do
        rows.parquet        all rows, in order
        runs/000000017/     the run folder of a row, where they are kept
        index.html          the page

    A part is written after the runs of its chunk, and is there whole or not at all: a chunk is done exactly
    when its part is there.

    Parameters
    ----------
    path : a new or an empty folder, or one where this sweep was begun
    definition : of the sweep
    """

    def __init__(self, path: str | Path, definition: Definition) -> None:
        self.path, self.definition = Path(path), definition
        self.parts = self.path / "parts"
        self.table = self.path / TABLE
        self._schema = schema_of(definition)

    def check(self) -> None:
        """`InputError` for a folder of something else, of another sweep, or that cannot be written."""
        check_folder(self.path, lambda path: is_sweep(path) or _hardly_begun(path))
        if not is_sweep(self.path):
            return
        there = json.loads((self.path / MANIFEST).read_text(encoding="utf-8"))["definition"]
        difference = _difference(there, self.definition.plain())
        if difference:
            raise InputError(
                f"{self.path}: holds another sweep: {difference}; expected a new folder, or the same sweep"
            )

    @contextmanager
    def opened(self) -> Iterator[None]:
        """The folder, begun or to go on with, for this process alone.

        Raises
        ------
        InputError : as `check`; another process is at it
        """
        self.check()
        try:
            self.path.mkdir(parents=True, exist_ok=True)
            lock = (self.path / ".lock").open("wb")
        except OSError as error:
            raise InputError(f"{self.path}: cannot be written: {error.strerror}") from None
        with lock:
            if taken(lock) is False:
                raise InputError(f"{self.path}: another process is at this sweep")
            self._remove_leftovers()
            if not is_sweep(self.path):
                self._write_manifest(complete=False)
            yield

    def _remove_leftovers(self) -> None:
        """What a process that was killed had not finished."""
        for folder in (self.path, self.parts, self.path / "runs"):
            for left in folder.glob(".*"):
                if left.is_dir():
                    shutil.rmtree(left, ignore_errors=True)
                elif left.name != ".lock":
                    left.unlink()

    @property
    def complete(self) -> bool:
        """Whether the table is there with all rows."""
        return self.table.exists() and rows_in(self.table) == self.definition.rows

    def missing(self) -> list[int]:
        """The chunks that are not done, in order."""
        if self.complete:
            return []
        self.parts.mkdir(exist_ok=True)
        chunks = range(self.definition.chunks)
        return [
            chunk for chunk in chunks if rows_in(self._part(chunk)) != len(self.definition.indices(chunk))
        ]

    def add(self, chunk: int, found: Computed) -> None:
        """A chunk is done."""
        for index, files in found.runs.items():
            self._write_run(self.path / run_folder(index), files)
        write_part(found.rows, self._part(chunk), self._schema)

    def finish(self) -> None:
        """All chunks are done: one table of them."""
        if not self.complete:
            join_parts(
                [self._part(chunk) for chunk in range(self.definition.chunks)], self.table, self._schema
            )
        shutil.rmtree(self.parts, ignore_errors=True)
        self._write_manifest(complete=True)

    def _part(self, chunk: int) -> Path:
        return self.parts / f"{chunk:06d}.parquet"

    def _write_manifest(self, *, complete: bool) -> None:
        content = {
            "format": FORMAT,
            "made_with": made_with(),
            "name": self.definition.name,
            "complete": complete,
            "rows": self.definition.rows,
            "definition": self.definition.plain(),
            "columns": [column._asdict() for column in columns_of(self.definition)],
        }
        text = json.dumps(content, indent=2, ensure_ascii=False)
        with whole_file(self.path / MANIFEST) as temporary:
            temporary.write_text(text + "\n", encoding="utf-8")

    @staticmethod
    def _write_run(folder: Path, files: dict[str, bytes]) -> None:
        folder.parent.mkdir(exist_ok=True)
        temporary = Path(tempfile.mkdtemp(prefix=".", dir=folder.parent))
        temporary.chmod(0o755)
        for name, content in files.items():
            (temporary / name).write_bytes(content)
        shutil.rmtree(folder, ignore_errors=True)  # of a chunk that was killed
        temporary.rename(folder)


def _hardly_begun(folder: Path) -> bool:
    """Whether a sweep was killed in a folder before it wrote what it is."""
    return all(path.name.startswith((".lock", f".{MANIFEST}")) for path in folder.iterdir())


def run_folder(index: int) -> str:
    """Where the run of a row is kept, from the sweep's folder."""
    return f"runs/{index:09d}"


def _difference(there: Any, here: Any, place: str = "") -> str:
    """The first place where two definitions differ, with both values; "" where they do not."""
    if isinstance(there, dict) and isinstance(here, dict):
        for key in [*there, *(key for key in here if key not in there)]:
            inner = f"{place}.{key}" if place else str(key)
            if key not in here or key not in there:
                return f"{inner} is {'not given there' if key in here else 'not given here'}"
            if found := _difference(there[key], here[key], inner):
                return found
        return ""
    return "" if there == here else f"{place} is {shown(there)} there, {shown(here)} here"
