"""A fix of a pose, or of a position, for the state of `filter_step`, as a plain kernel.

Source: B. M. Bell, F. W. Cathey, The iterated Kalman filter update as a Gauss-Newton method, IEEE Trans.
Automatic Control 38(2), 1993.
"""

from __future__ import annotations

import math

from nmm.base.arrays import Array
from nmm.base.kernels.compiled import clear, compiled, scratch
from nmm.base.kernels.linear_algebra import copied, eliminate
from nmm.base.kernels.planar_motions import exp_planar, to_body_axes
from nmm.plugins.robot.filter_step import carry_over

#: Iterations of a fix, and the change of eps, m and rad, at which they end.
ITERATIONS, CONVERGED = 10, 1e-9


@compiled
def correct(rows: int, y: Array, covariance: Array, at: Array, gate: float, x: Array, P: Array) -> float:
    """x (d,) and P (d, d) after a fix; the normalised innovation squared, above `gate` for an outlier, which
    changes nothing.

    rows : 2 for a position, 3 with a heading; y (3,), covariance (3, 3) : x, y, theta in the world's axes, of
    which the first `rows` count; at (2,) : the point of the body whose position it is, m

    eps is that of least eps' P⁻¹ eps + r' R⁻¹ r, r what the fix leaves, by Gauss and Newton: one iteration is
    the extended filter's. At the end this least is the innovation squared.
    """
    d = x.shape[0]
    z, R, eps, place, D = scratch(3), scratch((3, 3)), scratch(d), scratch(3), scratch((3, 3))
    S, scales, PH, gain = scratch((rows, rows + 1)), scratch(rows), scratch((d, rows)), scratch((d, rows))
    seen(rows, y, covariance, x, z, R)
    clear(eps)
    square = 0.0
    for _ in range(ITERATIONS):
        exp_planar(eps, place, D)
        offset(eps[2], at, place, D)
        for m in range(rows):
            for i in range(d):
                PH[i, m] = P[i, 0] * D[m, 0] + P[i, 1] * D[m, 1] + P[i, 2] * D[m, 2]
        for m in range(rows):
            scales[m] = 1.0
            for n in range(rows):
                S[m, n] = R[m, n] + D[m, 0] * PH[0, n] + D[m, 1] * PH[1, n] + D[m, 2] * PH[2, n]
            S[m, rows] = z[m] - place[m] + D[m, 0] * eps[0] + D[m, 1] * eps[1] + D[m, 2] * eps[2]
            gain[0, m] = S[m, rows]
        eliminate(S, scales)
        square, change = 0.0, 0.0
        for m in range(rows):
            square += gain[0, m] * S[m, rows]
        for i in range(d):
            value = 0.0
            for m in range(rows):
                value += PH[i, m] * S[m, rows]
            change = max(change, abs(value - eps[i]))
            eps[i] = value
        if change < CONVERGED:
            break
    if not square <= gate:
        return square
    gains(rows, R, D, PH, gain)
    joseph(rows, R, D, gain, P)
    carry_over(x, P, eps)
    return square


@compiled
def seen(rows: int, y: Array, covariance: Array, x: Array, z: Array, R: Array) -> None:
    """A fix as the body that is believed sees it: z (3,), and its covariance R (3, 3)."""
    c, s = math.cos(x[2]), math.sin(x[2])
    ahead, aside = y[0] - x[0], y[1] - x[1]
    z[0], z[1] = c * ahead + s * aside, c * aside - s * ahead
    z[2] = 0.0
    if rows == 3:
        turn = y[2] - x[2]
        z[2] = turn - 2.0 * math.pi * math.floor(turn / (2.0 * math.pi) + 0.5)
    turned = scratch((3, 3))
    for i in range(3):
        for j in range(3):
            turned[i, j] = covariance[i, j]
    to_body_axes(x[2], turned)
    for i in range(3):
        for j in range(3):
            R[j, i] = turned[i, j]
    to_body_axes(x[2], R)


@compiled
def offset(angle: float, at: Array, place: Array, D: Array) -> None:
    """Add a point `at` (2,) of the body to its place (3,), and to the derivative D (3, 3)."""
    c, s = math.cos(angle), math.sin(angle)
    place[0] += c * at[0] - s * at[1]
    place[1] += s * at[0] + c * at[1]
    D[0, 2] -= s * at[0] + c * at[1]
    D[1, 2] += c * at[0] - s * at[1]


@compiled
def gains(rows: int, R: Array, D: Array, PH: Array, gain: Array) -> None:
    """gain (d, rows) = PH S⁻¹, S = D P Dᵀ + R."""
    d = gain.shape[0]
    M, scales = scratch((rows, rows + d)), scratch(rows)
    for m in range(rows):
        scales[m] = 1.0
        for n in range(rows):
            M[m, n] = R[m, n] + D[m, 0] * PH[0, n] + D[m, 1] * PH[1, n] + D[m, 2] * PH[2, n]
        for i in range(d):
            M[m, rows + i] = PH[i, m]
    eliminate(M, scales)
    for m in range(rows):
        for i in range(d):
            gain[i, m] = M[m, rows + i]


@compiled
def joseph(rows: int, R: Array, D: Array, gain: Array, P: Array) -> None:
    """P (d, d) = (I - K H) P (I - K H)ᵀ + K R Kᵀ, H = [D 0]: which rounding leaves positive."""
    d = P.shape[0]
    HP, left = scratch((rows, d)), scratch((d, d))
    for m in range(rows):
        for j in range(d):
            HP[m, j] = D[m, 0] * P[0, j] + D[m, 1] * P[1, j] + D[m, 2] * P[2, j]
    for i in range(d):
        copied(P[i], left[i])
        for m in range(rows):
            for j in range(d):
                left[i, j] -= gain[i, m] * HP[m, j]
    for i in range(d):
        for m in range(rows):
            HP[m, i] = left[i, 0] * D[m, 0] + left[i, 1] * D[m, 1] + left[i, 2] * D[m, 2]
            for n in range(rows):
                HP[m, i] -= gain[i, n] * R[n, m]
    for i in range(d):
        for j in range(i + 1):
            value = left[i, j]
            for m in range(rows):
                value -= HP[m, i] * gain[j, m]
            P[i, j] = P[j, i] = value
