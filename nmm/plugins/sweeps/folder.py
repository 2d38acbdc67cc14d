"""A sweep's folder: its definition, the chunks that are done, and finally the table in Parquet."""

import json
import shutil
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from nmm.base.errors import InputError
from nmm.base.files import taken, whole_file, written_at
from nmm.plugins.sweeps.definition import Definition
from nmm.plugins.sweeps.rows import Computed, arrow, columns_of, parquet, rows_of
from nmm.scenario.numbers import shown
from nmm.views.folders.whole import FolderKind, check_folder

is_sweep = FolderKind("nmm sweep 1", "sweep.json")
TABLE = "rows.parquet"
#: Rows of a row group in the finished table.
GROUP = 65_536
#: Sweeps with fewer rows begin without an estimate.
TIMED = 200_000
#: The longest estimated duration allowed.
MOST_DAYS = 30.0
DAY = 86_400.0
#: Bytes of a cell, measured in tables of 10^4 rows.
CELL = 8.0


class SweepFolder:
    """The folder of one sweep: new, empty, or with this sweep begun. A part is written whole, after its
    chunk's runs: a chunk is done exactly when its part is there.

        sweep.json            what the sweep is (`Definition.plain`), its columns, whether it is complete
        parts/000042.parquet  rows of a chunk, while there are chunks to do
        rows.parquet          all rows, in order
        runs/000000017/       the run folder of a row, where they are kept
        index.html            the page
    """

    def __init__(self, path: str | Path, definition: Definition) -> None:
        self.path, self.definition = Path(path), definition
        self.parts = self.path / "parts"
        self.table = self.path / TABLE
        self._schema = schema_of(definition)

    def check(self) -> None:
        """`InputError` for a folder with something else or another sweep, or one that cannot be written."""
        # A sweep killed before it wrote its definition left these alone.
        begun = (".lock", f".{is_sweep.file}")
        check_folder(
            self.path,
            lambda path: is_sweep(path) or all(file.name.startswith(begun) for file in path.iterdir()),
        )
        if not is_sweep(self.path):
            return
        stored = json.loads((self.path / is_sweep.file).read_text(encoding="utf-8"))["definition"]
        difference = _difference(stored, self.definition.plain())
        if difference:
            place, was, now = difference
            where, expected = f"{self.path}: {place[1:]}", f"{shown(was)}, or a new folder"
            raise InputError("holds another sweep", where=where, expected=expected, got=now)

    @contextmanager
    def opened(self) -> Iterator[None]:
        """The folder, for this process alone; `InputError` as `check`, or where another process uses it."""
        self.check()
        with written_at(self.path):
            self.path.mkdir(parents=True, exist_ok=True)
            with (self.path / ".lock").open("wb") as lock:
                if taken(lock) is False:
                    raise InputError("another process is at this sweep", where=str(self.path))
                self._remove_leftovers()
                if not is_sweep(self.path):
                    self._write_manifest(complete=False)
                yield

    def _remove_leftovers(self) -> None:
        """Remove what a killed process left unfinished."""
        for folder in (self.path, self.parts, self.path / "runs"):
            for left in folder.glob(".*"):
                if left.is_dir():
                    shutil.rmtree(left, ignore_errors=True)
                elif left.name != ".lock":
                    left.unlink()

    @property
    def complete(self) -> bool:
        return self.table.exists() and rows_in(self.table) == self.definition.rows

    def missing(self) -> list[int]:
        if self.complete:
            return []
        self.parts.mkdir(exist_ok=True)
        sizes = {chunk: len(self.definition.indices(chunk)) for chunk in range(self.definition.chunks)}
        return [chunk for chunk, size in sizes.items() if rows_in(self._part(chunk)) != size]

    def damaged(self, chunks: Sequence[int]) -> int:
        """Rows of those chunks whose files are there but damaged."""
        stored = [chunk for chunk in chunks if self._part(chunk).exists()]
        return sum(len(self.definition.indices(chunk)) for chunk in stored)

    def add(self, chunk: int, result: Computed) -> None:
        for index, files in result.runs.items():
            self._write_run(self.path / f"runs/{index:09d}", files)
        table = arrow().Table.from_pylist(result.rows, schema=self._schema)
        with whole_file(self._part(chunk)) as temporary:
            parquet().write_table(table, temporary)

    def finish(self) -> None:
        if not self.complete:
            join_parts(list(map(self._part, range(self.definition.chunks))), self.table, self._schema)
        shutil.rmtree(self.parts, ignore_errors=True)
        self._write_manifest(complete=True)

    def _part(self, chunk: int) -> Path:
        return self.parts / f"{chunk:06d}.parquet"

    def _write_manifest(self, *, complete: bool) -> None:
        content = {
            "name": self.definition.name,
            "complete": complete,
            "rows": self.definition.rows,
            "definition": self.definition.plain(),
            "columns": [column._asdict() for column in columns_of(self.definition)],
        }
        with whole_file(self.path / is_sweep.file) as temporary:
            is_sweep.write(temporary.parent, content)

    @staticmethod
    def _write_run(folder: Path, files: dict[str, bytes]) -> None:
        folder.parent.mkdir(exist_ok=True)
        temporary = Path(tempfile.mkdtemp(prefix=".", dir=folder.parent))
        try:
            temporary.chmod(0o755)
            for name, content in files.items():
                (temporary / name).write_bytes(content)
            shutil.rmtree(folder, ignore_errors=True)  # of a chunk that was killed
            temporary.rename(folder)
        finally:
            shutil.rmtree(temporary, ignore_errors=True)


def _difference(stored: Any, current: Any, place: str = "") -> tuple[str, Any, Any] | None:
    """The first key where two definitions differ, and both values, None for a missing one."""
    if not (isinstance(stored, dict) and isinstance(current, dict)):
        return None if stored == current else (place, stored, current)
    inner = (_difference(stored.get(key), current.get(key), f"{place}.{key}") for key in stored | current)
    return next(filter(None, inner), None)


def schema_of(definition: Definition) -> Any:
    """The table's pyarrow schema, with the definition and what each column is as metadata."""
    pa = arrow()
    kinds = {"count": pa.int64(), "number": pa.float64(), "text": pa.string()}
    fields = [
        pa.field(column.name, kinds[column.kind], metadata={"unit": column.unit, "about": column.about})
        for column in columns_of(definition)
    ]
    return pa.schema(fields, metadata={"nmm": json.dumps(definition.plain())})


def rows_in(path: Path) -> int:
    """Rows of a file, all of which are read; -1 if they cannot be."""
    try:
        return int(parquet().read_table(path, partitioning=None).num_rows)
    except (OSError, arrow().ArrowException):
        return -1


def join_parts(parts: Sequence[Path], path: Path, schema: Any) -> None:
    """Join the parts' rows in order in one file, with one row group in memory at a time."""
    pa, pq = arrow(), parquet()
    with whole_file(path) as temporary, pq.ParquetWriter(temporary, schema) as writer:
        tables: list[Any] = []
        for part in parts:
            tables.append(pq.read_table(part, schema=schema, partitioning=None))
            if part == parts[-1] or sum(table.num_rows for table in tables) >= GROUP:
                writer.write_table(pa.concat_tables(tables).combine_chunks())
                tables = []


def check_size(definition: Definition, workers: int, folder: Path) -> None:
    """`InputError` for more than `MOST_DAYS`, `workers` rows at a time, or a table too large for its disk."""
    rows = definition.rows
    if rows < TIMED:
        return
    rows_of(definition, [0])  # the first one compiles, and loads the robot
    began = time.perf_counter()
    rows_of(definition, [1])
    each = time.perf_counter() - began
    days, size = rows * each / workers / DAY, rows * CELL * len(columns_of(definition))
    parent = next(parent for parent in (folder.absolute(), *folder.absolute().parents) if parent.exists())
    free = float(shutil.disk_usage(parent).free)
    long = f"{days / 365.25:.3g} years" if days > 365.25 else f"{days:.3g} days"
    what = (
        f"{rows} rollouts of {each:.2g} s each take {long} with {workers} at a time, and "
        f"{size / 1e9:.3g} GB for their table"
    )
    if days > MOST_DAYS:
        expected = f"at most {MOST_DAYS:g} days: fewer, or more workers"
        raise InputError(what, where="samples", expected=expected)
    if 2.0 * size > free:  # the parts, and the table of them
        expected = f"at most half of what is free at {parent}, {free / 1e9:.3g} GB"
        raise InputError(what, where="samples", expected=expected)
