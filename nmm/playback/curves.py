"""The command that brings the runs' curves into the page: its panels and what is drawn in each."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from nmm.looks import DASHES, Look
from nmm.playback.channels import Channel, Channels
from nmm.playback.drawing import Drawing
from nmm.playback.encoding import packed

#: The page's panels from above, by the names that its address knows.
PANELS: Mapping[str, str] = {
    "error": "Task error",
    "H": "Objective",
    "sigma": "Smallest singular value of J",
    "scale": "Share of the task's rate that limits left",
    "margin": "Limits",
    "partition": "Partition: the inputs in Ja",
    "inputs": "Inputs",
    "components": "Components of the task error",
    "coordinates": "Coordinates",
    "clearance": "Collisions",
    "residual": "Residual",
}
#: Those that are open at first, if they have something to say.
OPEN = ("error", "H", "sigma", "scale", "margin", "partition", "inputs")
#: A limit counts as near within this share of its range.
NEAR = 0.05
#: Lengths of dash and gap, px, of the house style's dashes.
LENGTHS: Mapping[str, list[int]] = dict(zip(DASHES, ([], [7, 4], [9, 3, 2, 3], [2, 3]), strict=True))


def draw_curves(drawing: Drawing, runs: Sequence[Channels], looks: Sequence[Look], start: float) -> None:
    """Append the page's command "curves".

    Parameters
    ----------
    runs, looks : one of each a run; a look's name is the run's
    start : the page's first time, s
    """
    lanes: dict[str, dict[str, Any]] = {}
    told = []
    for run in runs:
        columns = {}
        for channel in run.channels:
            key = _key(lanes, channel)
            lanes.setdefault(
                key,
                {
                    "key": key,
                    "panel": channel.panel,
                    "text": channel.text,
                    "unit": channel.unit,
                    "log": channel.log,
                },
            )
            ends = [float(end) if np.isfinite(end) else None for end in channel.limits]
            columns[key] = {"values": packed(channel.values, np.float32), "limits": ends}
        told.append(
            {
                "t": packed(run.t - start, np.float64),
                "samples": run.samples,
                "partitions": list(run.partitions),
                "columns": columns,
            }
        )
    for one, look in zip(told, looks, strict=True):
        one |= {"name": look.name, "color": look.color, "dash": LENGTHS[look.dashes] if len(runs) > 1 else []}
    used = {lane["panel"] for lane in lanes.values()}
    panels = [
        {"id": name, "title": title, "open": name in OPEN and _says_something(name, runs)}
        for name, title in PANELS.items()
        if name in used
    ]
    drawing.add("curves", panels=panels, lanes=list(lanes.values()), runs=told)


def _key(lanes: Mapping[str, Mapping[str, Any]], channel: Channel) -> str:
    """A channel's name; with its unit where another robot's of that name has another one."""
    known = lanes.get(channel.name)
    same = known is None or (known["unit"], known["panel"]) == (channel.unit, channel.panel)
    return channel.name if same else f"{channel.name} [{channel.unit}]"


def _says_something(panel: str, runs: Sequence[Channels]) -> bool:
    """Limits that are far away and a partition that never changes are not worth the room."""
    if panel == "scale":
        return any(_least(channel) < 1.0 for channel in _named(runs, "scale_"))
    if panel == "margin":
        return any(_least(channel) < NEAR for channel in _named(runs, "margin"))
    if panel == "partition":
        return any(len(run.partitions) > 1 for run in runs)
    return True


def _named(runs: Sequence[Channels], beginning: str) -> list[Channel]:
    return [channel for run in runs for channel in run.channels if channel.name.startswith(beginning)]


def _least(channel: Channel) -> float:
    known = channel.values[np.isfinite(channel.values)]
    return float(known.min(initial=1.0))
