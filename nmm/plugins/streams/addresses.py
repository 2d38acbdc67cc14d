"""What meshes are called in the description that a tool is given."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from nmm.plugins.robot.ros.description import by_file
from nmm.plugins.streams.tools import RERUN

Addressing = tuple[Callable[[str], str] | None, dict[str, str]]


def addresses(tool: str, live: bool) -> Addressing:
    """The address of a mesh by its file, and the files by the addresses that the server is asked for.

    Rerun reads files. Foxglove asks its server for package:// addresses, so those of a live stream are of
    the server's own; in a file they are as in ROS's logs (None).
    """
    if tool == RERUN:
        return by_file, {}
    if not live:
        return None, {}
    files: dict[str, str] = {}
    given: dict[str, str] = {}

    def address(file: str) -> str:
        if file not in given:
            given[file] = f"package://nmm/{len(given)}{Path(file).suffix.lower()}"
            files[given[file]] = file
        return given[file]

    return address, files
