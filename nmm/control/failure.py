"""Why a controller has no answer, in words."""

from __future__ import annotations

import numpy as np

from nmm.arrays import Array
from nmm.control.lost_directions import in_world_axes, lost_directions
from nmm.functions.function import row_scales
from nmm.functions.tasks.task import Stack
from nmm.resolvers.answer import Status
from nmm.resolvers.problem_arrays import ProblemArrays
from nmm.robots.robot import Robot
from nmm.words import listed


def reason(status: Status, problem: ProblemArrays, robot: Robot, task: Stack, q: Array) -> str:
    """What no input gives, where J lost rank; what is not finite, where something is not; after a colon."""
    J = problem.J
    if status is Status.NOT_FINITE:
        if all(np.isfinite(part).all() for part in (J, problem.rate, problem.h)):
            return ": the resolver's answer, though J, rate and h are finite"
        return ": the task, its reference or the objective is undefined here"
    if status is not Status.SINGULAR_J or not np.all(np.isfinite(J)):
        return ""
    rows = task.rows(robot)
    turned, scales = in_world_axes(J, task, robot, q), row_scales(rows, robot)
    for level, end in enumerate(problem.ends.tolist()):
        lost = lost_directions(turned[:end], rows[:end], scales[:end])
        if lost:
            above = "" if level == 0 else f"; {_contradicting(task, level, robot)}"
            return f", and the task asks for what no input gives: {', '.join(lost)}{above}"
    return ""


def _contradicting(task: Stack, level: int, robot: Robot) -> str:
    """Which level asks for what those above it decide, and what goes on all the same."""
    priority = sorted({one.priority for one in task})[level]
    names = listed([one.called(robot) for one in task if one.priority == priority])
    return (
        f"level {priority} ({names}) asks for what the levels above it decide; pg and dls damp it there, ej "
        "with singular: damped"
    )
