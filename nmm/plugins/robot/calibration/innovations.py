"""What a reference says beside the stretches before it: innovations of a Kalman filter, with their slopes.

A filter goes along the drive, predicts each look of the reference by the wheels, and corrects itself by it.
What it did not predict, divided by its standard deviation, is white noise of variance one for the right
numbers of the robot, whatever the wheels' noise and the reference's are: least squares of it are a maximum of
the likelihood. (L. Ljung, System Identification, 2nd ed., 1999, section 7.2; prediction errors.)

The error of a pose is along the body's axes: T = T_believed exp(error).
"""

from __future__ import annotations

import math

from nmm.base.arrays import Array, Integers
from nmm.base.kernels.compiled import clear, compiled, scratch
from nmm.base.kernels.planar_motions import compose_planar, exp_planar, inverse_adjoint_planar
from nmm.base.kernels.signatures import float64, int64, void

#: What is done with a look of the reference.
LEFT_OUT, TAKEN, BEGINS = range(3)
#: Variance of a heading that is only guessed where a drive begins, rad².
GUESSED = 1.0


@compiled
def begin_at(z: Array, R: Array, mount: Array, columns: Integers, X: Array, P: Array, D: Array) -> None:
    """The pose X (3,) at a look z (3,) of which all is taken, its covariance P (3, 3) and slopes D (3, n).

    R (3,) : variances of z; the look is of a point at `mount` (3,), whose numbers are the parameters
    `columns` (3,), -1 where they are held."""
    X[2] = z[2] - mount[2]
    c, s = math.cos(X[2]), math.sin(X[2])
    X[0] = z[0] - c * mount[0] + s * mount[1]
    X[1] = z[1] - s * mount[0] - c * mount[1]
    clear(P)
    clear(D)
    P[0, 0] = R[0] + R[2] * mount[1] * mount[1]
    P[1, 1] = R[1] + R[2] * mount[0] * mount[0]
    P[0, 1] = P[1, 0] = -R[2] * mount[0] * mount[1]
    P[0, 2] = P[2, 0] = R[2] * mount[1]
    P[1, 2] = P[2, 1] = -R[2] * mount[0]
    P[2, 2] = R[2]
    for i in range(2):
        if columns[i] >= 0:
            D[i, columns[i]] = -1.0
    if columns[2] >= 0:
        D[0, columns[2]], D[1, columns[2]], D[2, columns[2]] = -mount[1], mount[0], -1.0


@compiled
def go_on(motion: Array, J: Array, Q: Array, X: Array, P: Array, D: Array) -> None:
    """X, P and D after a stretch: its motion (3,), slopes J (3, n) and noise Q (3, 3) at its end."""
    n, A, rows = D.shape[1], scratch((3, 3)), scratch((3, 3))
    inverse_adjoint_planar(motion, A)
    compose_planar(X, motion)
    for i in range(3):
        for j in range(3):
            rows[i, j] = A[i, 0] * P[0, j] + A[i, 1] * P[1, j] + A[i, 2] * P[2, j]
    for i in range(3):
        for j in range(3):
            P[i, j] = rows[i, 0] * A[j, 0] + rows[i, 1] * A[j, 1] + rows[i, 2] * A[j, 2] + Q[i, j]
    for j in range(n):
        a, b, c = D[0, j], D[1, j], D[2, j]
        for i in range(3):
            D[i, j] = A[i, 0] * a + A[i, 1] * b + A[i, 2] * c + J[i, j]


@compiled
def innovations(
    motions: Array,
    slopes: Array,
    noise: Array,
    variances: Array,
    z: Array,
    taken: Integers,
    R: Array,
    mount: Array,
    columns: Integers,
    w: Array,
    S: Array,
    W: Array,
    poses: Array,
) -> None:
    """w (M, r), divided by their standard deviations, and W (M, r, n), their slopes; S (M, r) : variances
    before this; zeros, zeros and ones where nothing is predicted; poses (M, 3) : believed after each look.

    motions (M - 1, 3), slopes (M - 1, 3, n) : of the stretches
    noise (M - 1, K, 3, 3) : of the stretches, for variances of one; variances (K,) : of each kind of noise
    z (M, 3) : x, y, heading, of which r = 2 or 3 were seen; with 2 the heading is a guess where a drive
    begins taken (M,) : LEFT_OUT, whose innovations are told but not taken, TAKEN, or BEGINS
    R (M, 3) : variances of z, along the body's axes; mount (3,), columns (3,) : see `begin_at`
    """
    r, n = w.shape[1], W.shape[2]
    X, P, D, h, K = scratch(3), scratch((3, 3)), scratch((3, n)), scratch(3), scratch(3)
    nu, slope, eps, step = scratch(3), scratch((3, n)), scratch(3), scratch(3)
    unused, first, spread = scratch((3, 3)), scratch(3), scratch(3)
    J, Q = scratch((3, n)), scratch((3, 3))
    clear(X)
    clear(P)
    clear(D)
    for m in range(z.shape[0]):
        if m > 0:
            for i in range(3):
                step[i] = motions[m - 1, i]
                for j in range(n):
                    J[i, j] = slopes[m - 1, i, j]
                for j in range(3):
                    Q[i, j] = 0.0
                    for kind in range(variances.shape[0]):
                        Q[i, j] += variances[kind] * noise[m - 1, kind, i, j]
            go_on(step, J, Q, X, P, D)
        for row in range(r):
            w[m, row], S[m, row] = 0.0, 1.0
            for j in range(n):
                W[m, row, j] = 0.0
        if taken[m] == BEGINS:
            for i in range(3):
                first[i], spread[i] = z[m, i], R[m, i]
            begin_at(first, spread, mount, columns, X, P, D)
            for i in range(3):
                poses[m, i] = X[i]
            continue
        c, s = math.cos(X[2]), math.sin(X[2])
        dx, dy = z[m, 0] - X[0], z[m, 1] - X[1]
        nu[0], nu[1] = c * dx + s * dy - mount[0], c * dy - s * dx - mount[1]
        turn = z[m, 2] - X[2] - mount[2]
        nu[2] = turn - 2.0 * math.pi * math.floor(turn / (2.0 * math.pi) + 0.5)
        clear(eps)
        for row in range(r):
            h[0], h[1], h[2] = (1.0 if row == 0 else 0.0), (1.0 if row == 1 else 0.0), 1.0
            if row < 2:
                h[2] = -mount[1] if row == 0 else mount[0]
            variance, value = R[m, row], nu[row]
            for i in range(3):
                K[i] = P[i, 0] * h[0] + P[i, 1] * h[1] + P[i, 2] * h[2]
                value -= h[i] * eps[i]
            for i in range(3):
                variance += h[i] * K[i]
            deviation = math.sqrt(variance)
            w[m, row], S[m, row] = value / deviation, variance
            for j in range(n):  # D goes on with the gains, so that it is that of the corrected pose
                slope[row, j] = -(h[0] * D[0, j] + h[1] * D[1, j] + h[2] * D[2, j])
                if columns[row] == j:
                    slope[row, j] -= 1.0
                W[m, row, j] = slope[row, j] / deviation
            if taken[m] == LEFT_OUT:
                continue
            for i in range(3):
                eps[i] += K[i] / variance * value
                for j in range(n):
                    D[i, j] += K[i] / variance * slope[row, j]
            for i in range(3):
                for j in range(3):
                    P[i, j] -= K[i] * K[j] / variance
        exp_planar(eps, step, unused)
        compose_planar(X, step)
        for i in range(3):
            poses[m, i] = X[i]


_FLAT, _ROWS, _CUBE = float64[::1], float64[:, ::1], float64[:, :, ::1]
#: The signature of `innovations`, for n >= 1.
INNOVATIONS = void(
    *(_ROWS, _CUBE, float64[:, :, :, ::1], _FLAT, _ROWS, int64[::1], _ROWS, _FLAT, int64[::1]),
    *(_ROWS, _ROWS, _CUBE, _ROWS),
)
