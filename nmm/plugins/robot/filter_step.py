"""An invariant Kalman filter on SE(2) x bias x scales: its state, and a prediction, as plain kernels.

The state is x (d,) = [x, y, theta, gyro bias, scales of the counters, scale of turns], of which the last two
may be left out (both, or the last), its error eps (d,) in

    T = T_believed exp(eps[:3]),    bias and scales = those believed + eps[3:],

the left-invariant error: along the axes of the body. Wheels and a gyro move T by T exp(xi), with noise along
these axes, so eps goes on by a matrix of xi alone, and what is known of a pose after turns that were not (a
banana in x and y) is a Gaussian of eps. A fix, T p + noise, is a left-invariant observation: seen from the
body that is believed, it depends on eps alone. (A landmark seen from the body would ask for the other error.)
Neither matrix depends on the heading that is believed, which is why it is not believed too soon.

Sources: A. Barrau, S. Bonnabel, The invariant extended Kalman filter as a stable observer, IEEE Trans.
Automatic Control 62(4), 2017; for carrying P over to the new estimate, J. Solà, Quaternion
kinematics for the error-state Kalman filter, 2017, section 6.3.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from nmm.base.arrays import Array
from nmm.base.kernels.compiled import clear, compiled, scratch
from nmm.base.kernels.planar_motions import (
    compose_planar,
    inverse_adjoint_planar,
    right_jacobian_planar,
)
from nmm.base.kernels.record_layout import Vector
from nmm.plugins.robot.counted_motion import Counted, counted_motion


class Noise(NamedTuple):
    """What a filter takes as noise.

    shares, spread (k,) : of each counter, the share of its turning that moves the platform, and the variance
        of its turning for each radian or m
    slip (3,) : variances along and across for each m of the way, m, and of the turn for each rad, rad
    gyro (2,) : variance of a turn for each second, rad²/s; of the walk of its bias, rad²/s³
    walks (2,) : variances of the walks of the counters' scales and of that of turns, 1/s
    """

    shares: Vector
    spread: Vector
    slip: Vector
    gyro: Vector
    walks: Vector


@compiled
def carry_over(x: Array, P: Array, eps: Array) -> None:
    """x (d,) goes on by eps (d,), and its covariance P (d, d) becomes that of the error to the new x."""
    d = x.shape[0]
    step, J, rows = scratch(3), scratch((3, 3)), scratch((3, d))
    right_jacobian_planar(eps, step, J)
    compose_planar(x, step)
    for i in range(3, d):
        x[i] += eps[i]
    replace_rows(J, P, rows)
    for i in range(3):
        for j in range(3):
            P[i, j] = rows[i, 0] * J[j, 0] + rows[i, 1] * J[j, 1] + rows[i, 2] * J[j, 2]
        for j in range(3, d):
            P[i, j] = P[j, i] = rows[i, j]


@compiled
def replace_rows(J: Array, P: Array, rows: Array) -> None:
    """rows (3, d) = J P, J (3, 3) or (3, d)."""
    for i in range(3):
        for j in range(P.shape[0]):
            rows[i, j] = 0.0
            for k in range(J.shape[1]):
                rows[i, j] += J[i, k] * P[k, j]


@compiled
def predict(
    counted: Counted,
    noise: Noise,
    dt: float,
    by: Array,
    own: Array,
    ahead: Array,
    rate: float,
    x: Array,
    P: Array,
    step: Array,
) -> None:
    """x (d,) and P (d, d) after dt, s, in which the counters counted by (k,), the platform's own joints went
    from `own` to `ahead` (n_p - 3,), and a gyro measured a mean rate, rad/s, NaN without; step (3,) : the
    motion.

    The gyro measures the turn of this step, which has wheels for a prior, and its bias: both learn from the
    difference before the pose goes on, so a robot that stands still shows its gyro's bias.
    """
    d, k, p = x.shape[0], by.shape[0], counted.steered.shape[0]
    turned, up, twist, slopes = scratch(k), scratch(p), scratch(3), scratch((3, k + 1))
    scaled = d > 4
    for c in range(k):
        turned[c] = noise.shares[c] * by[c] * (1.0 + x[4 + c] if scaled else 1.0)
    counted_motion(counted, own, ahead, turned, up, twist, slopes)
    for i in range(3):
        slopes[i, k] = 0.0
    if d > 4 + k:
        slopes[2, k] = twist[2]
        twist[2] *= 1.0 + x[4 + k]
        for c in range(k):
            slopes[2, c] *= 1.0 + x[4 + k]
    Q, eps, pull, shift = scratch((3, 3)), scratch(d), scratch(d), scratch(3)
    for i in range(3):
        for j in range(3):
            Q[i, j] = 0.0
            for c in range(k):
                share = noise.shares[c] * noise.shares[c] * noise.spread[c] * abs(by[c])
                Q[i, j] += slopes[i, c] * share * slopes[j, c]
        way = abs(twist[2]) if i == 2 else math.sqrt(twist[0] * twist[0] + twist[1] * twist[1])
        Q[i, i] += noise.slip[i] * way
    for c in range(k):  # from here on in the scales
        for i in range(3):
            slopes[i, c] *= noise.shares[c] * by[c]
    clear(eps)
    clear(pull)
    clear(shift)
    S = 0.0
    if not math.isnan(rate):
        for i in range(d):
            pull[i] = P[i, 3] * dt
            for c in range(d - 4):
                pull[i] += P[i, 4 + c] * slopes[2, c]
        S = Q[2, 2] + noise.gyro[0] * dt + dt * pull[3]
        for c in range(d - 4):
            S += slopes[2, c] * pull[4 + c]
        residual = (rate - x[3]) * dt - twist[2]
        for i in range(d):
            pull[i] /= S
            eps[i] = pull[i] * residual
        for i in range(3):
            shift[i] = Q[i, 2] / S
            twist[i] += shift[i] * residual
            for c in range(d - 4):
                twist[i] += slopes[i, c] * eps[4 + c]
    A, Ad, J, G, rows = scratch((3, d)), scratch((3, 3)), scratch((3, 3)), scratch((3, 3)), scratch((3, d))
    right_jacobian_planar(eps, step, J)
    compose_planar(x, step)
    right_jacobian_planar(twist, step, G)
    inverse_adjoint_planar(step, Ad)
    compose_planar(x, step)
    clear(A)
    for i in range(3):
        for j in range(3):
            for m in range(3):
                A[i, j] += Ad[i, m] * J[m, j]
        for c in range(d - 4):
            for m in range(3):
                A[i, 4 + c] += G[i, m] * slopes[m, c]
    replace_rows(A, P, rows)
    for i in range(3):
        for j in range(3):
            P[i, j] = 0.0
            for m in range(d):
                P[i, j] += rows[i, m] * A[j, m]
            for m in range(3):
                for n in range(3):
                    P[i, j] += G[i, m] * Q[m, n] * G[j, n]
        for j in range(3, d):
            P[i, j] = P[j, i] = rows[i, j]
    if S > 0.0:
        for i in range(3, d):
            x[i] += eps[i]
        for i in range(3):
            rows[i, 0] = 0.0
            for m in range(d):
                rows[i, 0] += A[i, m] * pull[m]
            for m in range(3):
                rows[i, 0] += G[i, m] * shift[m]
        for i in range(3):
            pull[i] = rows[i, 0]
        for i in range(d):
            for j in range(d):
                P[i, j] -= pull[i] * S * pull[j]
    P[3, 3] += noise.gyro[1] * dt
    for i in range(4, d):
        P[i, i] += noise.walks[0 if i < 4 + k else 1] * dt
