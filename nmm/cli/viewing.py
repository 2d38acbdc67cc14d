"""view: a robot in the browser."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from nmm.cli.output import warn

OK = 0


def view_robot(
    source: str,
    *,
    platform: str | None,
    lock: dict[str, float],
    axle: str | list[float] | None,
    package_dirs: Sequence[Path],
    port: int | None,
    open_browser: bool,
    frames: bool,
) -> int:
    """Show a robot until Ctrl-C; shapes whose meshes are missing are left out, with a warning."""
    from nmm.playback import view
    from nmm.robots.loading import load

    robot = load(
        source, platform=platform, lock=lock, axle=axle, package_dirs=package_dirs, missing_meshes="skip"
    )
    for note in robot.notes:
        if note.startswith("shapes left out"):
            warn(note)
    view(robot, port=port, open_browser=open_browser, frames=frames)
    return OK
