"""Rows that keep distances, compiled: velocity dampers with room to brake, n·J S u >= -speed - ∂d/∂t."""

from __future__ import annotations

import math
from typing import NamedTuple

from nmm.arrays import Array
from nmm.collisions.rows import Rows
from nmm.control.bounds import COUNTED_ON, LimitNumbers, approach
from nmm.kernels.compiled import compiled
from nmm.kernels.memory import Cell, IntegerCell, Vector
from nmm.resolvers.problem_arrays import ProblemArrays

#: As far as an input goes in a sample, m or rad, where nothing limits its velocity.
FARTHEST = 0.1


class Clearance(NamedTuple):
    """How distances are kept.

    first () : where their rows begin among the limits'
    distance () : what they are kept above, m; margin () : rows keep them so much farther, m
    gain () : 1/s, d falls no faster than this times what is left of it; recovery () : m/s, back from below
    braking () : m/s² to count on, not a number for a share of what the inputs' accelerations give
    least (K,) : the rate that a row asks for in the place of that, m/s; -infinite where it asks for none
    """

    first: IntegerCell
    distance: Cell
    margin: Cell
    gain: Cell
    recovery: Cell
    braking: Cell
    least: Vector


@compiled
def bound_unlimited(limits: LimitNumbers, problem: ProblemArrays) -> None:
    """Bounds of the inputs whose velocity nothing limits: what the way ahead is looked at for.

    The most of the task's rate that rows leave would cost any inputs where they leave hardly a direction.
    """
    most = FARTHEST / problem.dt[()]
    for j in range(limits.slowest.shape[0]):
        if math.isinf(limits.fastest[j]):
            problem.u_upper[j] = max(min(problem.u_upper[j], most), problem.u_lower[j])
        if math.isinf(limits.slowest[j]):
            problem.u_lower[j] = min(max(problem.u_lower[j], -most), problem.u_upper[j])


@compiled
def clearance_bounds(keep: Clearance, near: Rows, acceleration: Array, problem: ProblemArrays) -> None:
    """Bounds of the distances' rates, whose rows on the inputs are there."""
    dt = problem.dt[()]
    for k in range(near.d.shape[0]):
        row = keep.first[()] + k
        problem.lower[row], problem.upper[row] = -math.inf, math.inf
        if k >= near.used[()]:
            continue
        if keep.least[k] > -math.inf:
            problem.lower[row] = keep.least[k] - near.d_t[k]
            continue
        braking = float(keep.braking[()])
        if math.isnan(braking):
            braking = 0.0
            for j in range(acceleration.shape[0]):
                if problem.limit_rows[row, j] != 0.0:
                    braking += COUNTED_ON * abs(problem.limit_rows[row, j]) * acceleration[j]
        room = near.d[k] - keep.distance[()]
        speed = keep.gain[()] * (room - keep.margin[()])  # within the margin the way back may take its time
        if room < 0.0:
            speed = approach(room, dt, braking, float(keep.recovery[()]))
        elif speed > 0.0:
            speed = min(speed, approach(room, dt, braking, float(keep.recovery[()])))
        problem.lower[row] = -speed - near.d_t[k]
