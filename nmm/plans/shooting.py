"""The smoothest motion of samples to a configuration in a given time, within all limits, compiled.

Multiple shooting: the unknowns are q and u at the samples' ends and the constant rate a = du/dt within each.
Every round is one step of Newton's method on the conditions of a primal-dual interior point: limits and
distances c ≥ 0 have slacks s and multipliers z with s z → μ (J. Nocedal, S. J. Wright, Numerical
Optimization, 2006, chapter 19). What couples the samples is solved from the end to the beginning, as in
differential dynamic programming (D. H. Jacobson, D. Q. Mayne, 1970), and so takes a time in proportion to
their number. The end is reached by multipliers, too.
"""

import math
from typing import NamedTuple

from nmm.arrays import Array, Integers
from nmm.collisions.legs_check import MovedShapes, place_shape, placed_bound, write_approach
from nmm.kernels.compiled import call_platform, clear, compiled, compiled_without_gil, scratch, view
from nmm.kernels.kinematics import axes, place_joints
from nmm.kernels.record_layout import (
    Cell,
    IntegerCell,
    IntegerVector,
    Matrices,
    Matrix,
    Vector,
    views,
)
from nmm.plans.samples import flow, sample_blocked
from nmm.robots.wheel_rates import rolling
from nmm.robots.zero_order_hold import Inputs

#: Distances are looked at within this beyond those to keep, m; the longest step of a round, m and rad.
NEAR, STEP = 0.08, 0.3
#: Weight of the end's error.
END = 1e5
#: The share of the way to a bound that a round goes at most.
BEFORE = 0.99
#: What is left of gaps between samples and of the end's error when a motion is found.
EXACT = 1e-11
#: The least slack to begin with, and the least product of slacks and multipliers.
SLACK, LEAST = 1e-2, 1e-4
#: Gaps this small are closed by the least change, in so many rounds.
SMALL, CLOSING = 3e-3, 8


class Shooting(NamedTuple):
    """N samples of n coordinates and m inputs, B bounds of one number each, w wheels, P pairs of shapes.

    inputs : what they move; step (), substeps () : of each sample, s
    column (B,), sign (B,), offset (B,) : bounds offset + sign [q u a][column] ≥ 0
    wheels (w, 9), spin (w,) : see `nmm.robots.wheel_rates`, and the largest rates, rad/s
    weights (2 m,) : of u and a; goal (n,)
    room (P,), margin (N + 1,) : what each pair and each sample's beginning keep beyond the distance at most
    q (N + 1, n), u (N + 1, m), a (N, m) : the motion; moves (N + 1, n + 2 m) : what a round changes of it
    gaps (N, n), D (N, n, n + 2 m) : where a sample leads less the next one's beginning, and its derivative
    c, s, z, ds, dz (N + 1, R) : the R = B + 2 w + P constraints of each sample's beginning; c is infinite for
        pairs that are far apart; rows (N + 1, 2 w + P, n + m) : derivatives of the last
    K (N, m, n + m + 1) : changes of a by those of q and u, and alone
    V (n + m, n + m + 1), Q (n + 2 m, n + 2 m + 1), W (n + m, n + 2 m) : while it solves
    duals (n + m,) : multipliers of the end; mu () : of the interior
    """

    inputs: Inputs
    step: Cell
    substeps: IntegerCell
    column: IntegerVector
    sign: Vector
    offset: Vector
    wheels: Matrix
    spin: Vector
    weights: Vector
    goal: Vector
    room: Vector
    margin: Vector
    q: Matrix
    u: Matrix
    a: Matrix
    moves: Matrix
    gaps: Matrix
    D: Matrices
    c: Matrix
    s: Matrix
    z: Matrix
    ds: Matrix
    dz: Matrix
    rows: Matrices
    K: Matrices
    V: Matrix
    Q: Matrix
    W: Matrix
    duals: Vector
    mu: Cell


@compiled
def write_constraints(scene: MovedShapes, joints: Array, twists: Array, x: Shooting, k: int) -> None:
    """c and rows at the beginning of sample k; at the first and the last only those of a count."""
    n, m, B, w = x.q.shape[1], x.u.shape[1], x.column.shape[0], x.spin.shape[0]
    N = x.a.shape[0]
    inner = 0 < k < N
    for r in range(B):
        i = x.column[r]
        x.c[k, r] = math.inf
        if i >= n + m:
            if k < N:
                x.c[k, r] = x.offset[r] + x.sign[r] * x.a[k, i - n - m]
        elif inner:
            value = x.q[k, i] if i < n else x.u[k, i - n]
            x.c[k, r] = x.offset[r] + x.sign[r] * value
    P = scene.kept.shape[0]
    if not inner:
        for r in range(2 * w + P):
            x.c[k, B + r] = math.inf
        return
    q, n_p = x.q[k], x.inputs.coordinates
    p = m - x.inputs.moved.shape[0]
    row, G, G_q = scratch(n + m), scratch((n_p, p)), scratch((n_p, p, n_p))
    clear(row)
    if w > 0:
        clear(G)
        clear(G_q)
        call_platform(x.inputs.platform, view(q, 0, (n_p,)), x.inputs.parameters, G, G_q)
    for i in range(w):
        steer = int(x.wheels[i, 4])
        along, across, turn, steered = rolling(x.wheels[i], q[2], q[steer] if steer >= 0 else 0.0)
        total = 0.0
        for j in range(p):
            row[n + j] = along * G[0, j] + across * G[1, j] + turn * G[2, j]
            if steer >= 0:
                row[n + j] += steered * G[steer, j]
            total += row[n + j] * x.u[k, j]
        for side in range(2):
            sign = 1.0 if side == 0 else -1.0
            r = 2 * i + side
            x.c[k, B + r] = x.spin[i] + sign * total
            for b in range(n + m):
                x.rows[k, r, b] = sign * row[b]
    place_joints(scene.joints, q, joints)
    axes(scene.joints, joints, twists)
    for shape in range(scene.carrier.shape[0]):
        place_shape(scene, joints, shape)
    for pair in range(P):
        r = 2 * w + pair
        asked = scene.kept[pair] + min(x.room[pair], x.margin[k])
        apart = placed_bound(scene, pair, asked + NEAR)
        x.c[k, B + r] = math.inf
        if apart < asked + NEAR:
            x.c[k, B + r] = apart - asked
            clear(x.rows[k, r])
            write_approach(scene, joints, twists, pair, x.rows[k, r])


@compiled
def write_all(scene: MovedShapes, x: Shooting) -> float:
    """Gaps, derivatives and constraints of the motion; returns how far it is from one that is allowed."""
    N, n = x.a.shape[0], x.q.shape[1]
    count = scene.joints.parent.shape[0]
    joints, twists, ahead = scratch((count, 12)), scratch((count, 6)), scratch(n)
    worst = 0.0
    for k in range(N):
        flow(x.inputs, x.q[k], x.u[k], x.a[k], x.step[()], x.substeps[()], ahead, x.D[k])
        for i in range(n):
            x.gaps[k, i] = ahead[i] - x.q[k + 1, i]
            worst = max(worst, abs(x.gaps[k, i]))
    for i in range(n):
        worst = max(worst, abs(x.q[N, i] - x.goal[i]))
    for j in range(x.u.shape[1]):
        worst = max(worst, abs(x.u[N, j]))
    for k in range(N + 1):
        write_constraints(scene, joints, twists, x, k)
        for r in range(x.c.shape[1]):
            worst = max(worst, -x.c[k, r])
            if x.c[k, r] < math.inf and x.s[k, r] == 0.0:
                x.s[k, r] = max(x.c[k, r], SLACK)
                x.z[k, r] = x.mu[()] / x.s[k, r]
            if x.c[k, r] == math.inf:
                x.s[k, r] = 0.0
    return worst


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
def add_constraints(x: Shooting, k: int, closing: int) -> None:
    """Add the constraints at the beginning of sample k to its quadratic model Q."""
    B, last = x.column.shape[0], x.Q.shape[1] - 1
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
    clear(V)
    for i in range(size):
        V[i, i] = END
        off = x.q[N, i] - x.goal[i] if i < n else x.u[N, i - n]
        V[i, size] = (0.0 if closing else x.duals[i]) + END * off
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
        add_constraints(x, k, closing)
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
        for i in range(size):
            for c in range(size + 1):
                value = Q[i, c if c < size else last]
                for b in range(m):
                    value -= K[b, i] * K[b, c]
                V[i, c] = value
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
        x.duals[i] += END * off
    less = min(share, share_z)
    x.mu[()] = max(total / max(count, 1) * max(0.1, (1.0 - less) ** 2), LEAST)
    return share


@compiled_without_gil
def shoot(integers: Integers, floats: Array, own_integers: Integers, own_floats: Array, rounds: int) -> int:
    """Rounds until the motion is allowed: how many it took, or less 0 where it is not after them."""
    scene = views(MovedShapes, integers, floats, 0)
    x = views(Shooting, own_integers, own_floats, 0)
    short = 0
    k = 0
    while k < rounds:
        off = write_all(scene, x)
        k += 1
        for _ in range(CLOSING):
            if off <= EXACT:
                return k
            if off > SMALL or solve_backward(x, 1) == 0:
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


@compiled_without_gil
def first_blocked_sample(integers: Integers, floats: Array, own_integers: Integers, own_floats: Array) -> int:
    """The first sample that comes too near to something, or -1."""
    scene = views(MovedShapes, integers, floats, 0)
    x = views(Shooting, own_integers, own_floats, 0)
    for k in range(x.a.shape[0]):
        pair = sample_blocked(scene, x.inputs, x.q[k], x.u[k], x.a[k], x.step[()], x.substeps[()])
        if pair >= 0:
            return k
    return -1
