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
    J: Array, row_scales: Array, rate: Array, u0: Array, mode: int, damping: float, threshold: float, u: Array
) -> tuple[float, float]:
    """The u (m,) with the least ‖A u - b‖² + Σ λ_i² (v_iᵀ (u - u0))², where A = Σ u_i σ_i v_iᵀ.

    A and b are J and rate over row_scales, so u = u0 + Σ v_i σ_i / (σ_i² + λ_i²) (u_iᵀ b - σ_i v_iᵀ u0).
    Returns the share of b that is given, the objective's part u0 apart,
    Σ σ_i² / (σ_i² + λ_i²) (u_iᵀ b)² / ‖b‖², and the least σ.
    """
    s, m = J.shape
    A, R = scratch((s, m)), scratch((s, s))
    for i in range(s):
        for j in range(m):
            A[i, j] = J[i, j] / row_scales[i]
    least, _ = singular_rows(A, R)
    for j in range(m):
        u[j] = u0[j]
    asked, given = 0.0, 0.0
    for i in range(s):
        square, along, wanted = 0.0, 0.0, 0.0
        for j in range(m):
            square += A[i, j] * A[i, j]
            along += A[i, j] * u0[j]
        for k in range(s):
            wanted += R[i, k] * rate[k] / row_scales[k]
        sigma = least if mode == VARIABLE else math.sqrt(square)
        bottom = square + damping_squared(mode, sigma, damping, threshold)
        asked += wanted * wanted
        given += square / bottom * wanted * wanted
        for j in range(m):
            u[j] += A[i, j] * (wanted - along) / bottom
    return given / asked if asked > 0.0 else 1.0, least


@compiled
def resolved(
    rate: Array, row_scales: Array, dt: float, damping: float, threshold: float
) -> tuple[float, float]:
    """λ and ε, raised to λ² >= ‖b‖ dt and ε² >= 2 ‖b‖ dt where dt is known, b the rate in scaled rows.

    Inputs that move a joint by dq change σ by dq about, rows in their scales; at ε that is ‖b‖ dt / ε in one
    step. With this ε no step carries σ through zero, and with this λ an arm that is pulled beyond its reach
    comes to rest: the stiffness of its motion there, ‖b‖ / λ² times the task's curvature, is within 1 / dt.
    """
    square = 0.0
    for i in range(rate.shape[0]):
        square += (rate[i] / row_scales[i]) ** 2
    step = math.sqrt(square) * dt
    if not 0.0 < step < math.inf:
        return damping, threshold
    return max(damping, math.sqrt(step)), max(threshold, math.sqrt(2.0 * step))
