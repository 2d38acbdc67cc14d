"""Control steps of second order: u_dot = controller(t, q, u).

Let y(t, q, u) = rate - J u. With y_dot = -k y the error follows e_ddot + (k + K) e_dot + k K e = 0, which is

    J u_dot = D_u[rate - J u] + k (rate - J u),

D_u the derivative along q_dot = S u at constant u: a central difference of the compiled rows at (t ± h,
q ± h S u). The resolver answers as at first order, for the rate led by D_u[rate - J u] / k, and u follows its
answer w:

    u_dot = k (w - u).

So J u_dot is as above, and the redundancy is a servo on the resolver's own answer. With limits u_dot is held
over a sample, and the bounds of w are such that the inputs at its end are within theirs. Of a coordinate that
an input moves these are the bounds of first order, seen from where it is after half the sample at the present
rate: q + u dt / 2.
"""

from __future__ import annotations

import math

from nmm.base.arrays import Array, Integers
from nmm.base.kernels.compiled import compiled, kernel, scratch
from nmm.base.kernels.linear_algebra import dot
from nmm.base.kernels.record_layout import views
from nmm.control.functions.program import BESIDE, LaidOut, run_stages
from nmm.control.limits.bounds import OFF, approach, bound_inputs, brakings, wheel_rows
from nmm.control.step.equations import (
    BOUNDS,
    STEP,
    ControlStep,
    call_bounds,
    drive,
    resolve,
    times_S,
    write_equation,
    write_problem,
)
from nmm.control.step.limit_rows import write_rates_beside, write_rows

#: A row whose second difference is beyond this share of 1 + its size jumps.
JUMPED = 1e-4
#: Rows of `SecondOrder.y`.
BEHIND, MIDDLE, AHEAD = 0, 1, 2


@compiled
def evaluate_beside(t: float, q: Array, side: int, integers: Integers, floats: Array) -> None:
    """Write y behind or ahead, at t and `beside`, a step h along the motion from q."""
    laid = views(LaidOut, integers, floats, 0)
    e = views(ControlStep, integers, floats, BESIDE)
    own, u, w = e.second, e.problem.before, e.limits.spin.shape[0]
    s, k, m = own.task.r.shape[0], own.added.r.shape[0], own.u_dot.shape[0]
    stood = laid.stands[()]
    laid.stands[()] = 1
    run_stages(t, own.beside, integers, floats, own.buffers, own.stages)
    laid.stands[()] = stood
    J, rate, added_J, added_rate = scratch((s, m)), scratch(s), scratch((k, m)), scratch(k)
    write_equation(own.task, own.buffers, e.arm, J, rate)
    write_equation(own.added, own.buffers, e.arm, added_J, added_rate)
    for i in range(s):
        own.y[side, i] = rate[i] - dot(J[i], u)
    for i in range(k):
        own.y[side, s + i] = added_rate[i] - dot(added_J[i], u)
    if w > 0:
        wheel_rows(e.limits, own.beside, own.buffers.G, e.problem)
    for i in range(w):
        own.y[side, s + k + i] = dot(e.problem.limit_rows[i], u)
    row = scratch(m)
    for i in range(e.limits.rows.shape[0]):
        function = e.limits.rows[i]
        times_S(own.buffers.value_q, function, own.buffers.G, e.arm, row)
        own.y[side, s + k + w + i] = own.buffers.value_t[function] + dot(row, u)
    if e.own_limits.shape[0] > 0:
        write_rates_beside(t, side, s + k, integers, floats)


@compiled
def move_beside(q: Array, side: int, integers: Integers, floats: Array) -> float:
    """Write `beside`, a step h along the motion from q, and return how much later that is."""
    e = views(ControlStep, integers, floats, BESIDE)
    h = float(e.second.h[()]) if side == AHEAD else -float(e.second.h[()])
    for i in range(q.shape[0]):
        e.second.beside[i] = q[i] + h * e.q_dot[i]
    return h


@compiled
def evaluate_sample(t: float, q: Array, integers: Integers, floats: Array) -> None:
    """Write the equations and y at (t, q), and the motion S u."""
    write_problem(t, q, integers, floats)
    b = views(LaidOut, integers, floats, 0).buffers
    e = views(ControlStep, integers, floats, BESIDE)
    own, problem, s = e.second, e.problem, e.task.r.shape[0]
    drive(problem.before, b.G, e.arm, e.q_dot)
    for i in range(s):
        own.y[MIDDLE, i] = problem.rate[i] - dot(problem.J[i], problem.before)
    for i in range(own.added.r.shape[0]):
        own.y[MIDDLE, s + i] = problem.added_rate[i] - dot(problem.added_J[i], problem.before)


@compiled
def differentiate(integers: Integers, floats: Array) -> None:
    """Write D from y; where the rate jumps between behind and ahead, from the side without the jump."""
    e = views(ControlStep, integers, floats, BESIDE)
    own = e.second
    with_middle = own.task.r.shape[0] + own.added.r.shape[0]
    for i in range(own.D.shape[0]):
        behind, ahead = own.y[BEHIND, i], own.y[AHEAD, i]
        own.D[i] = (ahead - behind) / (2.0 * own.h[()])
        if i < with_middle:
            middle = own.y[MIDDLE, i]
            if abs(ahead - 2.0 * middle + behind) > JUMPED * (1.0 + abs(middle)):
                gone = middle - behind if abs(middle - behind) < abs(ahead - middle) else ahead - middle
                own.D[i] = gone / own.h[()]


@compiled
def answer_led(q: Array, integers: Integers, floats: Array) -> float:
    """Lead the rates by D / k, resolve, and write u_dot; returns the status."""
    e = views(ControlStep, integers, floats, BESIDE)
    own, problem, s = e.second, e.problem, e.task.r.shape[0]
    differentiate(integers, floats)
    for i in range(s):
        own.lead[i] = own.D[i] / own.servo[()]
        problem.rate[i] += own.lead[i]
        e.task.full[i] += own.lead[i]
    for i in range(own.added.r.shape[0]):
        problem.added_rate[i] += own.D[s + i] / own.servo[()]
    own.share[()] = 1.0
    if e.limits_code != 0:
        call_bounds(e.limits_code, q, integers, floats)
    resolve(q, integers, floats)
    return follow_answer(integers, floats)


@compiled
def follow_answer(integers: Integers, floats: Array) -> float:
    """u_dot = k (w - u), w the resolver's answer, and q_dot = S u; returns the status."""
    b = views(LaidOut, integers, floats, 0).buffers
    e = views(ControlStep, integers, floats, BESIDE)
    own, u, share = e.second, e.problem.before, e.second.share[()]
    for j in range(own.u_dot.shape[0]):
        own.u_dot[j] = own.servo[()] * (e.answer.u[j] - u[j])
        if share != 1.0 or not (math.isinf(own.lower[j]) and math.isinf(own.upper[j])):
            following = min(max(u[j] + share * (e.answer.u[j] - u[j]), own.lower[j]), own.upper[j])
            own.u_dot[j] = (following - u[j]) / e.problem.dt[()]
    if share != 1.0:
        e.answer.excess[()] *= share
    drive(u, b.G, e.arm, e.q_dot)
    return float(e.answer.status[()])


@kernel(STEP)
def accelerate(t: float, q: Array, integers: Integers, floats: Array) -> float:
    """One control step of second order, of the inputs in `before`; returns the status."""
    evaluate_sample(t, q, integers, floats)
    for side in (BEHIND, AHEAD):
        evaluate_beside(t + move_beside(q, side, integers, floats), q, side, integers, floats)
    return answer_led(q, integers, floats)


@kernel(BOUNDS)
def write_next_limits(q: Array, integers: Integers, floats: Array) -> None:
    """Write bounds and rows for the resolver's answer, so that the inputs at the sample's end keep theirs."""
    b = views(LaidOut, integers, floats, 0).buffers
    e = views(ControlStep, integers, floats, BESIDE)
    limits, problem, own = e.limits, e.problem, e.second
    m, w, u = problem.u_lower.shape[0], limits.spin.shape[0], e.problem.before
    for j in range(m):
        problem.u_lower[j], problem.u_upper[j] = -math.inf, math.inf
        own.lower[j], own.upper[j] = -math.inf, math.inf
    for i in range(problem.lower.shape[0]):
        problem.lower[i], problem.upper[i] = -math.inf, math.inf
    if limits.mode[()] == OFF:
        return
    dt = problem.dt[()]
    share = own.servo[()] * dt
    own.share[()] = share
    drift = own.task.r.shape[0] + own.added.r.shape[0]
    if w > 0:
        wheel_rows(limits, q, b.G, problem)
    for i in range(limits.rows.shape[0]):
        row = limits.rows[i]
        times_S(b.value_q, row, b.G, e.arm, problem.limit_rows[w + i])
        slope = problem.limit_rows[w + i]
        above, below = brakings(limits, i, slope)
        value, recovery = b.value[row], limits.recovery[()]
        halfway = value + 0.5 * dt * (b.value_t[row] + dot(slope, u))
        problem.upper[w + i] = approach(limits.row_high[i] - halfway, dt, above, recovery) - b.value_t[row]
        problem.lower[w + i] = -approach(halfway - limits.row_low[i], dt, below, recovery) - b.value_t[row]
    # u_dot holds for a whole sample, also where the one before was shorter.
    elapsed = limits.elapsed[()]
    limits.elapsed[()] = math.nan
    if e.own_limits.shape[0] > 0:
        write_rows(q, False, integers, floats)
    for i in range(problem.lower.shape[0]):
        turned, now = dt * own.D[drift + i], dot(problem.limit_rows[i], u)
        problem.upper[i] = now + (problem.upper[i] - turned - now) / share
        problem.lower[i] = now + (problem.lower[i] - turned - now) / share
    ahead = scratch(q.shape[0])
    for i in range(q.shape[0]):
        ahead[i] = q[i]
    for j in range(m):
        if limits.coordinate[j] >= 0:
            ahead[limits.coordinate[j]] += 0.5 * dt * u[j]
    bound_inputs(limits, ahead, problem)
    limits.elapsed[()] = elapsed
    for j in range(m):
        own.lower[j], own.upper[j] = problem.u_lower[j], problem.u_upper[j]
        problem.u_lower[j] = u[j] + (own.lower[j] - u[j]) / share
        problem.u_upper[j] = u[j] + (own.upper[j] - u[j]) / share
