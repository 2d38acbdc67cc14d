"""What a sweep would take, before it is begun: time by a rollout that is timed, and room on the disk."""

from __future__ import annotations

import shutil
import time
from pathlib import Path

from nmm.errors import InputError
from nmm.sweeps.columns import columns_of
from nmm.sweeps.definition import Definition
from nmm.sweeps.rows import rows_of

#: Fewer rows are begun without being timed.
TIMED = 200_000
#: Days that a sweep may take by the estimate.
MOST_DAYS = 30.0
DAY = 86_400.0
#: Bytes of a cell, measured in tables of 10^4 rows.
CELL = 8.0


def check_size(definition: Definition, workers: int, folder: Path) -> None:
    """`InputError`, with numbers, for a sweep that would take more than `MOST_DAYS`, or than the disk has.

    Parameters
    ----------
    workers : how many rows are computed at the same time
    folder : where the table is to be
    """
    rows = definition.rows
    if rows < TIMED:
        return
    rows_of(definition, [0])  # the first one compiles, and loads the robot
    began = time.perf_counter()
    rows_of(definition, [1])
    each = time.perf_counter() - began
    days, size = rows * each / workers / DAY, rows * CELL * len(columns_of(definition))
    parent = folder.absolute()
    while not parent.exists():
        parent = parent.parent
    free = float(shutil.disk_usage(parent).free)
    told = (
        f"{rows} rollouts of {each:.2g} s each take {_days(days)} with {workers} at a time, and "
        f"{size / 1e9:.3g} GB for their table"
    )
    if days > MOST_DAYS:
        raise InputError(f"samples: {told}; expected at most {MOST_DAYS:g} days: take fewer, or more workers")
    if 2.0 * size > free:  # the parts, and the table of them
        raise InputError(
            f"samples: {told}; {free / 1e9:.3g} GB are free at {parent}, and twice that is needed"
        )


def _days(days: float) -> str:
    return f"{days / 365.25:.3g} years" if days > 365.25 else f"{days:.3g} days"
