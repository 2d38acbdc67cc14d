"""redundancy: what a task leaves free, and a motion that shows it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from nmm.cli.output import show_table, show_text, warn
from nmm.cli.subjects import studied
from nmm.errors import InputError

if TYPE_CHECKING:
    from nmm.analysis.redundant.moving import SelfMotion

OK = 0
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
    InputError : wrong options; a direction that does not exist
    """
    from nmm.analysis.redundant.report import redundancy

    if along is None and (html is not None or play):
        raise InputError(
            "--html and --play show a self-motion: expected --self-motion, as in --self-motion 0"
        )
    found = studied(source, tasks=tasks, at=at, settings=settings, **loading)
    report = redundancy(found.subject, found.q, found.t)
    show_text(report.text())
    if along is None:
        return OK
    from nmm.analysis.redundant.moving import self_motion

    moved = self_motion(
        found.subject, found.q, t=found.t, direction=direction_of(along), duration=duration, speed=speed
    )
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


def direction_of(text: str) -> int | str | dict[str, float]:
    """What `--self-motion` says: a number, an input, or inputs with rates."""
    from nmm.cli.options import values_of

    text = text.strip()
    if "=" in text:
        return values_of(text.split(","), "--self-motion", "INPUT=RATE,..., as in v=-1,q2=0.5")
    try:
        return int(text)
    except ValueError:
        return text


def show_self_motion(moved: SelfMotion) -> None:
    """How far each coordinate goes, and how well the task stays."""
    trajectory, robot = moved.trajectory, moved.trajectory.robot
    for warning in trajectory.warnings:
        warn(warning)
    show_text()
    show_table(
        ["coordinate", "unit", "from", "to", "lowest", "highest"],
        [
            [name, unit, *(f"{value:.4g}" for value in (q[0], q[moved.turning], q.min(), q.max()))]
            for name, unit, q in zip(robot.q_names, robot.q_units, trajectory.q.T, strict=True)
        ],
        title=f"self-motion: {moved.text}, and back",
        numeric=["from", "to", "lowest", "highest"],
    )
    error = float(np.abs(trajectory.error).max(initial=0.0))
    show_text(f"the task stays within {error:.1g} of its value over {trajectory.t[-1]:.3g} s")
