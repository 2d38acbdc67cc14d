"""Points in files: PLY, PCD and NumPy's NPZ."""

from __future__ import annotations

import io
import warnings
from pathlib import Path
from typing import Any

import numpy as np

from nmm.base.errors import InputError
from nmm.base.files import read_bytes
from nmm.base.text_format import one_line

#: No file has more bytes.
LONGEST = 2_000_000_000
_TYPES = {("F", 4): "<f4", ("F", 8): "<f8"}
_TYPES |= {(kind, size): f"<{kind.lower()}{size}" for kind in "IU" for size in (1, 2, 4, 8)}


def points_of_file(file: str | Path) -> Any:
    """The points (N, 3) of a file, f32 or f64, NaN among them; `InputError` names the file."""
    path = Path(file)
    readers = {".ply": _ply, ".pcd": _pcd, ".npz": _npz}
    reader = readers.get(path.suffix.lower())
    if reader is None:
        raise InputError(where=file, expected="a .ply, .pcd or .npz file", got=path.suffix)
    try:
        points = reader(content_of(path))
    except InputError as error:
        raise error.at(file) from None
    if points.ndim != 2 or points.shape[1] != 3 or not len(points):
        raise InputError(where=file, expected="points of three coordinates", got=points)
    return points


def content_of(path: Path) -> bytes:
    """The bytes of a file; `InputError`, without the file's name, where it cannot be read."""
    try:
        return read_bytes(path, LONGEST)
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror or one_line(str(error))}") from None


def _ply(content: bytes) -> Any:
    import trimesh

    try:
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore")
            loaded = trimesh.load(io.BytesIO(content), file_type="ply", process=False)
        return np.asarray(loaded.vertices)
    except Exception as error:  # trimesh's readers raise whatever they meet
        what = f"damaged, or no PLY ({type(error).__name__}: {one_line(str(error))})"
        raise InputError(what) from None


def arrays_of(content: bytes) -> dict[str, Any]:
    """The arrays of a .npz file by their names, without pickles."""
    try:
        loaded = np.load(io.BytesIO(content), allow_pickle=False)
        if not hasattr(loaded, "files"):
            raise InputError("it is a single array", expected="an archive made by np.savez")
        with loaded as file:
            arrays = {name: file[name] for name in file.files}
    except InputError:
        raise
    except Exception as error:  # zlib's and zipfile's own among them
        raise InputError(f"damaged, or no NPZ ({one_line(str(error))})") from None
    for name, array in arrays.items():
        if array.dtype.kind not in "fiu":
            raise InputError(where=name, expected="numbers", got=str(array.dtype))
    return arrays


def _npz(content: bytes) -> Any:
    arrays = arrays_of(content)
    name = "points" if "points" in arrays else next(iter(arrays)) if len(arrays) == 1 else None
    if name is None:
        raise InputError(expected="the array points, or a single one", available=[*arrays])
    points = arrays[name]
    return points if points.dtype in (np.float32, np.float64) else points.astype(np.float64)


def _pcd(content: bytes) -> Any:
    """Of the Point Cloud Library: a header of text, then lines of numbers or their bytes."""
    header: dict[str, list[str]] = {}
    begin = 0
    while "DATA" not in header:
        end = content.find(b"\n", begin)
        if end < 0 or begin > 10_000:
            raise InputError("no PCD: its header has no line DATA")
        words = content[begin:end].decode("ascii", "replace").split()
        begin = end + 1
        if words and not words[0].startswith("#"):
            header[words[0].upper()] = words[1:]
    fields = header.get("FIELDS", header.get("COLUMNS", []))
    try:
        sizes, kinds = [int(size) for size in header["SIZE"]], header["TYPE"]
        counts = [int(count) for count in header.get("COUNT", ["1"] * len(fields))]
        total = int(header["POINTS"][0]) if "POINTS" in header else _product(header)
        types = [_TYPES[kind, size] for kind, size in zip(kinds, sizes, strict=True)]
        named = [
            (f"{name}_{i}", *rest) for i, (name, *rest) in enumerate(zip(fields, types, counts, strict=True))
        ]
        layout = np.dtype([(name, kind, (count,)) for name, kind, count in named])
    except (KeyError, ValueError, IndexError, OverflowError) as error:
        raise InputError(f"its header is no PCD's ({type(error).__name__}: {one_line(str(error))})") from None
    missing = [axis for axis in "xyz" if axis not in fields]
    if missing or total < 0 or any(count < 1 for count in counts):
        raise InputError(where="FIELDS", expected="x, y and z, and counts above 0", got=fields)
    columns = [fields.index(axis) for axis in "xyz"]
    form = " ".join(header["DATA"])
    if form == "ascii":
        return _ascii(content[begin:], counts, columns, total)
    if form != "binary":
        mend = "pcl_convert_pcd_ascii_binary IN.pcd OUT.pcd 1"
        raise InputError(where="DATA", expected="ascii or binary", got=form, mend=mend)
    room = len(content) - begin
    if room < total * layout.itemsize:
        what = f"it ends after {room // layout.itemsize} of {total} points"
        raise InputError(what)
    rows = np.frombuffer(content, layout, total, begin)
    single = all(types[k] == "<f4" for k in columns)
    axes = [rows[str(named[k][0])][:, 0] for k in columns]
    return np.column_stack(axes).astype(np.float32 if single else np.float64)


def _product(header: dict[str, list[str]]) -> int:
    return int(header["WIDTH"][0]) * int(header["HEIGHT"][0])


def _ascii(content: bytes, counts: list[int], columns: list[int], total: int) -> Any:
    places = np.cumsum([0, *counts])[columns]
    lines = [line for line in content.decode("ascii", "replace").splitlines() if line.strip()]
    if len(lines) < total:
        raise InputError(f"it ends after {len(lines)} of {total} points")
    points = np.empty((total, 3))
    for k, line in enumerate(lines[:total]):
        words = line.split()
        try:
            points[k] = [float(words[place]) for place in places]
        except (ValueError, IndexError):
            raise InputError(f"point {k + 1} is no {sum(counts)} numbers") from None
    return points
