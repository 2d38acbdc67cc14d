"""drive: a robot that follows what one drags in the browser."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from nmm.cli.subjects import studied


def drive_subject(
    source: str, *, tasks: Sequence[str] | None, port: int | None, open_browser: bool, **asked: Any
) -> None:
    """Drive a scenario, or a robot with tasks, until Ctrl-C."""
    from nmm.driving import RobotSetup, ScenarioSetup, drive
    from nmm.driving.setups import DriveSetup

    subject = studied(source, tasks=tasks, usual_task="position", decide=False, **asked)
    setup: DriveSetup
    if subject.controller is None or subject.scenario is None:
        subject.robot.check_limits(subject.q)
        setup = RobotSetup(subject.robot, tuple(subject.task), subject.q)
    else:
        setup = ScenarioSetup(subject.scenario, subject.q)
    drive(setup, port=port, open_browser=open_browser)
