"""G of a platform described by its wheels: M(qp) qp_dot = [0; up], so G = M⁻¹ [0; I], and its derivative.

M holds the no-slip rows of the wheels, then the rows that keep axes concurrent, then the rows of the inputs.
None depends on x and y, and theta only turns the main body's axes: M is written in those axes, and G turned
at the end.
∂G/∂q_k = -M⁻¹ (∂M/∂q_k) G.

The packed parameters begin with the offsets of these sections, a line each with as many numbers as named:

- BODIES: carrier, x, y: the bodies by number, the main one (0) first; body b is turned by coordinate 2 + b
- TERMS: row, body, x, y, direction, weight: adds weight times the velocity, along a direction, of a point
- RATES: row, coordinate: the row is that coordinate's rate
- CLOSURES: row, three axes: the three wheels' axes stay concurrent
- COMMON: row, sign, length, x, y, two axes: see `CommonSpeed`

An axis is given by: coordinate of its pivot (-1 without), pivot x, y, heading.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from nmm.base.arrays import Array
from nmm.base.kernels.compiled import (
    PLATFORM,
    clear,
    compiled,
    inlined,
    integer_scratch,
    kernel,
    scratch,
    view,
)
from nmm.base.kernels.linear_algebra import dot, eliminate
from nmm.base.kernels.rotations import cross3

BODIES, TERMS, RATES, CLOSURES, COMMON, SIZE = range(6)
_AXIS = 4

#: Ratio of M's pivots below which its rows are taken as dependent.
SINGULAR = 1e-9
#: Sideways speed of a wheel, as a share of the platform's, above which axes contradict each other. The stages
#: of an integrator's step leave concurrent axes by the step's square: those are not to be refused.
CONTRADICTION = 1e-3


def pack(sections: Sequence[Array]) -> Array:
    """[offsets of the sections and of the end, section after section], all flattened."""
    flat = [section.ravel() for section in sections]
    ends = len(flat) + 1 + np.cumsum([0, *(len(section) for section in flat)])
    return np.concatenate([ends.astype(np.float64), *flat])


@inlined
def section(packed: Array, number: int) -> tuple[int, tuple[int]]:
    """Where one section begins, and its extents, for `view`."""
    first = int(packed[number])
    return first, (int(packed[number + 1]) - first,)


@compiled
def terms(qp: Array, bodies: Array, listed: Array, M: Array, M_q: Array) -> None:
    """Add the rows that are velocities of points; M_q[r, c, k] = dM[r, c] / dq of body k."""
    count = bodies.size // 3
    frame = scratch((count, 3))  # origin and angle in the main body's axes
    clear(frame)
    for b in range(1, count):
        carrier = int(bodies[3 * b])
        cosine, sine = math.cos(frame[carrier, 2]), math.sin(frame[carrier, 2])
        x, y = bodies[3 * b + 1], bodies[3 * b + 2]
        frame[b, 0] = frame[carrier, 0] + cosine * x - sine * y
        frame[b, 1] = frame[carrier, 1] + sine * x + cosine * y
        frame[b, 2] = frame[carrier, 2] + qp[2 + b]
    for line in range(listed.size // 6):
        row = int(listed[6 * line])
        body = int(listed[6 * line + 1])
        x, y = listed[6 * line + 2], listed[6 * line + 3]
        angle = frame[body, 2]
        px = frame[body, 0] + math.cos(angle) * x - math.sin(angle) * y
        py = frame[body, 1] + math.sin(angle) * x + math.cos(angle) * y
        dx = listed[6 * line + 5] * math.cos(angle + listed[6 * line + 4])
        dy = listed[6 * line + 5] * math.sin(angle + listed[6 * line + 4])
        M[row, 0] += dx
        M[row, 1] += dy
        M[row, 2] += px * dy - py * dx
        j = body
        while j > 0:
            ox, oy = frame[j, 0], frame[j, 1]
            M[row, 2 + j] += (px - ox) * dy - (py - oy) * dx
            # Joint j turns point and direction together about its origin: levers to what lies before change.
            M_q[row, 0, j] -= dy
            M_q[row, 1, j] += dx
            M_q[row, 2, j] += ox * dx + oy * dy
            i = int(bodies[3 * j])
            while i > 0:
                M_q[row, 2 + i, j] += (ox - frame[i, 0]) * dx + (oy - frame[i, 1]) * dy
                i = int(bodies[3 * i])
            j = int(bodies[3 * j])


@compiled
def no_slip_line(qp: Array, axis: Array, x: float, y: float, length: float, lines: Array) -> int:
    """Writes to lines (2, 3) a wheel's no-slip row over its carrier's (v_x, v_y, length ω) at (x, y) and its
    derivative in the pivot's angle, whose coordinate is returned. The second derivative is minus the row."""
    coordinate = int(axis[0])
    heading = axis[3]
    if coordinate >= 0:
        heading += qp[coordinate]
    cosine, sine = math.cos(heading), math.sin(heading)
    x, y = axis[1] - x, axis[2] - y
    lines[0, 0], lines[0, 1], lines[0, 2] = -sine, cosine, (x * cosine + y * sine) / length
    lines[1, 0], lines[1, 1], lines[1, 2] = -cosine, -sine, (y * cosine - x * sine) / length
    return coordinate


@compiled
def closures(qp: Array, listed: Array, length: float, M: Array, M_q: Array) -> float:
    """Rows dD/dt = 0 for D = (c₁ x c₂) . c₃ of three axes' lines: at D = 0 they meet or are parallel. Returns
    the largest D / ‖c₁ x c₂‖: a third wheel's sideways speed where two determine the motion."""
    lines = scratch((3, 2, 3))
    coordinates = integer_scratch(3)
    product = scratch(3)
    worst = 0.0
    width = 1 + 3 * _AXIS
    for line in range(listed.size // width):
        row = int(listed[width * line])
        for a in range(3):
            first = width * line + 1 + a * _AXIS
            axis = listed[first : first + _AXIS]
            coordinates[a] = no_slip_line(qp, axis, 0.0, 0.0, length, lines[a])
        cross3(lines[0, 0], lines[1, 0], product)
        share = abs(dot(product, lines[2, 0])) / math.sqrt(dot(product, product))
        if not share <= worst:  # a share that is no number counts
            worst = share
        for a in range(3):
            if coordinates[a] < 0:
                continue
            b, c = (a + 1) % 3, (a + 2) % 3
            cross3(lines[b, 0], lines[c, 0], product)
            M[row, coordinates[a]] += dot(product, lines[a, 1])
            M_q[row, coordinates[a], coordinates[a] - 2] -= dot(product, lines[a, 0])
            for turned, still in ((b, c), (c, b)):
                if coordinates[turned] >= 0:
                    cross3(lines[a, 1], lines[turned, 1], product)
                    sign = 1.0 if turned == b else -1.0
                    change = sign * dot(product, lines[still, 0])
                    M_q[row, coordinates[a], coordinates[turned] - 2] += change
    return worst


@compiled
def common_speeds(qp: Array, listed: Array, M: Array, M_q: Array) -> None:
    """Rows w over the twist at (x, y), w = ± c₁ x c₂ / ‖c₁ x c₂‖: orthogonal to both no-slip rows."""
    lines = scratch((2, 2, 3))
    coordinates = integer_scratch(2)
    w = scratch(3)
    change = scratch(3)
    width = 5 + 2 * _AXIS
    for line in range(listed.size // width):
        first = width * line
        row, sign, length = int(listed[first]), listed[first + 1], listed[first + 2]
        x, y = listed[first + 3], listed[first + 4]
        for a in range(2):
            axis = listed[first + 5 + a * _AXIS : first + 5 + (a + 1) * _AXIS]
            coordinates[a] = no_slip_line(qp, axis, x, y, length, lines[a])
        cross3(lines[0, 0], lines[1, 0], w)
        norm = sign * math.sqrt(dot(w, w))
        for i in range(3):
            w[i] /= norm
        M[row, 0], M[row, 1] = w[0], w[1]
        M[row, 2] = length * w[2] - y * w[0] + x * w[1]
        for a in range(2):
            if coordinates[a] < 0:
                continue
            cross3(lines[0, 1 - a], lines[1, a], change)
            along = dot(w, change)
            for i in range(3):
                change[i] = (change[i] - along * w[i]) / norm
            k = coordinates[a] - 2
            M_q[row, 0, k] += change[0]
            M_q[row, 1, k] += change[1]
            M_q[row, 2, k] += length * change[2] - y * change[0] + x * change[1]


@kernel(PLATFORM)
def wheeled(qp: Array, parameters: Array, G: Array, G_q: Array) -> None:
    """G = M⁻¹ [0; I] and its derivatives; not a number where M is singular or axes contradict each other."""
    n, p = G.shape
    M = scratch((n, 2 * n))  # [M I], which `eliminate` turns into [*, M⁻¹]
    M_q = scratch((n, n, n - 2))
    scales = scratch(n)
    clear(M)
    clear(M_q)
    bodies = view(parameters, *section(parameters, BODIES))
    velocities = view(parameters, *section(parameters, TERMS))
    rates = view(parameters, *section(parameters, RATES))
    concurrent = view(parameters, *section(parameters, CLOSURES))
    common = view(parameters, *section(parameters, COMMON))
    size = view(parameters, *section(parameters, SIZE))[0]
    terms(qp, bodies, velocities, M, M_q)
    for line in range(rates.size // 2):
        M[int(rates[2 * line]), int(rates[2 * line + 1])] = 1.0
    share = closures(qp, concurrent, size, M, M_q)
    common_speeds(qp, common, M, M_q)
    for i in range(n):
        M[i, n + i] = 1.0
        scales[i] = 1.0
    _, regular = eliminate(M, scales)
    if not (regular > SINGULAR and share <= CONTRADICTION):
        for i in range(n):
            for j in range(p):
                G[i, j] = math.nan
                for k in range(n):
                    G_q[i, j, k] = math.nan
        return
    for i in range(n):
        for j in range(p):
            G[i, j] = M[i, 2 * n - p + j]
    for k in range(1, n - 2):
        for j in range(p):
            for r in range(n):
                change = 0.0
                for c in range(n):
                    change += M_q[r, c, k] * G[c, j]
                if change != 0.0:
                    for i in range(n):
                        G_q[i, j, 2 + k] -= M[i, n + r] * change
    turn(math.cos(qp[2]), math.sin(qp[2]), G, G_q)


@compiled
def turn(cosine: float, sine: float, G: Array, G_q: Array) -> None:
    """From the main body's axes to the world's."""
    n, p = G.shape
    for j in range(p):
        forward, sideways = G[0, j], G[1, j]
        G[0, j] = cosine * forward - sine * sideways
        G[1, j] = sine * forward + cosine * sideways
        for k in range(3, n):
            forward, sideways = G_q[0, j, k], G_q[1, j, k]
            G_q[0, j, k] = cosine * forward - sine * sideways
            G_q[1, j, k] = sine * forward + cosine * sideways
        G_q[0, j, 2] = -G[1, j]
        G_q[1, j, 2] = G[0, j]
