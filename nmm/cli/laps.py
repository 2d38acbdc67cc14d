"""laps: a scenario driven round its path several times, per resolver."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from nmm.cli.interrupts import shielded
from nmm.cli.output import complain, progress, show_table, show_text, warn
from nmm.cli.paper_table import print_table
from nmm.folders.laps import is_laps, save
from nmm.folders.whole import check_folder
from nmm.runs.figure_options import PLAIN, FigureOptions

if TYPE_CHECKING:
    from nmm.analysis.redundancy.laps import Laps, Repeatability

OK, FAILED = 0, 1


def run_laps(
    name: str,
    kinds: Sequence[str],
    settings: Mapping[str, object],
    *,
    laps: int,
    period: float | None,
    out: Path | None,
    figures: FigureOptions = PLAIN,
    form: str | None = None,
) -> int:
    """Run the laps, write the folder, print the tables; 1 when a run ended before its last lap.

    form : of one table with all, for a paper; the terminal's when not given
    """
    from nmm.analysis.redundancy.laps import repeatability
    from nmm.scenario import Scenario

    scenario = Scenario.load(name, settings)
    folder = out or Path("runs") / f"{scenario.name}-laps"
    check_folder(folder, is_laps)
    with progress(f"{scenario.name}, {laps} laps") as report:
        found = repeatability(scenario, laps=laps, resolvers=kinds, period=period, progress=report)
    with shielded():
        save(found, folder, figures=figures)
    for one in found.laps:
        for warning in one.trajectory.warnings:
            warn(f"{one.name.upper()}: {warning}")
    if form is None:
        _show(found, scenario.name, folder)
    else:
        from nmm.tables import laps_table

        print_table(laps_table(found), form, folder)
    for one in found.laps:
        if not one.finished:
            complain(
                "nmm laps", f"{one.name.upper()} {one.verdict}; the part that was computed is in {folder}"
            )
    return OK if found.complete else FAILED


def _show(found: Repeatability, name: str, folder: Path) -> None:
    """A table a resolver, on the terminal."""
    show_text(f"{name}: {found.transient}; period {found.period:.6g} s")
    for one in found.laps:
        show_text()
        columns, rows = _table(one)
        show_table(columns, rows, title=f"{one.name.upper()} {one.verdict}", numeric=columns)
        if one.winding:
            show_text(one.winding)
    show_text()
    show_table(["", ""], [["files in", str(folder)]])


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
