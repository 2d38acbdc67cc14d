"""A step of the closed loop in one compiled call: a control step at its beginning and one at each stage."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import types

from nmm.arrays import Array, Integers
from nmm.control.bounds import SAMPLE, STAGE
from nmm.control.equations import ControlStep, step
from nmm.control.integrators import Integrator, RungeKutta, ZeroOrderHold
from nmm.functions.program import BESIDE, LaidOut
from nmm.kernels.compiled import checked_by_caller, compiled, scratch
from nmm.kernels.memory import Blocks, views
from nmm.resolvers.answer import SINGULAR_J
from nmm.robots.held import Inputs, hold

_FLAT, _BLOCKS = types.float64[::1], (types.int64[::1], types.float64[::1])
_ADVANCE = types.float64(
    *(types.float64, types.float64, _FLAT, *_BLOCKS),
    *(_FLAT, types.float64[:, ::1], _FLAT, _FLAT, _FLAT),
)


class Tableau(NamedTuple):
    """An explicit method of s stages: nodes (s,), matrix (s, s), weights (s,); none where inputs are held."""

    nodes: Array
    matrix: Array
    weights: Array


def tableau(integrator: Integrator) -> Tableau | None:
    """That of an integrator; None of one that has none."""
    if isinstance(integrator, ZeroOrderHold):
        return Tableau(np.zeros(0), np.zeros((0, 0)), np.zeros(0))
    return Tableau(*integrator.tableau) if isinstance(integrator, RungeKutta) else None


@compiled
def advance(
    t: float,
    dt: float,
    q: Array,
    integers: Integers,
    floats: Array,
    nodes: Array,
    matrix: Array,
    weights: Array,
    ahead: Array,
    u: Array,
) -> float:
    """ahead (n,): q at t + dt; u (m,): the inputs at t. Returns the status of the first step that failed,
    else that of the step at t.

    Bounds and the inputs before are the sample's: its stages change neither.
    """
    status = step(t, q, integers, floats)
    e = views(ControlStep, integers, floats, BESIDE)
    n, m = q.shape[0], u.shape[0]
    for j in range(m):
        u[j] = e.answer.u[j]
    if status >= SINGULAR_J:
        return status
    stages = weights.shape[0]
    if stages == 0:
        laid = views(LaidOut, integers, floats, 0)
        inputs = Inputs(
            laid.platform_kernel,
            laid.platform_numbers,
            laid.buffers.G.shape[0],
            e.arm.moved,
            e.arm.followers,
        )
        hold(inputs, q, u, dt, ahead)
        return status
    slopes, stage, before = scratch((stages, n)), scratch(n), scratch(m)
    for j in range(m):
        before[j] = e.problem.before[j]
    mode = e.limits.mode[()]
    if mode == SAMPLE:
        e.limits.mode[()] = STAGE
    failed = status
    for k in range(stages + 1):
        if k > 0:
            for i in range(n):
                slopes[k - 1, i] = e.q_dot[i]
        for i in range(n):
            total = 0.0
            for a in range(k):
                total += (weights[a] if k == stages else matrix[k, a]) * slopes[a, i]
            stage[i] = q[i] + dt * total
        if k == 0 or k == stages:
            continue
        failed = step(t + nodes[k] * dt, stage, integers, floats)
        if failed >= SINGULAR_J:
            break
    e.limits.mode[()] = mode
    for j in range(m):
        e.problem.before[j] = before[j]
    for i in range(n):
        ahead[i] = stage[i]
    return failed if failed >= SINGULAR_J else status


class Stepper:
    """`advance` for the blocks of one controller and one method."""

    def __init__(self, blocks: Blocks, method: Tableau, n: int, m: int) -> None:
        self._blocks, self._method = blocks, method
        self._shapes = n, m
        self._advance = checked_by_caller(advance, _ADVANCE)

    def __call__(self, t: float, q: Array, dt: float) -> tuple[float, Array, Array]:
        """Status, q (n,) at t + dt, u (m,) at t; q is contiguous float64."""
        n, m = self._shapes
        ahead, u = np.empty(n), np.empty(m)
        status = self._advance(t, dt, q, *self._blocks, *self._method, ahead, u)
        return status, ahead, u
