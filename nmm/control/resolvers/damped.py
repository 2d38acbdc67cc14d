"""Damped least squares, level by level, for several resolvers; also with joints at their limits.

A velocity limit scales the task's rate. A stop (a joint limit, a distance, a limit of a function's value)
cannot be scaled: inputs at a stop no longer contribute to the task, and the rest of J may be singular though
J is regular. So inputs at stops are held there, and the others are damped by their own singular values. The
arm comes to rest where no free input brings it nearer. As in bounded least squares (P. Stark, R. Parker,
"Bounded-variable least-squares", Computational Statistics 10, 1995), a stop that would be passed is held, and
one that hinders the task is released.
"""

from __future__ import annotations

import math

from nmm.base.arrays import Array, Integers
from nmm.base.kernels.active_set import DEPENDENT, ActiveNormals, combination, join, nearest, split
from nmm.base.kernels.compiled import clear, compiled, integer_scratch, scratch
from nmm.base.kernels.damping import CONSTANT, Law, damped_solution
from nmm.base.kernels.linear_algebra import add, copied, dot, norm, project_out, times, times_matrix
from nmm.control.resolvers.answer import INEXACT, RELAXED, AnswerArrays, certify
from nmm.control.resolvers.limit_check import rows_of_limits
from nmm.control.resolvers.problem_arrays import LOWER, UPPER, ProblemArrays

#: Tolerance of a stop, times its bound if that is above 1.
MISSED = 1e-12
#: A stop is released where the task gains more than this share of its rate.
GAIN = 1e-9
#: Limits on releases of each stop, and on rounds per stop.
MOST_LEFT, ROUNDS = 3, 4
#: Marks a stop that cannot be held together with the others.
BARRED = -1


@compiled
def damp(
    problem: ProblemArrays, alpha: float, law: Law, W: Array, dt: float, answer: AnswerArrays
) -> tuple[float, float]:
    """Write u, measure, residual, status and nu; W holds C (m, m), or (0, 0) where every weight is 1; dt, s :
    for which the law is resolved. Returns `overrun` of the damped part."""
    s, m = problem.J.shape
    J, u0, solution = scratch((s, m)), scratch(m), scratch(m)
    weigh(problem, alpha, W, J, u0)
    scales, damped = problem.row_scales, scratch(m)
    damping = damped_solution(J, scales, problem.rate, problem.ends, u0, law, dt, solution, answer.nu, damped)
    give(problem, W, solution, damping, answer)
    unweigh(W, damped, solution)
    return overrun(problem, solution)


@compiled
def overrun(problem: ProblemArrays, asked: Array) -> tuple[float, float]:
    """How long the previous inputs run on along the inputs asked for (m,) if these turn back, below 0 if they
    do not, s; and how long those that are asked, or the previous ones, take to be reached from rest."""
    along, size, change = dot(problem.before, asked), norm(asked), math.inf
    if size == 0.0:
        return 0.0, 0.0
    for j in range(asked.shape[0]):
        if asked[j] != 0.0:
            most = problem.rising[j] if asked[j] > 0.0 else problem.falling[j]
            change = min(change, most * size / abs(asked[j]))
    along /= size * change
    return -along, max(abs(along), size / change)


@compiled
def give(
    problem: ProblemArrays, W: Array, solution: Array, damping: tuple[float, bool], answer: AnswerArrays
) -> None:
    """Write the answer with u = C solution; damping and answer.nu come from `damped_solution`."""
    unweigh(W, solution, answer.u)
    answer.measure[()], damped = damping
    certify(problem, answer)
    if answer.status[()] == INEXACT and damped:
        answer.status[()] = RELAXED
    else:
        for level in range(answer.nu.shape[0]):
            answer.nu[level] = 1.0


@compiled
def weigh(problem: ProblemArrays, alpha: float, W: Array, weighted_J: Array, u0: Array) -> None:
    """J C and u0 = -α Cᵀ h, in ũ = C⁻¹ u, where the weighted norm is the Euclidean one; W holds C."""
    times_matrix(problem.J, W, weighted_J)
    for j in range(u0.shape[0]):
        u0[j] = -alpha * problem.h[j] if W.shape[0] == 0 else 0.0
        for k in range(W.shape[0]):
            u0[j] -= alpha * W[k, j] * problem.h[k]


@compiled
def unweigh(W: Array, solution: Array, u: Array) -> None:
    if W.shape[0] == 0:
        copied(solution, u)
    else:
        times(W, solution, u)


@compiled
def passed(problem: ProblemArrays, i: int, value: float) -> int:
    """UPPER or LOWER where the value of an input, or of a row after them, is beyond the stop i; else 0."""
    m, stops = problem.u_lower.shape[0], problem.stops[i]
    if stops == 0 or (i >= m and problem.limit_levels[i - m] > 0):  # a soft limit
        return 0
    if stops != LOWER and value - end(problem, i, UPPER) > MISSED * max(1.0, abs(end(problem, i, UPPER))):
        return UPPER
    if stops != UPPER and end(problem, i, LOWER) - value > MISSED * max(1.0, abs(end(problem, i, LOWER))):
        return LOWER
    return 0


@compiled
def end(problem: ProblemArrays, i: int, side: int) -> float:
    m = problem.u_lower.shape[0]
    if side == UPPER:
        return float(problem.u_upper[i] if i < m else problem.upper[i - m])
    return float(problem.u_lower[i] if i < m else problem.lower[i - m])


@compiled
def any_passed(problem: ProblemArrays, u: Array) -> bool:
    m = u.shape[0]
    for i in range(problem.stops.shape[0]):
        if passed(problem, i, u[i] if i < m else dot(problem.limit_rows[i - m], u)) != 0:
            return True
    return False


@compiled
def damp_between_stops(
    problem: ProblemArrays, alpha: float, law: Law, W: Array, dt: float, answer: AnswerArrays
) -> None:
    """`damp` for a task with one level, with inputs held at stops that they would pass."""
    s, m = problem.J.shape
    stops = problem.stops.shape[0]
    J, u0, G, solution = scratch((s, m)), scratch(m), scratch((stops, m)), scratch(m)
    weigh(problem, alpha, W, J, u0)
    rows_of_limits(problem, W, G)
    held, left = integer_scratch(stops), integer_scratch(stops)
    for i in range(stops):
        held[i], left[i] = 0, 0
    basis = ActiveNormals(scratch((m, m)), scratch((m, m)), integer_scratch(m), scratch(m), scratch(m))
    falls, multipliers, n = scratch(m), scratch(m), scratch(m)
    k, damping = 0, (0.0, False)
    cost = law.damping * law.damping if law.mode == CONSTANT else 0.0
    for _ in range(ROUNDS * stops):
        damping = between(problem, J, u0, G, held, basis, k, law, dt, solution, answer.nu)
        asked = fall(problem, J, solution, u0, cost, falls)
        split(basis, k, falls)
        combination(basis, k, basis.d, multipliers)
        new = farthest_passed(problem, G, solution, held, left)
        if new < 0:
            back = keeps_back(basis, k, multipliers, left, GAIN * asked)
            if back < 0:
                break
            held[back] = 0
            left[back] += 1
            k = hold(G, held, basis, n)
            continue
        side = passed(problem, new, dot(G[new], solution))
        outwards(G, new, side, n)
        joined = join(basis, k, new, n)
        if joined > k:
            k, held[new] = joined, side
            continue
        combination(basis, k, basis.d, basis.d)
        back = in_the_way(basis, k, basis.d, multipliers)
        if back < 0:
            left[new] = BARRED
            continue
        held[back], held[new] = 0, side
        k = hold(G, held, basis, n)
    give(problem, W, solution, damping, answer)


@compiled
def outwards(G: Array, i: int, side: int, n: Array) -> float:
    """Write the row of the stop i into n, at unit length and pointing beyond it; returns n over the row."""
    square = dot(G[i], G[i])
    share = 1.0 / math.sqrt(square) if square > 0.0 else 1.0
    if side == LOWER:
        share = -share
    for j in range(n.shape[0]):
        n[j] = share * G[i, j]
    return share


@compiled
def hold(G: Array, held: Integers, basis: ActiveNormals, n: Array) -> int:
    """Make the held stops the members of the basis; returns their number."""
    k = 0
    for i in range(held.shape[0]):
        if held[i] != 0:
            outwards(G, i, held[i], n)
            k = join(basis, k, i, n)
    return k


@compiled
def between(
    problem: ProblemArrays,
    J: Array,
    u0: Array,
    G: Array,
    held: Integers,
    basis: ActiveNormals,
    used: int,
    law: Law,
    dt: float,
    solution: Array,
    shares: Array,
) -> tuple[float, bool]:
    """`damped_solution` in the directions that the `used` held stops leave free."""
    s, m = J.shape
    A, b, start, at_ends, nothing = scratch((s, m)), scratch(s), scratch(m), scratch(used), scratch(m)
    parts, free = scratch(used), scratch(m)
    clear(nothing)
    for k in range(used):
        i = basis.members[k]
        at_ends[k] = outwards(G, i, held[i], start) * end(problem, i, held[i])
    nearest(basis, used, at_ends, nothing, parts, start)
    copied(u0, free)
    project_out(free, basis.Q, used)
    for i in range(s):
        b[i] = problem.rate[i] - dot(J[i], start)
        copied(J[i], A[i])
        project_out(A[i], basis.Q, used)
    scales = problem.row_scales
    damping = damped_solution(A, scales, b, problem.ends, free, law, dt, solution, shares, nothing)
    add(solution, 1.0, start)
    return damping


@compiled
def farthest_passed(problem: ProblemArrays, G: Array, solution: Array, held: Integers, left: Integers) -> int:
    """The stop exceeded the most by the solution, rows at unit length; -1 for none."""
    worst, farthest = -1, 0.0
    for i in range(held.shape[0]):
        value = dot(G[i], solution)
        side = passed(problem, i, value)
        if side == 0 or held[i] != 0 or left[i] == BARRED:
            continue
        by = abs(value - end(problem, i, side)) / math.sqrt(max(dot(G[i], G[i]), 1e-300))
        if by > farthest:
            worst, farthest = i, by
    return worst


@compiled
def in_the_way(basis: ActiveNormals, k: int, shares: Array, multipliers: Array) -> int:
    """The held stop to release so that another one can be held; -1 for none. With the other's row Σ r_i n_i,
    r the shares, it is the stop with r_i > 0 whose multiplier (`keeps_back`) reaches 0 first."""
    blocking, least = -1, math.inf
    for i in range(k):
        if shares[i] > DEPENDENT and multipliers[i] / shares[i] < least:
            blocking, least = basis.members[i], multipliers[i] / shares[i]
    return int(blocking)


@compiled
def fall(problem: ProblemArrays, J: Array, solution: Array, u0: Array, cost: float, falls: Array) -> float:
    """Write falls = Jᵀ r - cost (solution - u0), r the residual, rows in their scales; returns ‖rate‖."""
    asked = 0.0
    for j in range(falls.shape[0]):
        falls[j] = -cost * (solution[j] - u0[j])
    for i in range(J.shape[0]):
        scale = problem.row_scales[i]
        missing = (problem.rate[i] - dot(J[i], solution)) / scale
        asked += (problem.rate[i] / scale) ** 2
        for j in range(falls.shape[0]):
            falls[j] += missing * J[i, j] / scale
    return math.sqrt(asked)


@compiled
def keeps_back(basis: ActiveNormals, k: int, multipliers: Array, left: Integers, least: float) -> int:
    """The stop whose release helps the task most, and more than `least`; -1 for none.

    The task's error plus the cost of damping falls along `falls` = Jᵀ r - λ² (u - u0), of which Σ ν_i n_i is
    along the outward rows n_i of the stops: a multiplier ν_i < 0 means that it falls on returning from stop
    i.
    """
    member, most = -1, least
    for i in range(k):
        if -multipliers[i] > most and left[basis.members[i]] < MOST_LEFT:
            member, most = basis.members[i], -multipliers[i]
    return int(member)
