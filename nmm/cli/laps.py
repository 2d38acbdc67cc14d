"""laps: a scenario driven round its path several times, per resolver."""

from __future__ import annotations

import csv
import json
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from nmm.cli.output import complain, progress, shielded, show_table, show_text, warn
from nmm.cli.runs import check_folder
from nmm.runs.storage import has_format, replaced_folder

if TYPE_CHECKING:
    from nmm.analysis.redundancy.laps import Laps, Repeatability

#: Marks a folder of `nmm laps`.
FORMAT = "nmm laps 1"
OK, FAILED = 0, 1


def run_laps(
    name: str,
    kinds: Sequence[str],
    settings: Mapping[str, object],
    *,
    laps: int,
    period: float | None,
    out: Path | None,
) -> int:
    """Run the laps, write the folder, print the tables; 1 when a run ended before its last lap."""
    from nmm.analysis.redundancy.laps import repeatability
    from nmm.scenario import Scenario

    scenario = Scenario.load(name, settings)
    folder = out or Path("runs") / f"{scenario.name}-laps"
    check_folder(folder, _is_ours)
    with progress(f"{scenario.name}, {laps} laps") as report:
        found = repeatability(scenario, laps=laps, resolvers=kinds, period=period, progress=report)
    with shielded():
        _write(found, folder)
    show_text(f"{scenario.name}: {found.transient}; period {found.period:.6g} s")
    for one in found.laps:
        for warning in one.trajectory.warnings:
            warn(f"{one.name.upper()}: {warning}")
        show_text()
        columns, rows = _table(one)
        show_table(columns, rows, title=f"{one.name.upper()} {one.verdict}", numeric=columns)
        if one.winding:
            show_text(one.winding)
    show_text()
    show_table(["", ""], [["files in", str(folder)]])
    for one in found.laps:
        if not one.finished:
            complain(
                "nmm laps", f"{one.name.upper()} {one.verdict}; the part that was computed is in {folder}"
            )
    return OK if found.complete else FAILED


def _table(one: Laps) -> tuple[list[str], list[list[str]]]:
    """Columns and rows: a lap each."""
    robot = one.robot
    columns = ["lap", *(f"Δ{name}" for name in robot.q_names), "posture", "platform", "task error"]
    rows = []
    for k, drift in enumerate(one.drift):
        numbers = [*drift, one.distance[k], one.displacement[k], one.errors[k + 1]]
        rows.append([str(k + 1), *(_short(float(number)) for number in numbers)])
    return columns, rows


def _short(value: float) -> str:
    """Three digits; what is rounding as a power of ten."""
    return f"{value:.3f}" if abs(value) >= 0.01 else f"{value:.0e}" if value else "0"


def _is_ours(folder: Path) -> bool:
    return has_format(folder / "summary.json", FORMAT)


def _write(found: Repeatability, folder: Path) -> None:
    with replaced_folder(folder, _is_ours) as temporary:
        for one in found.laps:
            one.trajectory.save(temporary / one.name, figures=False)
        (temporary / "summary.json").write_text(
            json.dumps(_summary(found), indent=2) + "\n", encoding="utf-8"
        )
        with (temporary / "laps.csv").open("w", newline="", encoding="utf-8") as file:
            csv.writer(file, lineterminator="\n").writerows(_lines(found))
        if any(len(one.distance) for one in found.laps):
            from nmm.figures import style
            from nmm.figures.repeatability import laps

            style.save(laps(found), temporary / "laps.png")


def _summary(found: Repeatability) -> dict[str, Any]:
    return {
        "format": FORMAT,
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
