"""check: what is wrong with a robot's file."""

from __future__ import annotations

import os
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from nmm.bundled import bundled_robots
from nmm.cli.output import complain, show_table, show_text

if TYPE_CHECKING:
    from nmm.robots.loading.findings import Problem
    from nmm.robots.loading.report import Report
    from nmm.robots.robot import Robot

OK, BAD_INPUT = 0, 2


def check_file(
    file: str,
    arguments: Mapping[str, object],
    *,
    package_dirs: Sequence[Path],
    **loading: Any,
) -> int:
    """Print every problem and warning, a line each; 2 when there are problems, else 0 and what it holds."""
    from nmm.robots.loading.packages import package_file
    from nmm.robots.loading.report import report

    if file.startswith("package://"):
        path = package_file(file, package_dirs)
    else:
        path = bundled_robots().get(file, Path(file))
    made = report(path, arguments, package_dirs, **loading)
    shown = os.path.relpath(path) if file in bundled_robots() else file
    for problem in made.problems:
        print(_line(shown, problem, made))
    for warning in made.warnings:
        print(_line(shown, warning, made, "warning: "))
    counts = f"{_counted(made.problems, 'problem')}, {_counted(made.warnings, 'warning')}"
    if made.problems:
        sys.stdout.flush()
        complain("nmm check", f"{file}: {counts}")
        return BAD_INPUT
    if made.warnings:
        show_text()
    facts, pairs = dict(made.facts), list[list[str]]()
    if made.robot is not None:
        facts["collisions"], pairs = _touching(made.robot)
    show_table(["", ""], [[label, value] for label, value in facts.items()], title=f"{file}: {counts}")
    if pairs:
        show_table(["links that touch", "in"], pairs)
    return OK


def _touching(robot: Robot) -> tuple[str, list[list[str]]]:
    """How many of the robot's links can touch each other, and which, with how often they do."""
    from nmm.collisions.touch import touching_links

    found = touching_links(robot)
    if not found.shapes:
        return "no shapes: nothing keeps it from touching anything", []
    if not found.shares:
        return "no two of its links can touch: the model has no pairs", []
    counts = f"{len(found.never)} never, {len(found.sometimes)} sometimes, {len(found.always)} always"
    said = (
        f"{len(found.shares)} pairs of links: {counts} touch, in {found.configurations} random configurations"
    )
    often = {pair: share for pair, share in found.shares.items() if share > 0.0}
    return said, [[f"{one} and {other}", f"{share:.1%}"] for (one, other), share in often.items()]


def _line(file: str, problem: Problem, made: Report, kind: str = "") -> str:
    """file:line: message, as compilers do; of an expanded file the line comes last, and says so."""
    message = " ".join(problem.message.split())
    if problem.line is None:
        return f"{file}: {kind}{message}"
    if made.expanded:
        return f"{file}: {kind}{message} (line {problem.line} of the expanded file)"
    return f"{file}:{problem.line}: {kind}{message}"


def _counted(things: Sequence[Problem], name: str) -> str:
    return f"{len(things) or 'no'} {name}{'' if len(things) == 1 else 's'}"
