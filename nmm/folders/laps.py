"""The folder of laps round a closed path: a run a resolver, and what came of each lap."""

from __future__ import annotations

import csv
import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from nmm.folders.whole import has_format, replaced_folder
from nmm.machine import made_with
from nmm.runs.figure_options import PLAIN, FigureOptions

if TYPE_CHECKING:
    from nmm.analysis.redundancy.laps import Repeatability

#: Marks a folder of laps.
FORMAT = "nmm laps 1"


def is_laps(folder: Path) -> bool:
    """Whether a folder holds laps that nmm wrote."""
    return has_format(folder / "summary.json", FORMAT)


def save(found: Repeatability, folder: str | Path, *, figures: FigureOptions = PLAIN) -> Path:
    """Write each run's folder, summary.json, laps.csv and laps.png.

    Parameters
    ----------
    folder : a new folder, or one of laps, which is replaced
    figures : formats and width of the figure

    Raises
    ------
    InputError : the folder exists and is not one of laps, or cannot be written
    """
    with replaced_folder(folder, is_laps) as temporary:
        for one in found.laps:
            one.trajectory.save(temporary / one.name, figures=False)
        (temporary / "summary.json").write_text(
            json.dumps(_summary(found), indent=2) + "\n", encoding="utf-8"
        )
        with (temporary / "laps.csv").open("w", newline="", encoding="utf-8") as file:
            csv.writer(file, lineterminator="\n").writerows(_lines(found))
        if any(len(one.distance) for one in found.laps):
            from nmm.figures.files import save_as
            from nmm.figures.repeatability import laps

            save_as(laps(found, **figures.across()), temporary, "laps", figures)
    return Path(folder)


def _summary(found: Repeatability) -> dict[str, Any]:
    return {
        "format": FORMAT,
        "made_with": made_with(),
        "complete": found.complete,
        "period": found.period,
        "transient": found.transient,
        "laps": {
            one.name: {
                "verdict": one.verdict,
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
    """q at each lap's end, its drift, and the rest, under a line of names."""
    names = found.laps[0].robot.q_names if found.laps else ()
    yield [
        "resolver", "lap", *names, *(f"drift_{name}" for name in names), "posture_drift", "displacement",
        "task_error",
    ]  # fmt: skip
    for one in found.laps:
        blank = [""] * (len(names) + 2)
        for k, q in enumerate(one.q):
            change: Sequence[object] = blank
            if k:
                change = [
                    *one.drift[k - 1].tolist(),
                    float(one.distance[k - 1]),
                    float(one.displacement[k - 1]),
                ]
            yield [one.name, k, *q.tolist(), *change, float(one.errors[k])]
