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


def save(repeatability: Repeatability, folder: str | Path, *, figures: FigureOptions = PLAIN) -> Path:
    """Write each run's folder, summary.json, laps.csv and laps.png, replacing a folder of laps; InputError
    for one of anything else, or one that cannot be written."""
    with replaced_folder(folder, is_laps) as temporary:
        for run in repeatability.laps:
            run.trajectory.save(temporary / run.name, figures=False)
        is_laps.write(temporary, _summary(repeatability), ensure_ascii=True)
        with (temporary / "laps.csv").open("w", newline="", encoding="utf-8") as file:
            csv.writer(file, lineterminator="\n").writerows(_lines(repeatability))
        if any(len(run.distance) for run in repeatability.laps):
            from nmm.views.figures.repeatability import laps
            from nmm.views.figures.style import save_as

            save_as(laps(repeatability, **figures.across()), temporary, "laps", figures)
    return Path(folder)


def _summary(repeatability: Repeatability) -> dict[str, Any]:
    return {
        "complete": repeatability.complete,
        "period": repeatability.period,
        "transient": str(repeatability.transient),
        "laps": {
            run.name: {
                "verdict": str(run.verdict),
                "finding": run.verdict.as_json(),
                "closes": run.closes,
                "converges": run.converges,
                "factor": run.factor,
                "distance": run.distance.tolist(),
                "displacement": run.displacement.tolist(),
                "errors": run.errors.tolist(),
                "turns": {
                    coordinate: turns.tolist()
                    for coordinate, turns in zip(run.robot.q_names, run.turns.T, strict=True)
                    if np.any(turns)
                },
            }
            for run in repeatability.laps
        },
    }


def _lines(repeatability: Repeatability) -> Iterator[list[object]]:
    names = repeatability.laps[0].robot.q_names if repeatability.laps else ()
    yield [
        "resolver", "lap", *names, *(f"drift_{name}" for name in names), "posture_drift", "displacement",
        "task_error",
    ]  # fmt: skip
    for run in repeatability.laps:
        changes = np.column_stack([run.drift, run.distance, run.displacement]).tolist()
        ends = zip(run.q.tolist(), [[""] * (len(names) + 2), *changes], run.errors.tolist(), strict=False)
        for k, (q, change, error) in enumerate(ends):  # none where the first lap could not begin
            yield [run.name, k, *q, *change, error]
