"""Inputs within limits: as much of the task's rate as they allow, as near to the unlimited inputs as
possible.

A level whose rows are separate gets the inputs nearest to those wanted that keep what the levels above got.

For one level of priority: the largest λ in [0, 1] with J u = r0 + λ (J u* - r0) and u within the limits, then
the least ‖B (u - u*)‖. u* is the resolver's own answer, returned unchanged if within the limits, B its
metric, r0 = J u_ref, with u_ref the inputs within the limits nearest to rest, or those of the levels above: λ
= 0 is always possible. α h is part of u*, never scaled, only projected. Soft limits are rows placed among the
levels: they are kept as far as the levels above allow, widened by the least number that makes this possible,
and hold, so widened, for the levels below.
"""

from __future__ import annotations

import math

from nmm.base.arrays import Array
from nmm.base.kernels.active_set import ConstraintRows, nearest_within
from nmm.base.kernels.compiled import clear, compiled, integer_scratch, kernel, scratch, view
from nmm.base.kernels.linear_algebra import copied, dot, norm, residual_norm, solve, times, times_matrix
from nmm.control.resolvers.answer import (
    EXACT,
    FALLBACK,
    INEXACT,
    RELAXED,
    SINGULAR_J,
    SOLVED,
    AnswerArrays,
    certify,
)
from nmm.control.resolvers.limit_check import LIMIT, rows_of_limits, within
from nmm.control.resolvers.problem_arrays import ProblemArrays

#: A scale this little below 1 is 1 up to rounding.
WHOLE = 1e-12


@compiled
def nearest_allowed(problem: ProblemArrays, wanted: Array, u: Array) -> float:
    """Write the inputs (m,) nearest to `wanted` within the limits, soft ones ignored. Where rows contradict
    each other or the inputs' limits, all are widened by the least number, in their own units, which is
    returned."""
    m, count = u.shape[0], problem.lower.shape[0]
    for j in range(m):
        u[j] = min(max(wanted[j], problem.u_lower[j]), problem.u_upper[j])
    if within(problem, u):
        return 0.0
    c = m + count
    G, lower, upper, give = scratch((c, m)), scratch(c), scratch(c), scratch(c)
    rows_of_limits(problem, scratch((0, 0)), G)
    for j in range(m):
        lower[j], upper[j], give[j] = problem.u_lower[j], problem.u_upper[j], 0.0
    for i in range(count):
        lower[m + i], upper[m + i], give[m + i] = -math.inf, math.inf, 1.0
        if problem.limit_levels[i] == 0:
            lower[m + i], upper[m + i] = problem.lower[i], problem.upper[i]
    E, none, y = scratch((0, m)), scratch(0), scratch(m)
    active = integer_scratch(2 + c)
    active[0] = 0
    scale = nearest_within(ConstraintRows(E, none, none, G, lower, upper, give), wanted, -math.inf, active, y)
    if math.isnan(scale):
        return math.inf
    for j in range(m):
        u[j] = min(max(y[j], problem.u_lower[j]), problem.u_upper[j])
    return 1.0 - scale


@compiled
def replace_by_nearest(problem: ProblemArrays, wanted: Array, answer: AnswerArrays) -> None:
    """Answer with the inputs within the limits nearest to `wanted`; the task's share is 0, on purpose."""
    answer.excess[()] = nearest_allowed(problem, wanted, answer.u)
    answer.residual[()], _ = residual_norm(problem.J, answer.u, problem.rate)
    answer.status[()] = RELAXED
    clear(answer.nu)


@compiled
def fall_back(problem: ProblemArrays, answer: AnswerArrays) -> None:
    """Answer with the inputs nearest to rest; the status is FALLBACK."""
    rest = scratch(answer.u.shape[0])
    clear(rest)
    replace_by_nearest(problem, rest, answer)
    answer.status[()] = FALLBACK


@kernel(LIMIT)
def enforce_limits(problem: ProblemArrays, T: Array, answer: AnswerArrays) -> None:
    """Bring the resolver's inputs within the limits, or, where it has none, those nearest to rest.

    T (m, m) is the inverse of the metric B; (0, 0) for the identity.
    """
    if answer.status[()] >= SINGULAR_J:
        fall_back(problem, answer)
        return
    s, m = problem.J.shape
    c, levels, u = m + problem.lower.shape[0], problem.ends.shape[0], answer.u
    start, rest, difference, target = scratch(m), scratch(m), scratch(m), scratch(m)
    aim, metric = scratch(m), T
    copied(u, start)
    clear(target)
    answer.excess[()] = nearest_allowed(problem, target, rest)
    G, lower, upper, give = scratch((c, m)), scratch(c), scratch(c), scratch(c)
    low, high = scratch(c), scratch(c)
    JT, change, fixed, wanted = scratch((s, m)), scratch(s), scratch(s), scratch(s)
    clear(give)
    clear(fixed)
    first = 0
    for level in range(levels + 1):
        moved = keep_if_possible(problem, level, first, answer.excess[()], low, high, rest)
        if level == levels and not moved:
            break
        end = problem.ends[level] if level < levels else s
        # The next level begins without the contributions of the levels below it and of the objective.
        if level < levels - 1:
            metric = view(fixed, 0, (0, 0))
            shortest(problem, problem.ends[level + 1], start, aim)
        else:
            metric = T
            copied(start, aim)
        if level == 0 or level == levels - 1:
            times_matrix(problem.J, metric, JT)
            rows_of_limits(problem, metric, G)
        for j in range(m):
            difference[j] = aim[j] - rest[j]
        solve(metric, difference, target)
        for i in range(end):
            change[i] = dot(JT[i], target) if i >= first else 0.0
        from_rest(problem, low, high, rest, lower, upper)
        separate = level < levels and problem.separate[level] == 1
        equal = first if separate else end  # rows whose rates are equations
        equations = view(JT, 0, (equal, m)), view(fixed, 0, (equal,)), view(change, 0, (equal,))
        rows = ConstraintRows(*equations, G, lower, upper, give)
        active = view(problem.active, level * (2 + c), (2 + c,))
        scale = nearest_within(rows, target, 0.0, active, difference)
        if math.isnan(scale) and level == 0:
            fall_back(problem, answer)
            return
        if math.isnan(scale):  # keep the inputs of the levels above
            scale = 0.0
            copied(rest, u)
        else:
            move(problem, metric, rest, difference, u)
        if separate:
            scale = share_of_rows(problem, first, end, rest, change, u)
        for i in range(first, end):
            wanted[i] = dot(problem.J[i], u if separate else rest) + (0.0 if separate else scale * change[i])
        if level < levels and scale < 1.0 - WHOLE:
            answer.nu[level] *= scale
            answer.status[()] = RELAXED
        copied(u, rest)
        first = end
    judge(problem, wanted, answer)


@compiled
def share_of_rows(
    problem: ProblemArrays, first: int, end: int, rest: Array, change: Array, u: Array
) -> float:
    """1 - ‖what rows from `first` to `end` miss of their change from `rest`‖ / ‖change‖, in their scales."""
    asked, missed = 0.0, 0.0
    for i in range(first, end):
        weight = 1.0 / problem.row_scales[i]
        asked += (weight * change[i]) ** 2
        missed += (weight * (change[i] - dot(problem.J[i], u) + dot(problem.J[i], rest))) ** 2
    return 1.0 if missed <= WHOLE * WHOLE * asked else max(0.0, 1.0 - math.sqrt(missed / asked))


@compiled
def shortest(problem: ProblemArrays, end: int, other: Array, u: Array) -> None:
    """The shortest u (m,) that gives the first `end` rows of J the same rates as `other`."""
    m = u.shape[0]
    nothing, rates, none, target = scratch(end), scratch(end), scratch(0), scratch(m)
    clear(nothing)
    clear(target)
    times(problem.J, other, rates)
    active = integer_scratch(2)
    active[0] = 0
    rows = ConstraintRows(view(problem.J, 0, (end, m)), nothing, rates, scratch((0, m)), none, none, none)
    nearest_within(rows, target, 0.0, active, u)


@compiled
def move(problem: ProblemArrays, T: Array, start: Array, difference: Array, u: Array) -> None:
    """u = start + T difference, clipped to the limits of the inputs."""
    for j in range(u.shape[0]):
        moved = difference[j] if T.shape[0] == 0 else dot(T[j], difference)
        u[j] = min(max(start[j] + moved, problem.u_lower[j]), problem.u_upper[j])


@compiled
def from_rest(
    problem: ProblemArrays, low: Array, high: Array, rest: Array, lower: Array, upper: Array
) -> None:
    """The limits low and high (m + l,) of inputs and rows, relative to the inputs `rest`."""
    m = rest.shape[0]
    for i in range(low.shape[0]):
        at_rest = rest[i] if i < m else dot(problem.limit_rows[i - m], rest)
        lower[i] = low[i] - at_rest
        upper[i] = high[i] - at_rest


@compiled
def keep_if_possible(
    problem: ProblemArrays, level: int, first: int, excess: float, low: Array, high: Array, rest: Array
) -> bool:
    """Bring `rest` within the soft limits before a level, or as near as possible; returns whether it moved.

    The tasks above, the first rows of J, keep their rates for `rest`. low and high (m + l,) gain these rows,
    widened; before the first level they are initialised with the limits that are always kept.
    """
    m, c = rest.shape[0], low.shape[0]
    give, lower, upper = scratch(c), scratch(c), scratch(c)
    clear(give)
    missed = False
    for i in range(c):
        row = i - m
        if row < 0:
            if level == 0:
                low[i], high[i] = problem.u_lower[i], problem.u_upper[i]
        elif problem.limit_levels[row] == 0:
            if level == 0:
                low[i], high[i] = problem.lower[row] - excess, problem.upper[row] + excess
        elif problem.limit_levels[row] == level + 1:
            low[i], high[i], give[i] = problem.lower[row], problem.upper[row], 1.0
            value = dot(problem.limit_rows[row], rest)
            missed = missed or not low[i] <= value <= high[i]
        elif level == 0:
            low[i], high[i] = -math.inf, math.inf
    if not missed:
        return False
    from_rest(problem, low, high, rest, lower, upper)
    nothing, still, difference, moved = scratch(first), scratch(m), scratch(m), scratch(m)
    active = integer_scratch(2 + c)
    active[0] = 0
    clear(nothing)
    clear(still)
    plain, G = scratch((0, 0)), scratch((c, m))
    rows_of_limits(problem, plain, G)
    rows = ConstraintRows(view(problem.J, 0, (first, m)), nothing, nothing, G, lower, upper, give)
    widened = 1.0 - nearest_within(rows, still, -math.inf, active, difference)
    if not math.isnan(widened):
        move(problem, plain, rest, difference, moved)
        copied(moved, rest)
    else:
        widened = math.inf
    for i in range(m, c):
        if give[i] > 0.0:
            low[i], high[i] = low[i] - widened, high[i] + widened
    return True


@compiled
def judge(problem: ProblemArrays, wanted: Array, answer: AnswerArrays) -> None:
    """Write the residual against the rate, and the status: whether J u agrees with λ."""
    before = float(answer.status[()])
    certify(problem, answer)
    if before == RELAXED:
        astray, _ = residual_norm(problem.J, answer.u, wanted)
        before = INEXACT if astray > EXACT * (1.0 + norm(problem.rate)) else RELAXED
    if before != SOLVED:
        answer.status[()] = before
