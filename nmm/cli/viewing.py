"""view: a robot in the browser."""

from __future__ import annotations

from typing import Any

from nmm.cli.output import warn


def view_robot(source: str, *, port: int | None, open_browser: bool, frames: bool, **loading: Any) -> None:
    """Show a robot until Ctrl-C; shapes whose meshes are missing are left out, with a warning."""
    from nmm.playback import view
    from nmm.robots.loading import load

    robot = load(source, **loading, missing_meshes="skip")
    for note in robot.notes:
        if note.startswith("shapes left out"):
            warn(note)
    view(robot, port=port, open_browser=open_browser, frames=frames)
