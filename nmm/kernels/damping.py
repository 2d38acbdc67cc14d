"""Damped least squares: solutions that stay bounded where J loses rank."""

from __future__ import annotations

import math

from nmm.arrays import Array
from nmm.kernels.compiled import compiled, scratch
from nmm.kernels.singular_values import singular_rows

#: What is damped: every direction by the same λ; every one, by a λ that grows from 0 as the least singular
#: value falls below a threshold; those below the threshold alone.
CONSTANT, VARIABLE, DIRECTIONS = 0, 1, 2
#: λ and ε when nothing else is said. With λ = ε / √2 the inputs that do the task are at most ‖b‖ / ε (b is
#: the rate, rows in their scales): damped, they are no larger than undamped at the threshold.
LARGEST, BELOW = 0.05 / math.sqrt(2.0), 0.05


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
    u0: Array,
    mode: int,
    damping: float,
    threshold: float,
    dt: float,
    u: Array,
) -> tuple[float, float, bool]:
    """u = Σ v_i σ_i / (σ_i² + λ_i²) u_iᵀ b + (I - Σ w_i v_i v_iᵀ) u0, shape (m,), where A = Σ u_i σ_i v_iᵀ.

    A and b are J and rate over row_scales; the first part is the least of ‖A u - b‖² + Σ λ_i² (v_iᵀ u)². The
    second is u0 in A's null space: w_i = 1 - (1 - (σ_i / ε)²)² for σ_i < ε, 1 from there on. So no damping
    lets the objective into the task, and u is continuous where a σ_i vanishes. λ and ε are `resolved` for dt,
    but for the ε in w_i.
    Returns the share of b that is given, the objective's part apart, Σ σ_i² / (σ_i² + λ_i²) (u_iᵀ b)² / ‖b‖²;
    the least σ; and whether anything is damped.
    """
    s, m = J.shape
    A, R, wanted = scratch((s, m)), scratch((s, s)), scratch(s)
    for i in range(s):
        for j in range(m):
            A[i, j] = J[i, j] / row_scales[i]
    least, _ = singular_rows(A, R)
    for j in range(m):
        u[j] = u0[j]
    for i in range(s):
        wanted[i] = 0.0
        for k in range(s):
            wanted[i] += R[i, k] * rate[k] / row_scales[k]
    damping, limit = resolved(A, wanted, dt, damping, threshold)
    asked, given = 0.0, 0.0
    for i in range(s):
        square, along = norm_squared(A, i), 0.0
        for j in range(m):
            along += A[i, j] * u0[j]
        sigma = least if mode == VARIABLE else math.sqrt(square)
        bottom = square + damping_squared(mode, sigma, damping, limit)
        asked += wanted[i] * wanted[i]
        given += square / bottom * wanted[i] * wanted[i]
        share = min(square / (threshold * threshold), 1.0)
        kept = share * (2.0 - share) / square if square > 0.0 else 0.0
        for j in range(m):
            u[j] += A[i, j] * (wanted[i] / bottom - kept * along)
    damped = damping_squared(mode, least, damping, limit) > 0.0
    return given / asked if asked > 0.0 else 1.0, least, damped


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
