"""The closed loop in compiled calls: from a sample to the next one, a control step at each stage between."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import types

from nmm.arrays import Array, Integers
from nmm.control.bounds import SAMPLE, STAGE
from nmm.control.equations import ControlStep, call_step, write_equation
from nmm.control.integrators import Followed, Integrator, RungeKutta, ZeroOrderHold
from nmm.functions.program import BESIDE, LaidOut, run
from nmm.kernels.compiled import checked_by_caller, compiled, compiled_without_gil, scratch, view
from nmm.kernels.followers import place_followers
from nmm.kernels.memory import Blocks, Matrix, Vector, record_type, views
from nmm.resolvers.answer import SINGULAR_J, SOLVED
from nmm.robots.held import Inputs, hold


class Tableau(NamedTuple):
    """An explicit method of s stages: nodes (s,), matrix (s, s), weights (s,); none where inputs are held."""

    nodes: Vector
    matrix: Matrix
    weights: Vector


_FLAT = types.float64[::1]
_ADVANCE = types.float64(
    *(types.float64, types.float64, _FLAT, types.int64[::1], _FLAT),
    *(record_type(Tableau), _FLAT, _FLAT),
)


def tableau(integrator: Integrator) -> Tableau | None:
    """That of an integrator; None of one that has none. `go_on` places joints that follow, whatever it is."""
    if isinstance(integrator, ZeroOrderHold):
        return Tableau(np.zeros(0), np.zeros((0, 0)), np.zeros(0))
    if isinstance(integrator, Followed):
        return tableau(integrator.integrator)
    return Tableau(*integrator.tableau) if isinstance(integrator, RungeKutta) else None


@compiled
def hold_inputs(q: Array, u: Array, dt: float, integers: Integers, floats: Array, ahead: Array) -> None:
    """ahead (n,): q after dt with the inputs u (m,)."""
    laid = views(LaidOut, integers, floats, 0)
    arm = views(ControlStep, integers, floats, BESIDE).arm
    n_p = laid.buffers.G.shape[0]
    hold(Inputs(laid.platform_kernel, laid.platform_numbers, n_p, arm.moved, arm.followers), q, u, dt, ahead)


@compiled
def go_on(
    t: float, dt: float, q: Array, integers: Integers, floats: Array, method: Tableau, ahead: Array
) -> float:
    """ahead (n,): q at t + dt, from the sample at (t, q) that was just made. Returns the status of the first
    stage that failed, else SOLVED.

    Bounds and the inputs before are the sample's: its stages change neither.
    """
    e = views(ControlStep, integers, floats, BESIDE)
    n, m = q.shape[0], e.answer.u.shape[0]
    stages = method.weights.shape[0]
    if stages == 0:
        hold_inputs(q, e.answer.u, dt, integers, floats, ahead)
        return SOLVED
    slopes, stage, before = scratch((stages, n)), scratch(n), scratch(m)
    for j in range(m):
        before[j] = e.problem.before[j]
    mode = e.limits.mode[()]
    if mode == SAMPLE:
        e.limits.mode[()] = STAGE
    status = float(SOLVED)
    for k in range(1, stages + 1):
        for i in range(n):
            slopes[k - 1, i] = e.q_dot[i]
        for i in range(n):
            total = 0.0
            for a in range(k):
                total += (method.weights[a] if k == stages else method.matrix[k, a]) * slopes[a, i]
            stage[i] = q[i] + dt * total
        if k < stages:
            status = call_step(e.step, t + method.nodes[k] * dt, stage, integers, floats)
            if status >= SINGULAR_J:
                break
    e.limits.mode[()] = mode
    for j in range(m):
        e.problem.before[j] = before[j]
    place_followers(stage, e.arm.followers)
    for i in range(n):
        ahead[i] = stage[i]
    return status if status >= SINGULAR_J else SOLVED


@compiled_without_gil
def write_errors(
    integers: Integers, floats: Array, times: Array, q: Array, error: Array, rate: Array
) -> None:
    """The task's errors and ∂g/∂t + K e (N, s) at times (N,) and q (N, n); no step is made."""
    e = views(ControlStep, integers, floats, BESIDE)
    b = views(LaidOut, integers, floats, 0).buffers
    for k in range(times.shape[0]):
        run(times[k], view(q, k * q.shape[1], (q.shape[1],)), integers, floats)
        write_equation(e.task, b, e.arm, e.problem.J, e.problem.rate)
        for i in range(error.shape[1]):
            error[k, i], rate[k, i] = e.task.error[i], e.task.full[i]


@compiled
def advance(
    t: float,
    dt: float,
    q: Array,
    integers: Integers,
    floats: Array,
    method: Tableau,
    ahead: Array,
    u: Array,
) -> float:
    """A sample at (t, q) and the way to the next. ahead (n,): q at t + dt; u (m,): the inputs at t. Returns
    the status of the first step that failed, else that of the step at t."""
    e = views(ControlStep, integers, floats, BESIDE)
    status = float(call_step(e.step, t, q, integers, floats))
    for j in range(u.shape[0]):
        u[j] = e.answer.u[j]
    if status >= SINGULAR_J:
        return status
    failed = go_on(t, dt, q, integers, floats, method, ahead)
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
        status = self._advance(t, dt, q, *self._blocks, self._method, ahead, u)
        return status, ahead, u
