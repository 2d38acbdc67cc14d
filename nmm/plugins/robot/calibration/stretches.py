"""How a platform moved between two looks of a reference, by its counters: the steps of odometry, joined."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from nmm.base.arrays import Array, Integers
from nmm.base.kernels.compiled import (
    call_platform,
    checked_by_caller,
    clear,
    compiled,
    integer_scratch,
    scratch,
    view,
)
from nmm.base.kernels.linear_algebra import orthonormal_rows
from nmm.base.kernels.planar_motions import compose_planar, inverse_adjoint_planar, right_jacobian_planar
from nmm.base.kernels.record_layout import Memory, views
from nmm.base.kernels.signatures import float64, int64, void
from nmm.plugins.robot.counted_motion import Counted, counted_inputs, counted_motion

#: Counters and joints are taken as linear for so long at most, s: as v and δ change, a turn is then exact to
#: a ten thousandth.
LONGEST = 0.05
#: What noise a stretch gathers: of the counters, sliding across, turning.
COUNTERS, ACROSS, TURNS = range(3)


#: Of `Stretches`, what is known beside motions.
SIDES = ("spare", "spare_slopes", "astray", "counted")


class Stretches(NamedTuple):
    """Motions between M times, in the axes of where each begins; errors are along the axes of where it ends.

    motions (M - 1, 3) : m, m, rad
    slopes (M - 1, 3, k) : d of their ends for a relative change of each counter
    noise (M - 1, 3, 3, 3) : covariance of their ends for a variance of one, of each kind: of a counter for
        each rad (or m) that it counted, rad; across for each m of the way, m; of the turn for each rad, rad
    spare (M - 1, k) : what counters say beyond what any motion would have them say, rad or m: zero where they
        agree; of as many as there are inputs, always
    spare_slopes (M - 1, k, k) : d of it for a relative change of each counter
    astray (M - 1, n_p - 3) : how far own joints turned otherwise than they follow by the platform's inputs,
    rad;
        of hitches, since steering joints turn as they are told
    counted (M - 1, k) : how far they counted to and fro, rad or m
    regular (M - 1,) : how regular the counters' rows were at worst, 0 where motions are not determined
    """

    motions: Array
    slopes: Array
    noise: Array
    spare: Array
    spare_slopes: Array
    astray: Array
    counted: Array
    regular: Array


@compiled
def disagreement(
    counted: Counted, own: Array, ahead: Array, by: Array, up: Array, spare: Array, P: Array
) -> None:
    """Adds to spare (k,) what no inputs would have counters count, of `by` (k,), and gives P (k, k), its
    derivative in these; with the own joints half of the way from `own` to `ahead`, and inputs up (p,) of
    them."""
    k, p = by.shape[0], up.shape[0]
    C, B = scratch((k, p)), scratch((3, p))
    counted_inputs(counted, own, 0.5, ahead, C, B)
    count = 0
    for j in range(p):
        if counted.steered[j] < 0:
            count += 1
    J, L, Q = scratch((count, k)), scratch((count, count)), scratch((count, k))
    scales, order, left = scratch(count), integer_scratch(count), scratch(k)
    row = 0
    for j in range(p):
        if counted.steered[j] < 0:
            scales[row] = 1.0
            for i in range(k):
                J[row, i] = C[i, j]
            row += 1
    orthonormal_rows(J, scales, order, L, Q)
    for i in range(k):
        left[i] = by[i]
        for j in range(p):
            if counted.steered[j] >= 0:
                left[i] -= C[i, j] * up[j]
        for j in range(k):
            P[i, j] = 1.0 if i == j else 0.0
            for row in range(count):
                P[i, j] -= Q[row, i] * Q[row, j]
    for i in range(k):
        for j in range(k):
            spare[i] += P[i, j] * left[j]


@compiled
def follow_counters(
    integers: Integers,
    floats: Array,
    counts: Array,
    own: Array,
    looks: Integers,
    motions: Array,
    slopes: Array,
    noise: Array,
    spare: Array,
    spare_slopes: Array,
    astray: Array,
    gone: Array,
    regular: Array,
    whole: int,
    sides: int,
) -> None:
    """`Stretches` between the rows `looks` (M,) of counters (N, k) and own joints (N, n_p - 3), all linear
    between rows; the record lies at the blocks' beginning. Noise and slopes are empty where it is not whole
    (0), spare, its slopes and astray where nothing beside motions is asked for (0)."""
    counted = views(Counted, integers, floats, 0)
    k, joints, p = counts.shape[1], own.shape[1], counted.steered.shape[0]
    by, begin, end, up = scratch(k), scratch(joints), scratch(joints), scratch(p)
    twist, turned, pose, step = scratch(3), scratch((3, k)), scratch(3), scratch(3)
    G, A, J, Q = scratch((3, 3)), scratch((3, 3)), scratch((3, k)), scratch((9, 3))
    qp, H, H_q = scratch(joints + 3), scratch((joints + 3, p)), scratch((joints + 3, p, joints + 3))
    carried, rows, over, P = scratch((3, k)), scratch((3, 3)), scratch(k), scratch((k, k))
    inputs = 0
    for j in range(p):
        if counted.steered[j] < 0:
            inputs += 1
    for m in range(looks.shape[0] - 1):
        clear(pose)
        clear(J)
        clear(Q)
        clear(over)
        regular[m] = math.inf
        if sides == 1:
            for j in range(joints):
                astray[m, j] = own[int(looks[m + 1]), j] - own[int(looks[m]), j]
        for c in range(k):
            gone[m, c] = 0.0
        if whole == 1 and sides == 1:
            for c in range(k):
                for j in range(k):
                    spare_slopes[m, c, j] = 0.0
        for n in range(int(looks[m]), int(looks[m + 1])):
            for c in range(k):
                by[c] = counts[n + 1, c] - counts[n, c]
            for j in range(joints):
                begin[j], end[j] = own[n, j], own[n + 1, j]
            regular[m] = min(regular[m], counted_motion(counted, begin, end, by, up, twist, turned))
            for c in range(k):
                gone[m, c] += abs(by[c])
            if joints > 0 and sides == 1:
                clear(qp)
                clear(H)
                clear(H_q)
                for j in range(joints):
                    qp[3 + j] = 0.5 * (begin[j] + end[j])
                call_platform(counted.platform, qp, counted.parameters, H, H_q)
                for j in range(joints):
                    for i in range(p):
                        astray[m, j] -= H[3 + j, i] * up[i]
            if k > inputs and sides == 1:
                disagreement(counted, begin, end, by, up, over, P)
                if whole == 1:
                    for c in range(k):
                        for j in range(k):
                            spare_slopes[m, c, j] += P[c, j] * by[j]
            right_jacobian_planar(twist, step, G)
            compose_planar(pose, step)
            if whole == 0:
                continue
            inverse_adjoint_planar(step, A)
            for i in range(3):
                for c in range(k):
                    carried[i, c] = 0.0
                    for j in range(3):
                        carried[i, c] += A[i, j] * J[j, c]
            for i in range(3):  # the slopes of the step's end, of its counters
                for c in range(k):
                    J[i, c] = 0.0
                    for j in range(3):
                        J[i, c] += G[i, j] * turned[j, c]
            for kind in range(3):
                part = view(Q, 9 * kind, (3, 3))
                for i in range(3):
                    for j in range(3):
                        rows[i, j] = 0.0
                        for h in range(3):
                            rows[i, j] += A[i, h] * part[h, j]
                for i in range(3):
                    for j in range(3):
                        part[i, j] = 0.0
                        for h in range(3):
                            part[i, j] += rows[i, h] * A[j, h]
                        for c in range(k):
                            if kind == COUNTERS:
                                part[i, j] += J[i, c] * abs(by[c]) * J[j, c]
            for i in range(3):
                for j in range(3):
                    Q[3 * ACROSS + i, j] += G[i, 1] * G[j, 1] * math.hypot(twist[0], twist[1])
                    Q[3 * TURNS + i, j] += G[i, 2] * G[j, 2] * abs(twist[2])
                for c in range(k):
                    J[i, c] = carried[i, c] + J[i, c] * by[c]
        for i in range(3):
            motions[m, i] = pose[i]
            if whole == 1:
                for c in range(k):
                    slopes[m, i, c] = J[i, c]
                for kind in range(3):
                    for j in range(3):
                        noise[m, kind, i, j] = Q[3 * kind + i, j]
        if sides == 1:
            for c in range(k):
                spare[m, c] = over[c]


_FLAT, _ROWS = float64[::1], float64[:, ::1]
FOLLOW = void(
    *(int64[::1], _FLAT, _ROWS, _ROWS, int64[::1], _ROWS, float64[:, :, ::1], float64[:, :, :, ::1]),
    *(_ROWS, float64[:, :, ::1], _ROWS, _ROWS, _FLAT, int64, int64),
)


def steps_between(at: Array) -> Integers:
    """Into how many steps each stretch between times (M,), s, is cut: (M - 1,)."""
    return np.maximum(np.ceil(np.diff(at) / LONGEST - 1e-3).astype(np.int64), 1)


def stretches(
    record: Counted,
    t: Array,
    counts: Array,
    own: Array,
    at: Array,
    steps: Integers | None = None,
    whole: bool = True,
    sides: bool = True,
) -> Stretches:
    """See `follow_counters`: between the times `at` (M,), s, by readings at t (N,), each stretch in equal
    steps of at most `LONGEST`; with slopes and noise where it is whole, and with what is known beside
    motions. NaN where the counters do not determine the motion."""
    memory = Memory()
    memory.add(record)
    looks = np.concatenate([[0], np.cumsum(steps_between(at) if steps is None else steps)])
    grid = np.interp(np.arange(looks[-1] + 1), looks, at)
    many, k = len(at) - 1, counts.shape[1]
    some, beside = many * whole, many * sides
    made = Stretches(
        *(np.zeros((many, 3)), np.zeros((some, 3, k)), np.zeros((some, 3, 3, 3))),
        *(np.zeros((beside, k)), np.zeros((some * sides, k, k))),
        *(np.zeros((beside, own.shape[1])), np.zeros((many, k)), np.zeros(many)),
    )
    tables = [at_times(grid, t, table) for table in (counts, own)]
    checked_by_caller(follow_counters, FOLLOW)(
        *memory.blocks(), *tables, looks, *made, int(whole), int(sides)
    )
    return made


def at_times(grid: Array, t: Array, table: Array) -> Array:
    """Columns of a table (N, k) of times t (N,) at others (G,): (G, k)."""
    made = np.empty((len(grid), table.shape[1]))
    for i, column in enumerate(table.T):
        made[:, i] = np.interp(grid, t, column)
    return made
