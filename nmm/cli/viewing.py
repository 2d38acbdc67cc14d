"""view: a robot in the browser, one with an arm on it, or a scenario's."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from nmm.cli.options import arguments_of
from nmm.cli.output import warn
from nmm.cli.subjects import configuration_at, is_scenario, opened
from nmm.errors import InputError

if TYPE_CHECKING:
    from nmm.functions.function import Function
    from nmm.functions.tasks import Task
    from nmm.robots.motion import Motion
    from nmm.robots.robot import Robot
    from nmm.scenario import Scenario


def view_subject(
    source: str,
    *,
    tasks: Sequence[str] | None,
    at: Sequence[str] | None,
    settings: Sequence[str] | None,
    arm: str | None,
    port: int | None,
    open_browser: bool,
    frames: bool,
    **loading: Any,
) -> None:
    """Show a robot, or a scenario's at its start, until Ctrl-C; shapes whose meshes are missing are left out,
    with a warning."""
    from nmm.playback import view
    from nmm.scenario.short_task import short_task

    task: list[Task | Function] | None = None
    beside: Motion | None = None
    if arm is not None:
        at, robot = _with_arm(source, arm, at, settings, loading)
        q = robot.rest
    else:
        skip = {} if is_scenario(source) else {"missing_meshes": "skip"}
        run, scenario, robot = opened(source, settings, {**skip, **loading})
        if run is not None:
            raise InputError(f"{source} is a run: expected a robot or a scenario; nmm play {source} shows it")
        q = robot.rest
        if scenario is not None:
            from nmm.playback.asked import asked_for

            beside = asked_for(scenario, robot)
            q, task = beside.q[0], _viewable(scenario, robot)
    for note in robot.notes:
        if note.startswith("shapes left out"):
            warn(note)
    if tasks:
        task = [short_task(text, robot) for text in tasks]
    q = configuration_at(robot, q, at, loading.get("lock") or {})
    robot.check_limits(q)
    view(robot, q, frames=frames, task=task, beside=beside, port=port, open_browser=open_browser)


def _with_arm(
    source: str,
    arm: str,
    at: Sequence[str] | None,
    settings: Sequence[str] | None,
    loading: Mapping[str, Any],
) -> tuple[list[str], Robot]:
    """What `--at` says of coordinates, and the robot, whose frame for the arm a `--at` without = names."""
    from nmm.drafts.parts import chosen_robot

    if is_scenario(source):
        raise InputError(f"--arm: expected with a robot; {source} is a scenario, which has one")
    frames = [text for text in at or () if "=" not in text]
    if len(frames) > 1:
        raise InputError(f"--at: expected one frame that carries the arm, got {', '.join(frames)}")
    values = [text for text in at or () if "=" in text]
    frame = frames[0] if frames else None
    chosen = chosen_robot(source, Path(), arm=arm, at=frame, arguments=arguments_of(settings), **loading)
    return values, chosen.robot


def _viewable(scenario: Scenario, robot: Robot) -> list[Task | Function] | None:
    """The scenario's tasks; None, and a warning, where they have more rows than there are inputs."""
    tasks: list[Task | Function] = [*scenario.controller().task]
    rows = sum(len(one.rows(robot)) for one in tasks)
    if rows <= robot.n_u:
        return tasks
    warn(f"no numbers of its tasks: {rows} rows for {robot.n_u} inputs; --task shows some of them")
    return None
