"""Redo a section of a paper from one file: `python section.py section.yaml OUT`.

OUT holds the file itself, a folder of each run, the tables and the figures. Exit status: 0; 1 where a run did
not complete (all is still written); 2 for bad input.
"""

from __future__ import annotations

import shutil
import sys
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import yaml

import nmm
from nmm import figures


def redo(file: Path, out: Path) -> dict[str, nmm.Trajectory]:
    """Write what `file` states into `out`; returns the runs by name."""
    stated = known("the file", yaml.safe_load(file.read_text(encoding="utf-8")), "runs", "tables", "figures")
    runs = {name: run(name, what) for name, what in stated.get("runs", {}).items()}
    out.mkdir(parents=True, exist_ok=True)
    shutil.copyfile(file, out / "section.yaml")
    for name, trajectory in runs.items():
        trajectory.save(out / "runs" / name, figures=False)
    for name, columns in stated.get("tables", {}).items():
        nmm.comparison_table(several(runs, columns, name)).save(out / name)
    for name, what in stated.get("figures", {}).items():
        figures.save(figure(name, what, runs), out / name)
    return runs


def run(name: str, what: Any) -> nmm.Trajectory:
    """A scenario as stated, run."""
    known(name, what, "scenario", "resolver", "set", "label")
    if "scenario" not in what:
        raise nmm.InputError(f"{name}: expected a scenario")
    kind = {"resolver.kind": what["resolver"]} if "resolver" in what else {}
    trajectory = nmm.Scenario.load(what["scenario"], kind | what.get("set", {})).run()
    return replace(trajectory, label=what.get("label", ""))


def figure(name: str, what: Any, runs: Mapping[str, nmm.Trajectory]) -> Any:
    """A drawing of one run, or of several."""
    options = dict(known(name, what))
    drawn, of, width = (options.pop(key, None) for key in ("draw", "of", "width"))
    if drawn not in figures.__all__ or drawn in ("FigureOptions", "save", "write_run_figures"):
        raise nmm.InputError(f"{name}: draw: expected a drawing of nmm.figures, got {drawn!r}")
    chosen = several(runs, of, name)
    options |= figures.FigureOptions(width=width).across()
    return getattr(figures, drawn)(chosen if isinstance(of, list) else chosen[0], **options)


def several(runs: Mapping[str, nmm.Trajectory], names: Any, where: str) -> list[nmm.Trajectory]:
    """The runs of these names, or of this one."""
    listed = names if isinstance(names, list) else [names]
    for name in listed:
        if name not in runs:
            raise nmm.InputError(f"{where}: expected runs among {', '.join(runs)}, got {name!r}")
    return [runs[name] for name in listed]


def known(where: str, given: Any, *keys: str) -> dict[str, Any]:
    """What was given, which is a mapping with no other keys than these, if any are named."""
    if not isinstance(given, dict):
        raise nmm.InputError(f"{where}: expected a mapping, got {given!r}")
    for key in given:
        if keys and key not in keys:
            raise nmm.InputError(f"{where}: expected {', '.join(keys)}, got {key!r}")
    return given


def main(arguments: list[str]) -> int:
    """The exit status."""
    if len(arguments) != 2:
        print("expected: python section.py FILE.yaml OUT", file=sys.stderr)
        return 2
    try:
        runs = redo(Path(arguments[0]), Path(arguments[1]))
    except (nmm.NmmError, OSError, TypeError, yaml.YAMLError) as error:
        print(f"{arguments[0]}: {' '.join(str(error).split())}", file=sys.stderr)
        return 2
    failed = {name: one for name, one in runs.items() if not one.complete}
    for name, trajectory in failed.items():
        print(f"{name}: {trajectory.outcome}: {trajectory.message}", file=sys.stderr)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
