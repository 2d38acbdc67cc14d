"""How far a platform moved while its wheels turned so far: the step of odometry, with its derivative."""

from __future__ import annotations

import math
from typing import NamedTuple

from nmm.base.arrays import Array, Integers
from nmm.base.kernels.compiled import call_platform, clear, compiled, integer_scratch, scratch, view
from nmm.base.kernels.linear_algebra import orthonormal_rows, pseudoinverse_transposed
from nmm.base.kernels.planar_motions import compose_planar, exp_planar, to_body_axes
from nmm.base.kernels.record_layout import IntegerVector, Matrix, Vector, views
from nmm.base.kernels.signatures import float64, int64, void
from nmm.model.robots.wheel_rates import rolling

#: Where Gauss and Legendre look between two readings, for two looks.
NODES = 0.5 - math.sqrt(3.0) / 6.0, 0.5 + math.sqrt(3.0) / 6.0
#: What the bracket of the two looks adds to their mean (Magnus expansion of fourth order).
BRACKET = math.sqrt(3.0) / 12.0


class Counted(NamedTuple):
    """What counts a platform's inputs.

    platform, parameters, coordinates : its kernel, numbers and n_p
    wheels : rows (w, 9) of `wheel_rates`
    sources (k,) : of each counter its row of `wheels`, or -1 - i for the input i
    steered (p,) : of each input the coordinate whose measured change it is, -1 where counters say it
    """

    platform: int
    parameters: Vector
    coordinates: int
    wheels: Matrix
    sources: IntegerVector
    steered: IntegerVector


@compiled
def counted_inputs(counted: Counted, own: Array, shift: float, ahead: Array, C: Array, B: Array) -> None:
    """What inputs (p,) add to the counters, C (k, p), and to the pose in the platform's own axes, B (3, p),
    with its own joints a share `shift` of the way from `own` to `ahead`, both (n_p - 3,)."""
    n_p, p = counted.coordinates, counted.steered.shape[0]
    qp, G, G_q = scratch(n_p), scratch((n_p, p)), scratch((n_p, p, n_p))
    clear(qp)
    clear(G)
    clear(G_q)
    clear(C)
    for i in range(n_p - 3):
        qp[3 + i] = own[i] + shift * (ahead[i] - own[i])
    call_platform(counted.platform, qp, counted.parameters, G, G_q)
    for i in range(3):
        for j in range(p):
            B[i, j] = G[i, j]
    for k in range(counted.sources.shape[0]):
        source = int(counted.sources[k])
        if source < 0:
            C[k, -1 - source] = 1.0
            continue
        wheel = counted.wheels[source]
        steer = int(wheel[4])
        x, y, theta, delta = rolling(wheel, 0.0, qp[steer] if steer >= 0 else 0.0)
        for j in range(p):
            C[k, j] = x * G[0, j] + y * G[1, j] + theta * G[2, j]
            if steer >= 0:
                C[k, j] += delta * G[steer, j]


@compiled
def counted_motion(
    counted: Counted, own: Array, ahead: Array, turned: Array, up: Array, twist: Array, slopes: Array
) -> float:
    """What moved the platform while its counters turned by (k,), rad or m, and its own joints went from `own`
    to `ahead`, (n_p - 3,).

    up (p,) : the inputs, for a unit of time; twist (3,) : their mean along the platform's axes on the way,
    whose exponential is the motion; slopes (3, k) : the twist's derivative in `turned`. Returns how regular
    the counters' rows are, 0 where they do not determine the inputs: the twist is NaN then.

    Inputs are taken as constant, so the error is of the fifth power of the step, and none where the own
    joints stand still. Source: S. Blanes, F. Casas, J. A. Oteo, J. Ros, The Magnus expansion, Physics Reports
    470, 2009.
    """
    k, p = turned.shape[0], up.shape[0]
    C, B, other_C, other_B = scratch((k, p)), scratch((3, p)), scratch((k, p)), scratch((3, p))
    counted_inputs(counted, own, NODES[0], ahead, C, B)
    counted_inputs(counted, own, NODES[1], ahead, other_C, other_B)
    count = 0
    for j in range(p):
        if counted.steered[j] < 0:
            count += 1
    J, L, Q, X = scratch((count, k)), scratch((count, count)), scratch((count, k)), scratch((count, k))
    scales, order, free = scratch(count), integer_scratch(count), integer_scratch(count)
    remaining, twist_up = scratch(k), scratch((3, p))
    row = 0
    for j in range(p):
        up[j] = 0.0
        c = int(counted.steered[j])
        if c >= 0:
            up[j] = ahead[c - 3] - own[c - 3]
            continue
        free[row], scales[row] = j, 1.0
        for i in range(k):
            J[row, i] = 0.5 * (C[i, j] + other_C[i, j])
        row += 1
    for i in range(k):
        remaining[i] = turned[i]
        for j in range(p):
            if counted.steered[j] >= 0:
                remaining[i] -= 0.5 * (C[i, j] + other_C[i, j]) * up[j]
    regular = orthonormal_rows(J, scales, order, L, Q)
    if count > 0 and not regular > 0.0:
        for i in range(3):
            twist[i] = math.nan
        return 0.0
    pseudoinverse_transposed(order, L, Q, X)
    for row in range(count):
        for i in range(k):
            up[free[row]] += X[row, i] * remaining[i]
    first, second = scratch(3), scratch(3)
    for i in range(3):
        first[i] = second[i] = 0.0
        for j in range(p):
            first[i] += B[i, j] * up[j]
            second[i] += other_B[i, j] * up[j]
    for i in range(3):
        twist[i] = 0.5 * (first[i] + second[i])
    twist[0] += BRACKET * (second[2] * first[1] - first[2] * second[1])
    twist[1] += BRACKET * (first[2] * second[0] - second[2] * first[0])
    for j in range(p):
        for i in range(3):
            twist_up[i, j] = 0.5 * (B[i, j] + other_B[i, j])
        twist_up[0, j] += BRACKET * (
            other_B[2, j] * first[1] + second[2] * B[1, j] - B[2, j] * second[1] - first[2] * other_B[1, j]
        )
        twist_up[1, j] += BRACKET * (
            B[2, j] * second[0] + first[2] * other_B[0, j] - other_B[2, j] * first[0] - second[2] * B[0, j]
        )
    for i in range(3):
        for c in range(k):
            slopes[i, c] = 0.0
            for row in range(count):
                slopes[i, c] += twist_up[i, free[row]] * X[row, c]
    return regular if count > 0 else 1.0


@compiled
def inputs_of_record(integers: Integers, floats: Array, own: Array, C: Array, B: Array) -> None:
    """`counted_inputs` of the record at the blocks' beginning, the joints at `own`."""
    counted_inputs(views(Counted, integers, floats, 0), own, 0.0, own, C, B)


@compiled
def move_by_record(
    integers: Integers,
    floats: Array,
    q: Array,
    ahead: Array,
    by: Array,
    shares: Array,
    spread: Array,
    up: Array,
    P: Array,
) -> float:
    """A step of odometry by the record at the blocks' beginning: the platform goes from q (n,) to the first
    three of `ahead` (n,), whose own joints are measured; its covariance P (3, 3) goes on.

    by, shares, spread (k,) : how far the counters went, the share of it that moves the platform, and its
    variance for each radian or m; up (at least p,) : the inputs. Returns as `counted_motion`.
    """
    counted = views(Counted, integers, floats, 0)
    joints, k = counted.coordinates - 3, by.shape[0]
    turned, twist, slopes = scratch(k), scratch(3), scratch((3, k))
    way, slope, noise, rows = scratch(3), scratch((3, 3)), scratch((3, k)), scratch((3, 3))
    for c in range(k):
        turned[c] = shares[c] * by[c]
    inputs = view(up, 0, (counted.steered.shape[0],))
    regular = counted_motion(
        counted, view(q, 3, (joints,)), view(ahead, 3, (joints,)), turned, inputs, twist, slopes
    )
    exp_planar(twist, way, slope)
    for i in range(3):
        ahead[i] = q[i]
    compose_planar(ahead, way)
    to_body_axes(-q[2], slope)
    for i in range(3):
        for c in range(k):
            noise[i, c] = 0.0
            for j in range(3):
                noise[i, c] += slope[i, j] * slopes[j, c] * shares[c]
    for j in range(3):  # P = F P F' + noise, F of the turn about where it was
        rows[0, j] = P[0, j] - (ahead[1] - q[1]) * P[2, j]
        rows[1, j] = P[1, j] + (ahead[0] - q[0]) * P[2, j]
        rows[2, j] = P[2, j]
    for i in range(3):
        P[i, 0] = rows[i, 0] - (ahead[1] - q[1]) * rows[i, 2]
        P[i, 1] = rows[i, 1] + (ahead[0] - q[0]) * rows[i, 2]
        P[i, 2] = rows[i, 2]
        for j in range(3):
            for c in range(k):
                P[i, j] += noise[i, c] * spread[c] * abs(by[c]) * noise[j, c]
    return regular


_FLAT, _ROWS = float64[::1], float64[:, ::1]
INPUTS = void(int64[::1], _FLAT, _FLAT, _ROWS, _ROWS)
MOVE = float64(int64[::1], _FLAT, _FLAT, _FLAT, _FLAT, _FLAT, _FLAT, _FLAT, _ROWS)
