"""Damped least squares between stops: what an arm does whose joints cannot go on, though its J is regular.

A limit of velocity scales the task's rate. A stop (the end of a joint, a distance, a limit of a function's
value) leaves nothing to scale: what it holds does the task no more, and what is left of J may be singular
where J is regular. So inputs at a stop are kept there, and the rest is damped by its own singular values. An
arm that stops hold comes to rest where no input that is left brings it nearer.

As for bounded least squares (P. Stark, R. Parker, "Bounded-variable least-squares", Computational Statistics
10, 1995): a stop that would be passed is held, and one that keeps the task back is left.
"""

from __future__ import annotations

import math

from nmm.arrays import Array, Integers
from nmm.kernels.compiled import clear, compiled, integer_scratch, scratch
from nmm.kernels.damping import CONSTANT, damped_solution
from nmm.kernels.linear_algebra import (
    closest_solution,
    orthonormal_rows,
    project_out,
    pseudoinverse_transposed,
)
from nmm.resolvers.answer import AnswerArrays
from nmm.resolvers.damped import give, weigh
from nmm.resolvers.problem_arrays import LOWER, UPPER, ProblemArrays
from nmm.resolvers.within import times

#: A stop is missed by no more than this, times its bound if that is above 1.
MISSED = 1e-12
#: A row with no more than this share of it outside the span of others is their combination.
DEPENDENT = 1e-9
#: A stop is left where the task gains more by it than this share of its rate.
GAIN = 1e-9
#: So often each may be left, and so many rounds there are for each, before what is found stands.
MOST_LEFT, ROUNDS = 3, 4
#: Of how often a stop was left: it cannot be held with the others.
BARRED = -1
#: What is in the way of a stop: nothing, or others which leave no way for it.
NOTHING, CONTRADICTS = -1, -2


@compiled
def passed(problem: ProblemArrays, i: int, value: float) -> int:
    """UPPER or LOWER where the value of an input, or of a row after them, is beyond the stop i; else 0."""
    m, stops = problem.u_lower.shape[0], problem.stops[i]
    if stops == 0 or (i >= m and problem.limit_levels[i - m] > 0):  # that has its place among the levels
        return 0
    if stops != LOWER and value - end(problem, i, UPPER) > MISSED * max(1.0, abs(end(problem, i, UPPER))):
        return UPPER
    if stops != UPPER and end(problem, i, LOWER) - value > MISSED * max(1.0, abs(end(problem, i, LOWER))):
        return LOWER
    return 0


@compiled
def end(problem: ProblemArrays, i: int, side: int) -> float:
    """The bound of the stop i on that side."""
    m = problem.u_lower.shape[0]
    if side == UPPER:
        return float(problem.u_upper[i] if i < m else problem.upper[i - m])
    return float(problem.u_lower[i] if i < m else problem.lower[i - m])


@compiled
def any_passed(problem: ProblemArrays, u: Array) -> bool:
    """Whether inputs (m,) go beyond a stop."""
    m = u.shape[0]
    for i in range(problem.stops.shape[0]):
        if passed(problem, i, u[i] if i < m else times(problem.limit_rows, i - m, u)) != 0:
            return True
    return False


@compiled
def damp_between_stops(
    problem: ProblemArrays,
    alpha: float,
    law: int,
    damping: float,
    threshold: float,
    W: Array,
    answer: AnswerArrays,
) -> None:
    """`damp` of a task with one level, with inputs kept at the stops that they would pass."""
    s, m = problem.J.shape
    stops = problem.stops.shape[0]
    J, u0, G, solution = scratch((s, m)), scratch(m), scratch((stops, m)), scratch(m)
    weigh(problem, alpha, W, J, u0)
    stop_rows(problem, W, G)
    held, left = integer_scratch(stops), integer_scratch(stops)
    for i in range(stops):
        held[i], left[i] = 0, 0
    shares, costs, falls = scratch(1), scratch(m), scratch(m)
    least, damped, used = 0.0, False, 0
    square = damping * damping if law == CONSTANT else 0.0
    for _ in range(ROUNDS * stops):
        least, damped = between(problem, J, u0, G, held, used, law, damping, threshold, solution, shares)
        for j in range(m):
            costs[j] = square * (solution[j] - u0[j])
        asked = fall(problem, J, solution, costs, falls)
        new = farthest_passed(problem, G, solution, held, left)
        if new < 0:
            back = keeps_back(G, falls, held, used, left, GAIN * asked)
            if back < 0:
                break
            held[back] = 0
            left[back] += 1
            used -= 1
            continue
        side = passed(problem, new, times(G, new, solution))
        back = in_the_way(G, falls, held, used, new, side)
        if back == CONTRADICTS:
            left[new] = BARRED
            continue
        if back >= 0:
            held[back] = 0
            used -= 1
        held[new] = side
        used += 1
    give(problem, W, solution, least, damped, shares, answer)


@compiled
def stop_rows(problem: ProblemArrays, W: Array, G: Array) -> None:
    """G = [I; limit_rows] C, in the coordinates of `weigh`."""
    stops, m = G.shape
    for i in range(stops):
        for j in range(m):
            if W.shape[0] == 0:
                G[i, j] = problem.limit_rows[i - m, j] if i >= m else 1.0 if i == j else 0.0
            elif i < m:
                G[i, j] = W[i, j]
            else:
                G[i, j] = 0.0
                for k in range(m):
                    G[i, j] += problem.limit_rows[i - m, k] * W[k, j]


@compiled
def rows_held(G: Array, held: Integers, rows: Array, sizes: Array, members: Integers) -> None:
    """The rows (k, m) of G that are held, their norms and which they are."""
    k = 0
    for i in range(held.shape[0]):
        if held[i] != 0:
            square = 0.0
            for j in range(G.shape[1]):
                rows[k, j] = G[i, j]
                square += G[i, j] * G[i, j]
            sizes[k], members[k] = math.sqrt(square) if square > 0.0 else 1.0, i
            k += 1


@compiled
def between(
    problem: ProblemArrays,
    J: Array,
    u0: Array,
    G: Array,
    held: Integers,
    used: int,
    law: int,
    damping: float,
    threshold: float,
    solution: Array,
    shares: Array,
) -> tuple[float, bool]:
    """`damped_solution` in what the stops that are held, `used` of them, leave."""
    s, m = J.shape
    rows, sizes, members = scratch((used, m)), scratch(used), integer_scratch(used)
    order, L, Q = integer_scratch(used), scratch((used, used)), scratch((used, m))
    A, b, start, at_ends, nothing = scratch((s, m)), scratch(s), scratch(m), scratch(used), scratch(m)
    clear(nothing)
    rows_held(G, held, rows, sizes, members)
    orthonormal_rows(rows, sizes, order, L, Q)
    for k in range(used):
        at_ends[k] = end(problem, members[k], held[members[k]])
    closest_solution(at_ends, nothing, order, L, Q, start)
    free = scratch((1, m))
    for j in range(m):
        free[0, j] = u0[j]
    project_out(free, 0, Q, used)
    for i in range(s):
        b[i] = problem.rate[i] - times(J, i, start)
        for j in range(m):
            A[i, j] = J[i, j]
        project_out(A, i, Q, used)
    scales, dt = problem.row_scales, problem.dt[()]
    least, damped = damped_solution(
        A, scales, b, problem.ends, free[0], law, damping, threshold, dt, solution, shares
    )
    for j in range(m):
        solution[j] += start[j]
    return least, damped


@compiled
def farthest_passed(problem: ProblemArrays, G: Array, solution: Array, held: Integers, left: Integers) -> int:
    """The stop that the solution passes by the most, its row at unit length; -1 for none."""
    worst, farthest = -1, 0.0
    for i in range(held.shape[0]):
        value = times(G, i, solution)
        side = passed(problem, i, value)
        if side == 0 or held[i] != 0 or left[i] == BARRED:
            continue
        by = abs(value - end(problem, i, side)) / math.sqrt(max(times(G, i, G[i]), 1e-300))
        if by > farthest:
            worst, farthest = i, by
    return worst


@compiled
def in_the_way(G: Array, falls: Array, held: Integers, used: int, new: int, side: int) -> int:
    """Which of the stops that are held has to be left so that the stop `new` can be, NOTHING, or CONTRADICTS.

    Where its row is a combination Σ r_i n_i of theirs, all outwards, the way back from it is the way back
    from one with r_i > 0: the one whose multiplier ν_i (see `keeps_back`) that lowers to 0 first.
    """
    m = G.shape[1]
    rows, sizes, members = scratch((used, m)), scratch(used), integer_scratch(used)
    order, L, Q, X = integer_scratch(used), scratch((used, used)), scratch((used, m)), scratch((used, m))
    rows_held(G, held, rows, sizes, members)
    orthonormal_rows(rows, sizes, order, L, Q)
    rest = scratch((1, m))
    for j in range(m):
        rest[0, j] = G[new, j]
    for _ in range(2):
        project_out(rest, 0, Q, used)
    size = math.sqrt(times(G, new, G[new]))
    if math.sqrt(times(rest, 0, rest[0])) > DEPENDENT * size:
        return NOTHING
    pseudoinverse_transposed(order, L, Q, X)
    found, least = CONTRADICTS, math.inf
    for k in range(used):
        share, outwards = times(X, k, G[new]) * sizes[k], times(X, k, falls) * sizes[k]
        if held[members[k]] != side:
            share = -share
        if held[members[k]] == LOWER:
            outwards = -outwards
        if share > DEPENDENT * size and outwards / share < least:
            found, least = members[k], outwards / share
    return found


@compiled
def fall(problem: ProblemArrays, J: Array, solution: Array, costs: Array, falls: Array) -> float:
    """Write falls = Jᵀ r - costs, with r the task's residual, rows in their scales; returns ‖rate‖."""
    asked = 0.0
    for j in range(falls.shape[0]):
        falls[j] = -costs[j]
    for i in range(J.shape[0]):
        scale = problem.row_scales[i]
        missing = (problem.rate[i] - times(J, i, solution)) / scale
        asked += (problem.rate[i] / scale) ** 2
        for j in range(falls.shape[0]):
            falls[j] += missing * J[i, j] / scale
    return math.sqrt(asked)


@compiled
def keeps_back(G: Array, falls: Array, held: Integers, used: int, left: Integers, least: float) -> int:
    """The stop by leaving which the task gains the most, and more than `least`; -1 for none.

    What the task lacks, and what damping costs, falls along `falls` = Jᵀ r - λ² (u - u0). Of that, Σ ν_i n_i
    is along the stops' rows n_i, outwards: where ν_i < 0 it falls on the way back from the stop i.
    """
    m = G.shape[1]
    rows, sizes, members = scratch((used, m)), scratch(used), integer_scratch(used)
    order, L, Q, X = integer_scratch(used), scratch((used, used)), scratch((used, m)), scratch((used, m))
    rows_held(G, held, rows, sizes, members)
    orthonormal_rows(rows, sizes, order, L, Q)
    pseudoinverse_transposed(order, L, Q, X)
    found, most = -1, least
    for k in range(used):
        gain = -times(X, k, falls) * sizes[k]
        if held[members[k]] == LOWER:
            gain = -gain
        if gain > most and left[members[k]] < MOST_LEFT:
            found, most = members[k], gain
    return found
