"""What was or is sent to a tool."""

from __future__ import annotations

from pathlib import Path
from types import TracebackType
from typing import Self


class Stream:
    """A stream to a tool; as a context manager it ends with the block.

    Attributes
    ----------
    tool : its name
    file : what is written, None for live
    address : of the viewer, or of the server
    sent : how many pictures were sent
    dropped : how many were not, as the viewer, or the disk, was too slow, or of `trouble`
    trouble : what went wrong beside the run or the loop, "" for nothing

    Examples
    --------
    >>> run = nmm.Scenario.load("unicycle_2r_position", {"duration": 2}).run()
    >>> shown = nmm.stream(run, "foxglove", file="run.mcap")
    >>> shown.sent, shown.dropped, shown.trouble
    (401, 0, '')
    """

    def __init__(self, tool: str, file: Path | None = None) -> None:
        self.tool, self.file, self.address = tool, file, ""
        self.sent = self.dropped = 0
        self.trouble = ""

    def __call__(self, loop: object = None) -> None:
        """Show the last sample of the loop; raises nothing and waits for nobody."""

    def close(self, why: str = "") -> None:
        """Send what is left, and end: a server is closed, a file is whole. A second call does nothing.

        Parameters
        ----------
        why : what broke off, where something did; the file says so

        Raises
        ------
        RunError : the file could not be written whole; what was there before stays
        """

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, where: TracebackType | None
    ) -> None:
        self.close()

    def __repr__(self) -> str:
        to = self.file or self.address
        return f"Stream({self.tool}, {to}, {self.sent} pictures, {self.dropped} dropped)"
