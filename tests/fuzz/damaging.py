"""Ways in which the files of a folder get damaged, the same for the same seed."""

from __future__ import annotations

import json
import random
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import yaml

import nmm
from nmm.views.folders import comparison

#: What stands in the place of a value in JSON or YAML.
WRONG: tuple[Any, ...] = (
    None, True, False, 0, -1, 2, 10**25, -1e308, float("nan"), float("inf"), "", "nan", "\x1b[31mred",
    "../..", "q1", "x" * 5000, [], [0.0], [[]], {}, {"kind": "sphere"}, [1.0, 2.0, 3.0],
)  # fmt: skip


def damage(folder: Path, rng: random.Random) -> str:
    """Damage one file of a folder; in words, what was done."""
    file = rng.choice(sorted(path for path in folder.rglob("*") if path.suffix in (".npz", ".json", ".yaml")))
    ways: list[Callable[[Path, random.Random], str]] = [_cut, _flipped, _replaced_file]
    ways += [_array] * 4 if file.suffix == ".npz" else [_value] * 4
    return f"{file.relative_to(folder)}: {rng.choice(ways)(file, rng)}"


def _cut(file: Path, rng: random.Random) -> str:
    content = file.read_bytes()
    left = rng.choice([0, 1, rng.randrange(len(content)), len(content) - 1])
    file.write_bytes(content[:left])
    return f"cut to {left} bytes"


def _flipped(file: Path, rng: random.Random) -> str:
    content = bytearray(file.read_bytes())
    places = [rng.randrange(len(content)) for _ in range(rng.choice([1, 1, 3, 30]))]
    for place in places:
        content[place] ^= 1 << rng.randrange(8)
    file.write_bytes(content)
    return f"bits flipped at {places}"


def _replaced_file(file: Path, rng: random.Random) -> str:
    file.unlink()
    what = rng.choice(["nothing", "a folder", "a loop", "bytes", "deep JSON", "an npy file", "a device"])
    if what == "a folder":
        file.mkdir()
    elif what == "a loop":
        file.symlink_to(file)
    elif what == "bytes":
        file.write_bytes(rng.randbytes(500))
    elif what == "deep JSON":
        file.write_text("[" * 100_000)
    elif what == "an npy file":
        with file.open("wb") as opened:
            np.save(opened, np.zeros(3))
    elif what == "a device":
        file.symlink_to("/dev/zero")
    return f"replaced by {what}"


def _array(file: Path, rng: random.Random) -> str:
    with np.load(file) as found:
        arrays = dict(found)
    name = rng.choice(sorted(arrays))
    array = arrays[name]
    ways: dict[str, Callable[[], Any]] = {
        "deleted": lambda: None,
        "a sample less": lambda: array[:-1],
        "an axis more": lambda: array[np.newaxis],
        "flat": lambda: array.ravel(),
        "a column more": lambda: np.concatenate([array, array], axis=-1),
        "one number": lambda: np.array(3.0),
        "empty": lambda: array[:0],
        "text": lambda: array.astype(str),
        "complex": lambda: np.zeros(array.shape, complex),
        "objects": lambda: np.array([{"a": 1}] * max(len(array), 1), dtype=object),
        "single": lambda: array.astype(np.float32) if array.dtype.kind == "f" else array.astype(str),
        "backwards": lambda: array[::-1],
        "not numbers": lambda: array * np.nan if array.dtype.kind in "fi" else array,
        "huge": lambda: array * 1e300 if array.dtype.kind == "f" else array,
        "far indices": lambda: array + 10**6 if array.dtype.kind == "i" else array,
        "zeros": lambda: np.zeros_like(array),
    }
    way = rng.choice(sorted(ways))
    changed = ways[way]()
    arrays[name] = changed
    if changed is None:
        del arrays[name]
    np.savez(file, **arrays)
    return f"{name} {way}"


def _value(file: Path, rng: random.Random) -> str:
    text = file.read_text(encoding="utf-8")
    content = json.loads(text) if file.suffix == ".json" else yaml.safe_load(text)
    holder, key = rng.choice(list(_places(content)))
    said = f"{key!r} of {str(holder)[:60]!r}"
    if rng.random() < 0.3:
        del holder[key]
        said += " deleted"
    else:
        holder[key] = rng.choice(WRONG)
        said += f" set to {str(holder[key])[:40]!r}"
    dump = json.dumps if file.suffix == ".json" else yaml.safe_dump
    file.write_text(dump(content), encoding="utf-8")
    return said


def _places(content: Any) -> Any:
    """Every mapping or list with each of its keys or indices."""
    inner = content.items() if isinstance(content, dict) else enumerate(content)
    for key, value in list(inner):
        yield content, key
        if isinstance(value, dict | list):
            yield from _places(value)


def whole_folders(top: Path) -> dict[str, Path]:
    """Folders to damage, by name: a run among obstacles, one of tasks that come and go, and a comparison."""
    short = {"duration": 0.1}
    for name in ("unicycle_3r_crossing", "unicycle_3r_sequence"):
        nmm.Scenario.load(name, short).run().save(top / name, figures=False)
    case = nmm.Scenario.load("unicycle_2r_position", short)
    compared = [case.with_resolver(kind).run() for kind in ("rg", "pg")]
    comparison.save(compared, top / "compared", "compared")
    return {path.name: path for path in top.iterdir()}


def copied(folder: Path, to: Path) -> Path:
    """A copy to damage, in the place of the one before."""
    shutil.rmtree(to, ignore_errors=True)
    return Path(shutil.copytree(folder, to))
