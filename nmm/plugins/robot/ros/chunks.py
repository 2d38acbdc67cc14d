"""Chunks of logs, decompressed as far as they claim to be long, and no further than a robot's log needs.

The packages that read logs decompress a chunk whole, whatever comes of it: some kB may fill the memory.
"""

from __future__ import annotations

import bz2
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from typing import Any

from nmm.base.errors import InputError
from nmm.plugins.robot.ros.log import rosbags

#: Bytes of one chunk (rosbag2 writes 0.8 MB), and of all: so many, or so many times those of the file.
MOST_OF_A_CHUNK, MOST_OF_ALL, MOST_TIMES = 1_000_000_000, 20_000_000_000, 200
#: Bytes of a metadata.yaml.
MOST_OF_METADATA = 10_000_000


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
    most = max(MOST_OF_ALL, MOST_TIMES * path.stat().st_size)
    if sum(claimed) > most:
        raise InputError(where=path, expected=f"at most {_said(most)} of messages", got=_said(sum(claimed)))


def _check_chunk(size: int, where: Path | str = "") -> None:
    if size > MOST_OF_A_CHUNK:
        raise InputError(where=where, expected=f"chunks of at most {_said(MOST_OF_A_CHUNK)}", got=_said(size))


def _said(size: int) -> str:
    return f"{size / 1e9:.3g} GB"


def decompressed(kind: str, data: bytes, size: int = MOST_OF_A_CHUNK) -> bytes:
    """A chunk of at most `size` bytes; `InputError` where there are more, or more than any chunk has."""
    _check_chunk(size)
    made: Any = _DECOMPRESSORS[kind]()
    content: bytes = made.decompress(data, size + 1)
    if len(content) > size:
        raise InputError(expected=f"a chunk of at most {size:,} bytes", got="more")
    if not made.eof:
        raise InputError("a chunk that lacks its end")
    return content


def _zstd() -> Any:
    try:
        return import_module("compression.zstd").ZstdDecompressor()
    except ImportError:
        return import_module("backports.zstd").ZstdDecompressor()


def _lz4() -> Any:
    return import_module("lz4.frame").LZ4FrameDecompressor()


_DECOMPRESSORS: dict[str, Callable[[], Any]] = {"zstd": _zstd, "lz4": _lz4, "bz2": bz2.BZ2Decompressor}


def bound_readers() -> None:
    """From now on rosbags decompresses chunks by `decompressed`."""
    of_mcap = getattr(rosbags("rosbag2.storage_mcap"), "DECOMPRESSORS", {})
    of_ros1 = getattr(rosbags("rosbag1.reader"), "decompressors", {})
    for kind in _DECOMPRESSORS.keys() & of_mcap.keys():
        of_mcap[kind] = lambda data, size, kind=kind: decompressed(kind, data, size)
    for kind in _DECOMPRESSORS.keys() & of_ros1.keys():
        of_ros1[kind] = lambda data, kind=kind: decompressed(kind, data)


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
