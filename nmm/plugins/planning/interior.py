"""The best of the motions that a problem of shooting allows, compiled.

Every round is one step of Newton's method on the conditions of a primal-dual interior point: limits and
distances c ≥ 0 have slacks s and multipliers z with s z → μ (J. Nocedal, S. J. Wright, Numerical
Optimization, 2006, chapter 19). What couples the samples is solved from the end to the beginning, as in
differential dynamic programming (D. H. Jacobson, D. Q. Mayne, 1970), and so takes a time in proportion to
their number. An end that is given is reached by multipliers, too.
"""

import math

from nmm.base.arrays import Array, Integers
from nmm.base.kernels.compiled import clear, compiled, compiled_without_gil, scratch
from nmm.base.kernels.record_layout import BLOCKS, views
from nmm.base.kernels.signatures import float64, int64
from nmm.plugins.planning.collisions.legs_check import MovedShapes
from nmm.plugins.planning.shooting import Shooting, write_all

#: The longest step of a round, m and rad.
STEP = 0.3
#: The share of the way to a bound that a round goes at most.
BEFORE = 0.99
#: The least product of slacks and multipliers.
LEAST = 1e-4
#: Gaps this small are closed by the least change, in so many rounds.
SMALL, CLOSING = 3e-3, 8


@compiled
def add_row(Q: Array, row: Array, weight: float, push: float) -> None:
    """Add weight row rowᵀ to Q's square, and push row to its last column."""
    last = Q.shape[1] - 1
    for i in range(row.shape[0]):
        if row[i] != 0.0:
            for j in range(row.shape[0]):
                Q[i, j] += weight * row[i] * row[j]
            Q[i, last] += push * row[i]


@compiled
def add_costs(x: Shooting, k: int, closing: int) -> None:
    """Add aims and constraints at the beginning of sample k to its quadratic model Q."""
    B, last = x.column.shape[0], x.Q.shape[1] - 1
    for e in range(x.aims.shape[1]):
        off = 0.0 if closing else -x.aimed[k, e]
        for i in range(0 if closing else x.q.shape[1]):
            off += x.aims[k, e, i] * x.q[k, i]
        add_row(x.Q, x.aims[k, e], x.pull[k, e], x.pull[k, e] * off)
    for r in range(x.c.shape[1]):
        if x.c[k, r] == math.inf:
            continue
        weight = x.z[k, r] / x.s[k, r]
        push = 0.0 if closing else weight * (x.c[k, r] - x.s[k, r]) - x.mu[()] / x.s[k, r]
        if r < B:
            i = x.column[r]
            x.Q[i, i] += weight
            x.Q[i, last] += push * x.sign[r]
        else:
            add_row(x.Q, x.rows[k, r - B], weight, push)


@compiled
def solve_backward(x: Shooting, closing: int) -> int:
    """K of all samples, from the last to the first, `closing`: for the least change that closes the gaps;
    0 where a matrix is not positive definite."""
    N, n, m = x.a.shape[0], x.q.shape[1], x.u.shape[1]
    h, size, last = x.step[()], x.q.shape[1] + x.u.shape[1], x.Q.shape[1] - 1
    V, Q, W = x.V, x.Q, x.W
    clear(Q)
    for i in range(size):
        off = x.q[N, i] - x.goal[i] if i < n else x.u[N, i - n]
        Q[i, i] = x.ends[i]
        Q[i, last] = (0.0 if closing else x.duals[i]) + x.ends[i] * off
    add_costs(x, N, closing)
    for i in range(size):
        for c in range(size + 1):
            V[i, c] = Q[i, c if c < size else last]
    L = scratch((m, m))
    for k in range(N - 1, -1, -1):
        clear(Q)
        clear(W)
        # W = V T with T = [D; 0 I h], then Q = Tᵀ W and its last column Tᵀ (V gap + v).
        for i in range(n):
            for c in range(size + m):
                d = x.D[k, i, c]
                if d != 0.0:
                    for r in range(size):
                        W[r, c] += V[r, i] * d
        for j in range(m):
            for r in range(size):
                W[r, n + j] += V[r, n + j]
                W[r, size + j] += h * V[r, n + j]
        for r in range(size):
            push = V[r, size]
            for i in range(n):
                push += V[r, i] * x.gaps[k, i]
            if r < n:
                for c in range(size + m):
                    d = x.D[k, r, c]
                    if d != 0.0:
                        for other in range(size + m):
                            Q[c, other] += d * W[r, other]
                        Q[c, last] += d * push
            else:
                for other in range(size + m):
                    Q[r, other] += W[r, other]
                    Q[r + m, other] += h * W[r, other]
                Q[r, last] += push
                Q[r + m, last] += h * push
        for j in range(2 * m):
            value = x.u[k, j] if j < m else x.a[k, j - m]
            Q[n + j, n + j] += x.weights[j]
            Q[n + j, last] += 0.0 if closing else x.weights[j] * value
        add_costs(x, k, closing)
        # Qaa = L Lᵀ, then K = -Qaa⁻¹ [Qax, qa] and V = Qxx + Qxa K.
        for i in range(m):
            for j in range(i + 1):
                value = Q[size + i, size + j]
                for b in range(j):
                    value -= L[i, b] * L[j, b]
                if i == j:
                    if not value > 0.0:
                        return 0
                    L[i, i] = math.sqrt(value)
                else:
                    L[i, j] = value / L[j, j]
        K = x.K[k]
        for c in range(size + 1):
            source = c if c < size else last
            for i in range(m):
                value = -Q[size + i, source]
                for b in range(i):
                    value -= L[i, b] * K[b, c]
                K[i, c] = value / L[i, i]
        # Made symmetric: what rounding leaves of a difference grows on a way on which hitches fold.
        for i in range(size):
            for c in range(i, size + 1):
                value = Q[i, c if c < size else last]
                for b in range(m):
                    value -= K[b, i] * K[b, c]
                V[i, c] = value
                if c < size:
                    V[c, i] = value
        for c in range(size + 1):
            for i in range(m - 1, -1, -1):
                value = K[i, c]
                for b in range(i + 1, m):
                    value -= L[b, i] * K[b, c]
                K[i, c] = value / L[i, i]
    return 1


@compiled
def solve_forward(x: Shooting) -> None:
    """What the round changes, from the first sample to the last, and of slacks and multipliers."""
    N, n, m, B = x.a.shape[0], x.q.shape[1], x.u.shape[1], x.column.shape[0]
    size = n + m
    clear(x.moves)
    for k in range(N + 1):
        d = x.moves[k]
        if k < N:
            for j in range(m):
                d[size + j] = x.K[k, j, size]
                for i in range(size):
                    d[size + j] += x.K[k, j, i] * d[i]
            then = x.moves[k + 1]
            for i in range(n):
                then[i] = x.gaps[k, i]
                for c in range(size + m):
                    then[i] += x.D[k, i, c] * d[c]
            for j in range(m):
                then[n + j] = d[n + j] + x.step[()] * d[size + j]
        for r in range(x.c.shape[1]):
            if x.c[k, r] == math.inf:
                continue
            change = 0.0
            if r < B:
                change = x.sign[r] * d[x.column[r]]
            else:
                for i in range(size):
                    change += x.rows[k, r - B, i] * d[i]
            x.ds[k, r] = x.c[k, r] - x.s[k, r] + change
            x.dz[k, r] = (x.mu[()] - x.z[k, r] * x.ds[k, r]) / x.s[k, r] - x.z[k, r]


@compiled
def add_moves(x: Shooting, share: float) -> None:
    """Change the motion by a share of the moves."""
    N, n, m = x.a.shape[0], x.q.shape[1], x.u.shape[1]
    for k in range(N + 1):
        for i in range(n):
            x.q[k, i] += share * x.moves[k, i]
        for j in range(m):
            x.u[k, j] += share * x.moves[k, n + j]
            if k < N:
                x.a[k, j] += share * x.moves[k, n + m + j]


@compiled
def step_forward(x: Shooting) -> float:
    """Go on by what a round found, before slacks and multipliers are used up; returns the share of it."""
    N, n = x.a.shape[0], x.q.shape[1]
    share, share_z, longest = 1.0, 1.0, 0.0
    for k in range(N + 1):
        for i in range(n):
            longest = max(longest, abs(x.moves[k, i]))
        for r in range(x.c.shape[1]):
            if x.c[k, r] < math.inf:
                if x.ds[k, r] < 0.0:
                    share = min(share, -BEFORE * x.s[k, r] / x.ds[k, r])
                if x.dz[k, r] < 0.0:
                    share_z = min(share_z, -BEFORE * x.z[k, r] / x.dz[k, r])
    if not longest < math.inf:
        return -1.0
    if share * longest > STEP:
        share = STEP / longest
    add_moves(x, share)
    total, count = 0.0, 0
    for k in range(N + 1):
        for r in range(x.c.shape[1]):
            if x.c[k, r] < math.inf:
                x.s[k, r] += share * x.ds[k, r]
                x.z[k, r] += share_z * x.dz[k, r]
                total += x.s[k, r] * x.z[k, r]
                count += 1
    for i in range(x.duals.shape[0]):
        off = x.q[N, i] - x.goal[i] if i < n else x.u[N, i - n]
        x.duals[i] += x.ends[i] * off
    less = min(share, share_z)
    x.mu[()] = max(total / max(count, 1) * max(0.1, (1.0 - less) ** 2), LEAST)
    return share


@compiled_without_gil
def shoot(
    integers: Integers,
    floats: Array,
    own_integers: Integers,
    own_floats: Array,
    least: int,
    rounds: int,
    exact: float,
) -> int:
    """Rounds, `least` of them or more, until the motion is allowed but for `exact`: how many it took, or less
    0 where it is not after them."""
    scene = views(MovedShapes, integers, floats, 0)
    x = views(Shooting, own_integers, own_floats, 0)
    short = 0
    k = 0
    while k < rounds:
        off = write_all(scene, x)
        k += 1
        for _ in range(CLOSING):
            if off <= exact and k > least:
                return k
            if k <= least or off > SMALL or solve_backward(x, 1) == 0:
                break
            solve_forward(x)
            add_moves(x, 1.0)
            off = write_all(scene, x)
            k += 1
        if solve_backward(x, 0) == 0:
            return -k
        solve_forward(x)
        share = step_forward(x)
        short = short + 1 if share < 0.02 else 0
        if share < 0.0 or short > 8:
            return -k
    return -k


SHOOT = int64(*BLOCKS.types, *BLOCKS.types, int64, int64, float64)
