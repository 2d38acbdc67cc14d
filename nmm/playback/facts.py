"""What a page tells of a run besides its curves: its numbers, and what happened when."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from nmm.arrays import Array
from nmm.looks import Look, pretty
from nmm.playback.channels import Channels, input_text
from nmm.playback.drawing import Drawing
from nmm.robots.motion import Motion
from nmm.robots.robot import Robot
from nmm.runs.binding import AT_LIMIT
from nmm.runs.chattering import chattering
from nmm.runs.settling import settling_time
from nmm.runs.summary import summarise
from nmm.runs.table import rows
from nmm.runs.trajectory import Trajectory

#: A page lists so many events of a run.
MOST = 100
#: A limit is left beyond this share of its range.
LEFT = 0.01


def draw_facts(
    drawing: Drawing,
    runs: Sequence[Motion | Trajectory],
    told: Sequence[Channels],
    looks: Sequence[Look],
    start: float,
) -> None:
    """Append the page's command "facts", where a run is more than a motion.

    Parameters
    ----------
    runs, told, looks : one of each a run
    start : the page's first time, s
    """
    found = []
    for run, channels, look in zip(runs, told, looks, strict=True):
        facts, happened = [], []
        if isinstance(run, Trajectory):
            facts, happened = list(_facts(run)), sorted(events(run, channels))
        found.append(
            {
                "name": look.name,
                "facts": facts,
                "events": [[t - start, text] for t, text in happened[:MOST]],
                "more": max(len(happened) - MOST, 0),
            }
        )
    if any(one["facts"] for one in found):
        drawing.add("facts", runs=found)


def _facts(run: Trajectory) -> Iterator[tuple[str, str]]:
    numbers = summarise(run)
    # Events have their own list.
    yield from ((label, value) for label, value in rows(run, numbers) if not label.startswith("t = "))
    if run.message:
        yield "message", run.message
    for warning in numbers["warnings"]:
        yield "warning", warning


def events(run: Trajectory, channels: Channels) -> Iterator[tuple[float, str]]:
    """When, s, and what: tasks that come and go, limits reached, another partition, a singularity passed,
    chattering, the error has settled, the end where it is not just the end of time."""
    for event in run.events:
        yield event.t, f"{event.task} {event.what}{f': {event.why}' if event.why else ''}"
    if len(run.shares) == len(run):
        for name, share in zip(run.limit_names, run.shares.T, strict=True):
            for words, margin in (("lower", share), ("upper", 1.0 - share)):
                for k in _reached(margin):
                    yield float(run.t[k]), f"{_limited(run.robot, name)} reaches its {words} limit"
    number = next((one.values for one in channels.channels if one.name == "partition"), None)
    if number is not None:
        for last in np.flatnonzero(np.diff(number)):
            before, after = (channels.partitions[int(number[i])] for i in (last, last + 1))
            yield float(channels.t[last + 1]), f"partition {before} → {after}"
    for t in run.t[np.flatnonzero(run.crossed)].tolist():
        yield t, "J_e was singular on the way from the sample before"
    if (jumps := chattering(run.t, run.u, run.robot.u_names)) is not None:
        yield jumps.start, jumps.sentence
    if (settles := settling_time(run)) is not None:
        yield float(run.t[0]) + settles, "‖e‖ down to 2 % of its start"
    if len(run) and (run.message or not run.complete):
        # The table has all of the message.
        first = run.message.partition(";")[0]
        yield float(run.t[-1]), f"{run.outcome}{f': {first}' if first else ''}"


def _reached(margin: Array) -> Iterator[int]:
    """The samples at which a margin (N,) comes down to nothing, after it had been left."""
    near = margin <= AT_LIMIT
    since = 0
    for k in np.flatnonzero(near & ~np.concatenate([[False], near[:-1]])):
        if k == 0 or since == 0 or margin[since:k].max() > LEFT:
            yield int(k)
        since = int(k)


def _limited(robot: Robot, name: str) -> str:
    """What people call what has a limit."""
    inputs = {f"u_{one}": input_text(robot, i) for i, one in enumerate(robot.u_names)}
    return inputs.get(name, pretty(name))
