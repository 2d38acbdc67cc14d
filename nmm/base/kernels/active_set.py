"""The largest scale at which a linear system can be satisfied within limits, and the nearest point there.

    max λ, then min ‖y - target‖  with  E y = e0 + λ e1,  lower - (1 - λ) give <= G y <= upper + (1 - λ) give

by a dual active set (Goldfarb and Idnani 1983) that starts at λ = 1. If no step satisfies a violated row p,
its normal is a combination of active ones, n_p = Σ r_i n_i with r_i <= 0 on the inequalities, so that
Σ r_i b_i(λ) >= b_p(λ) is linear in λ, and λ is cut to where equality holds. Each cut bounds every solution,
so the λ reached is the largest, without weights. The active set, and the row of the last cut, start the next
call.
"""

import math
from typing import NamedTuple

from nmm.base.arrays import Array, Integers
from nmm.base.kernels.compiled import clear, compiled, integer_scratch, scratch
from nmm.base.kernels.linear_algebra import EPSILON, add, copied, dot, less, norm, turn
from nmm.base.kernels.record_layout import IntegerVector, Matrix, Vector

#: A normal is a combination of others if its part outside their span, over its norm, is below this.
DEPENDENT = 1e-9
#: Rows may miss their bounds by this much, times the bound if that is above 1; where normals are nearly
#: dependent and rounding prevents this, by up to the second number.
FEASIBLE, ROUNDED = 1e-12, 1e-7
#: Limits on steps per row, and on cuts.
STEPS_PER_ROW, CUTS = 10, 60
#: Where normals are nearly dependent, rounding of λ can change a row 1e8 times as much: λ is then reduced for
#: what a row still misses, at most this often and by this much.
BACKS, BACK = 4, 1e-12


class ConstraintRows(NamedTuple):
    """E (e, m), e0 and e1 (e,); G (c, m), lower, upper and give (c,)."""

    E: Matrix
    e0: Vector
    e1: Vector
    G: Matrix
    lower: Vector
    upper: Vector
    give: Vector


class ActiveNormals(NamedTuple):
    """The active normals n_i = Σ_j R[j, i] Q[j]; Q's first rows are orthonormal, R is upper triangular.

    members : row of E as -1 - row; row of G as 1 + row at its lower bound, 1 + row + c at its upper one
    d, v : the parts of the normal that was split last
    """

    Q: Matrix
    R: Matrix
    members: IntegerVector
    d: Vector
    v: Vector


@compiled
def normal(rows: ConstraintRows, member: int, n: Array) -> None:
    """The normal of a member: a row of E, or one of G that points into the allowed region."""
    c = rows.G.shape[0]
    if member < 0:
        copied(rows.E[-1 - member], n)
    elif member <= c:
        copied(rows.G[member - 1], n)
    else:
        for j in range(n.shape[0]):
            n[j] = -rows.G[member - 1 - c, j]


@compiled
def bound(rows: ConstraintRows, member: int) -> tuple[float, float]:
    """(b0, b1): the bound on n . y is b0 + λ b1."""
    c = rows.G.shape[0]
    if member < 0:
        return rows.e0[-1 - member], rows.e1[-1 - member]
    if member <= c:
        give = rows.give[member - 1]
        return rows.lower[member - 1] - give, give
    give = rows.give[member - 1 - c]
    return -rows.upper[member - 1 - c] - give, give


@compiled
def split(basis: ActiveNormals, k: int, n: Array) -> float:
    """n = Σ_i d[i] Q[i] + v with v orthogonal to the first k rows; ‖v‖, or 0 where n is their combination."""
    d, v, parts, whole, full = basis.d, basis.v, scratch(k), dot(n, n), k == n.shape[0]
    copied(n, v)
    for i in range(k):
        d[i] = 0.0
    square = whole
    for _ in range(2):  # the second pass corrects rounding where the first has cost more than a digit
        before = square
        for i in range(k):
            parts[i] = dot(basis.Q[i], v)
        for i in range(k):
            d[i] += parts[i]
            add(v, -parts[i], basis.Q[i])
        square = dot(v, v)
        if full or square > 0.01 * before:
            break
    return 0.0 if full or square <= DEPENDENT * DEPENDENT * whole else math.sqrt(square)


@compiled
def append(basis: ActiveNormals, k: int, member: int, norm: float) -> int:
    """Append the normal that was split last as member k; returns the number of members."""
    for i in range(k):
        basis.R[i, k] = basis.d[i]
    basis.R[k, k] = norm
    share = 1.0 / norm
    for j in range(basis.v.shape[0]):
        basis.Q[k, j] = share * basis.v[j]
    basis.members[k] = member
    return k + 1


@compiled
def join(basis: ActiveNormals, k: int, member: int, n: Array) -> int:
    """Append n unless it is a combination of the first k; returns the number of members."""
    norm = split(basis, k, n)
    return append(basis, k, member, norm) if norm > 0.0 else k


@compiled
def drop(basis: ActiveNormals, k: int, dropped: int) -> int:
    """Remove member number `dropped`; returns the number left."""
    Q, R = basis.Q, basis.R
    for i in range(dropped, k - 1):
        basis.members[i] = basis.members[i + 1]
        for j in range(i + 2):
            R[j, i] = R[j, i + 1]
        length = math.hypot(R[i, i], R[i + 1, i])  # turn rows i and i + 1, so that R[i + 1, i] is 0
        cosine, sine = R[i, i] / length, -R[i + 1, i] / length
        turn(Q, i, i + 1, cosine, sine)
        turn(R, i, i + 1, cosine, sine)
    return k - 1


@compiled
def combination(basis: ActiveNormals, k: int, d: Array, r: Array) -> None:
    """Solve R r = d: the coefficients of the combination of members with coordinates d in Q."""
    for i in range(k - 1, -1, -1):
        x = d[i]
        for j in range(i + 1, k):
            x -= basis.R[i, j] * r[j]
        r[i] = x / basis.R[i, i]


@compiled
def nearest(basis: ActiveNormals, k: int, ends: Array, target: Array, parts: Array, y: Array) -> None:
    """The nearest y = target + Σ parts[i] Q[i] with n_i . y = ends[i] for all members; ends becomes Q y."""
    copied(target, y)
    for i in range(k):  # Rᵀ z = b
        x = ends[i]
        for j in range(i):
            x -= basis.R[j, i] * ends[j]
        ends[i] = x / basis.R[i, i]
    missing = scratch(k)
    for i in range(k):
        parts[i] = 0.0
    for _ in range(2):  # the second pass corrects rounding where the target is far away
        for i in range(k):
            missing[i] = less(ends[i], basis.Q[i], y)
        for i in range(k):
            add(y, missing[i], basis.Q[i])
            parts[i] += missing[i]


@compiled
def settle(
    rows: ConstraintRows,
    basis: ActiveNormals,
    k: int,
    scale: float,
    target: Array,
    multipliers: Array,
    y: Array,
) -> int:
    """The y nearest to the target with all members at equality, and their multipliers; members of the wrong
    sign are dropped. Returns the number left."""
    while True:
        for i in range(k):
            b0, b1 = bound(rows, basis.members[i])
            basis.d[i] = b0 + scale * b1
        nearest(basis, k, basis.d, target, multipliers, y)
        combination(basis, k, multipliers, multipliers)
        worst, least = -1, 0.0
        for i in range(k):
            if basis.members[i] > 0 and multipliers[i] < least:
                worst, least = i, multipliers[i]
        if worst < 0:
            return k
        k = drop(basis, k, worst)


@compiled
def most_violated(rows: ConstraintRows, scale: float, y: Array, tolerance: float) -> int:
    """The member whose bound is violated by the greatest length; 0 for none beyond rounding."""
    c, member, worst = rows.G.shape[0], 0, 0.0
    for i in range(c):
        value, shift = dot(rows.G[i], y), (1.0 - scale) * rows.give[i]
        for side in range(2):
            limit = rows.lower[i] - shift if side == 0 else rows.upper[i] + shift
            missing = limit - value if side == 0 else value - limit
            if missing > tolerance * max(1.0, abs(limit)):
                missing /= max(norm(rows.G[i]), 1e-150)
                if missing > worst:
                    member, worst = 1 + i + side * c, missing
    return member


@compiled
def unexplained(
    rows: ConstraintRows, basis: ActiveNormals, k: int, member: int, r: Array
) -> tuple[float, float, float]:
    """(b0, b1) of a row less the members' by the combination r, and the size of the terms of b1."""
    b0, b1 = bound(rows, member)
    size = abs(b1)
    for i in range(k):
        own0, own1 = bound(rows, basis.members[i])
        b0 -= r[i] * own0
        b1 -= r[i] * own1
        size += abs(r[i] * own1)
    return b0, b1, size


@compiled
def first_to_leave(basis: ActiveNormals, k: int, multipliers: Array, r: Array) -> tuple[float, int]:
    """The step along -r at which the first multiplier of a row of G is 0, and its number; -1 for none."""
    step, first = math.inf, -1
    for i in range(k):
        if basis.members[i] > 0 and r[i] > 1e-14:
            until = max(multipliers[i], 0.0) / r[i]
            if until < step:
                step, first = until, i
    return step, first


@compiled
def nearest_within(rows: ConstraintRows, target: Array, least: float, active: Integers, y: Array) -> float:
    """Write y (m,) for the largest λ in [least, 1] and return λ, NaN if there is none (y is then arbitrary).

    active (2 + c,) : the number of active rows of G, and these, kept between calls; last the row that cut λ,
        which cuts it at once in the next call. Reset to [0, ...] where there is no λ
    """
    c, m = rows.G.shape
    basis = ActiveNormals(scratch((m, m)), scratch((m, m)), integer_scratch(m), scratch(m), scratch(m))
    multipliers, r, n = scratch(m), scratch(m), scratch(m)
    scale, k, e, cutting = 1.0, 0, rows.E.shape[0], 0
    clear(multipliers)
    for i in range(e + active[0]):
        member = -1 - i if i < e else active[1 + i - e]
        if math.isinf(bound(rows, member)[0]):  # the row has no limit this time
            continue
        normal(rows, member, n)
        joined = join(basis, k, member, n)
        if joined == k:  # a combination of those before: satisfied already, or only with a smaller λ
            combination(basis, k, basis.d, r)
            _, blocking = first_to_leave(basis, k, multipliers, r)
            a0, a1, size = unexplained(rows, basis, k, member, r)
            if (abs(a1) if member < 0 else a1) > 1e-7 * size and scale > least and blocking < 0:
                scale = max(least, min(scale, -a0 / a1))
                cutting = member
        k = joined
    k = settle(rows, basis, k, scale, target, multipliers, y)
    active[0] = 0
    cuts, backs, tolerance = 0, 0, FEASIBLE
    for _ in range(STEPS_PER_ROW * (c + m)):
        p = most_violated(rows, scale, y, tolerance)
        if p == 0:
            for i in range(k):
                if basis.members[i] > 0:
                    active[0] += 1
                    active[active[0]] = basis.members[i]
                if basis.members[i] == cutting:
                    cutting = 0
            if cutting > 0:
                active[0] += 1
                active[active[0]] = cutting
            return scale
        normal(rows, p, n)
        b0, b1 = bound(rows, p)
        for _ in range(m + 1):
            norm = split(basis, k, n)
            combination(basis, k, basis.d, r)
            step, blocking = first_to_leave(basis, k, multipliers, r)
            if norm == 0.0 and blocking < 0:  # no step satisfies row p: cut λ
                a0, a1, _ = unexplained(rows, basis, k, p, r)
                cutting = p
                cuts += 1
                if a1 <= 0.0 or cuts > CUTS:
                    return math.nan
                met = (0.0 - a0) / a1  # 0, where it is, and not -0
                if met >= scale:  # satisfied up to rounding
                    back = max(less(b0 + scale * b1, n, y) / a1, EPSILON * scale)
                    if backs == BACKS or back > BACK or scale - back < least:
                        tolerance *= 10.0
                        if tolerance > ROUNDED:
                            return math.nan
                        break
                    backs += 1
                    scale -= back
                elif met < least - 1e-9:
                    return math.nan
                else:
                    scale = max(met, least)
                k = settle(rows, basis, k, scale, target, multipliers, y)
                break
            if norm > 0.0:
                full = less(b0 + scale * b1, n, y) / (norm * norm)
                if full <= step:
                    k = append(basis, k, p, norm)
                    k = settle(rows, basis, k, scale, target, multipliers, y)
                    break
                add(y, step, basis.v)
            for i in range(k):
                multipliers[i] -= step * r[i]
            for i in range(blocking, k - 1):
                multipliers[i] = multipliers[i + 1]
            k = drop(basis, k, blocking)
    return math.nan
