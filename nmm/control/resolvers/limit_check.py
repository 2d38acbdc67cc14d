"""Check inputs against limits, and call `enforce_limits` by its address."""

from __future__ import annotations

import math

from nmm.base.arrays import Array
from nmm.base.kernels.active_set import FEASIBLE
from nmm.base.kernels.compiled import caller, clear, compiled, scratch, view
from nmm.base.kernels.linear_algebra import copied, dot, times_matrix
from nmm.base.kernels.record_layout import record_type
from nmm.base.kernels.signatures import float64, void
from nmm.control.resolvers.answer import NOT_FINITE, SINGULAR_J, AnswerArrays
from nmm.control.resolvers.problem_arrays import ProblemArrays

#: Tolerance of rows of limits that the resolver itself has enforced.
LEFT = 1e-9

#: Signature of `enforce_limits`: the problem, the inverse of the resolver's metric, the answer it changes.
LIMIT = void(record_type(ProblemArrays), float64[:, ::1], record_type(AnswerArrays))

call_limit = caller(LIMIT)


@compiled
def within(problem: ProblemArrays, u: Array, rounding: float = FEASIBLE) -> bool:
    """Whether the inputs are within the limits; rows of limits may be missed by rounding."""
    for j in range(u.shape[0]):
        if not problem.u_lower[j] <= u[j] <= problem.u_upper[j]:
            return False
    for i in range(problem.lower.shape[0]):
        value = dot(problem.limit_rows[i], u)
        lower, upper = problem.lower[i], problem.upper[i]
        if value < lower - rounding * max(1.0, abs(lower)) or value > upper + rounding * max(1.0, abs(upper)):
            return False
    return True


@compiled
def rows_of_limits(problem: ProblemArrays, T: Array, G: Array) -> None:
    """G = [I; limit_rows] T, (m + l, m); T (0, 0) stands for the identity."""
    m = G.shape[1]
    for i in range(m):
        if T.shape[0] > 0:
            copied(T[i], G[i])
            continue
        clear(G[i])
        G[i, i] = 1.0
    times_matrix(problem.limit_rows, T, view(G, m * m, problem.limit_rows.shape))


@compiled
def beyond(problem: ProblemArrays, answer: AnswerArrays) -> bool:
    return problem.limiter != 0 and bool(answer.status[()] < SINGULAR_J) and not within(problem, answer.u)


@compiled
def bring_within(problem: ProblemArrays, T: Array, answer: AnswerArrays) -> None:
    """Bring the inputs within the limits; T (m, m): the inverse of the metric, (0, 0) for the identity."""
    if beyond(problem, answer):
        call_limit(problem.limiter, problem, T, answer)


@compiled
def undefined(problem: ProblemArrays) -> bool:
    """Whether the task or the gradient is not finite, which ends a run even without limits."""
    total = 0.0
    for j in range(problem.h.shape[0]):
        total += problem.h[j]
        for i in range(problem.J.shape[0]):
            total += problem.J[i, j]
    for i in range(problem.rate.shape[0]):
        total += problem.rate[i]
    return not math.isfinite(total)


@compiled
def keep_limits(problem: ProblemArrays, answer: AnswerArrays) -> None:
    """Call `enforce_limits` where the resolver found no inputs, or inputs beyond the limits; where
    nothing did so, no limit is active. A limit that has no value ends a run: nothing says that it is kept."""
    for i in range(problem.lower.shape[0]):
        if math.isnan(problem.lower[i]) or math.isnan(problem.upper[i]):
            answer.status[()] = NOT_FINITE
            answer.excess[()] = 0.0
            for j in range(answer.u.shape[0]):
                answer.u[j] = math.nan
            return
    limited = problem.lower.shape[0] > 0
    for j in range(answer.u.shape[0]):
        limited = limited or not (math.isinf(problem.u_lower[j]) and math.isinf(problem.u_upper[j]))
    seen_to = not math.isnan(answer.excess[()])
    if not seen_to:
        answer.excess[()] = 0.0
    may_limit = limited and problem.limiter != 0
    if may_limit and answer.status[()] == NOT_FINITE:
        may_limit = not undefined(problem)
    if may_limit and (answer.status[()] >= SINGULAR_J or not (seen_to or within(problem, answer.u, LEFT))):
        call_limit(problem.limiter, problem, scratch((0, 0)), answer)
    elif not seen_to:
        clear(problem.active)
