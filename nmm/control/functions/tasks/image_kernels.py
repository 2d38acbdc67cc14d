"""Kernels of what a camera sees: points, their moments, a line, and how far ahead a point is."""

from __future__ import annotations

import math

from nmm.base.arrays import Array
from nmm.base.kernels.compiled import compiled, kernel, scratch
from nmm.base.kernels.records import FUNCTION, At, Frames, Rows
from nmm.base.kernels.rotations import transposed_times3


@compiled
def look_at(at: At, frames: Frames, rows: Rows, point: int) -> None:
    """A point in world axes, the rows 3 point to 3 point + 2, becomes P, as the frame sees it, in place:
    P = Rᵀ (p - c), Ṗ = Rᵀ (ṗ - ċ - ω × (p - c))."""
    slot, first = frames.slots[0], 3 * point
    frame = frames.placements[slot]
    d, x, seen = scratch(3), scratch(3), scratch(3)
    for i in range(3):
        d[i] = rows.value[first + i] - frame[i, 3]
    for column in range(-1, at.q.shape[0]):  # -1: the time
        if column < 0:
            for i in range(3):
                x[i] = rows.value_t[first + i]
        else:
            j = frames.jacobians[slot]
            wx, wy, wz = j[3, column], j[4, column], j[5, column]
            x[0] = rows.value_q[first, column] - j[0, column] - (wy * d[2] - wz * d[1])
            x[1] = rows.value_q[first + 1, column] - j[1, column] - (wz * d[0] - wx * d[2])
            x[2] = rows.value_q[first + 2, column] - j[2, column] - (wx * d[1] - wy * d[0])
        transposed_times3(frame, x, seen)
        for i in range(3):
            if column < 0:
                rows.value_t[first + i] = seen[i]
            else:
                rows.value_q[first + i, column] = seen[i]
    transposed_times3(frame, d, seen)
    for i in range(3):
        rows.value[first + i] = seen[i]


@kernel(FUNCTION)
def image_points(at: At, frames: Frames, numbers: Array, rows: Rows) -> None:
    """(fx X/Z + cx, fy Y/Z + cy) of each point, by the chain rule, in place: three rows a point become two;
    numbers = [fx, fy, cx, cy]. Behind the camera there is no picture: the values are not numbers."""
    for point in range(rows.value.shape[0] // 3):
        look_at(at, frames, rows, point)
        first, two = 3 * point, 2 * point
        Z = rows.value[first + 2]
        ahead = 1.0 / Z if Z > 0.0 else math.nan
        x, y = ahead * rows.value[first], ahead * rows.value[first + 1]
        fx, fy = numbers[0], numbers[1]
        dX, dY, dZ = rows.value_t[first], rows.value_t[first + 1], rows.value_t[first + 2]
        rows.value_t[two] = fx * (ahead * (dX - x * dZ))
        rows.value_t[two + 1] = fy * (ahead * (dY - y * dZ))
        for k in range(at.q.shape[0]):
            dX, dY, dZ = rows.value_q[first, k], rows.value_q[first + 1, k], rows.value_q[first + 2, k]
            rows.value_q[two, k] = fx * (ahead * (dX - x * dZ))
            rows.value_q[two + 1, k] = fy * (ahead * (dY - y * dZ))
        rows.value[two] = fx * x + numbers[2]
        rows.value[two + 1] = fy * y + numbers[3]


@kernel(FUNCTION)
def image_moments(at: At, frames: Frames, numbers: Array, rows: Rows) -> None:
    """The mean (x, y) of k points, of which two rows each are there, and log a, a² the mean square of their
    distance from it, by the chain rule, in place."""
    k = rows.value.shape[0] // 2
    mean, d = scratch(2), scratch(2)
    for i in range(2):
        mean[i] = 0.0
        for point in range(k):
            mean[i] += rows.value[2 * point + i] / k
    square = 0.0
    for row in range(2 * k):
        rows.value[row] -= mean[row % 2]
        square += rows.value[row] * rows.value[row] / k
    spread = square if square > 0.0 else math.nan  # points that coincide have no size
    for column in range(-1, at.q.shape[0]):  # -1: the time
        d[0], d[1], growth = 0.0, 0.0, 0.0
        for row in range(2 * k):
            rate = rows.value_t[row] if column < 0 else rows.value_q[row, column]
            d[row % 2] += rate / k
            growth += rows.value[row] * rate / (k * spread)
        if column < 0:
            rows.value_t[0], rows.value_t[1], rows.value_t[2] = d[0], d[1], growth
        else:
            rows.value_q[0, column], rows.value_q[1, column], rows.value_q[2, column] = d[0], d[1], growth
    rows.value[0], rows.value[1], rows.value[2] = mean[0], mean[1], 0.5 * math.log(spread)


@kernel(FUNCTION)
def log_depth(at: At, frames: Frames, numbers: Array, rows: Rows) -> None:
    """log Z, by the chain rule, in place: the first three rows hold the point."""
    look_at(at, frames, rows, 0)
    Z = rows.value[2]
    ahead = 1.0 / Z if Z > 0.0 else math.nan
    rows.value_t[0] = ahead * rows.value_t[2]
    for k in range(at.q.shape[0]):
        rows.value_q[0, k] = ahead * rows.value_q[2, k]
    rows.value[0] = math.log(Z) if Z > 0.0 else math.nan


@compiled
def picture(X: float, Y: float, Z: float, numbers: Array) -> tuple[float, float]:
    """The first two homogeneous coordinates of a point's picture; the third is Z."""
    return numbers[0] * X + numbers[2] * Z, numbers[1] * Y + numbers[3] * Z


@kernel(FUNCTION)
def image_line(at: At, frames: Frames, numbers: Array, rows: Rows) -> None:
    """(ρ, θ) of the line x cos θ + y sin θ = ρ through two points, by the chain rule, in place: six rows
    become two; numbers = [fx, fy, cx, cy]. With n = a × b of the points' homogeneous pictures, θ =
    atan2(n_y, n_x) and ρ = -n_z / |(n_x, n_y)|."""
    look_at(at, frames, rows, 0)
    look_at(at, frames, rows, 1)
    a3, b3 = rows.value[2], rows.value[5]
    a1, a2 = picture(rows.value[0], rows.value[1], a3, numbers)
    b1, b2 = picture(rows.value[3], rows.value[4], b3, numbers)
    n1, n2, n3 = a2 * b3 - a3 * b2, a3 * b1 - a1 * b3, a1 * b2 - a2 * b1
    square = n1 * n1 + n2 * n2
    seen = (a3 > 0.0 or b3 > 0.0) and square > 0.0
    size = math.sqrt(square) if seen else math.nan
    for k in range(-1, at.q.shape[0]):  # -1: the time
        d = scratch(6)
        for i in range(6):
            d[i] = rows.value_t[i] if k < 0 else rows.value_q[i, k]
        da3, db3 = d[2], d[5]
        da1, da2 = picture(d[0], d[1], da3, numbers)
        db1, db2 = picture(d[3], d[4], db3, numbers)
        dn1 = da2 * b3 + a2 * db3 - da3 * b2 - a3 * db2
        dn2 = da3 * b1 + a3 * db1 - da1 * b3 - a1 * db3
        dn3 = da1 * b2 + a1 * db2 - da2 * b1 - a2 * db1
        along = (n1 * dn1 + n2 * dn2) / size
        d_rho = (n3 * along / size - dn3) / size
        d_theta = (n1 * dn2 - n2 * dn1) / (size * size)
        if k < 0:
            rows.value_t[0], rows.value_t[1] = d_rho, d_theta
        else:
            rows.value_q[0, k], rows.value_q[1, k] = d_rho, d_theta
    rows.value[0] = -n3 / size
    rows.value[1] = math.atan2(n2, n1)
