"""view: a robot in the browser."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from nmm.cli.output import warn
from nmm.cli.subjects import configuration_at


def view_robot(
    source: str,
    *,
    tasks: Sequence[str] | None,
    at: Sequence[str] | None,
    port: int | None,
    open_browser: bool,
    frames: bool,
    **loading: Any,
) -> None:
    """Show a robot until Ctrl-C; shapes whose meshes are missing are left out, with a warning."""
    from nmm.playback import view
    from nmm.robots.loading import load
    from nmm.scenario.short_task import short_task

    robot = load(source, **{"missing_meshes": "skip", **loading})
    for note in robot.notes:
        if note.startswith("shapes left out"):
            warn(note)
    task = [short_task(text, robot) for text in tasks or ()] or None
    q = configuration_at(robot, robot.rest, at, loading.get("lock") or {})
    robot.check_limits(q)
    view(robot, q, frames=frames, task=task, port=port, open_browser=open_browser)
