"""Sweeps as YAML files: a scenario's name, what varies, how it is sampled."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from nmm.bundled import bundled_scenarios, bundled_sweeps
from nmm.errors import InputError, ScenarioError, expect_known, unknown
from nmm.scenario.document import read_file
from nmm.scenario.numbers import shown
from nmm.scenario.scenario import SUFFIXES

#: The keys of a file, and the keyword of `Sweep` that each is.
KEYS = {
    "name": "name",
    "title": "title",
    "scenario": "scenario",
    "set": "settings",
    "vary": "vary",
    "samples": "samples",
    "sampler": "sampler",
    "seed": "seed",
    "keep": "keep",
}


def is_sweep_file(name_or_path: str | Path) -> bool:
    """Whether it names a bundled sweep, or a YAML file that says what varies."""
    if str(name_or_path) in bundled_sweeps():
        return True
    path = Path(name_or_path)
    return path.suffix in SUFFIXES and path.is_file() and "vary" in read_file(path).data


def read_sweep(name_or_path: str | Path) -> dict[str, Any]:
    """The keywords of `Sweep` that a bundled sweep or a file says; it is read as strictly as a scenario.

    Raises
    ------
    ScenarioError : no such sweep; or the file, the line, and what was expected there
    """
    bundled = bundled_sweeps()
    path = bundled.get(str(name_or_path), Path(name_or_path))
    if not path.is_file() and path.suffix not in SUFFIXES:
        raise ScenarioError(unknown("sweep", str(name_or_path), bundled))
    document = read_file(path)
    data = document.data
    for key in data:
        try:
            expect_known("key", key, KEYS)
        except InputError as error:
            raise ScenarioError(f"{document.where((key,))}: {error}") from None
    for key in ("scenario", "vary"):
        if key not in data:
            raise ScenarioError(f"{document.where((key,))}: {key}: this key is missing")
    for key in ("vary", "set"):
        if not isinstance(data.get(key, {}), Mapping):
            raise ScenarioError(
                f"{document.where((key,))}: expected a mapping (key: value), got {shown(data[key])}"
            )
    found = {keyword: data[key] for key, keyword in KEYS.items() if key in data}
    name = data["scenario"]
    if not isinstance(name, str):
        raise ScenarioError(f"{document.where(('scenario',))}: expected a scenario's name, got {shown(name)}")
    if name not in bundled_scenarios():
        found["scenario"] = document.absolute(name, ("scenario",))
    return {"name": path.name.split(".", 1)[0], **found}
