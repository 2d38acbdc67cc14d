"""Singular values of many small matrices in one compiled call."""

import math

import numpy as np

from nmm.base.arrays import Array
from nmm.base.cores import Work, over_cores
from nmm.base.kernels.compiled import (
    compiled,
    inlined_in_callers,
    integer_scratch,
    scratch,
    vectorized_without_gil,
    view,
)
from nmm.base.kernels.linear_algebra import EPSILON, MOST_SWEEPS, orthonormal_rows
from nmm.base.kernels.signatures import float64, void

#: Matrices per compiled call, which cannot be interrupted.
AT_ONCE = 128
#: More rows than this are made triangular first, which then need fewer sweeps.
FEW_ROWS = 6
#: Number of matrices side by side; fewer where they would overflow the stack.
SIDE_BY_SIDE, MOST_NUMBERS = 16, 1 << 14


@inlined_in_callers
def orthogonal_rows(A: Array, squares: Array) -> None:
    """Make the rows of each matrix in A (k, m, N) orthogonal, in place; squares (k, N): their squared
    lengths, the singular values squared. The N matrices lie side by side, so that one instruction serves
    several; they do not affect each other's results.
    """
    k, m, N = A.shape
    product, cosine, sine = scratch(N), scratch(N), scratch(N)
    for _ in range(MOST_SWEEPS):
        for i in range(k):
            for p in range(N):
                squares[i, p] = 0.0
            for j in range(m):
                for p in range(N):
                    squares[i, p] += A[i, j, p] * A[i, j, p]
        turned = False
        for a in range(k - 1):
            for b in range(a + 1, k):
                for p in range(N):
                    product[p] = 0.0
                for j in range(m):
                    for p in range(N):
                        product[p] += A[a, j, p] * A[b, j, p]
                turning = 0
                for p in range(N):
                    turning += abs(product[p]) > EPSILON * math.sqrt(squares[a, p]) * math.sqrt(squares[b, p])
                if turning == 0:
                    continue
                turned = True
                for p in range(N):
                    one, other = squares[a, p], squares[b, p]
                    turns = abs(product[p]) > EPSILON * math.sqrt(one) * math.sqrt(other)
                    zeta = (other - one) / (2.0 * product[p] if turns else 1.0)
                    tangent = (1.0 if zeta >= 0.0 else -1.0) / (abs(zeta) + math.sqrt(1.0 + zeta * zeta))
                    along = 1.0 / math.sqrt(1.0 + tangent * tangent)
                    cosine[p] = along if turns else 1.0
                    sine[p] = along * tangent if turns else 0.0
                    moved = tangent * product[p] if turns else 0.0
                    squares[a, p] = max(one - moved, 0.0)
                    squares[b, p] = max(other + moved, 0.0)
                for j in range(m):
                    for p in range(N):
                        first, second = A[a, j, p], A[b, j, p]
                        A[a, j, p] = cosine[p] * first - sine[p] * second
                        A[b, j, p] = sine[p] * first + cosine[p] * second
        if not turned:
            break


@compiled
def put(J: Array, A: Array, p: int) -> None:
    """A[:, :, p] = J (s, m), transposed if s > m; NaN where J is not finite. Many rows become a triangle with
    the same singular values, and zeros."""
    s, m = J.shape
    k, longer = A.shape[:2]
    finite = True
    for i in range(s):
        for j in range(m):
            finite = finite and math.isfinite(J[i, j])
            if s <= m:
                A[i, j, p] = J[i, j]
            else:
                A[j, i, p] = J[i, j]
    if not finite:
        for i in range(k):
            for j in range(longer):
                A[i, j, p] = math.nan
    elif k > FEW_ROWS:
        rows, ones, order = scratch((k, longer)), scratch(k), integer_scratch(k)
        L, Q = scratch((k, k)), scratch((k, longer))
        for i in range(k):
            ones[i] = 1.0
            for j in range(longer):
                rows[i, j] = A[i, j, p]
        if orthonormal_rows(rows, ones, order, L, Q) > 0.0:
            for i in range(k):
                for j in range(longer):
                    A[i, j, p] = L[j, i] if j < k else 0.0


@compiled
def write_roots(squares: Array, p: int, found: Array) -> None:
    for i in range(squares.shape[0]):
        value, place = math.sqrt(squares[i, p]), i
        while place > 0 and found[place - 1] < value:
            found[place] = found[place - 1]
            place -= 1
        found[place] = value


WRITE_SPECTRA = void(float64[:, :, ::1], float64[:, ::1])


@vectorized_without_gil
def write_spectra(J: Array, found: Array) -> None:
    """found (N, k): singular values of J (N, s, m), k = min(s, m), descending; NaN where J is not finite."""
    s, m = J.shape[1], J.shape[2]
    k, longer = min(s, m), max(s, m)
    width = max(1, min(SIDE_BY_SIDE, J.shape[0], MOST_NUMBERS // (k * longer)))
    A, squares = scratch((k, longer, width)), scratch((k, width))
    for first in range(0, J.shape[0], width):
        for p in range(width):  # repeats the last matrix where none is left
            put(view(J, min(first + p, J.shape[0] - 1) * s * m, (s, m)), A, p)
        orthogonal_rows(A, squares)
        for p in range(min(width, J.shape[0] - first)):
            write_roots(squares, p, view(found, (first + p) * k, (k,)))


@compiled
def write_spectrum(J: Array, found: Array) -> None:
    """found (min(s, m),): the singular values of one J (s, m), as `write_spectra`."""
    k, longer = min(J.shape), max(J.shape)
    A, squares = scratch((k, longer, 1)), scratch((k, 1))
    put(J, A, 0)
    orthogonal_rows(A, squares)
    write_roots(squares, 0, found)


def spectra(J: Array, threads: int | None = None) -> Array:
    """Singular values (N, min(s, m)) of J (N, s, m), descending; NaN where J is not finite.

    `threads` is the number of cores when None. Small ones are as accurate as large ones where
    J's rows are (Demmel and Veselić 1992).
    """
    J = np.ascontiguousarray(J, dtype=np.float64)
    found = np.empty((len(J), min(J.shape[1:])))

    def worker() -> Work:
        return lambda first, last: write_spectra(J[first:last], found[first:last])

    over_cores(len(J), AT_ONCE, worker, threads=threads)
    return found
