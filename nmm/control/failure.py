"""Why a controller has no answer, in words."""

from __future__ import annotations

import numpy as np

from nmm.arrays import Array
from nmm.control.lost_directions import in_world_axes, lost_directions
from nmm.functions.function import row_scales
from nmm.functions.tasks.task import Stack
from nmm.resolvers.answer import Status
from nmm.resolvers.problem import ProblemArrays
from nmm.robots.robot import Robot


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
    lost = lost_directions(in_world_axes(J, task, robot, q), rows, row_scales(rows, robot))
    return f", and the task asks for what no input gives: {', '.join(lost)}" if lost else ""
