"""The arrays of a run's folder, read with the kinds and the shapes that they must have."""

from __future__ import annotations

import zipfile
from collections.abc import Collection
from pathlib import Path
from typing import Any

import numpy as np

from nmm.errors import InputError
from nmm.files import expect_file
from nmm.memory import SHARE, free_memory
from nmm.words import one_line, printable

#: Arrays and their shapes: N samples, n coordinates, m inputs, s rows of the task; a dot is any length.
ARRAYS = {
    "t": "N",
    "q": "Nn",
    "u": "Nm",
    "q_dot": "Nn",
    "r": "Ns",
    "r_d": "Ns",
    "error": "Ns",
    "objective": "N",
    "sigma_min": "N",
    "partition": "Ns",
    "residual": "N",
}
OPTIONAL_ARRAYS = {"path": "N3", "desired": "N3", "target": "3"}
#: Arrays that older folders lack. K is N, or 0 where no distances were kept; L is how many limits have names.
LATER_ARRAYS = {
    "scale": "N.",
    "margin": "N",
    "step_size": "N",
    "crossed": "N",
    "shares": "NL",
    "clearance": "K",
    "clearance_between": "K",
    "clearance_pairs": "K",
    "clearance_points": "K6",
}
SHAPES = ARRAYS | OPTIONAL_ARRAYS | LATER_ARRAYS
WHOLE_NUMBERS = frozenset({"partition", "crossed", "clearance_pairs"})
#: Rows of tasks that are not active are no numbers, and margins and distances may be infinite; not these.
FINITE = frozenset({"t", "q", "u", "q_dot", "path", "target"})
#: Beyond it a motion has diverged long ago, and what is drawn of it overflows.
LARGEST = 1e30
UNBOUNDED = frozenset({"objective", "partition", "clearance_pairs"})


def read_arrays(path: Path) -> dict[str, Any]:
    """All arrays of an npz file; `InputError` names the file, and the array that is damaged."""
    name = ""
    try:
        expect_file(path)
        with zipfile.ZipFile(path) as archive:
            size, free = sum(info.file_size for info in archive.infolist()), SHARE * free_memory()
            if size > free:
                raise InputError(
                    f"{path}: holds {size / 1e9:.3g} GB, and {free / 1e9:.3g} GB of memory may be filled"
                )
        found = {}
        with np.load(path, allow_pickle=False) as file:
            for name in file.files:
                found[name] = file[name]
    except InputError:
        raise
    except FileNotFoundError:
        raise InputError(f"{path}: this file is missing") from None
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror or error}") from None
    # zipfile, zlib and numpy raise whatever they meet in a damaged file.
    except Exception as error:
        entry = f"{one_line(name)}: " if name else ""
        reason = one_line(str(error)) or type(error).__name__
        raise InputError(
            f"{path}: {printable(entry)}damaged, or not what nmm wrote: {printable(reason)}"
        ) from None
    return found


def check_arrays(found: dict[str, Any], path: Path, limits: int, pairs: int) -> None:
    """`InputError` names the array that is missing, or of another kind or shape than a run's.

    Parameters
    ----------
    found : of a run's trajectory.npz
    limits, pairs : how many names summary.json has for limits and for pairs of shapes
    """
    lengths = {"L": limits, "K": np.size(found.get("t", ())) if pairs else 0, "3": 3, "6": 6}
    for name, shape in SHAPES.items():
        if name not in found:
            if name in ARRAYS or (pairs and shape.startswith("K")):
                raise InputError(f"{path}: {name}: this array is missing")
            continue
        array, kind = found[name], "i" if name in WHOLE_NUMBERS else "f"
        where = f"{path}: {name}"
        if array.dtype.kind != kind or array.dtype.itemsize != 8:
            whole = "whole numbers" if kind == "i" else "numbers"
            raise InputError(f"{where}: expected {whole} of 64 bits, got {array.dtype}")
        if array.ndim != len(shape):
            raise InputError(f"{where}: expected {len(shape)} axes, got shape {array.shape}")
        expected = [
            length if letter == "." else lengths.setdefault(letter, length)
            for letter, length in zip(shape, array.shape, strict=True)
        ]
        if expected != list(array.shape):
            raise InputError(f"{where}: expected shape {tuple(expected)}, got {array.shape}")
        if name in FINITE and not np.all(np.abs(array) <= LARGEST):
            raise InputError(f"{where}: expected finite numbers, none beyond {LARGEST:g}")
        if name not in UNBOUNDED and np.any(np.abs(array[np.isfinite(array)]) > LARGEST):
            raise InputError(f"{where}: expected numbers, none beyond {LARGEST:g}")
    if np.any(np.diff(found["t"]) <= 0.0):
        raise InputError(f"{path}: t: expected times that increase from sample to sample")
    _check_indices(found["partition"], found["u"].shape[1], f"{path}: partition: columns of the inputs")
    if "clearance_pairs" in found:
        _check_indices(found["clearance_pairs"], pairs, f"{path}: clearance_pairs: places among the names")


def check_placements(places: Any, where: str, lengths: Collection[int]) -> None:
    """`InputError` unless they are placements (K, 4, 4), rotations and m, of as many samples as that."""
    if places.dtype != np.float64 or places.shape[1:] != (4, 4) or len(places) not in lengths:
        raise InputError(
            f"{where}: expected placements, (K, 4, 4), got {places.dtype} of shape {places.shape}"
        )
    turned = places[:, :3, :3]
    square = np.einsum("kij,kil->kjl", turned, turned)
    rigid = np.abs(square - np.eye(3)).max(initial=0.0) < 1e-6 and np.all(np.linalg.det(turned) > 0.0)
    if not (np.isfinite(places).all() and rigid and np.all(places[:, 3] == [0.0, 0.0, 0.0, 1.0])):
        raise InputError(f"{where}: expected rotations and finite translations")


def _check_indices(found: Any, count: int, what: str) -> None:
    if found.size and not (found.min() >= -1 and found.max() < count):
        raise InputError(
            f"{what}: expected numbers from -1 to {count - 1}, got {found.min()} to {found.max()}"
        )
