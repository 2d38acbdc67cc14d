"""Damped least squares: solutions that stay bounded where J loses rank."""

from __future__ import annotations

import math

from nmm.arrays import Array, Integers
from nmm.kernels.compiled import compiled, scratch
from nmm.kernels.linear_algebra import project_out
from nmm.kernels.singular_values import singular_rows

#: What is damped: every direction by the same λ; every one, by a λ that grows from 0 as the least singular
#: value falls below a threshold; those below the threshold alone.
CONSTANT, VARIABLE, DIRECTIONS = 0, 1, 2
#: λ and ε when nothing else is said. With λ = ε / √2 the inputs that do the task are at most ‖b‖ / ε (b is
#: the rate, rows in their scales): damped, they are no larger than undamped at the threshold.
LARGEST, BELOW = 0.05 / math.sqrt(2.0), 0.05
#: A singular value below this is none: its direction is left to the levels below.
NOTHING = 1e-9


@compiled
def damping_squared(mode: int, sigma: float, damping: float, threshold: float) -> float:
    """λ²: constant, or λ² (1 - (σ/ε)²) below the threshold ε and 0 from there on."""
    if mode == CONSTANT:
        return damping * damping
    if not sigma < threshold:
        return 0.0
    share = sigma / threshold
    return damping * damping * (1.0 - share * share)


@compiled
def damped_solution(
    J: Array,
    row_scales: Array,
    rate: Array,
    ends: Integers,
    u0: Array,
    mode: int,
    damping: float,
    threshold: float,
    dt: float,
    u: Array,
    shares: Array,
) -> tuple[float, bool]:
    """u = Σ v_i σ_i / (σ_i² + λ_i²) u_iᵀ b + (I - Σ w_i v_i v_iᵀ) u0, shape (m,), where A = Σ u_i σ_i v_iᵀ.

    A and b are J and rate over row_scales; the first part is the least of ‖A u - b‖² + Σ λ_i² (v_iᵀ u)². The
    second is u0 in A's null space: w_i = 1 - (1 - (σ_i / ε)²)² for σ_i < ε, 1 from there on. So no damping
    lets the objective into the task, and u is continuous where a σ_i vanishes. λ and ε are `resolved` for dt,
    but for the ε in w_i.

    ends (levels,): the row after the last of each level of priority. A level below is solved in the same way
    in what those above leave: A less its part along all their v_i, damped or not, b less what they do already
    (Nakamura, Hanafusa, Yoshikawa 1987; Siciliano, Slotine 1991). No level changes what those above get.
    Writes of each level the share of b that is given, the objective's part apart,
    Σ σ_i² / (σ_i² + λ_i²) (u_iᵀ b)² / ‖b‖², into shares (levels,). Returns the least σ, and whether anything
    is damped.
    """
    m = J.shape[1]
    done, above = scratch(m), scratch((m, m))
    taken, first = 0, 0
    smallest, any_damped = math.inf, False
    for j in range(m):
        u[j] = u0[j]
        done[j] = 0.0
    for level in range(ends.shape[0]):
        s = ends[level] - first
        A, R, b, wanted = scratch((s, m)), scratch((s, s)), scratch(s), scratch(s)
        for i in range(s):
            b[i] = rate[first + i] / row_scales[first + i]
            for j in range(m):
                A[i, j] = J[first + i, j] / row_scales[first + i]
                b[i] -= A[i, j] * done[j]
            for _ in range(2):  # the second time for what rounding left
                project_out(A, i, above, taken)
        least, _ = singular_rows(A, R)
        for i in range(s):
            wanted[i] = 0.0
            for k in range(s):
                wanted[i] += R[i, k] * b[k]
        largest, limit = resolved(A, wanted, dt, damping, threshold)
        asked, given = 0.0, 0.0
        for i in range(s):
            square, along = norm_squared(A, i), 0.0
            for j in range(m):
                along += A[i, j] * u0[j]
            sigma = least if mode == VARIABLE else math.sqrt(square)
            bottom = square + damping_squared(mode, sigma, largest, limit)
            asked += wanted[i] * wanted[i]
            given += square / bottom * wanted[i] * wanted[i]
            share = min(square / (threshold * threshold), 1.0)
            kept = share * (2.0 - share) / square if square > 0.0 else 0.0
            for j in range(m):
                done[j] += A[i, j] * wanted[i] / bottom
                u[j] += A[i, j] * (wanted[i] / bottom - kept * along)
            if square > NOTHING * NOTHING and taken < m:
                for j in range(m):
                    above[taken, j] = A[i, j] / math.sqrt(square)
                taken += 1
        shares[level] = given / asked if asked > 0.0 else 1.0
        any_damped = any_damped or damping_squared(mode, least, largest, limit) > 0.0
        smallest = min(smallest, least)
        first = ends[level]
    return smallest, any_damped


@compiled
def norm_squared(A: Array, row: int) -> float:
    """‖A[row]‖²."""
    square = 0.0
    for j in range(A.shape[1]):
        square += A[row, j] * A[row, j]
    return square


@compiled
def step_threshold(size: float, dt: float, threshold: float) -> float:
    """ε raised to ε² >= 2 size dt where dt is known; size is a norm of the rate, rows in their scales.

    Inputs that move a joint by dq change σ by dq about, rows in their scales; at ε that is size dt / ε in one
    step: with this ε no step carries σ through zero.
    """
    step = size * dt
    return max(threshold, math.sqrt(2.0 * step)) if 0.0 < step < math.inf else threshold


@compiled
def resolved(A: Array, wanted: Array, dt: float, damping: float, threshold: float) -> tuple[float, float]:
    """λ and ε, raised to λ² >= β dt and ε² >= 2 β dt where dt is known.

    β is the part of the rate in the directions that a step could carry through zero: from β = ‖b‖ on, two
    times over, β² := Σ max(0, 1 - σ_i² / (2 β dt)) (u_iᵀ b)². What is asked of others raises nothing.
    A (s, m) has rows σ_i v_iᵀ, wanted (s,) the u_iᵀ b. With this λ an arm that is pulled beyond its reach
    comes to rest: the stiffness of its motion there, β / λ² times the task's curvature, is within 1 / dt.
    """
    total = 0.0
    for i in range(wanted.shape[0]):
        total += wanted[i] * wanted[i]
    size = math.sqrt(total)
    for _ in range(2):
        step = 2.0 * size * dt
        if not 0.0 < step < math.inf:
            return damping, threshold
        total = 0.0
        for i in range(wanted.shape[0]):
            total += max(1.0 - norm_squared(A, i) / step, 0.0) * wanted[i] * wanted[i]
        size = math.sqrt(total)
    return max(damping, math.sqrt(size * dt)), step_threshold(size, dt, threshold)
