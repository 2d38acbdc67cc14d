"""redundancy: what a task leaves free, and a motion that shows it."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from nmm.cli.output import show_table, show_text, warn
from nmm.cli.singularity_words import ZERO, number, say
from nmm.errors import InputError
from nmm.files import replaceable

if TYPE_CHECKING:
    from nmm.analysis.redundancy.moving import SelfMotion
    from nmm.analysis.redundancy.report import RedundancyReport


def check_file(file: Path, option: str) -> None:
    """`InputError` where a file cannot be written, its folder missing: before anything is computed."""
    try:
        folder = replaceable(file).parent
    except InputError as error:
        raise InputError(f"{option}: {error}") from None
    if not folder.is_dir() or not os.access(folder, os.W_OK | os.X_OK):
        raise InputError(f"{option}: {file} cannot be written: {folder} is not a folder where you may write")


def direction_of(text: str) -> int | str | dict[str, float]:
    """What `--self-motion` says: a number, an input, or inputs with rates."""
    from nmm.cli.options import values_of

    text = text.strip()
    if not text:
        raise InputError("--self-motion: expected a number, an input or INPUT=RATE,..., as in v=-1,q2=0.5")
    if "=" in text or "," in text:
        return values_of(text.split(","), "--self-motion", "INPUT=RATE,..., as in v=-1,q2=0.5")
    try:
        return int(text)
    except ValueError:
        return text


def show_report(report: RedundancyReport) -> None:
    """The report's lines, each going on below itself where the terminal is narrow."""
    for line in report.text().splitlines():
        say(line)


def show_self_motion(moved: SelfMotion) -> None:
    """How far each coordinate goes, and how well the task stays."""
    trajectory, robot = moved.trajectory, moved.trajectory.robot
    for warning in trajectory.warnings:
        warn(warning)
    show_text()
    say(f"self-motion: {moved.text}, and back")
    error = float(np.abs(trajectory.error).max(initial=0.0))
    # What the feedback moves to take out the drift is noise too: where 1e-10 of `largest` is a zero.
    largest = max(float(np.abs(trajectory.q).max()), 10.0 * error / ZERO)
    show_table(
        ["coordinate", "unit", "from", "to", "lowest", "highest"],
        [
            [name, unit, *(number(value, largest) for value in (q[0], q[moved.turning], q.min(), q.max()))]
            for name, unit, q in zip(robot.q_names, robot.q_units, trajectory.q.T, strict=True)
        ],
        numeric=["from", "to", "lowest", "highest"],
    )
    say(f"the task stays within {error:.1g} of its value over {trajectory.t[-1]:.3g} s")
