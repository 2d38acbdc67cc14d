"""The largest scale at which a linear system can be met within limits, and the nearest point there.

    max λ, then min ‖y - target‖  with  E y = e0 + λ e1,  lower - (1 - λ) give <= G y <= upper + (1 - λ) give

by a dual active set (Goldfarb and Idnani 1983) that starts at λ = 1. Where a violated row p can be met by no
step, its normal is a combination of active ones, n_p = Σ r_i n_i with r_i <= 0 on the inequalities; so
Σ r_i b_i(λ) >= b_p(λ), which is linear in λ, and λ is cut to where it holds with equality. Each cut is a
bound on every solution: the λ reached is the largest, without weights. The active set survives a cut, and is
where the next call begins.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from nmm.arrays import Array, Integers
from nmm.kernels.compiled import compiled, integer_scratch, scratch
from nmm.kernels.memory import IntegerVector, Matrix, Vector

#: A normal whose part outside the span of others is below this, beside its norm, is their combination.
DEPENDENT = 1e-9
#: Rows may miss their bounds by this much, times the bound if that is above 1; where rounding does not let
#: them be met so well (normals that are nearly dependent), by up to the second number.
FEASIBLE, ROUNDED = 1e-12, 1e-7
#: Steps and cuts per row before a problem is given up.
STEPS_PER_ROW, CUTS = 10, 60
EPSILON = 2.0**-52
#: Where normals are nearly dependent, a last digit of λ can be 1e8 times as much of a row: so often, and by
#: no more at once, λ is then taken back for what a row still misses.
BACKS, BACK = 4, 1e-12


class Rows(NamedTuple):
    """E (e, m), e0 and e1 (e,); G (c, m), lower, upper and give (c,)."""

    E: Matrix
    e0: Vector
    e1: Vector
    G: Matrix
    lower: Vector
    upper: Vector
    give: Vector


class Basis(NamedTuple):
    """The active normals n_i = Σ_j R[j, i] Q[j]: Q's first rows are orthonormal, R is upper triangular.

    members : row of E as -1 - row; row of G as 1 + row at its lower bound, 1 + row + c at its upper one
    """

    Q: Matrix
    R: Matrix
    members: IntegerVector


@compiled
def normal(rows: Rows, member: int, n: Array) -> None:
    """The normal of a member: a row of E, or one of G that points into what is allowed."""
    c, m = rows.G.shape
    if member < 0:
        for j in range(m):
            n[j] = rows.E[-1 - member, j]
    elif member <= c:
        for j in range(m):
            n[j] = rows.G[member - 1, j]
    else:
        for j in range(m):
            n[j] = -rows.G[member - 1 - c, j]


@compiled
def bound(rows: Rows, member: int) -> tuple[float, float]:
    """(b0, b1): what n . y is at λ = 0, and how that grows with λ."""
    c = rows.G.shape[0]
    if member < 0:
        return rows.e0[-1 - member], rows.e1[-1 - member]
    if member <= c:
        give = rows.give[member - 1]
        return rows.lower[member - 1] - give, give
    give = rows.give[member - 1 - c]
    return -rows.upper[member - 1 - c] - give, give


@compiled
def split(basis: Basis, k: int, n: Array, d: Array, v: Array) -> float:
    """n = Σ_i d[i] Q[i] + v with v orthogonal to the first k rows; ‖v‖, or 0 where n is their combination."""
    m = n.shape[0]
    size = 0.0
    for j in range(m):
        v[j] = n[j]
        size += n[j] * n[j]
    for i in range(k):
        d[i] = 0.0
    for _ in range(2):  # the second pass for what rounding left
        for i in range(k):
            overlap = 0.0
            for j in range(m):
                overlap += basis.Q[i, j] * v[j]
            d[i] += overlap
            for j in range(m):
                v[j] -= overlap * basis.Q[i, j]
    square = 0.0
    for j in range(m):
        square += v[j] * v[j]
    return math.sqrt(square) if square > DEPENDENT * DEPENDENT * size else 0.0


@compiled
def append(basis: Basis, k: int, member: int, d: Array, v: Array, norm: float) -> None:
    """Make a normal, as `split` gave it, member k."""
    for i in range(k):
        basis.R[i, k] = d[i]
    basis.R[k, k] = norm
    for j in range(v.shape[0]):
        basis.Q[k, j] = v[j] / norm
    basis.members[k] = member


@compiled
def drop(rows: Rows, basis: Basis, k: int, dropped: int, n: Array, d: Array, v: Array) -> int:
    """Take member number `dropped` out; returns how many are left."""
    kept = dropped
    for i in range(dropped + 1, k):
        member = basis.members[i]
        normal(rows, member, n)
        norm = split(basis, kept, n, d, v)
        if norm > 0.0:
            append(basis, kept, member, d, v, norm)
            kept += 1
    return kept


@compiled
def combination(basis: Basis, k: int, d: Array, r: Array) -> None:
    """R r = d: the coefficients of the members whose combination has the coordinates d in Q."""
    for i in range(k - 1, -1, -1):
        x = d[i]
        for j in range(i + 1, k):
            x -= basis.R[i, j] * r[j]
        r[i] = x / basis.R[i, i]


@compiled
def place(
    rows: Rows, basis: Basis, k: int, scale: float, target: Array, z: Array, multipliers: Array, y: Array
) -> None:
    """The point nearest to the target at which all members hold with equality, and their multipliers."""
    m = y.shape[0]
    for j in range(m):
        y[j] = target[j]
    for i in range(k):  # Rᵀ z = b
        b0, b1 = bound(rows, basis.members[i])
        x = b0 + scale * b1
        for j in range(i):
            x -= basis.R[j, i] * z[j]
        z[i] = x / basis.R[i, i]
    for again in range(2):  # the second time for what rounding left of a target far away
        for i in range(k):
            missing = z[i]
            for j in range(m):
                missing -= basis.Q[i, j] * y[j]
            for j in range(m):
                y[j] += missing * basis.Q[i, j]
            multipliers[i] = missing if again == 0 else multipliers[i] + missing
    combination(basis, k, multipliers, multipliers)


@compiled
def settle(
    rows: Rows,
    basis: Basis,
    k: int,
    scale: float,
    target: Array,
    work: Array,
    multipliers: Array,
    y: Array,
) -> int:
    """Drop members that pull the wrong way until none does; returns how many are left. work (3, m)."""
    z, v, n = work[0], work[1], work[2]
    while True:
        place(rows, basis, k, scale, target, z, multipliers, y)
        worst = -1
        least = 0.0
        for i in range(k):
            if basis.members[i] > 0 and multipliers[i] < least:
                least = multipliers[i]
                worst = i
        if worst < 0:
            return k
        k = drop(rows, basis, k, worst, n, z, v)


@compiled
def most_violated(rows: Rows, scale: float, y: Array, tolerance: float) -> int:
    """The member that misses its bound by the greatest length; 0 where none does beyond rounding."""
    c, m = rows.G.shape
    found = 0
    worst = 0.0
    for i in range(c):
        value = 0.0
        square = 0.0
        for j in range(m):
            value += rows.G[i, j] * y[j]
            square += rows.G[i, j] * rows.G[i, j]
        given = (1.0 - scale) * rows.give[i]
        for side in range(2):
            limit = rows.lower[i] - given if side == 0 else rows.upper[i] + given
            missing = limit - value if side == 0 else value - limit
            if missing <= tolerance * max(1.0, abs(limit)):
                continue
            missing /= math.sqrt(square) if square > 0.0 else 1e-300
            if missing > worst:
                worst = missing
                found = 1 + i + side * c
    return found


@compiled
def nearest_within(rows: Rows, target: Array, least: float, active: Integers, y: Array) -> float:
    """Write y (m,) for the largest λ in [least, 1], which is returned; not a number when there is none.

    active (1 + c,) : how many rows of G are active and which, kept from call to call; [0, ...] to begin with.
    Where there is no λ it is [0, ...] again, and y is whatever it was last.
    """
    c, m = rows.G.shape
    e = rows.E.shape[0]
    work = scratch((3, m))
    basis = Basis(scratch((m, m)), scratch((m, m)), integer_scratch(m))
    multipliers, d, r, n, v = scratch(m), scratch(m), scratch(m), scratch(m), scratch(m)
    scale = 1.0
    k = 0
    for i in range(e):
        normal(rows, -1 - i, n)
        norm = split(basis, k, n, d, v)
        if norm > 0.0:
            append(basis, k, -1 - i, d, v, norm)
            k += 1
            continue
        # A combination of rows before: it asks for nothing new, or only for what a smaller λ agrees with.
        combination(basis, k, d, r)
        a0, a1 = rows.e0[i], rows.e1[i]
        size = abs(a1)
        for a in range(k):
            b0, b1 = bound(rows, basis.members[a])
            a0 -= r[a] * b0
            a1 -= r[a] * b1
            size += abs(r[a] * b1)
        if abs(a1) > 1e-7 * size and scale > least:
            scale = max(least, min(scale, -a0 / a1))
    for i in range(active[0]):
        if k == m:
            break
        if math.isinf(bound(rows, active[1 + i])[0]):  # a row that does not count this time
            continue
        normal(rows, active[1 + i], n)
        norm = split(basis, k, n, d, v)
        if norm > 0.0:
            append(basis, k, active[1 + i], d, v, norm)
            k += 1
    k = settle(rows, basis, k, scale, target, work, multipliers, y)
    active[0] = 0
    cuts, backs = 0, 0
    tolerance = FEASIBLE
    for _ in range(STEPS_PER_ROW * (c + m)):
        p = most_violated(rows, scale, y, tolerance)
        if p == 0:
            for i in range(k):
                if basis.members[i] > 0:
                    active[0] += 1
                    active[active[0]] = basis.members[i]
            return scale
        normal(rows, p, n)
        b0, b1 = bound(rows, p)
        for _ in range(m + 1):
            norm = split(basis, k, n, d, v)
            combination(basis, k, d, r)
            step = math.inf
            blocking = -1
            for i in range(k):
                if basis.members[i] > 0 and r[i] > 1e-14:
                    until = max(multipliers[i], 0.0) / r[i]
                    if until < step:
                        step = until
                        blocking = i
            if norm == 0.0 and blocking < 0:  # no step meets row p: cut λ
                a0, a1 = -b0, -b1
                for i in range(k):
                    at0, at1 = bound(rows, basis.members[i])
                    a0 += r[i] * at0
                    a1 += r[i] * at1
                cuts += 1
                if a1 >= 0.0 or cuts > CUTS:
                    return math.nan
                if -a0 / a1 >= scale:  # it is met, but for rounding
                    missing = b0 + scale * b1
                    for j in range(m):
                        missing -= n[j] * y[j]
                    back = max(-missing / a1, EPSILON * scale)
                    if backs < BACKS and back <= BACK and scale - back >= least:
                        backs += 1
                        scale -= back
                        k = settle(rows, basis, k, scale, target, work, multipliers, y)
                        break
                    tolerance *= 10.0
                    if tolerance > ROUNDED:
                        return math.nan
                    break
                scale = -a0 / a1
                if scale < least:
                    if scale < least - 1e-9:
                        return math.nan
                    scale = least
                k = settle(rows, basis, k, scale, target, work, multipliers, y)
                break
            if norm > 0.0:
                missing = b0 + scale * b1
                for j in range(m):
                    missing -= n[j] * y[j]
                full = missing / (norm * norm)
                if full <= step:
                    append(basis, k, p, d, v, norm)
                    k += 1
                    k = settle(rows, basis, k, scale, target, work, multipliers, y)
                    break
                for j in range(m):
                    y[j] += step * v[j]
            for i in range(k):
                multipliers[i] -= step * r[i]
            for i in range(blocking, k - 1):
                multipliers[i] = multipliers[i + 1]
            k = drop(rows, basis, k, blocking, work[0], work[1], work[2])
    return math.nan
