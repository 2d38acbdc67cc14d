"""Singular values of many small matrices in one compiled call."""

from __future__ import annotations

import math

import numpy as np
from numba import types

from nmm.arrays import Array
from nmm.cores import Work, over_cores
from nmm.kernels.compiled import compiled, compiled_without_gil, integer_scratch, scratch
from nmm.kernels.linear_algebra import EPSILON, orthonormal_rows
from nmm.kernels.singular_values import MOST_SWEEPS

#: Matrices a compiled call: what nothing interrupts.
AT_ONCE = 1000
#: More rows than these are first made triangular, which then turn orthogonal sooner.
FEW_ROWS = 6


@compiled
def orthogonal_rows(A: Array, squares: Array) -> None:
    """Turn the rows of A (k, m) until they are orthogonal, in place: their lengths are its singular values.

    squares (k,) : what they become. One-sided Jacobi (Hestenes 1958), as
    `nmm.kernels.singular_values.singular_rows`, without the vectors and with each length carried along
    """
    k, m = A.shape
    for _ in range(MOST_SWEEPS):
        for i in range(k):
            squares[i] = 0.0
            for j in range(m):
                squares[i] += A[i, j] * A[i, j]
        turned = False
        for a in range(k - 1):
            for b in range(a + 1, k):
                one, other, product = squares[a], squares[b], 0.0
                for j in range(m):
                    product += A[a, j] * A[b, j]
                if not abs(product) > EPSILON * math.sqrt(one) * math.sqrt(other):
                    continue
                turned = True
                zeta = (other - one) / (2.0 * product)
                tangent = (1.0 if zeta >= 0.0 else -1.0) / (abs(zeta) + math.sqrt(1.0 + zeta * zeta))
                cosine = 1.0 / math.sqrt(1.0 + tangent * tangent)
                sine = cosine * tangent
                for j in range(m):
                    first, second = A[a, j], A[b, j]
                    A[a, j] = cosine * first - sine * second
                    A[b, j] = sine * first + cosine * second
                squares[a] = max(one - tangent * product, 0.0)
                squares[b] = max(other + tangent * product, 0.0)
        if not turned:
            break


WRITE_SPECTRA = types.void(types.float64[:, :, ::1], types.float64[:, ::1])


@compiled_without_gil
def write_spectra(J: Array, found: Array) -> None:
    """found (N, k): the singular values of J (N, s, m), k = min(s, m), falling; NaN where J is not finite."""
    s, m = J.shape[1], J.shape[2]
    k, longer = min(s, m), max(s, m)
    A, R, squares, ones = scratch((k, longer)), scratch((k, k)), scratch(k), scratch(k)
    L, Q, order = scratch((k, k)), scratch((k, longer)), integer_scratch(k)
    for i in range(k):
        ones[i] = 1.0
    for p in range(J.shape[0]):
        finite = True
        for i in range(s):
            for j in range(m):
                finite = finite and math.isfinite(J[p, i, j])
                if s <= m:
                    A[i, j] = J[p, i, j]
                else:
                    A[j, i] = J[p, i, j]
        if not finite:
            for i in range(k):
                found[p, i] = math.nan
            continue
        if k > FEW_ROWS and orthonormal_rows(A, ones, order, L, Q) > 0.0:
            for i in range(k):
                for j in range(k):
                    R[i, j] = L[j, i]
            orthogonal_rows(R, squares)
        else:
            orthogonal_rows(A, squares)
        for i in range(k):
            value, place = math.sqrt(squares[i]), i
            while place > 0 and found[p, place - 1] < value:
                found[p, place] = found[p, place - 1]
                place -= 1
            found[p, place] = value


def spectra(J: Array, threads: int | None = None) -> Array:
    """Singular values (N, min(s, m)) of J (N, s, m), falling; not numbers where J is not finite.

    In so many threads, as many as there are cores when None. Small ones are as accurate as large ones where
    J's rows are (Demmel and Veselić 1992).
    """
    J = np.ascontiguousarray(J, dtype=np.float64)
    found = np.empty((len(J), min(J.shape[1:])))

    def worker() -> Work:
        return lambda first, last: write_spectra(J[first:last], found[first:last])

    over_cores(len(J), AT_ONCE, worker, threads=threads)
    return found
