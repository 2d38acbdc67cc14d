"""info, scenarios and robots."""

from __future__ import annotations

import re
from collections.abc import Iterator
from math import isfinite
from typing import TYPE_CHECKING

from nmm.bundled import bundled_robots, bundled_scenarios
from nmm.cli.output import show_table, show_text

if TYPE_CHECKING:
    from nmm.robot import Robot

OK = 0
#: An angle beyond this many turns is a joint without limits.
UNBOUNDED = 1e6


def list_scenarios() -> int:
    """The bundled scenarios."""
    from nmm.scenario import Scenario

    loaded = [Scenario.load(name) for name in bundled_scenarios()]
    show_table(["scenario", "what it shows"], [[scenario.name, scenario.title] for scenario in loaded])
    return OK


def list_keys() -> int:
    """The keys of a scenario file."""
    from nmm.scenario.reference import sections

    for section in sections():
        show_text(f"{section.title} ({section.summary.rstrip('.')})")
        show_table(["key", "default", "meaning"], section.keys)
        show_text()
    return OK


def list_robots() -> int:
    """The bundled robots."""
    rows = []
    for name, path in bundled_robots().items():
        text = path.read_text(encoding="utf-8")
        about = re.search(r"<!--\s*(.+?)\s*(?:\n\s*\n|-->)", text, re.DOTALL)
        arguments = re.findall(r'<xacro:arg\s+name="([^"]+)"\s+default="([^"]*)"', text)
        rows.append(
            [
                name,
                " ".join(about.group(1).split()) if about else "",
                ", ".join(f"{argument}={default}" for argument, default in arguments),
            ]
        )
    show_table(["robot", "what it is", "arguments (m)"], rows)
    return OK


def describe_robot(source: str, platform: str | None, scenario: str | None) -> int:
    """Coordinates, inputs, frames, wheels, redundancy."""
    from nmm.loading import load

    task = None
    if scenario is not None:
        from nmm.scenario import Scenario

        loaded = Scenario.load(scenario)
        task = loaded.name, len(loaded.controller().rows)
    robot = load(source, platform=platform)
    show_text(f"{robot.name} ({robot.source}), {robot.platform.name} platform")
    show_text()
    show_table(
        ["coordinate", "unit", "of", "lower", "upper"],
        _coordinates(robot),
        numeric=["lower", "upper"],
    )
    show_text()
    show_table(["input", "unit", "limit"], _inputs(robot), numeric=["limit"])
    show_text()
    show_text(f"frames: {', '.join(robot.frames)}")
    show_text()
    if robot.wheels:
        show_table(
            ["wheel", "radius", "centre, from the root link"],
            [
                [w.joint, f"{w.radius:g} m", f"({', '.join(f'{c:g}' for c in w.center)}) m"]
                for w in robot.wheels
            ],
            numeric=["radius"],
        )
        show_text()
    show_table(
        ["task", "rows", "static redundancy", "kinematic redundancy"],
        _redundancies(robot, task),
        numeric=["rows", "static redundancy", "kinematic redundancy"],
    )
    if robot.notes:
        show_text()
        for note in robot.notes:
            show_text(f"note: {note}")
    return OK


def _coordinates(robot: Robot) -> Iterator[list[str]]:
    model = robot.model
    for i, (name, unit) in enumerate(zip(robot.q_names, robot.q_units, strict=True)):
        of = "platform" if i < robot.platform.n_p else "arm"
        lower, upper = float(model.lowerPositionLimit[i]), float(model.upperPositionLimit[i])
        yield [name, unit, of, _limit(lower), _limit(upper)]


def _inputs(robot: Robot) -> Iterator[list[str]]:
    arm = robot.model.velocityLimit[robot.platform.n_p :]
    limits = ["-"] * robot.platform.p + [_limit(float(limit)) for limit in arm]
    for name, unit, limit in zip(robot.u_names, robot.u_units, limits, strict=True):
        yield [name, unit, limit]


def _limit(value: float) -> str:
    return f"{value:.4g}" if isfinite(value) and abs(value) < UNBOUNDED else "-"


def _redundancies(robot: Robot, task: tuple[str, int] | None) -> Iterator[list[str]]:
    tasks = [("position in the plane", 2), ("position in space", 3), ("pose in space", 6)]
    for name, s in tasks if task is None else [task]:
        yield [name, str(s), *(str(count - s) if count >= s else "-" for count in (robot.n, robot.n_u))]
