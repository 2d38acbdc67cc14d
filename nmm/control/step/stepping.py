"""The closed loop in compiled calls: from a sample to the next, with a control step at each stage."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from nmm.base.arrays import Array, Integers
from nmm.base.kernels.compiled import compiled, compiled_without_gil, integer_scratch, scratch, view
from nmm.base.kernels.linear_algebra import copied
from nmm.base.kernels.record_layout import Matrix, Vector, keep, kept, put_back, record_type, views
from nmm.base.kernels.signatures import float64, int64
from nmm.base.kernels.velocity_map import place_mimic_joints
from nmm.control.functions.program import BESIDE, LaidOut, run_program
from nmm.control.integrators import MIDPOINT, Integrator, RungeKutta, WithMimicJoints, ZeroOrderHold
from nmm.control.limits.bounds import SAMPLE, STAGE
from nmm.control.resolvers.answer import SINGULAR_J, SOLVED
from nmm.control.step.equations import ControlStep, call_step, write_equation
from nmm.model.robots.zero_order_hold import Inputs, hold_rates


class Tableau(NamedTuple):
    """An explicit method of s stages: nodes (s,), matrix (s, s), weights (s,); empty for constant inputs.

    holds : 1 where the last stage's inputs are held over the step, else 0
    """

    nodes: Vector
    matrix: Matrix
    weights: Vector
    holds: int


_FLAT = float64[::1]
ADVANCE = float64(*(float64, float64, _FLAT, int64[::1], _FLAT), *(record_type(Tableau), _FLAT, _FLAT))


def tableau(integrator: Integrator) -> Tableau | None:
    """The integrator's tableau, or None; `integrate_step` sets mimic joints in any case."""
    if isinstance(integrator, ZeroOrderHold) and not integrator.at_middle:
        return Tableau(np.zeros(0), np.zeros((0, 0)), np.zeros(0), 0)
    if isinstance(integrator, ZeroOrderHold):
        return Tableau(*MIDPOINT.tableau, 1)
    if isinstance(integrator, WithMimicJoints):
        return tableau(integrator.integrator)
    return Tableau(*integrator.tableau, 0) if isinstance(integrator, RungeKutta) else None


@compiled
def hold_inputs(q: Array, u: Array, dt: float, integers: Integers, floats: Array, q_next: Array) -> None:
    """q_next (n,): q after dt with the inputs u (m,); at second order with the u_dot of the sample just made,
    and u is then what they come to."""
    laid = views(LaidOut, integers, floats, 0)
    e = views(ControlStep, integers, floats, BESIDE)
    arm, u_dot = e.arm, e.second.u_dot
    n_p = laid.buffers.G.shape[0]
    inputs = Inputs(laid.platform_kernel, laid.platform_numbers, n_p, arm.moved, arm.mimic_joints)
    hold_rates(inputs, q, u, u_dot, dt, q_next)
    for j in range(u_dot.shape[0]):
        u[j] += dt * u_dot[j]


@compiled
def integrate_step(
    t: float, dt: float, q: Array, integers: Integers, floats: Array, method: Tableau, q_next: Array
) -> float:
    """q_next (n,): q at t + dt, from the sample just made at (t, q); returns the first failed stage's status,
    else SOLVED. Stages keep the sample's bounds and previous inputs; `end_stages` restores the rest."""
    e = views(ControlStep, integers, floats, BESIDE)
    n, m = q.shape[0], e.second.u_dot.shape[0]
    stages = method.weights.shape[0]
    if stages == 0:
        hold_inputs(q, e.problem.before if m > 0 else e.answer.u, dt, integers, floats, q_next)
        return SOLVED
    slopes, stage, start = scratch((stages, n + m)), scratch(n), scratch(m)
    for j in range(m):
        start[j] = e.problem.before[j]
    mode = e.limits.mode[()]
    if mode == SAMPLE:
        e.limits.mode[()] = STAGE
    stands = views(LaidOut, integers, floats, 0).stands
    stands[()] = 1
    status = float(SOLVED)
    for k in range(1, stages + 1):
        for i in range(n):
            slopes[k - 1, i] = e.q_dot[i]
        for i in range(n):
            total = 0.0
            for a in range(k):
                total += (method.weights[a] if k == stages else method.matrix[k, a]) * slopes[a, i]
            stage[i] = q[i] + dt * total
        for j in range(m):  # at second order the inputs are integrated, too
            slopes[k - 1, n + j] = e.second.u_dot[j]
            total = 0.0
            for a in range(k):
                total += (method.weights[a] if k == stages else method.matrix[k, a]) * slopes[a, n + j]
            e.problem.before[j] = start[j] + dt * total
        if k < stages:
            status = call_step(e.step, t + method.nodes[k] * dt, stage, integers, floats)
            if status >= SINGULAR_J:
                break
    e.limits.mode[()], stands[()] = mode, 0
    if status >= SINGULAR_J:
        return status
    if method.holds == 1:
        hold_inputs(q, e.answer.u, dt, integers, floats, q_next)
        return SOLVED
    place_mimic_joints(stage, e.arm.mimic_joints)
    for i in range(n):
        q_next[i] = stage[i]
    return SOLVED


@compiled
def end_stages(
    integers: Integers, floats: Array, left_integers: Integers, left: Array, method: Tableau, held: Array
) -> None:
    """Restore what stages changed, but for the active bounds and, at second order, the inputs. Where the
    stages' inputs are held over the step, held (m,) becomes these, from which accelerations then count."""
    e = views(ControlStep, integers, floats, BESIDE)
    active, inputs = integer_scratch(e.problem.active.shape[0]), scratch(e.second.u_dot.shape[0])
    for j in range(inputs.shape[0]):
        inputs[j] = e.problem.before[j]
    for i in range(active.shape[0]):
        active[i] = e.problem.active[i]
    if method.holds == 1:
        copied(e.answer.u, held)
    put_back(integers, floats, left_integers, left)
    for i in range(active.shape[0]):
        e.problem.active[i] = active[i]
    for j in range(inputs.shape[0]):
        e.problem.before[j] = inputs[j]
    if method.holds == 1 and e.limits.mode[()] == SAMPLE:
        copied(held, e.problem.before)


@compiled_without_gil
def write_errors(
    integers: Integers, floats: Array, times: Array, q: Array, error: Array, rate: Array
) -> None:
    """The task's errors and ∂g/∂t + K e (N, s) at times (N,) and q (N, n), without integration."""
    e = views(ControlStep, integers, floats, BESIDE)
    b = views(LaidOut, integers, floats, 0).buffers
    for k in range(times.shape[0]):
        run_program(times[k], view(q, k * q.shape[1], (q.shape[1],)), integers, floats)
        write_equation(e.task, b, e.arm, e.problem.J, e.problem.rate)
        for i in range(error.shape[1]):
            error[k, i], rate[k, i] = e.task.error[i], e.task.full[i]


@compiled
def advance(
    t: float, dt: float, q: Array, integers: Integers, floats: Array, method: Tableau, q_next: Array, u: Array
) -> float:
    """q_next (n,), q at t + dt, and the inputs u (m,) of the sample at (t, q), or those held after it;
    returns the status of the first step that failed, else that of the step at t."""
    e = views(ControlStep, integers, floats, BESIDE)
    status = float(call_step(e.step, t, q, integers, floats))
    for j in range(u.shape[0]):
        u[j] = e.problem.before[j] if e.second.u_dot.shape[0] > 0 else e.answer.u[j]
    if status >= SINGULAR_J:
        return status
    if method.weights.shape[0] < 2:  # no stages besides the sample
        integrate_step(t, dt, q, integers, floats, method, q_next)
        return status
    count, size = kept(integers, floats)
    left_integers, left = integer_scratch(count), scratch(size)
    keep(integers, floats, left_integers, left)
    failed = integrate_step(t, dt, q, integers, floats, method, q_next)
    end_stages(integers, floats, left_integers, left, method, u)
    if failed >= SINGULAR_J:
        e.answer.status[()] = failed
    return failed if failed >= SINGULAR_J else status
