"""The folder of laps round a closed path: a run for each resolver, and each lap's drift."""

from __future__ import annotations

import csv
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from nmm.base.figure_options import PLAIN, FigureOptions
from nmm.views.folders.whole import FolderKind, replaced_folder

if TYPE_CHECKING:
    from nmm.analysis.null_space.laps import Repeatability

is_laps = FolderKind("nmm laps 1")


def save(found: Repeatability, folder: str | Path, *, figures: FigureOptions = PLAIN) -> Path:
    """Write each run's folder, summary.json, laps.csv and laps.png, replacing a folder of laps; InputError
    for one of anything else, or one that cannot be written."""
    with replaced_folder(folder, is_laps) as temporary:
        for one in found.laps:
            one.trajectory.save(temporary / one.name, figures=False)
        is_laps.write(temporary, _summary(found), ensure_ascii=True)
        with (temporary / "laps.csv").open("w", newline="", encoding="utf-8") as file:
            csv.writer(file, lineterminator="\n").writerows(_lines(found))
        if any(len(one.distance) for one in found.laps):
            from nmm.views.figures.repeatability import laps
            from nmm.views.figures.style import save_as

            save_as(laps(found, **figures.across()), temporary, "laps", figures)
    return Path(folder)


def _summary(found: Repeatability) -> dict[str, Any]:
    return {
        "complete": found.complete,
        "period": found.period,
        "transient": str(found.transient),
        "laps": {
            one.name: {
                "verdict": str(one.verdict),
                "finding": one.verdict.as_json(),
                "closes": one.closes,
                "converges": one.converges,
                "factor": one.factor,
                "distance": one.distance.tolist(),
                "displacement": one.displacement.tolist(),
                "errors": one.errors.tolist(),
                "turns": {
                    coordinate: turns.tolist()
                    for coordinate, turns in zip(one.robot.q_names, one.turns.T, strict=True)
                    if np.any(turns)
                },
            }
            for one in found.laps
        },
    }


def _lines(found: Repeatability) -> Iterator[list[object]]:
    names = found.laps[0].robot.q_names if found.laps else ()
    yield [
        "resolver", "lap", *names, *(f"drift_{name}" for name in names), "posture_drift", "displacement",
        "task_error",
    ]  # fmt: skip
    for one in found.laps:
        changes = np.column_stack([one.drift, one.distance, one.displacement]).tolist()
        ends = zip(one.q.tolist(), [[""] * (len(names) + 2), *changes], one.errors.tolist(), strict=False)
        for k, (q, change, error) in enumerate(ends):  # none where the first lap could not begin
            yield [one.name, k, *q, *change, error]
