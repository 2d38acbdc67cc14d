"""Where pictures go: a tool's file or its viewer, in this process."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol

from nmm.plugins.streams.pictures import RobotPicture, Said, Still
from nmm.plugins.streams.tools import LOOPBACK, RERUN

#: How long a live viewer may take for what is left, s.
PATIENCE = 5.0


class Sink(Protocol):
    """What takes pictures and lines of text in the order of their times, until it is closed, with what is to
    be said of the whole: a file is whole then."""

    def take(self, items: Sequence[RobotPicture | Said]) -> None: ...

    def close(self, about: Mapping[str, str]) -> None: ...


@dataclass(frozen=True)
class Destination:
    """Where a stream goes.

    tool : its name
    file : what is written; None for live
    port : of Rerun's viewer, or of the server for Foxglove; 0 for a free one
    assets : the files of meshes, by their addresses in the description
    patience : how long a live viewer may take for what is left, s
    """

    tool: str
    file: Path | None
    port: int = 0
    assets: Mapping[str, str] = field(default_factory=dict)
    patience: float = field(default_factory=lambda: PATIENCE)

    def open(self, still: Still, came: Callable[[], None] = lambda: None) -> tuple[Sink, str]:
        """The sink, and its address if it is live; `came` is called when a viewer comes, at once where one
        is there."""
        if self.tool == RERUN:
            from nmm.plugins.streams.rerun_sink import RerunSink

            address = f"rerun+http://{LOOPBACK}:{self.port}/proxy"
            sink = RerunSink(still, self.file, address, self.patience)
            came()
            return sink, address
        from nmm.plugins.streams.foxglove_sink import FoxgloveSink

        served = FoxgloveSink(still, self.file, self.port, self.assets, came)
        return served, f"ws://{LOOPBACK}:{served.port}"
