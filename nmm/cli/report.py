"""A run in a few lines: what `nmm run` prints, and a column of what `nmm compare` prints."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING, Any

from nmm.cli.output import show_table, warn
from nmm.runs.table import rows

if TYPE_CHECKING:
    from nmm.runs.trajectory import Trajectory


def show_run(trajectory: Trajectory, numbers: dict[str, Any]) -> int:
    """Print the table of a run, and its warnings; returns the width of its first column.

    numbers : its summary
    """
    scenario = trajectory.scenario or {}
    title = f"{scenario.get('name', '')}: {scenario.get('title', '')}".strip(": ")
    lines = describe(trajectory, numbers)
    show_table(["", ""], lines, title=title)
    sys.stdout.flush()
    return max(len(label) for label, _ in lines)


def describe(trajectory: Trajectory, numbers: dict[str, Any]) -> list[tuple[str, str]]:
    """Labels and values of the numbers of a run, by its summary; warnings go to standard error."""
    for warning in numbers["warnings"]:
        warn(f"{trajectory.called}: {warning}")
    return list(rows(trajectory, numbers))
