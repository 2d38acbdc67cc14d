"""A comparison's folder: several runs with one summary, figure and playback."""

from __future__ import annotations

import re
from collections.abc import Sequence
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING

from nmm.base.errors import InputError
from nmm.base.figure_options import PLAIN, FigureOptions
from nmm.views.folders.whole import FolderKind, replaced_folder

if TYPE_CHECKING:
    from nmm.base.ellipsoid_options import Wanted
    from nmm.motion.trajectory import Trajectory

is_comparison = FolderKind("nmm comparison 1")


def runs_of(folder: Path) -> list[Path]:
    """The folders of a comparison's runs; InputError for an invalid summary.json."""
    from nmm.views.folders.schema import ToldComparison, read_checked

    file = folder / is_comparison.file
    names = list(read_checked(file, ToldComparison, is_comparison.format).runs)
    for name in names:
        if not name or name in (".", "..") or Path(name).name != name:
            raise InputError(where=f"{file}: runs", expected="names of folders", got=name)
    return [folder / name for name in names]


def folder_name(called: str) -> str:
    """A run's folder: "rg" for RG, "pg-alpha-50" for PG α=50."""
    return re.sub(r"[^\w.]+", "-", called.replace("α", "alpha")).strip("-.").lower() or "run"


def names_of(trajectories: Sequence[Trajectory]) -> list[str]:
    """A unique folder name for each run."""
    names: list[str] = []
    for trajectory in trajectories:
        name = folder_name(trajectory.called)
        again = (f"{name}-{k}" for k in count(2))
        names.append(name if name not in names else next(other for other in again if other not in names))
    return names


def save(
    trajectories: Sequence[Trajectory],
    folder: str | Path,
    title: str,
    *,
    ellipsoids: Wanted = False,
    figures: FigureOptions = PLAIN,
) -> Path:
    """Write a folder for each run, named after it, summary.json, comparison.png and playback.html, replacing
    a comparison; InputError for a folder of anything else, or one that cannot be written."""
    with replaced_folder(folder, is_comparison) as temporary:
        runs = dict(zip(names_of(trajectories), trajectories, strict=True))
        for name, trajectory in runs.items():
            trajectory.save(temporary / name, figures=False)
        summary = {
            "complete": all(trajectory.complete for trajectory in trajectories),
            "runs": {name: trajectory.summary() for name, trajectory in runs.items()},
        }
        is_comparison.write(temporary, summary, ensure_ascii=True)
        shown = [trajectory for trajectory in trajectories if len(trajectory) > 1]
        if shown:
            from nmm.views.figures import comparison
            from nmm.views.figures.style import save_as
            from nmm.views.playback import write_html

            save_as(comparison(shown, **figures.across()), temporary, "comparison", figures)
            write_html(shown, temporary / "playback.html", title=title, ellipsoids=ellipsoids)
    return Path(folder)
