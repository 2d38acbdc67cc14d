"""The floor: cases 1 and 4 of the paper written out by hand, for nothing else.

Pinocchio's calls and one compiled function with every number of the case in its text. What
`benchmarks/step.py` compares the toolkit with, and an independent check of its answers.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numba
import numpy as np
import pinocchio as pin

PI = math.pi


@numba.njit(cache=True)
def _circle(t: float) -> tuple[float, float, float, float]:
    phase = 0.08 * PI * t + 1.25 * PI
    c, s = math.cos(phase), math.sin(phase)
    return 2.0 + 3.0 * c, 2.0 + 3.0 * s, -0.24 * PI * s, 0.24 * PI * c


@numba.njit(cache=True)
def case1_rg(t, q, p, Jf, partition, u):
    gx, gy, gx_t, gy_t = _circle(t)
    rx, ry = gx_t + gx - p[0], gy_t + gy - p[1]
    c, s = math.cos(q[2]), math.sin(q[2])
    j0x, j0y = Jf[0, 0] * c + Jf[0, 1] * s, Jf[1, 0] * c + Jf[1, 1] * s
    first = q[2] + q[3] + q[4] - 0.5 * PI
    h = (0.0, first, first + q[3] - 0.25 * PI, first)
    d12 = j0x * Jf[1, 2] - j0y * Jf[0, 2]
    d13 = j0x * Jf[1, 3] - j0y * Jf[0, 3]
    if partition[0] == 0:
        partition[0] = 3 if abs(d13) >= abs(d12) else 2
    if partition[0] == 3 and abs(d13) < 0.01 and abs(d12) > abs(d13):
        partition[0] = 2
    elif partition[0] == 2 and abs(d12) < 0.01 and abs(d13) > abs(d12):
        partition[0] = 3
    a = partition[0]
    b = 5 - a
    det = d13 if a == 3 else d12
    ax, ay = Jf[0, a], Jf[1, a]
    u[0] = (rx * ay - ry * ax) / det
    u[a - 1] = (j0x * ry - j0y * rx) / det
    for k in (b, 4):
        x0 = (Jf[0, k] * ay - Jf[1, k] * ax) / det
        x1 = (j0x * Jf[1, k] - j0y * Jf[0, k]) / det
        ub = -10.0 * (h[k - 1] - x0 * h[0] - x1 * h[a - 1])
        u[k - 1] = ub
        u[0] -= x0 * ub
        u[a - 1] -= x1 * ub


@numba.njit(cache=True)
def case1_pg(t, q, p, Jf, partition, u):
    gx, gy, gx_t, gy_t = _circle(t)
    c, s = math.cos(q[2]), math.sin(q[2])
    j0x, j0y = Jf[0, 0] * c + Jf[0, 1] * s, Jf[1, 0] * c + Jf[1, 1] * s
    first = q[2] + q[3] + q[4] - 0.5 * PI
    h1, h2, h3 = first, first + q[3] - 0.25 * PI, first
    rx = gx_t + gx - p[0] + 10.0 * (Jf[0, 2] * h1 + Jf[0, 3] * h2 + Jf[0, 4] * h3)
    ry = gy_t + gy - p[1] + 10.0 * (Jf[1, 2] * h1 + Jf[1, 3] * h2 + Jf[1, 4] * h3)
    a = j0x * j0x + Jf[0, 2] ** 2 + Jf[0, 3] ** 2 + Jf[0, 4] ** 2
    b = j0x * j0y + Jf[0, 2] * Jf[1, 2] + Jf[0, 3] * Jf[1, 3] + Jf[0, 4] * Jf[1, 4]
    d = j0y * j0y + Jf[1, 2] ** 2 + Jf[1, 3] ** 2 + Jf[1, 4] ** 2
    det = a * d - b * b
    lx, ly = (d * rx - b * ry) / det, (a * ry - b * rx) / det
    u[0] = j0x * lx + j0y * ly
    u[1] = Jf[0, 2] * lx + Jf[1, 2] * ly - 10.0 * h1
    u[2] = Jf[0, 3] * lx + Jf[1, 3] * ly - 10.0 * h2
    u[3] = Jf[0, 4] * lx + Jf[1, 4] * ly - 10.0 * h3


@numba.njit(cache=True)
def _cross(a, b):
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


@numba.njit(cache=True)
def _dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@numba.njit(cache=True)
def _reduced(t, q, p, Jf):
    gx, gy, gx_t, gy_t = _circle(t)
    rate = (gx_t + gx - p[0], gy_t + gy - p[1], 0.5 - p[2])
    c, s = math.cos(q[2]), math.sin(q[2])
    v = (Jf[0, 0] * c + Jf[0, 1] * s, Jf[1, 0] * c + Jf[1, 1] * s, Jf[2, 0] * c + Jf[2, 1] * s)
    return rate, v


@numba.njit(cache=True)
def _column(Jf, k):
    return (Jf[0, k], Jf[1, k], Jf[2, k])


@numba.njit(cache=True)
def case4_rg(t, q, p, Jf, partition, u):
    """The partition that the motion starts with, [v, omega, q2], by Cramer's rule."""
    rate, v = _reduced(t, q, p, Jf)
    w, q1, q2, q3 = _column(Jf, 2), _column(Jf, 3), _column(Jf, 4), _column(Jf, 5)
    r0, r1, r2 = _cross(w, q2), _cross(q2, v), _cross(v, w)
    det = _dot(v, r0)
    u[0], u[1], u[3] = _dot(r0, rate) / det, _dot(r1, rate) / det, _dot(r2, rate) / det
    h1, h3 = q[3], q[5] + 0.5 * PI
    ub = -10.0 * h1
    u[2] = ub
    u[0] -= _dot(r0, q1) / det * ub
    u[1] -= _dot(r1, q1) / det * ub
    u[3] -= _dot(r2, q1) / det * ub
    ub = -10.0 * h3
    u[4] = ub
    u[0] -= _dot(r0, q3) / det * ub
    u[1] -= _dot(r1, q3) / det * ub
    u[3] -= _dot(r2, q3) / det * ub


@numba.njit(cache=True)
def case4_pg(t, q, p, Jf, partition, u):
    rate, v = _reduced(t, q, p, Jf)
    h1, h3 = 10.0 * q[3], 10.0 * (q[5] + 0.5 * PI)
    x = rate[0] + Jf[0, 3] * h1 + Jf[0, 5] * h3
    y = rate[1] + Jf[1, 3] * h1 + Jf[1, 5] * h3
    z = rate[2] + Jf[2, 3] * h1 + Jf[2, 5] * h3
    a00, a01, a02 = v[0] * v[0], v[0] * v[1], v[0] * v[2]
    a11, a12, a22 = v[1] * v[1], v[1] * v[2], v[2] * v[2]
    for k in range(2, 6):
        a00 += Jf[0, k] * Jf[0, k]
        a01 += Jf[0, k] * Jf[1, k]
        a02 += Jf[0, k] * Jf[2, k]
        a11 += Jf[1, k] * Jf[1, k]
        a12 += Jf[1, k] * Jf[2, k]
        a22 += Jf[2, k] * Jf[2, k]
    l00 = math.sqrt(a00)
    l10, l20 = a01 / l00, a02 / l00
    l11 = math.sqrt(a11 - l10 * l10)
    l21 = (a12 - l20 * l10) / l11
    l22 = math.sqrt(a22 - l20 * l20 - l21 * l21)
    x /= l00
    y = (y - l10 * x) / l11
    z = (z - l20 * x - l21 * y) / l22
    z /= l22
    y = (y - l21 * z) / l11
    x = (x - l10 * y - l20 * z) / l00
    u[0] = v[0] * x + v[1] * y + v[2] * z
    for k in range(2, 6):
        u[k - 1] = Jf[0, k] * x + Jf[1, k] * y + Jf[2, k] * z
    u[2] -= h1
    u[4] -= h3


FLOORS = {(1, "rg"): case1_rg, (1, "pg"): case1_pg, (4, "rg"): case4_rg, (4, "pg"): case4_pg}


def floor_controller(case: int, resolver: str, model: pin.Model) -> Callable[[float, np.ndarray], np.ndarray]:
    """u = controller(t, q) of that case, by hand, on the model's frame `ee`."""
    data = model.createData()
    frame = model.getFrameId("ee")
    p = data.oMf[frame].translation
    by_hand = FLOORS[case, resolver]
    partition = np.zeros(1, dtype=np.int64)
    buffer = np.empty(model.nv - 1)
    jacobians, placement, frame_jacobian = (
        pin.computeJointJacobians,
        pin.updateFramePlacement,
        pin.getFrameJacobian,
    )
    axes = pin.LOCAL_WORLD_ALIGNED

    def controller(t: float, q: np.ndarray) -> np.ndarray:
        jacobians(model, data, q)
        placement(model, data, frame)
        by_hand(t, q, p, frame_jacobian(model, data, frame, axes), partition, buffer)
        return buffer.copy()

    return controller
