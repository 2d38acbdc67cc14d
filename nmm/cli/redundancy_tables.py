"""redundancy: what a task leaves free, and a motion that shows it."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from nmm.arrays import positive
from nmm.cli.output import show_table, show_text, warn
from nmm.cli.singularity_words import ZERO, number, say
from nmm.cli.subjects import studied
from nmm.errors import InputError, SingularError

if TYPE_CHECKING:
    from nmm.analysis.redundancy.moving import SelfMotion
    from nmm.analysis.redundancy.report import RedundancyReport

OK = 0
#: Between samples of a self-motion, s; less for short ones.
DT = 0.01
#: A page's title does not hide the robot: a longer sentence is left to the table.
LONGEST_TITLE = 100


def show_redundancy(
    source: str,
    *,
    tasks: Sequence[str] | None,
    at: Sequence[str] | None,
    settings: Sequence[str] | None,
    along: str | None,
    duration: float,
    speed: float,
    html: Path | None,
    play: bool,
    port: int | None = None,
    open_browser: bool = True,
    **loading: Any,
) -> int:
    """The report of SOURCE; with `along` the self-motion's table, file and playback.

    Raises
    ------
    InputError : wrong options; a direction that does not exist. Nothing has been printed then
    SingularError : the self-motion cannot begin; the report has been printed
    """
    from nmm.analysis.redundancy.null_fields import expect_direction
    from nmm.analysis.redundancy.report import redundancy

    if along is None and (html is not None or play):
        raise InputError(
            "--html and --play show a self-motion: expected --self-motion, as in --self-motion 0"
        )
    duration, speed = positive(duration, "--duration"), positive(speed, "--speed")
    if html is not None:
        check_file(html, "--html")
    direction = None if along is None else direction_of(along)
    found = studied(source, tasks=tasks, at=at, settings=settings, **loading)
    report = redundancy(found.subject, found.q, found.t)
    if direction is None:
        show_report(report)
        return OK
    from nmm.analysis.redundancy.moving import self_motion

    expect_direction(found.robot, report.J, report.rank_J, direction, "--self-motion")
    dt = min(DT, duration / 4.0)
    try:
        moved = self_motion(
            found.subject, found.q, t=found.t, direction=direction, duration=duration, speed=speed, dt=dt
        )
    except SingularError:
        show_report(report)
        raise
    show_report(report)
    show_self_motion(moved)
    short = moved.text if len(moved.text) <= LONGEST_TITLE else "self-motion"
    title = f"{found.robot.name}: {short}"
    motion = moved.trajectory.motion("self-motion")
    if html is not None:
        from nmm.playback import write_html

        show_text(f"written: {write_html([motion], html, title=title)}")
    if play:
        from nmm.playback import play as play_motions

        play_motions([motion], port=port, open_browser=open_browser, title=title)
    return OK


def check_file(file: Path, option: str) -> None:
    """`InputError` where a file cannot be written, its folder missing: before anything is computed."""
    folder = file.absolute().parent
    if file.is_dir():
        raise InputError(f"{option}: expected a file, {file} is a folder")
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
