"""Validation of a folder's JSON and arrays: keys, kinds of values, shapes."""

import math
import zipfile
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from pydantic import BaseModel, ConfigDict, FiniteFloat, PositiveFloat, ValidationError

from nmm.base.arrays import increasing
from nmm.base.errors import InputError, expect
from nmm.base.files import expect_file, read_bytes
from nmm.base.machine import SHARE, free_memory
from nmm.base.text_format import one_line, printable
from nmm.control.step.quantities import saved
from nmm.motion.residuals import NO_RESIDUALS
from nmm.motion.trajectory import Outcome
from nmm.scenario.keys import first_error
from nmm.scenario.yaml_text import dotted
from nmm.views.folders.whole import MOST

#: Larger values belong to diverged motions, and overflow when drawn.
LARGEST = 1e30


class Told(BaseModel):
    """A mapping of a folder's JSON; other keys are ignored."""

    model_config = ConfigDict(strict=True, frozen=True)


class ToldRobot(Told):
    name: str
    source: str
    arguments: dict[str, str]
    fingerprint: str | None = None
    numbers: dict[str, FiniteFloat] = {}


class ToldEvent(Told):
    t: FiniteFloat
    task: str
    what: str
    why: str


class ToldFinding(Told):
    code: str
    values: dict[str, Any] = {}
    where: dict[str, Any] = {}
    text: str
    line: str


class ToldObstacle(Told):
    name: str
    shape: dict[str, Any]


class ToldGoal(Told):
    point: int
    x: int
    y: int
    intrinsics: tuple[PositiveFloat, PositiveFloat, FiniteFloat, FiniteFloat]


class ToldCamera(Told):
    frame: str
    points: tuple[int, ...]
    goals: tuple[ToldGoal, ...]
    border: tuple[FiniteFloat, FiniteFloat, FiniteFloat, FiniteFloat]
    bounded: bool
    intrinsics: tuple[PositiveFloat, PositiveFloat, FiniteFloat, FiniteFloat]
    lines: tuple[tuple[int, int], ...]


class ToldRun(Told):
    """summary.json of a run; values with a default may be absent in older ones."""

    format: str
    robot: ToldRobot
    r_names: tuple[str, ...]
    r_units: tuple[str, ...]
    resolver: str
    method: str
    dt: PositiveFloat
    outcome: Outcome
    message: str
    warnings: tuple[str, ...]
    findings: tuple[ToldFinding, ...] | None = None
    frame: str | None
    samples: int | None = None
    label: str = ""
    limited: bool = False
    kinematics_off: float | None = None
    limit_names: tuple[str, ...] = ()
    clearance_names: tuple[str, ...] = ()
    clearance_asked: FiniteFloat = 0.0
    obstacles: tuple[ToldObstacle, ...] | None = None
    events: tuple[ToldEvent, ...] = ()
    cameras: tuple[ToldCamera, ...] = ()
    made_with: dict[str, str | int] = {}
    unmet_samples: int = NO_RESIDUALS.samples
    unmet_share: float = NO_RESIDUALS.share
    unmet_largest: float = NO_RESIDUALS.largest
    unmet_relative: float = NO_RESIDUALS.relative
    unmet_t: float = NO_RESIDUALS.t


class ToldFormat(Told):
    format: str


class ToldComparison(ToldFormat):
    """summary.json of a comparison, with its runs by folder."""

    runs: dict[str, Any]


Kind = TypeVar("Kind", bound=Told)
Model = TypeVar("Model", bound=BaseModel)


def read_checked(path: Path, kind: type[Kind], format_: str) -> Kind:
    """A JSON file's content; InputError names the file, the key and what was expected."""
    with _reading(path):
        content = read_bytes(path, MOST)
    stored = _checked(path, content, ToldFormat).format
    if stored != format_:
        same = stored.rpartition(" ")[0] == format_.rpartition(" ")[0]
        what = "written by another version of nmm" if same else ""
        raise InputError(what, where=f"{path}: format", expected=repr(format_), got=stored)
    return _checked(path, content, kind)


def read_json(path: Path, kind: type[Model]) -> Model:
    """As `read_checked`, of a file that states no format of nmm's."""
    with _reading(path):
        content = read_bytes(path, MOST)
    return _checked(path, content, kind)


def _checked(path: Path, content: bytes, kind: type[Model]) -> Model:
    try:
        return kind.model_validate_json(content)
    except ValidationError as error:
        first = error.errors(include_url=False, include_input=False)[0]
        if first["type"] == "json_invalid":
            raise InputError(f"not valid JSON: {first['ctx']['error']}", where=path) from None
        wrong = first_error(error, {})
        raise wrong.at(f"{path}: {dotted(wrong.place)}" if wrong.place else path, InputError) from None


def read_arrays(path: Path) -> dict[str, Any]:
    """All arrays of an npz file; InputError names the file and a damaged array."""
    name, arrays = "", {}
    with _reading(path):
        expect_file(path)
        try:
            with zipfile.ZipFile(path) as archive:
                size, free = sum(info.file_size for info in archive.infolist()), SHARE * free_memory()
                for info in archive.infolist() if size <= free else ():
                    name = info.filename.removesuffix(".npy")
                    if name != info.filename:
                        _expect_its_size(archive, info)
                name = ""
            if size > free:
                holds = f"holds {size / 1e9:.3g} GB, and {free / 1e9:.3g} GB of memory may be filled"
                raise InputError(holds, where=path)
            with np.load(path, allow_pickle=False) as file:
                for name in file.files:
                    arrays[name] = file[name]
        except (InputError, OSError):
            raise
        except Exception as error:  # zipfile, zlib and numpy raise whatever they meet in a damaged file
            entry = f"{one_line(name)}: " if name else ""
            reason = one_line(str(error)) or type(error).__name__
            damaged = f"{printable(entry)}damaged, or not what nmm wrote: {printable(reason)}"
            raise InputError(damaged, where=path) from None
    return arrays


def _expect_its_size(archive: zipfile.ZipFile, info: zipfile.ZipInfo) -> None:
    """`ValueError` for an array whose header claims more than its entry holds: numpy would reserve it all."""
    with archive.open(info) as entry:
        version = np.lib.format.read_magic(entry)
        read = (
            np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
        )
        shape, _, kind = read(entry)
        if math.prod(shape) * kind.itemsize > info.file_size:
            raise ValueError(f"its header claims the shape {shape}, it holds {info.file_size:,} bytes")


@contextmanager
def _reading(path: Path) -> Iterator[None]:
    try:
        yield
    except FileNotFoundError:
        raise InputError("this file is missing", where=path) from None
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror or error}", where=path) from None


def check_arrays(arrays: dict[str, Any], path: Path, limits: int, pairs: int) -> None:
    """InputError for a run's array that is missing, or of another kind or shape than summary.json implies."""
    lengths = {"L": limits, "K": np.size(arrays.get("t", ())) if pairs else 0}
    for quantity in saved():
        name = quantity.name
        if name not in arrays:
            if (quantity.since == 1 and not quantity.optional) or (pairs and quantity.shape.startswith("K")):
                raise InputError("this array is missing", where=f"{path}: {name}")
            continue
        array, where = arrays[name], f"{path}: {name}"
        fits = array.dtype.kind == ("i" if quantity.whole else "f") and array.dtype.itemsize == 8
        expect(fits, where, f"{'whole ' if quantity.whole else ''}numbers of 64 bits", str(array.dtype))
        expect(array.ndim == len(quantity.shape), where, f"{len(quantity.shape)} axes", array)
        expected = [
            int(letter) if letter.isdigit() else lengths.setdefault(letter, length)
            for letter, length in zip(quantity.shape, array.shape, strict=True)
        ]
        expect(expected == list(array.shape), where, f"shape {tuple(expected)}", array)
        finite = not quantity.finite or np.all(np.abs(array) <= LARGEST)
        expect(finite, where, f"finite numbers, none beyond {LARGEST:g}")
        beyond = quantity.bounded and np.any(np.abs(array[np.isfinite(array)]) > LARGEST)
        expect(not beyond, where, f"numbers, none beyond {LARGEST:g}")
    increasing(arrays["t"], f"{path}: t")
    counts = {"m": arrays["u"].shape[1], "p": pairs}
    for quantity in saved():
        if quantity.counts is not None and quantity.name in arrays:
            letter, words = quantity.counts
            indices, count = arrays[quantity.name], counts[letter]
            fits = np.all((indices >= -1) & (indices < count))
            expect(fits, f"{path}: {quantity.name}: {words}", f"numbers from -1 to {count - 1}", indices)


def check_placements(places: Any, where: str, lengths: Collection[int]) -> None:
    """InputError unless placements (K, 4, 4), rotations and m, of one of those numbers of samples."""
    fits = places.dtype == np.float64 and places.shape[1:] == (4, 4) and len(places) in lengths
    expect(fits, where, "placements, (K, 4, 4)", places)
    turned = places[:, :3, :3]
    square = np.einsum("kij,kil->kjl", turned, turned)
    rigid = np.abs(square - np.eye(3)).max(initial=0.0) < 1e-6 and np.all(np.linalg.det(turned) > 0.0)
    fits = np.isfinite(places).all() and rigid and np.all(places[:, 3] == [0.0, 0.0, 0.0, 1.0])
    expect(fits, where, "rotations and finite translations")
