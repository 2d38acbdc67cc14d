"""Small dense linear algebra as plain loops: for a dozen rows these are faster than LAPACK calls, and fuse.

Three decompositions serve every resolver: orthonormal rows (J = Pᵀ L Q, the transpose of a pivoted QR), for
minimum-norm solutions, projections, rank and det J Jᵀ; Gaussian elimination with partial pivoting for square
systems; and singular values and vectors by one-sided Jacobi, the most accurate method for small ones.
"""

import math

import numpy as np

from nmm.base.arrays import Array
from nmm.base.kernels.compiled import clear, compiled, scratch, view

EPSILON = float(np.finfo(float).eps)
#: Sweeps end when no pair of rows is rotated, always before this many.
MOST_SWEEPS = 40


@compiled
def copied(source: Array, target: Array) -> None:
    for i in range(target.shape[0]):
        target[i] = source[i]


@compiled
def dot(a: Array, b: Array) -> float:
    total = 0.0
    for i in range(a.shape[0]):
        total += a[i] * b[i]
    return total


@compiled
def less(value: float, a: Array, b: Array) -> float:
    """value - a · b, subtracted term by term."""
    for i in range(a.shape[0]):
        value -= a[i] * b[i]
    return value


@compiled
def add(x: Array, share: float, d: Array) -> None:
    for i in range(x.shape[0]):
        x[i] += share * d[i]


@compiled
def norm(x: Array) -> float:
    return math.sqrt(dot(x, x))


@compiled
def orthonormal_rows(J: Array, row_scales: Array, order: Array, L: Array, Q: Array) -> float:
    """J[order] = L Q, L (s, s) lower triangular, L[i, i] > 0, Q (s, m), Q Qᵀ = I. Returns how regular J is.

    Gram-Schmidt on the rows, largest remainder first, done twice so that Q is orthonormal to machine
    precision. The pivots, L[i, i] / row_scales[order[i]], decrease; the last over max(1, the first) is
    returned: 0 without full row rank, else about σ_min of the scaled J, or 1 / cond where its σ_max is above
    1.
    """
    s, m = J.shape
    first, last = 0.0, 0.0
    clear(L)
    for i in range(s):
        order[i] = i
        copied(J[i], Q[i])
    for i in range(s):
        pivot, largest = i, -1.0
        for k in range(i, s):
            square = dot(Q[k], Q[k]) / (row_scales[order[k]] * row_scales[order[k]])
            if square > largest:
                pivot, largest = k, square
        if pivot != i:
            order[i], order[pivot] = order[pivot], order[i]
            for j in range(m):
                Q[i, j], Q[pivot, j] = Q[pivot, j], Q[i, j]
            for j in range(i):
                L[i, j], L[pivot, j] = L[pivot, j], L[i, j]
        for k in range(i):  # the second pass
            overlap = dot(Q[i], Q[k])
            L[i, k] += overlap
            add(Q[i], -overlap, Q[k])
        length = norm(Q[i])
        L[i, i] = length
        last = length / row_scales[order[i]]
        if i == 0:
            first = last
        if last <= 1e-15 * first or length == 0.0:
            return 0.0
        for j in range(m):
            Q[i, j] /= length
        for k in range(i + 1, s):
            L[k, i] = dot(Q[k], Q[i])
            add(Q[k], -L[k, i], Q[i])
    return last / max(1.0, first)


@compiled
def times(A: Array, x: Array, out: Array) -> None:
    for i in range(out.shape[0]):
        out[i] = dot(A[i], x)


@compiled
def project_out(x: Array, Q: Array, count: int) -> None:
    """x minus its components along the first `count` rows of Q, which are orthonormal; in place."""
    for k in range(count):
        add(x, -dot(x, Q[k]), Q[k])


@compiled
def diagonal(T: Array) -> bool:
    """Whether T is diagonal, as the metric of weights for single inputs is."""
    numbers, others = view(T, 0, (T.size,)), 0
    for i in range(T.size):  # to the end, as then several are counted at once
        others += numbers[i] != 0.0
    for i in range(T.shape[0]):
        others -= T[i, i] != 0.0
    return others == 0


@compiled
def times_matrix(A: Array, T: Array, product: Array) -> None:
    """product = A T; A itself where T is (0, 0), which means the identity."""
    scales = diagonal(T)
    for i in range(A.shape[0]):
        if T.shape[0] == 0:
            copied(A[i], product[i])
        elif scales:
            for j in range(T.shape[0]):
                product[i, j] = A[i, j] * T[j, j]
        else:
            clear(product[i])
            for k in range(T.shape[0]):
                add(product[i], A[i, k], T[k])


@compiled
def closest_solution(rate: Array, u0: Array, order: Array, L: Array, Q: Array, u: Array) -> None:
    """The solution of J u = rate closest to u0: u0 + Qᵀ (y - Q u0), L y = rate[order]."""
    s = Q.shape[0]
    y = scratch(s)
    copied(u0, u)
    for i in range(s):
        y[i] = less(rate[order[i]], L[i, :i], y) / L[i, i]
    for i in range(s):
        add(u, less(y[i], Q[i], u0), Q[i])


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

    Gaussian elimination with partial pivoting, rows compared in their scales. Returns det A, and how regular
    A is: its smallest pivot in its row's scale, over the largest if that is above 1; a zero pivot gives 0 for
    both, and no solution. row_scales (s,) is permuted to the order of the pivots.
    """
    s, width = M.shape
    determinant, smallest, largest = 1.0, math.inf, 0.0
    for i in range(s):
        pivot = i
        for row in range(i + 1, s):
            if abs(M[row, i]) * row_scales[pivot] > abs(M[pivot, i]) * row_scales[row]:
                pivot = row
        size = abs(M[pivot, i]) / row_scales[pivot]
        if size == 0.0:
            return 0.0, 0.0
        smallest, largest = min(smallest, size), max(largest, size)
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
def solve(T: Array, x: Array, y: Array) -> None:
    """y = T⁻¹ x; x itself where T is (0, 0), which means the identity."""
    m = x.shape[0]
    if T.shape[0] == 0:
        copied(x, y)
        return
    if diagonal(T):
        for j in range(m):
            y[j] = x[j] / T[j, j]
        return
    M, scales = scratch((m, m + 1)), scratch(m)
    for i in range(m):
        scales[i] = 1.0
        for j in range(m):
            M[i, j] = T[i, j]
        M[i, m] = x[i]
    eliminate(M, scales)
    for j in range(m):
        y[j] = M[j, m]


@compiled
def residual_norm(J: Array, u: Array, rate: Array) -> tuple[float, float]:
    """‖J u - rate‖, which certifies a resolver's answer, and how much of it rounding can hide.

    The second number is the machine's precision times the norm of |J| |u| + |rate|: for a large u the
    computed residual may be zero by chance.
    """
    square, size = 0.0, 0.0
    for i in range(J.shape[0]):
        difference, weight = -rate[i], abs(rate[i])
        for j in range(J.shape[1]):
            product = J[i, j] * u[j]
            difference += product
            weight += abs(product)
        square += difference * difference
        size += weight * weight
    return math.sqrt(square), EPSILON * math.sqrt(size)


@compiled
def singular_rows(A: Array, R: Array) -> tuple[float, float]:
    """Turn the rows of A (s, m) into σ_i v_iᵀ, in place; R (s, s) becomes the rotation, its rows u_iᵀ.

    So A = Σ u_i σ_i v_iᵀ, in no particular order. Returns the least and the largest σ. Works for every rank;
    a matrix that is not finite gives no useful result. Source: Hestenes 1958; Demmel and Veselić 1992 on
    accuracy.
    """
    s = A.shape[0]
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
        length = norm(A[i])
        least, largest = min(least, length), max(largest, length)
    return least, largest


@compiled
def orthogonalised(A: Array, R: Array, i: int, k: int) -> bool:
    """Rotate rows i and k until they are orthogonal; returns whether that was needed."""
    square_i, square_k, product = 0.0, 0.0, 0.0
    for j in range(A.shape[1]):
        square_i += A[i, j] * A[i, j]
        square_k += A[k, j] * A[k, j]
        product += A[i, j] * A[k, j]
    if not abs(product) > EPSILON * math.sqrt(square_i) * math.sqrt(square_k):
        return False
    zeta = (square_k - square_i) / (2.0 * product)
    tangent = (1.0 if zeta >= 0.0 else -1.0) / (abs(zeta) + math.hypot(1.0, zeta))
    cosine = 1.0 / math.hypot(1.0, tangent)
    sine = cosine * tangent
    turn(A, i, k, cosine, sine)
    turn(R, i, k, cosine, sine)
    return True


@compiled
def turn(A: Array, i: int, k: int, cosine: float, sine: float) -> None:
    for j in range(A.shape[1]):
        first, second = A[i, j], A[k, j]
        A[i, j] = cosine * first - sine * second
        A[k, j] = sine * first + cosine * second
