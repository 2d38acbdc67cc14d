"""Whether inputs are within limits, and the call of the code that brings them there.

That code is as much as a resolver's own. It is called by its address, and compiled where there are limits.
"""

from __future__ import annotations

import math

from numba import types

from nmm.arrays import Array
from nmm.kernels.active_set import FEASIBLE
from nmm.kernels.compiled import caller, compiled, scratch
from nmm.kernels.memory import record_type
from nmm.resolvers.answer import NOT_FINITE, SINGULAR_J, AnswerArrays
from nmm.resolvers.problem_arrays import ProblemArrays

#: Rows of limits that a resolver has seen to are missed by no more than this.
LEFT = 1e-9

#: `limit`: the problem, the inverse of the resolver's metric, and the answer that it changes.
LIMIT = types.void(record_type(ProblemArrays), types.float64[:, ::1], record_type(AnswerArrays))

call_limit = caller(LIMIT)


@compiled
def within(problem: ProblemArrays, u: Array, rounding: float = FEASIBLE) -> bool:
    """Whether the inputs are within the limits; rows of limits may be missed by rounding."""
    for j in range(u.shape[0]):
        if not problem.u_lower[j] <= u[j] <= problem.u_upper[j]:
            return False
    for i in range(problem.lower.shape[0]):
        value = times(problem.limit_rows, i, u)
        lower, upper = problem.lower[i], problem.upper[i]
        if value < lower - rounding * max(1.0, abs(lower)) or value > upper + rounding * max(1.0, abs(upper)):
            return False
    return True


@compiled
def times(A: Array, row: int, x: Array) -> float:
    """A[row] . x."""
    total = 0.0
    for j in range(x.shape[0]):
        total += A[row, j] * x[j]
    return total


@compiled
def beyond(problem: ProblemArrays, answer: AnswerArrays) -> bool:
    """Whether there are inputs, and limits that they exceed: then `call_limit`."""
    return problem.limiter != 0 and bool(answer.status[()] < SINGULAR_J) and not within(problem, answer.u)


@compiled
def bring_within(problem: ProblemArrays, T: Array, answer: AnswerArrays) -> None:
    """A resolver's inputs within the limits; T (m, m) is its inverse metric, (0, 0) for the identity."""
    if beyond(problem, answer):
        call_limit(problem.limiter, problem, T, answer)


@compiled
def undefined(problem: ProblemArrays) -> bool:
    """Whether the task or the gradient is no number: that ends a run, as it does without limits."""
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
    """What a resolver itself did not see to: inputs it did not find, or left beyond the limits."""
    limited = problem.lower.shape[0] > 0
    for j in range(answer.u.shape[0]):
        limited = limited or not (math.isinf(problem.u_lower[j]) and math.isinf(problem.u_upper[j]))
    seen_to = not math.isnan(answer.excess[()])
    if not seen_to:
        answer.excess[()] = 0.0
    if not limited or problem.limiter == 0 or (answer.status[()] == NOT_FINITE and undefined(problem)):
        return
    if answer.status[()] >= SINGULAR_J or not (seen_to or within(problem, answer.u, LEFT)):
        call_limit(problem.limiter, problem, scratch((0, 0)), answer)
