"""Damped least squares: solutions that stay bounded where J loses rank."""

import math
from typing import NamedTuple

from nmm.base.arrays import Array, Integers
from nmm.base.kernels.compiled import clear, compiled, scratch
from nmm.base.kernels.linear_algebra import add, copied, dot, less, norm, project_out, singular_rows, times

#: What is damped: all directions by the same λ; all, by a λ that grows from 0 as the least singular value
#: falls below a threshold; only those below the threshold.
CONSTANT, VARIABLE, DIRECTIONS = 0, 1, 2


class Law(NamedTuple):
    """`mode`: one of these; the largest λ, and the threshold ε."""

    mode: int
    damping: float
    threshold: float


#: Defaults of λ and ε. With λ = ε / √2 the inputs that do the task are at most ‖b‖ / ε (b is the rate, rows
#: in their scales): damped, they are no larger than undamped at the threshold.
LARGEST, BELOW = 0.05 / math.sqrt(2.0), 0.05
USUAL = Law(DIRECTIONS, LARGEST, BELOW)
#: A singular value below this counts as 0: its direction is left to the levels below.
NOTHING = 1e-9


@compiled
def damping_squared(law: Law, sigma: float) -> float:
    """λ²: constant, or λ² (1 - (σ/ε)²) below the threshold ε and 0 from there on."""
    if law.mode == CONSTANT:
        return law.damping * law.damping
    if not sigma < law.threshold:
        return 0.0
    share = sigma / law.threshold
    return law.damping * law.damping * (1.0 - share * share)


@compiled
def damped_solution(
    J: Array,
    row_scales: Array,
    rate: Array,
    ends: Integers,
    u0: Array,
    law: Law,
    dt: float,
    u: Array,
    shares: Array,
    damped: Array,
) -> tuple[float, bool]:
    """u = Σ v_i σ_i / (σ_i² + λ_i²) u_iᵀ b + (I - Σ w_i v_i v_iᵀ) u0, shape (m,), where A = Σ u_i σ_i v_iᵀ.

    A and b are J and rate over row_scales; the first part minimises ‖A u - b‖² + Σ λ_i² (v_iᵀ u)². The second
    is u0 in A's null space: w_i = 1 - (1 - (σ_i / ε)²)² for σ_i < ε, else 1. So no damping lets the objective
    affect the task, and u is continuous where a σ_i vanishes. λ and ε are `resolved` for dt, except the ε in
    w_i.

    ends (levels,): the row after the last of each level of priority. A lower level is solved likewise in what
    the higher ones leave: A less its part along all their v_i, damped or not, b less what they do already
    (Nakamura, Hanafusa, Yoshikawa 1987; Siciliano, Slotine 1991). No level affects those above.

    A level may have more rows than u: its A has only as many directions u_i as u has numbers, and what b has
    beside them stays undone.

    Writes into shares (levels,) the share of b that each level is given without the objective's part,
    Σ σ_i² / (σ_i² + λ_i²) (u_iᵀ b)² / ‖b‖², and into damped (m,) the terms of the first sum with λ_i > 0.
    Returns the least σ, and whether anything is damped or undone.
    """
    m = J.shape[1]
    done, above = scratch(m), scratch((m, m))
    taken, first = 0, 0
    smallest, any_damped = math.inf, False
    copied(u0, u)
    clear(done)
    clear(damped)
    for level in range(ends.shape[0]):
        s = ends[level] - first
        A, b, wanted = scratch((s, m)), scratch(s), scratch(s)
        for i in range(s):
            b[i] = rate[first + i] / row_scales[first + i]
            for j in range(m):
                A[i, j] = J[first + i, j] / row_scales[first + i]
            b[i] = less(b[i], A[i], done)
            for _ in range(2):  # the second pass corrects rounding
                project_out(A[i], above, taken)
        least = directions(A, b, wanted)
        count = min(s, m)
        beside = max(dot(b, b) - dot(wanted, wanted), 0.0) if s > m else 0.0
        own = resolved(A, wanted, beside, dt, law)
        asked, achieved = beside, 0.0
        for i in range(count):
            square, along = dot(A[i], A[i]), dot(A[i], u0)
            bottom = square + damping_squared(own, least if law.mode == VARIABLE else math.sqrt(square))
            asked += wanted[i] * wanted[i]
            achieved += square / bottom * wanted[i] * wanted[i]
            share = min(square / (law.threshold * law.threshold), 1.0)
            weight = share * (2.0 - share) / square if square > 0.0 else 0.0
            if bottom > square:
                add(damped, wanted[i] / bottom, A[i])
            for j in range(m):
                done[j] += A[i, j] * wanted[i] / bottom
                u[j] += A[i, j] * (wanted[i] / bottom - weight * along)
            if square > NOTHING * NOTHING and taken < m:
                for j in range(m):
                    above[taken, j] = A[i, j] / math.sqrt(square)
                taken += 1
        shares[level] = achieved / asked if asked > 0.0 else 1.0
        any_damped = any_damped or s > m or damping_squared(own, least) > 0.0
        smallest = min(smallest, least)
        first = ends[level]
    return smallest, any_damped


@compiled
def directions(A: Array, b: Array, wanted: Array) -> float:
    """Turn the first min(s, m) rows of A (s, m) into σ_i v_iᵀ, in place, and write u_iᵀ b into the first of
    wanted (s,), zeros into the others, where A = Σ u_i σ_i v_iᵀ; returns the least σ."""
    s, m = A.shape
    if s <= m:
        R = scratch((s, s))
        least, _ = singular_rows(A, R)
        times(R, b, wanted)
        return least
    columns, V = scratch((m, s)), scratch((m, m))
    for i in range(s):
        for j in range(m):
            columns[j, i] = A[i, j]
    least, _ = singular_rows(columns, V)
    clear(wanted)
    for i in range(m):
        sigma = norm(columns[i])
        wanted[i] = dot(columns[i], b) / sigma if sigma > 0.0 else 0.0
        for j in range(m):
            A[i, j] = sigma * V[i, j]
    return least


@compiled
def step_threshold(size: float, dt: float, threshold: float) -> float:
    """ε raised to ε² >= 2 size dt where dt is known, size a norm of the rate, rows in their scales: a step
    changes σ by about size dt / ε at ε, so then no step carries it through zero."""
    step = size * dt
    return max(threshold, math.sqrt(2.0 * step)) if 0.0 < step < math.inf else threshold


@compiled
def resolved(A: Array, wanted: Array, beside: float, dt: float, law: Law) -> Law:
    """The law with λ and ε raised to λ² >= β dt and ε² >= 2 β dt where dt is known.

    β is the part of the rate in the directions that a step could carry through zero: from β = ‖b‖ on, twice,
    β² := Σ max(0, 1 - σ_i² / (2 β dt)) (u_iᵀ b)²; the rate in other directions raises nothing, but what is
    beside all of them, by its square, does. A (s, m) and wanted (s,) are of `directions`. With this λ an arm
    pulled beyond its reach comes to rest: the stiffness of its motion there, β / λ² times the task's
    curvature, is within 1 / dt.
    """
    size = norm(wanted) if beside == 0.0 else math.sqrt(dot(wanted, wanted) + beside)
    for _ in range(2):
        step = 2.0 * size * dt
        if not 0.0 < step < math.inf:
            return law
        total = beside
        for i in range(min(A.shape)):
            total += max(1.0 - dot(A[i], A[i]) / step, 0.0) * wanted[i] * wanted[i]
        size = math.sqrt(total)
    threshold = step_threshold(size, dt, law.threshold)
    return Law(law.mode, max(law.damping, math.sqrt(size * dt)), threshold)
