"""What hitches say of a stretch: how much of its motion, by the counters, was slip, and what is left over.

A wheel that slips turns the robot otherwise than it counts, and hitches turn by what the robot does. How
far they turned otherwise than they follow by the counters, a = B e + v, tells of e, the error of the motion,
what is likely: Q B' (B Q B' + V)⁻¹ a (B. D. O. Anderson, J. B. Moore, Optimal Filtering, 1979, section 3.1).
What slips is taken as independent of what is counted, as where wheels turn as they are told.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from nmm.base.arrays import Array
from nmm.base.kernels.compiled import checked_by_caller, clear, compiled, scratch
from nmm.base.kernels.signatures import float64, void
from nmm.plugins.robot.calibration.sides import SideRows
from nmm.plugins.robot.calibration.stretches import COUNTERS, Stretches


class Slipping(NamedTuple):
    """What wheels that slip do in a drive's stretches, with a deviation of one of each counter for a rad (or
    m) of it: how far they move the end, moved (M - 1, 3, k), and turn the h hitches, turned (M - 1, h, k);
    and the noise of the ends, as in `Stretches`."""

    moved: Array
    turned: Array
    noise: Array


class ToldMotions(NamedTuple):
    """Of a drive's stretches, with what hitches say of them: motions (M - 1, 3), their slopes (M - 1, 3, f),
    noise (M - 1, K, 3, 3) for variances of one, variances (K,); and what hitches say besides."""

    motions: Array
    ends: Array
    noise: Array
    variances: Array
    beside: SideRows


def slipping(made: Stretches, turned: Array) -> Slipping:
    """Of hitches that are turned so far (M - 1, h, k) by a relative change of each counter."""
    of_one = np.asarray(1.0 / np.sqrt(np.where(made.counted > 0.0, made.counted, np.inf)))[:, np.newaxis]
    return Slipping(made.slopes * of_one, turned * of_one, made.noise)


@compiled
def correct(
    astray: Array,
    by: Array,
    moved: Array,
    turned: Array,
    noise: Array,
    variances: Array,
    own: float,
    motions: Array,
    ends: Array,
    Q: Array,
    over: Array,
    rows: Array,
    S: Array,
) -> None:
    """Corrects motions (M - 1, 3) and ends (M - 1, 3, f) by what hitches say; noise that is left, Q (M - 1,
    1, 3, 3); what hitches are astray beside what is likely, over (M - 1, h), and its slopes, rows (M - 1, h,
    f), over its deviation, and its variance, S (M - 1, h). The others are as `told_by_hitches` has them.

    Slips x (k,) of the wheels are found hitch by hitch, by a Kalman filter's corrections."""
    h, k, f = turned.shape[1], turned.shape[2], by.shape[2]
    deviation = math.sqrt(variances[COUNTERS])
    x, X, P, K = scratch(k), scratch((k, f)), scratch((k, k)), scratch(k)
    slope, step = scratch(f), scratch(3)
    for m in range(turned.shape[0]):
        clear(x)
        clear(X)
        for i in range(k):
            for j in range(k):
                P[i, j] = 1.0 if i == j else 0.0
        for row in range(h):
            S[m, row], value = own, astray[m, row]
            for i in range(f):
                slope[i] = by[m, row, i]
            for i in range(k):
                K[i], t = 0.0, deviation * turned[m, row, i]
                for j in range(k):
                    K[i] += P[i, j] * deviation * turned[m, row, j]
                S[m, row] += t * K[i]
                value -= t * x[i]
                for j in range(f):
                    slope[j] -= t * X[i, j]
            over[m, row] = value / math.sqrt(S[m, row])
            for j in range(f):
                rows[m, row, j] = slope[j] / math.sqrt(S[m, row])
            for i in range(k):
                gain = K[i] / S[m, row]
                x[i] += gain * value
                for j in range(f):
                    X[i, j] += gain * slope[j]
                for j in range(k):
                    P[i, j] -= gain * K[j]
        clear(step)
        for i in range(3):
            for n in range(k):
                step[i] += deviation * moved[m, i, n] * x[n]
                for j in range(f):
                    ends[m, i, j] += deviation * moved[m, i, n] * X[n, j]
        c, s = math.cos(motions[m, 2]), math.sin(motions[m, 2])
        motions[m, 0] += c * step[0] - s * step[1]
        motions[m, 1] += s * step[0] + c * step[1]
        motions[m, 2] += step[2]
        for i in range(3):
            for j in range(3):
                Q[m, 0, i, j] = 0.0
                for kind in range(variances.shape[0]):
                    Q[m, 0, i, j] += variances[kind] * noise[m, kind, i, j]
                for n in range(k):
                    for o in range(k):
                        known = (1.0 if n == o else 0.0) - P[n, o]
                        Q[m, 0, i, j] -= variances[COUNTERS] * moved[m, i, n] * known * moved[m, j, o]


_FLAT, _ROWS, _CUBE, _QUADS = float64[::1], float64[:, ::1], float64[:, :, ::1], float64[:, :, :, ::1]
CORRECT = void(
    *(_ROWS, _CUBE, _CUBE, _CUBE, _QUADS, _FLAT, float64),
    *(_ROWS, _CUBE, _QUADS, _ROWS, _CUBE, _ROWS),
)


def told_by_hitches(
    motions: Array, ends: Array, astray: Array, by: Array, slips: Slipping, variances: Array, own: float
) -> ToldMotions:
    """Motions (M - 1, 3), with slopes of their ends (M - 1, 3, f), of a robot whose h hitches are astray by
    (M - 1, h), rad, with slopes (M - 1, h, f), turn by themselves with a variance of own, rad², each, and by
    wheels that slip, with noise of variances (K,)."""
    motions, ends, Q = motions.copy(), ends.copy(), np.empty((len(motions), 1, 3, 3))
    over, rows, S = np.empty_like(astray), np.empty_like(by), np.empty_like(astray)
    checked_by_caller(correct, CORRECT)(
        *(astray, by, slips.moved, slips.turned, slips.noise, variances, own),
        *(motions, ends, Q, over, rows, S),
    )
    flat = over.ravel(), rows.reshape(over.size, by.shape[2]), np.ones(over.size)
    return ToldMotions(motions, ends, Q, np.ones(1), SideRows(*flat, float(np.log(S).sum()), over.size))
