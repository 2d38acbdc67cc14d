"""The last steps and fixes of a filter in rings, so that a fix that comes late is taken where it belongs, and
what came after it again: the same operations as if it had come in time."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from nmm.base.arrays import Array, Integers
from nmm.base.kernels.compiled import compiled, scratch, view
from nmm.base.kernels.linear_algebra import copied
from nmm.base.kernels.planar_motions import compose_planar
from nmm.base.kernels.record_layout import (
    Blocks,
    Cell,
    IntegerCell,
    IntegerVector,
    Matrices,
    Matrix,
    Memory,
    Vector,
    views,
)
from nmm.base.kernels.signatures import boolean, float64, int64
from nmm.plugins.robot.counted_motion import Counted
from nmm.plugins.robot.filter_fix import correct
from nmm.plugins.robot.filter_step import Noise, predict

#: What became of a fix: `pose_filter.OUTCOMES` has the words.
WAITING, USED, OUTLIER, LATE, EARLY, CROWDED, INVALID = range(7)
#: A covariance's halves may differ by such a share of a variance.
SYMMETRIC = 1e-9


class Steps(NamedTuple):
    """A ring of N steps, one of them spare: from `start` to `end` (N,), s, the counters counted `by` (N, k);
    at the end the own joints are `ahead` (N, n_p - 3); mean gyro `rate` (N,), NaN without; x (N, d), P
    (N, d, d) at the end."""

    start: Vector
    end: Vector
    by: Matrix
    ahead: Matrix
    rate: Vector
    x: Matrix
    P: Matrices


class Fixes(NamedTuple):
    """M places of fixes: see `correct`; square (M,) : the innovation squared; order (M,) : places by time."""

    t: Vector
    y: Matrix
    covariance: Matrices
    at: Matrix
    square: Vector
    rows: IntegerVector
    outcome: IntegerVector
    order: IntegerVector


class History(NamedTuple):
    """A filter in memory. gates (2,) : of positions, and of those with a heading; delay : s; odom (3,) : the
    motions of all steps as they were first taken; newest, stored : of the steps; fixed : fixes in `order`;
    outliers : in a row, the last of the fixes whose places are free again."""

    counted: Counted
    noise: Noise
    steps: Steps
    fixes: Fixes
    gates: Vector
    delay: Cell
    odom: Vector
    newest: IntegerCell
    stored: IntegerCell
    fixed: IntegerCell
    outliers: IntegerCell


def new_history(
    counted: Counted, noise: Noise, gates: Array, delay: float, sizes: tuple[int, int, int], odom: Array
) -> Blocks:
    """The blocks of a history with room for steps and fixes, and d numbers of the state (`sizes`)."""
    steps, places, d = sizes
    steps += 1  # what is stored stays while the next step is tried
    k, joints = counted.sources.shape[0], max(counted.coordinates - 3, 0)
    memory = Memory()
    memory.add(
        History(
            counted,
            noise,
            Steps(
                *(np.zeros(steps), np.zeros(steps), np.zeros((steps, k)), np.zeros((steps, joints))),
                *(np.zeros(steps), np.zeros((steps, d)), np.zeros((steps, d, d))),
            ),
            Fixes(
                *(np.zeros(places), np.zeros((places, 3)), np.zeros((places, 3, 3)), np.zeros((places, 2))),
                np.zeros(places),
                *(np.zeros(places, np.int64), np.zeros(places, np.int64), np.arange(places, dtype=np.int64)),
            ),
            *(gates, np.array(delay), odom, np.array(0), np.array(1), np.array(0), np.array(0)),
        )
    )
    return memory.blocks()


@compiled
def take_step(history: History, k: int, previous: int, odom: Array) -> None:
    """Take the step k of the ring, and the fixes in it, from where the step `previous` ended; odom (3,) goes
    on, too."""
    steps, fixes = history.steps, history.fixes
    d = steps.x.shape[1]
    x, P = view(steps.x, k * d, (d,)), view(steps.P, k * d * d, (d, d))
    copied(view(steps.x, previous * d, (d,)), x)
    copied(view(steps.P, previous * d * d, (d * d,)), view(steps.P, k * d * d, (d * d,)))
    start, lasts, share = steps.start[k], steps.end[k] - steps.start[k], 0.0
    for n in range(history.fixed[()]):
        fix = int(fixes.order[n])
        if fixes.t[fix] <= start:
            continue
        if fixes.t[fix] > steps.end[k]:
            break
        until = (fixes.t[fix] - start) / lasts
        if until > share:
            take_part(history, k, previous, share, until, x, P, odom)
            share = until
        rows = int(fixes.rows[fix])
        gate = history.gates[rows - 2]
        square = correct(rows, fixes.y[fix], fixes.covariance[fix], fixes.at[fix], gate, x, P)
        fixes.square[fix] = square
        fixes.outcome[fix] = USED if square <= gate else OUTLIER
    if share < 1.0:
        take_part(history, k, previous, share, 1.0, x, P, odom)


@compiled
def take_part(
    history: History, k: int, previous: int, since: float, until: float, x: Array, P: Array, odom: Array
) -> None:
    """x (d,), P (d, d) and odom (3,) after the part of the step k between two shares of it."""
    steps = history.steps
    counters, joints = steps.by.shape[1], steps.ahead.shape[1]
    by, own, ahead, step = scratch(counters), scratch(joints), scratch(joints), scratch(3)
    for c in range(counters):
        by[c] = (until - since) * steps.by[k, c]
    for j in range(joints):
        first, way = steps.ahead[previous, j], steps.ahead[k, j] - steps.ahead[previous, j]
        own[j], ahead[j] = first + since * way, first + until * way
    dt = (until - since) * (steps.end[k] - steps.start[k])
    predict(history.counted, history.noise, dt, by, own, ahead, steps.rate[k], x, P, step)
    compose_planar(odom, step)


@compiled
def advance(integers: Integers, floats: Array, t: float, by: Array, ahead: Array, rate: float) -> bool:
    """A new step until t, s, with the fixes that waited for it; False, and nothing is changed, for numbers
    that are not finite, or lead to such."""
    for c in range(by.shape[0]):
        if not math.isfinite(by[c]):
            return False
    for j in range(ahead.shape[0]):
        if not math.isfinite(ahead[j]):
            return False
    history = views(History, integers, floats, 0)
    steps = history.steps
    previous = int(history.newest[()])
    k = (previous + 1) % steps.end.shape[0]
    steps.start[k], steps.end[k], steps.rate[k] = steps.end[previous], t, rate
    copied(by, steps.by[k])
    copied(ahead, steps.ahead[k])
    odom = scratch(3)
    copied(history.odom, odom)
    take_step(history, k, previous, odom)
    for i in range(steps.x.shape[1]):
        if not (math.isfinite(steps.x[k, i]) and math.isfinite(steps.P[k, i, i])):
            for fix in range(history.fixes.t.shape[0]):
                if history.fixes.t[fix] > steps.end[previous]:
                    history.fixes.outcome[fix] = WAITING
            return False
    copied(odom, history.odom)
    history.newest[()] = k
    history.stored[()] = min(history.stored[()] + 1, steps.end.shape[0] - 1)
    return True


@compiled
def is_fix(y: Array, R: Array, at: Array) -> bool:
    """Whether all is finite, and R, (2, 2) or (3, 3), symmetric and positive definite."""
    rows, largest = y.shape[0], 0.0
    for i in range(rows):
        if not (math.isfinite(y[i]) and R[i, i] > 0.0):
            return False
        largest = max(largest, R[i, i])
    for i in range(rows):
        for j in range(rows):
            if not (math.isfinite(R[i, j]) and abs(R[i, j] - R[j, i]) <= SYMMETRIC * largest):
                return False
    minor = R[0, 0] * R[1, 1] - R[0, 1] * R[1, 0]
    if not (minor > 0.0 and math.isfinite(at[0]) and math.isfinite(at[1])):
        return False
    if rows == 2:
        return True
    first = R[2, 0] * (R[0, 1] * R[1, 2] - R[0, 2] * R[1, 1])
    return first - R[2, 1] * (R[0, 0] * R[1, 2] - R[0, 2] * R[1, 0]) + R[2, 2] * minor > 0.0


@compiled
def add_fix(integers: Integers, floats: Array, t: float, y: Array, covariance: Array, at: Array) -> int:
    """What becomes of a fix (2,) or (3,) of time t, s; the steps since then are taken again."""
    if not is_fix(y, covariance, at):
        return INVALID
    history = views(History, integers, floats, 0)
    steps, fixes = history.steps, history.fixes
    count, newest = steps.end.shape[0], int(history.newest[()])
    oldest = (newest - int(history.stored[()]) + 1) % count
    if not math.isfinite(t):
        return INVALID
    if not t > steps.end[oldest] or t < steps.end[newest] - history.delay[()]:
        return LATE
    if t > steps.end[newest] + history.delay[()]:
        return EARLY
    recent = steps_since(history, steps.end[newest] - history.delay[()])
    forget_fixes(history, steps.end[(newest - recent) % count])
    last = int(history.fixed[()])
    if last == fixes.t.shape[0]:
        return CROWDED
    fix = int(fixes.order[last])  # the places behind the last are free
    rows = y.shape[0]
    fixes.t[fix], fixes.rows[fix], fixes.outcome[fix] = t, rows, WAITING
    copied(at, fixes.at[fix])
    for i in range(3):
        fixes.y[fix, i] = y[i] if i < rows else 0.0
        for j in range(3):
            fixes.covariance[fix, i, j] = covariance[i, j] if i < rows and j < rows else 0.0
    while last > 0 and fixes.t[int(fixes.order[last - 1])] > t:
        fixes.order[last] = fixes.order[last - 1]
        last -= 1
    fixes.order[last] = fix
    history.fixed[()] += 1
    unused = scratch(3)
    for i in range(3):
        unused[i] = 0.0
    for back in range(steps_since(history, t) - 1, -1, -1):
        k = (newest - back) % count
        take_step(history, k, (k - 1) % count, unused)
    return int(fixes.outcome[fix])


@compiled
def steps_since(history: History, t: float) -> int:
    """How many of the newest steps end at a time t, s, or later; what the oldest began from is none."""
    steps, many = history.steps, 0
    count, newest = steps.end.shape[0], int(history.newest[()])
    while many < history.stored[()] - 1 and steps.end[(newest - many) % count] >= t:
        many += 1
    return many


@compiled
def forget_fixes(history: History, before: float) -> None:
    """Free the places of fixes until a time, s, which no step will ask for again."""
    fixes = history.fixes
    old, last = 0, int(history.fixed[()])
    while old < last and fixes.t[int(fixes.order[old])] <= before:
        old += 1
    for _ in range(old):
        first = fixes.order[0]
        outcome = int(fixes.outcome[int(first)])
        if outcome == USED:
            history.outliers[()] = 0
        elif outcome == OUTLIER:
            history.outliers[()] += 1
        for n in range(last - 1):
            fixes.order[n] = fixes.order[n + 1]
        fixes.order[last - 1] = first
        last -= 1
    history.fixed[()] = last


_FLAT = float64[::1]
ADVANCE = boolean(int64[::1], _FLAT, float64, _FLAT, _FLAT, float64)
ADD_FIX = int64(int64[::1], _FLAT, float64, _FLAT, float64[:, ::1], _FLAT)
