"""Small dense linear algebra as plain loops: at a dozen rows they beat a call into LAPACK, and fuse.

Two decompositions serve every resolver: orthonormal rows (J = Pᵀ L Q, the transpose of a pivoted
QR), from which come minimum-norm solutions, projections, rank and det J Jᵀ; and Gaussian
elimination with partial pivoting for square systems.
"""

from __future__ import annotations

import math

import numpy as np

from nmm.arrays import Array
from nmm.kernels.compiled import compiled, scratch

EPSILON = float(np.finfo(float).eps)


@compiled
def orthonormal_rows(J: Array, row_scales: Array, order: Array, L: Array, Q: Array) -> float:
    """J[order] = L Q, L lower triangular with L[i, i] > 0, Q Qᵀ = I. Returns how regular J is.

    Gram-Schmidt on the rows, the largest remainder first, twice over so that Q is orthonormal to
    machine precision whatever J's condition. Rows are compared in their scales: the pivots L[i, i] /
    row_scales[order[i]] fall, and the last of them, over the first if that is above 1, is returned. It is
    0 for a J without full row rank (to machine precision), and about σ_min of the scaled J where its
    largest singular value is below 1, or 1 / cond.
    J (s, m), row_scales (s,), order (s,) integers, L (s, s), Q (s, m).
    """
    s, m = J.shape
    first = 0.0
    last = 0.0
    for i in range(s):
        order[i] = i
        for j in range(m):
            Q[i, j] = J[i, j]
        for j in range(s):
            L[i, j] = 0.0
    for i in range(s):
        largest = -1.0
        pivot = i
        for k in range(i, s):
            square = 0.0
            for j in range(m):
                square += Q[k, j] * Q[k, j]
            square /= row_scales[order[k]] * row_scales[order[k]]
            if square > largest:
                largest = square
                pivot = k
        if pivot != i:
            order[i], order[pivot] = order[pivot], order[i]
            for j in range(m):
                Q[i, j], Q[pivot, j] = Q[pivot, j], Q[i, j]
            for j in range(i):
                L[i, j], L[pivot, j] = L[pivot, j], L[i, j]
        for k in range(i):  # the second pass
            overlap = 0.0
            for j in range(m):
                overlap += Q[i, j] * Q[k, j]
            L[i, k] += overlap
            for j in range(m):
                Q[i, j] -= overlap * Q[k, j]
        norm = 0.0
        for j in range(m):
            norm += Q[i, j] * Q[i, j]
        norm = math.sqrt(norm)
        L[i, i] = norm
        last = norm / row_scales[order[i]]
        if i == 0:
            first = last
        if last <= 1e-15 * first or norm == 0.0:
            return 0.0
        for j in range(m):
            Q[i, j] /= norm
        for k in range(i + 1, s):
            overlap = 0.0
            for j in range(m):
                overlap += Q[k, j] * Q[i, j]
            L[k, i] = overlap
            for j in range(m):
                Q[k, j] -= overlap * Q[i, j]
    return last / max(1.0, first)


@compiled
def project_out(A: Array, row: int, Q: Array, count: int) -> None:
    """A[row] less its parts along the first `count` rows of Q, which are orthonormal; in place."""
    for k in range(count):
        overlap = 0.0
        for j in range(A.shape[1]):
            overlap += A[row, j] * Q[k, j]
        for j in range(A.shape[1]):
            A[row, j] -= overlap * Q[k, j]


@compiled
def closest_solution(rate: Array, u0: Array, order: Array, L: Array, Q: Array, u: Array) -> None:
    """The solution of J u = rate closest to u0, J⁺ rate + (I - J⁺ J) u0, from `orthonormal_rows`.

    u = u0 + Qᵀ (y - Q u0) with L y = rate[order].
    """
    s, m = Q.shape
    y = scratch(s)
    for j in range(m):
        u[j] = u0[j]
    for i in range(s):
        y[i] = rate[order[i]]
        for j in range(i):
            y[i] -= L[i, j] * y[j]
        y[i] /= L[i, i]
    for i in range(s):
        missing = y[i]
        for j in range(m):
            missing -= Q[i, j] * u0[j]
        for j in range(m):
            u[j] += missing * Q[i, j]


@compiled
def pseudoinverse_transposed(order: Array, L: Array, Q: Array, X: Array) -> None:
    """X = (J⁺)ᵀ, shape (s, m), from `orthonormal_rows`: Lᵀ X[order] = Q."""
    s, m = Q.shape
    for i in range(s - 1, -1, -1):
        for j in range(m):
            x = Q[i, j]
            for k in range(i + 1, s):
                x -= L[k, i] * X[order[k], j]
            X[order[i], j] = x / L[i, i]


@compiled
def eliminate(M: Array, row_scales: Array) -> tuple[float, float]:
    """Solve A X = B in place: M = [A B], shape (s, s + k), becomes [*, X].

    Gaussian elimination with partial pivoting, rows compared in their scales. Returns det A, and how
    regular A is: its smallest pivot in its row's scale, over the largest if that is above 1; when a pivot
    is zero both are 0 and there is no solution. row_scales (s,) is put into the pivots' order.
    """
    s, width = M.shape
    determinant = 1.0
    smallest = math.inf
    largest = 0.0
    for i in range(s):
        pivot = i
        for row in range(i + 1, s):
            if abs(M[row, i]) * row_scales[pivot] > abs(M[pivot, i]) * row_scales[row]:
                pivot = row
        size = abs(M[pivot, i]) / row_scales[pivot]
        if size == 0.0:
            return 0.0, 0.0
        smallest = min(smallest, size)
        largest = max(largest, size)
        if pivot != i:
            determinant = -determinant
            row_scales[i], row_scales[pivot] = row_scales[pivot], row_scales[i]
            for j in range(i, width):
                M[i, j], M[pivot, j] = M[pivot, j], M[i, j]
        determinant *= M[i, i]
        for row in range(i + 1, s):
            factor = M[row, i] / M[i, i]
            for j in range(i + 1, width):
                M[row, j] -= factor * M[i, j]
    for i in range(s - 1, -1, -1):
        for j in range(s, width):
            x = M[i, j]
            for row in range(i + 1, s):
                x -= M[i, row] * M[row, j]
            M[i, j] = x / M[i, i]
    if math.isnan(determinant):
        return math.nan, math.nan
    return determinant, smallest / max(1.0, largest)


@compiled
def residual_norm(J: Array, u: Array, rate: Array) -> tuple[float, float]:
    """‖J u - rate‖, the certificate of a resolver's answer, and how much of it rounding can hide.

    The second number is the machine's precision times the norm of |J| |u| + |rate|: with a large u the
    residual computed here may be zero by chance.
    """
    square = 0.0
    size = 0.0
    for i in range(J.shape[0]):
        difference = -rate[i]
        weight = abs(rate[i])
        for j in range(J.shape[1]):
            product = J[i, j] * u[j]
            difference += product
            weight += abs(product)
        square += difference * difference
        size += weight * weight
    return math.sqrt(square), EPSILON * math.sqrt(size)
