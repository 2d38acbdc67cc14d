"""Chunks of logs, decompressed as far as they claim to be long, and no further than a robot's log needs.

The packages that read logs decompress a chunk, a message or a file whole, whatever comes of it, as often as
an index asks for it: some kB may fill the memory, or the disk, or take hours.
"""

from __future__ import annotations

import bz2
import shutil
import sqlite3
import tempfile
from collections.abc import Callable, Iterable, Iterator
from contextlib import closing, contextmanager
from contextvars import ContextVar
from dataclasses import replace
from functools import cache
from importlib import import_module
from pathlib import Path
from types import SimpleNamespace
from typing import Any, TypeVar

from nmm.base.errors import InputError
from nmm.plugins.robot.ros.log import rosbags

#: Bytes of one chunk (rosbag2 writes 0.8 MB), and of all: so many, or so many times those of the file.
MOST_OF_A_CHUNK, MOST_OF_ALL, MOST_TIMES = 1_000_000_000, 20_000_000_000, 200
#: Bytes of a metadata.yaml.
MOST_OF_METADATA = 10_000_000
#: Messages of a log: so many, or so many a byte of its files. Each takes a tenth of a millisecond to read.
FEW_MESSAGES, MESSAGES_A_BYTE = 2_000_000, 1
#: Of the disk's free space so much may be filled by files that are decompressed.
SHARE_OF_DISK = 0.5

T = TypeVar("T")


class Allowance:
    """The messages of one pass over a log, and the bytes made of compressed ones; `InputError` for more."""

    def __init__(self, path: Path) -> None:
        self._path, self._made = path, 0
        self._most = most_of(path)
        self._messages = max(FEW_MESSAGES, MESSAGES_A_BYTE * _size_of(path))

    @contextmanager
    def counting(self) -> Iterator[None]:
        """What is decompressed in the block counts."""
        before = _ALLOWED.set(self)
        try:
            yield
        finally:
            _ALLOWED.reset(before)

    def over(self, items: Iterator[T]) -> Iterator[T]:
        """The items, counting what is decompressed for each."""
        while True:
            before = _ALLOWED.set(self)  # as `counting` does, in a twentieth of a message's time
            try:
                item = next(items, None)
            finally:
                _ALLOWED.reset(before)
            if item is None:
                return
            self._messages -= 1
            if self._messages < 0:
                raise InputError(where=self._path, expected="a message a byte of its files", got="more")
            yield item

    def take(self, size: int, most: float = float("inf")) -> None:
        self._made += size
        most = min(most, self._most)
        if self._made > most:
            expected = f"at most {_said(most)} of messages, decompressed"
            raise InputError(where=self._path, expected=expected, got="more")


_ALLOWED: ContextVar[Allowance | None] = ContextVar("allowance", default=None)


def most_of(path: Path) -> float:
    """How many bytes of messages a log may hold, by those of its files."""
    return max(MOST_OF_ALL, MOST_TIMES * _size_of(path))


def _size_of(path: Path) -> int:
    files = [file for file in path.iterdir() if file.is_file()] if path.is_dir() else [path]
    return sum(file.stat().st_size for file in files)


def claims_of(bag: Any) -> Iterator[tuple[Path, list[int]]]:
    """The MCAP files of an open reader of rosbags, and the sizes of their chunks by their index."""
    storage = getattr(bag, "storage", None)
    for part in getattr(storage, "storages", [storage]):
        if chunks := getattr(part, "chunks", ()):
            yield Path(part.path), [chunk.uncompressed_size for chunk in chunks]


def check_claims(path: Path, sizes: Iterable[int]) -> None:
    """`InputError` for a log whose chunks claim to be longer than any is, before one is read."""
    claimed = [*sizes]
    _check_chunk(max(claimed, default=0), path)
    most = most_of(path)
    if sum(claimed) > most:
        raise InputError(where=path, expected=f"at most {_said(most)} of messages", got=_said(sum(claimed)))


def _check_chunk(size: int, where: Path | str = "") -> None:
    if size > MOST_OF_A_CHUNK:
        raise InputError(where=where, expected=f"chunks of at most {_said(MOST_OF_A_CHUNK)}", got=_said(size))


def _said(size: float) -> str:
    return f"{size / 1e9:.3g} GB"


def decompressed(kind: str, data: bytes, size: int = MOST_OF_A_CHUNK) -> bytes:
    """A chunk of at most `size` bytes; `InputError` where there are more, or more than any chunk has."""
    _check_chunk(size)
    made: Any = _DECOMPRESSORS[kind]()
    content: bytes = made.decompress(data, size + 1)
    if len(content) > size:
        raise InputError(expected=f"a chunk of at most {size:,} bytes", got="more")
    if not made.eof:
        raise ValueError("a chunk that lacks its end")  # as of other damage: what is before it is read
    return _counted(content)


def _counted(content: bytes) -> bytes:
    if (allowed := _ALLOWED.get()) is not None:
        allowed.take(len(content))
    return content


class _CountedFile:
    """A compressed file as far as it may be decompressed, and the disk has room for."""

    def __init__(self, file: Any, mode: str) -> None:
        self._file = _zstd_module().open(file, mode)
        self._room = SHARE_OF_DISK * shutil.disk_usage(tempfile.gettempdir()).free

    def read(self, size: int) -> bytes:
        content: bytes = self._file.read(size)
        if (allowed := _ALLOWED.get()) is not None:
            allowed.take(len(content), self._room)
        return content

    def __enter__(self) -> _CountedFile:
        return self

    def __exit__(self, *_: object) -> None:
        self._file.close()


def _zstd_module() -> Any:
    try:
        return import_module("compression.zstd")
    except ImportError:
        return import_module("backports.zstd")


def _zstd() -> Any:
    return _zstd_module().ZstdDecompressor()


def _lz4() -> Any:
    return import_module("lz4.frame").LZ4FrameDecompressor()


_DECOMPRESSORS: dict[str, Callable[[], Any]] = {"zstd": _zstd, "lz4": _lz4, "bz2": bz2.BZ2Decompressor}


@cache
def bound_readers() -> None:
    """From now on rosbags decompresses by `decompressed`, and opens databases whose tables are stored."""
    of_mcap = getattr(rosbags("rosbag2.storage_mcap"), "DECOMPRESSORS", {})
    of_ros1 = getattr(rosbags("rosbag1.reader"), "decompressors", {})
    for kind in _DECOMPRESSORS.keys() & of_mcap.keys():
        of_mcap[kind] = lambda data, size, kind=kind: decompressed(kind, data, size)
    for kind in _DECOMPRESSORS.keys() & of_ros1.keys():
        of_ros1[kind] = lambda data, kind=kind: decompressed(kind, data)
    if "none" in of_ros1:  # an index may ask for the same again and again
        of_ros1["none"] = _counted
    reader = rosbags("rosbag2.reader")
    if hasattr(reader, "zstd"):  # messages and files that are compressed as a whole
        reader.zstd = SimpleNamespace(decompress=lambda data: decompressed("zstd", data), open=_CountedFile)
    database = getattr(rosbags("rosbag2.storage_sqlite3"), "Sqlite3Reader", None)
    if database is not None:
        opened = database.open

        def checked(self: Any) -> None:
            check_tables(Path(self.path))
            opened(self)

        database.open = checked


def check_tables(path: Path) -> None:
    """`InputError` for a database whose tables are not stored: rows that are computed may be without end."""
    with closing(sqlite3.connect(f"{path.absolute().as_uri()}?immutable=1", uri=True)) as database:
        for kind, name, text in database.execute("SELECT type, name, sql FROM sqlite_master").fetchall():
            computed = kind == "view" or (
                kind == "table" and "VIRTUAL" in str(text).upper().split("TABLE")[0]
            )
            if kind == "table" and not computed:
                columns = database.execute("SELECT hidden FROM pragma_table_xinfo(?)", (name,)).fetchall()
                computed = any(hidden for (hidden,) in columns)
            if computed:
                raise InputError("rows that are computed", where=path, expected="tables that hold messages")


def records_of(stream: Any, file: Any, kind_of_chunk: type) -> Iterator[Any]:
    """The records of an MCAP file one after another, those in chunks too, by mcap's module stream_reader."""
    reader = stream.StreamReader(
        file, validate_crcs=True, emit_chunks=True, record_size_limit=MOST_OF_A_CHUNK
    )
    for record in reader.records:
        if not isinstance(record, kind_of_chunk):
            yield record
            continue
        chunk: Any = record
        _check_chunk(chunk.uncompressed_size)
        if chunk.compression in _DECOMPRESSORS:
            data = decompressed(chunk.compression, chunk.data, chunk.uncompressed_size)
            chunk = replace(chunk, compression="", data=data)
        yield from stream.breakup_chunk(chunk, validate_crc=True)
