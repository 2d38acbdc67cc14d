"""The bounds and rows with which limits and distances enter a control step.

A step calls this code by its address, so it is compiled only where something is limited.
"""

import math

from nmm.base.arrays import Array, Integers
from nmm.base.kernels.compiled import clear, kernel, scratch
from nmm.base.kernels.linear_algebra import copied
from nmm.base.kernels.record_layout import views
from nmm.control.functions.program import BESIDE, LaidOut
from nmm.control.limits.bounds import (
    OFF,
    SAMPLE,
    bound_inputs,
    bound_unlimited,
    clearance_bounds,
    function_bounds,
    wheel_rows,
)
from nmm.control.step.equations import BOUNDS, ControlStep, times_S
from nmm.control.step.limit_rows import write_rows


@kernel(BOUNDS)
def write_limits(q: Array, integers: Integers, floats: Array) -> None:
    """Write bounds and rows of inputs, wheels and functions; at a stage the sample's bounds stay."""
    b = views(LaidOut, integers, floats, 0).buffers
    e = views(ControlStep, integers, floats, BESIDE)
    limits, problem = e.limits, e.problem
    w = limits.spin.shape[0]
    if limits.mode[()] == OFF:
        for j in range(problem.u_lower.shape[0]):
            problem.u_lower[j], problem.u_upper[j] = -math.inf, math.inf
        for i in range(problem.lower.shape[0]):
            problem.lower[i], problem.upper[i] = -math.inf, math.inf
        return
    if w > 0:
        wheel_rows(limits, q, b.G, problem)
    for i in range(limits.rows.shape[0]):
        times_S(b.value_q, limits.rows[i], b.G, e.arm, problem.limit_rows[w + i])
    if limits.mode[()] == SAMPLE:
        bound_inputs(limits, q, problem)
        function_bounds(limits, b.value, b.value_t, problem)
    if e.own_limits.shape[0] > 0:
        write_rows(q, limits.mode[()] != SAMPLE, integers, floats)


@kernel(BOUNDS)
def write_clearance(q: Array, integers: Integers, floats: Array) -> None:
    """Write rows and bounds of distances; a stage keeps its sample's bounds and gradients, not its S."""
    b = views(LaidOut, integers, floats, 0).buffers
    e = views(ControlStep, integers, floats, BESIDE)
    count, n = e.near.d_q.shape
    if e.limits.mode[()] == OFF or count == 0:
        return
    gradient = scratch((1, n))
    for k in range(count):
        row = e.problem.limit_rows[e.clearance.first[()] + k]
        if k < e.near.used[()]:
            copied(e.near.d_q[k], gradient[0])
            times_S(gradient, 0, b.G, e.arm, row)
        elif e.limits.mode[()] == SAMPLE:
            clear(row)
    if e.limits.mode[()] == SAMPLE:
        bound_unlimited(e.limits, e.problem)
        clearance_bounds(e.clearance, e.near, e.limits, e.problem)
