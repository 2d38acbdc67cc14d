"""Inputs within limits: as much of the task's rate as they leave, as near to the unlimited inputs as can be.

For one level of priority: the largest λ in [0, 1] with J u = r0 + λ (J u* - r0) and u within the limits, then
the least ‖B (u - u*)‖. u* is the resolver's own answer, B its metric, r0 = J u_ref, with u_ref the inputs
within the limits nearest to rest, or what the levels above have left: λ = 0 always exists. α h lives in u*
and is never scaled, only projected. u* within the limits is returned as it is.

Rows of limits may have a place among the levels, too: then they are kept as far as the levels above them
leave it, widened by the least number with which they can be, and hold as that for the levels below.
"""

from __future__ import annotations

import math

from nmm.arrays import Array
from nmm.kernels.active_set import Rows, nearest_within
from nmm.kernels.compiled import clear, compiled, integer_scratch, kernel, scratch, view
from nmm.kernels.linear_algebra import eliminate, residual_norm
from nmm.resolvers.answer import (
    EXACT,
    FALLBACK,
    INEXACT,
    RELAXED,
    SINGULAR_J,
    SOLVED,
    AnswerArrays,
    certify,
)
from nmm.resolvers.problem_arrays import ProblemArrays
from nmm.resolvers.within import LIMIT, times, within

#: A scale below 1 by no more than this is rounding.
WHOLE = 1e-12


@compiled
def nearest_allowed(problem: ProblemArrays, wanted: Array, u: Array) -> float:
    """Write the inputs (m,) within the limits nearest to `wanted`; returns how far rows were widened.

    Limits of single inputs hold always, rows of limits below levels do not count. Where the other rows leave
    nothing with them, all of these are widened by the least number, in their own units, with which they do.
    """
    m, count = u.shape[0], problem.lower.shape[0]
    for j in range(m):
        u[j] = min(max(wanted[j], problem.u_lower[j]), problem.u_upper[j])
    if within(problem, u):
        return 0.0
    G, lower, upper, give = (
        scratch((m + count, m)),
        scratch(m + count),
        scratch(m + count),
        scratch(m + count),
    )
    clear(G)
    for i in range(m + count):
        if i < m:
            G[i, i] = 1.0
            lower[i], upper[i], give[i] = problem.u_lower[i], problem.u_upper[i], 0.0
            continue
        lower[i], upper[i], give[i] = -math.inf, math.inf, 1.0
        if problem.limit_levels[i - m] > 0:
            continue
        lower[i], upper[i] = problem.lower[i - m], problem.upper[i - m]
        for j in range(m):
            G[i, j] = problem.limit_rows[i - m, j]
    E, none = scratch((0, m)), scratch(0)
    y = scratch(m)
    active = integer_scratch(1 + m + count)
    active[0] = 0
    scale = nearest_within(Rows(E, none, none, G, lower, upper, give), wanted, -math.inf, active, y)
    if math.isnan(scale):
        return math.inf
    for j in range(m):
        u[j] = min(max(y[j], problem.u_lower[j]), problem.u_upper[j])
    return 1.0 - scale


@compiled
def nearest_to_rest(problem: ProblemArrays, u: Array) -> float:
    """`nearest_allowed` to 0."""
    rest = scratch(u.shape[0])
    clear(rest)
    return float(nearest_allowed(problem, rest, u))


@compiled
def instead(problem: ProblemArrays, wanted: Array, answer: AnswerArrays) -> None:
    """The inputs nearest to other ones than the resolver's: nothing is left of the task on purpose."""
    answer.excess[()] = nearest_allowed(problem, wanted, answer.u)
    answer.residual[()], _ = residual_norm(problem.J, answer.u, problem.rate)
    answer.status[()] = RELAXED
    for level in range(answer.scale.shape[0]):
        answer.scale[level] = 0.0


@compiled
def fall_back(problem: ProblemArrays, answer: AnswerArrays) -> None:
    """The inputs nearest to rest instead of an answer, and say so."""
    rest = scratch(answer.u.shape[0])
    clear(rest)
    instead(problem, rest, answer)
    answer.status[()] = FALLBACK


@kernel(LIMIT)
def limit(problem: ProblemArrays, T: Array, answer: AnswerArrays) -> None:
    """Bring the resolver's inputs within the limits: u, scale, residual, status, excess.

    T (m, m) is the inverse of the metric B; (0, 0) where B is the identity. Where there are no inputs, the
    nearest to rest stand in for them.
    """
    if answer.status[()] >= SINGULAR_J:
        fall_back(problem, answer)
        return
    s, m = problem.J.shape
    c = m + problem.lower.shape[0]
    levels = problem.ends.shape[0]
    u = answer.u
    start, rest, difference, target = scratch(m), scratch(m), scratch(m), scratch(m)
    aim, metric = scratch(m), T
    for j in range(m):
        start[j] = u[j]
    answer.excess[()] = nearest_to_rest(problem, rest)
    G, lower, upper, give = scratch((c, m)), scratch(c), scratch(c), scratch(c)
    low, high = scratch(c), scratch(c)
    JT, change, fixed = scratch((s, m)), scratch(s), scratch(s)
    clear(give)
    clear(fixed)
    wanted = scratch(s)
    first = 0
    for level in range(levels + 1):
        moved = keep_if_possible(problem, level, first, answer.excess[()], low, high, rest)
        if level == levels and not moved:
            break
        end = problem.ends[level] if level < levels else s
        # What the next level begins with is nothing that levels below it, or the objective, may change.
        if level < levels - 1:
            metric = view(fixed, 0, (0, 0))
            shortest(problem, problem.ends[level + 1], start, aim)
        else:
            metric = T
            for j in range(m):
                aim[j] = start[j]
        if level == 0 or level == levels - 1:
            transform(problem, metric, JT, G)
        for j in range(m):
            difference[j] = aim[j] - rest[j]
        into_metric(metric, difference, target)
        for i in range(end):
            change[i] = times(JT, i, target) if i >= first else 0.0
        from_rest(problem, low, high, rest, lower, upper)
        rows = Rows(
            view(JT, 0, (end, m)), view(fixed, 0, (end,)), view(change, 0, (end,)), G, lower, upper, give
        )
        scale = nearest_within(rows, target, 0.0, problem.active, difference)
        if math.isnan(scale) and level == 0:
            fall_back(problem, answer)
            return
        if math.isnan(scale):  # what the levels above have left stands
            scale = 0.0
            for j in range(m):
                u[j] = rest[j]
        else:
            move(problem, metric, rest, difference, u)
        for i in range(first, end):
            wanted[i] = times(problem.J, i, rest) + scale * change[i]
        if level < levels and scale < 1.0 - WHOLE:
            answer.scale[level] *= scale
            answer.status[()] = RELAXED
        for j in range(m):
            rest[j] = u[j]
        first = end
    judge(problem, wanted, answer)


@compiled
def shortest(problem: ProblemArrays, end: int, given: Array, u: Array) -> None:
    """The shortest u (m,) that gives the first rows of J the rates that `given` gives them."""
    m = u.shape[0]
    nothing, rates, none = scratch(end), scratch(end), scratch(0)
    clear(nothing)
    for i in range(end):
        rates[i] = times(problem.J, i, given)
    active = integer_scratch(1)
    active[0] = 0
    rows = Rows(view(problem.J, 0, (end, m)), nothing, rates, scratch((0, m)), none, none, none)
    target = scratch(m)
    clear(target)
    nearest_within(rows, target, 0.0, active, u)


@compiled
def move(problem: ProblemArrays, T: Array, start: Array, difference: Array, u: Array) -> None:
    """u = start + T difference, within the limits of the inputs."""
    for j in range(u.shape[0]):
        moved = difference[j] if T.shape[0] == 0 else times(T, j, difference)
        u[j] = min(max(start[j] + moved, problem.u_lower[j]), problem.u_upper[j])


@compiled
def from_rest(
    problem: ProblemArrays, low: Array, high: Array, rest: Array, lower: Array, upper: Array
) -> None:
    """What the limits low and high (m + l,) of inputs and rows leave beside the inputs `rest`."""
    m = rest.shape[0]
    for i in range(low.shape[0]):
        at_rest = rest[i] if i < m else times(problem.limit_rows, i - m, rest)
        lower[i] = low[i] - at_rest
        upper[i] = high[i] - at_rest


@compiled
def keep_if_possible(
    problem: ProblemArrays,
    level: int,
    first: int,
    excess: float,
    low: Array,
    high: Array,
    rest: Array,
) -> bool:
    """Bring `rest` within the rows of limits that have their place before a level, or as near as can be.

    The tasks above, the first rows of J, keep what `rest` gives them. low and high (m + l,) gain these rows,
    widened; before the first level they are written, with what is always kept. Returns whether `rest` moved.
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
            value = times(problem.limit_rows, row, rest)
            missed = missed or not low[i] <= value <= high[i]
        elif level == 0:
            low[i], high[i] = -math.inf, math.inf
    if not missed:
        return False
    from_rest(problem, low, high, rest, lower, upper)
    nothing, still, difference, moved = scratch(first), scratch(m), scratch(m), scratch(m)
    active = integer_scratch(1 + c)
    active[0] = 0
    clear(nothing)
    clear(still)
    plain, J, G = scratch((0, 0)), scratch((problem.J.shape[0], m)), scratch((c, m))
    transform(problem, plain, J, G)
    rows = Rows(view(J, 0, (first, m)), nothing, nothing, G, lower, upper, give)
    widened = 1.0 - nearest_within(rows, still, -math.inf, active, difference)
    if not math.isnan(widened):
        move(problem, plain, rest, difference, moved)
        for j in range(m):
            rest[j] = moved[j]
    for i in range(m, c):
        if give[i] > 0.0:
            low[i] = low[i] - widened if not math.isnan(widened) else -math.inf
            high[i] = high[i] + widened if not math.isnan(widened) else math.inf
    return True


@compiled
def transform(problem: ProblemArrays, T: Array, JT: Array, G: Array) -> None:
    """JT = J T and G = [I; limit_rows] T."""
    s, m = problem.J.shape
    plain = T.shape[0] == 0
    for j in range(m):
        for i in range(s):
            total = problem.J[i, j] if plain else 0.0
            if not plain:
                for a in range(m):
                    total += problem.J[i, a] * T[a, j]
            JT[i, j] = total
        for i in range(m):
            G[i, j] = T[i, j] if not plain else 1.0 if i == j else 0.0
        for i in range(problem.lower.shape[0]):
            total = problem.limit_rows[i, j] if plain else 0.0
            if not plain:
                for a in range(m):
                    total += problem.limit_rows[i, a] * T[a, j]
            G[m + i, j] = total


@compiled
def into_metric(T: Array, difference: Array, y: Array) -> None:
    """T y = difference."""
    m = difference.shape[0]
    if T.shape[0] == 0:
        for j in range(m):
            y[j] = difference[j]
        return
    M, scales = scratch((m, m + 1)), scratch(m)
    for i in range(m):
        scales[i] = 1.0
        for j in range(m):
            M[i, j] = T[i, j]
        M[i, m] = difference[i]
    eliminate(M, scales)
    for j in range(m):
        y[j] = M[j, m]


@compiled
def judge(problem: ProblemArrays, wanted: Array, answer: AnswerArrays) -> None:
    """Residual against the rate, and whether J u is what λ says."""
    before = float(answer.status[()])
    certify(problem, answer)
    if before == RELAXED:
        astray, _ = residual_norm(problem.J, answer.u, wanted)
        asked = 0.0
        for i in range(problem.rate.shape[0]):
            asked += problem.rate[i] * problem.rate[i]
        before = INEXACT if astray > EXACT * (1.0 + math.sqrt(asked)) else RELAXED
    if before != SOLVED:
        answer.status[()] = before
