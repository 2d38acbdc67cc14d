"""Singular values and vectors of a few rows: one-sided Jacobi, the most accurate way for small ones."""

from __future__ import annotations

import math

from nmm.arrays import Array
from nmm.kernels.compiled import clear, compiled
from nmm.kernels.linear_algebra import EPSILON

#: Pairs of rows are turned until none is turned any more; so many sweeps over them are never needed.
MOST_SWEEPS = 40


@compiled
def singular_rows(A: Array, R: Array) -> tuple[float, float]:
    """Turn the rows of A (s, m) into σ_i v_iᵀ, in place; R (s, s) becomes the rotation, its rows u_iᵀ.

    So that R A has orthogonal rows, A = Σ u_i σ_i v_iᵀ; they are in no order. Returns the least and the
    largest σ. Works for every rank; a matrix that is not finite stays as it is, more or less. Source:
    Hestenes 1958; Demmel and Veselić 1992 on its accuracy.
    """
    s, m = A.shape
    clear(R)
    for i in range(s):
        R[i, i] = 1.0
    for _ in range(MOST_SWEEPS):
        turned = False
        for i in range(s - 1):
            for k in range(i + 1, s):
                turned = orthogonalised(A, R, i, k) or turned
        if not turned:
            break
    least, largest = math.inf, 0.0
    for i in range(s):
        square = 0.0
        for j in range(m):
            square += A[i, j] * A[i, j]
        least, largest = min(least, math.sqrt(square)), max(largest, math.sqrt(square))
    return least, largest


@compiled
def orthogonalised(A: Array, R: Array, i: int, k: int) -> bool:
    """Turn rows i and k until they are orthogonal; whether they had to be."""
    one, other, product = 0.0, 0.0, 0.0
    for j in range(A.shape[1]):
        one += A[i, j] * A[i, j]
        other += A[k, j] * A[k, j]
        product += A[i, j] * A[k, j]
    if not abs(product) > EPSILON * math.sqrt(one) * math.sqrt(other):
        return False
    zeta = (other - one) / (2.0 * product)
    tangent = (1.0 if zeta >= 0.0 else -1.0) / (abs(zeta) + math.hypot(1.0, zeta))
    cosine = 1.0 / math.hypot(1.0, tangent)
    sine = cosine * tangent
    turn(A, i, k, cosine, sine)
    turn(R, i, k, cosine, sine)
    return True


@compiled
def turn(A: Array, i: int, k: int, cosine: float, sine: float) -> None:
    """Rows i and k, turned in their plane."""
    for j in range(A.shape[1]):
        one, other = A[i, j], A[k, j]
        A[i, j] = cosine * one - sine * other
        A[k, j] = sine * one + cosine * other
