"""A comparison's folder: several runs, and one summary, figure and playback of all."""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING

from nmm.errors import InputError
from nmm.folders.whole import has_format, replaced_folder
from nmm.machine import made_with
from nmm.runs.figure_options import PLAIN, FigureOptions
from nmm.scenario.numbers import shown

if TYPE_CHECKING:
    from nmm.runs.ellipsoid_options import Wanted
    from nmm.runs.trajectory import Trajectory

#: Marks a folder of a comparison.
FORMAT = "nmm comparison 1"


def is_comparison(folder: Path) -> bool:
    """Whether a folder holds a comparison that nmm wrote."""
    return has_format(folder / "summary.json", FORMAT)


def runs_of(folder: Path) -> list[Path]:
    """The folders of a comparison's runs; `InputError` names what is wrong with its summary.json."""
    from nmm.folders.told import ToldComparison, read_told

    file = folder / "summary.json"
    names = list(read_told(file, ToldComparison, FORMAT).runs)
    for name in names:
        if not name or name in (".", "..") or Path(name).name != name:
            raise InputError(f"{file}: runs: expected names of folders, got {shown(name)}")
    return [folder / name for name in names]


def folder_name(called: str) -> str:
    """What a run's folder is named after: "rg" of RG, "pg-alpha-50" of PG α=50."""
    return re.sub(r"[^\w.]+", "-", called.replace("α", "alpha")).strip("-.").lower() or "run"


def names_of(trajectories: Sequence[Trajectory]) -> list[str]:
    """The name of each run's folder; no two are the same."""
    found: list[str] = []
    for trajectory in trajectories:
        name = folder_name(trajectory.called)
        again = (f"{name}-{k}" for k in count(2))
        found.append(name if name not in found else next(other for other in again if other not in found))
    return found


def save(
    trajectories: Sequence[Trajectory],
    folder: str | Path,
    title: str,
    *,
    ellipsoids: Wanted = False,
    figures: FigureOptions = PLAIN,
) -> Path:
    """Write each run's folder, summary.json, comparison.png and playback.html.

    Parameters
    ----------
    trajectories : the runs; what they are called tells them apart
    folder : a new folder, or one of a comparison, which is replaced
    title : of the playback
    ellipsoids : whether the playback shows manipulability ellipsoids, or how
    figures : formats and width of the figure

    Raises
    ------
    InputError : the folder exists and is not a comparison's, or cannot be written
    """
    with replaced_folder(folder, is_comparison) as temporary:
        runs = dict(zip(names_of(trajectories), trajectories, strict=True))
        for name, trajectory in runs.items():
            trajectory.save(temporary / name, figures=False)
        summary = {
            "format": FORMAT,
            "made_with": made_with(),
            "complete": all(trajectory.complete for trajectory in trajectories),
            "runs": {name: trajectory.summary() for name, trajectory in runs.items()},
        }
        (temporary / "summary.json").write_text(json.dumps(summary, indent=2) + "\n", encoding="utf-8")
        shown = [trajectory for trajectory in trajectories if len(trajectory) > 1]
        if shown:
            from nmm.figures import comparison
            from nmm.figures.files import save_as
            from nmm.playback import write_html

            save_as(comparison(shown, **figures.across()), temporary, "comparison", figures)
            write_html(shown, temporary / "playback.html", title=title, ellipsoids=ellipsoids)
    return Path(folder)
