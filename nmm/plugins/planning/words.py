"""The shortest ways of a car from one pose to another, compiled: words of arcs and straight lines.

J. A. Reeds and L. A. Shepp, Optimal paths for a car that goes both forwards and backwards, Pacific Journal of
Mathematics 145 (1990), in the numbering of their equations; L. E. Dubins, On curves of minimal length,
American Journal of Mathematics 79 (1957), for one that does not reverse. Lengths are in turning radii, from
the origin with heading 0.
"""

import math

from nmm.base.arrays import Array
from nmm.base.kernels.compiled import compiled, scratch

#: A word has at most this many parts.
PARTS = 5
LEFT, STRAIGHT, RIGHT = 1.0, 0.0, -1.0
#: Parts this short, in radii, are none: a length that should be 0 is not refused for its sign.
SHORT = 1e-10
#: Words whose lengths differ by less are equally long, in radii; so are sums of roots.
ALIKE, ROOTS = 1e-9, 1e-6
#: A turn that is so little short of a whole one is none: two arcs that touch leave roots of rounding in a
#: line between.
NONE = 1e-7


@compiled
def wrapped(angle: float) -> float:
    """The angle in (-π, π]."""
    turned = angle - 2.0 * math.pi * math.floor(angle / (2.0 * math.pi))
    return turned - 2.0 * math.pi if turned > math.pi else turned


@compiled
def take(
    word: Array, best: Array, way: tuple[float, float], turns: tuple[float, ...], parts: tuple[float, ...]
) -> None:
    """Make a word the best one where it is the shortest so far. way: the signs of time and of turning in
    which it was found; best (2,) : its length, and the sum of the roots of its parts'; word (5, 2) : turn and
    length of its parts.

    Of words that are equally long the one whose parts are less alike is the best, from either of its ends."""
    total, roots = 0.0, 0.0
    for part in parts:
        total += abs(part)
        roots += math.sqrt(abs(part))
    if total < best[0] - ALIKE or (total <= best[0] + ALIKE and roots < best[1] - ROOTS):
        best[0], best[1] = total, roots
        for i in range(PARTS):
            word[i, 0] = turns[i] * way[1]
            word[i, 1] = parts[i] * way[0]


@compiled
def tau_omega(u: float, v: float, xi: float, eta: float, phi: float) -> tuple[float, float]:
    """The outer arcs of four arcs, by the two inner ones (eqs. 8.7 and 8.8)."""
    delta = wrapped(u - v)
    A, B = math.sin(u) - math.sin(delta), math.cos(u) - math.cos(delta) - 1.0
    t = math.atan2(eta * A - xi * B, xi * A + eta * B)
    if 2.0 * (math.cos(delta) - math.cos(v) - math.cos(u)) + 3.0 < 0.0:
        t += math.pi
    tau = wrapped(t)
    return tau, wrapped(tau - u + v - phi)


@compiled
def with_straight(x: float, y: float, phi: float, way: tuple[float, float], word: Array, best: Array) -> None:
    """Arc, line, arc (8.1, 8.2), and with a quarter of a turn backwards at both ends (8.11)."""
    low = -SHORT
    xi, eta = x - math.sin(phi), y - 1.0 + math.cos(phi)
    t = math.atan2(eta, xi)
    v = wrapped(phi - t)
    if t >= low and v >= low:
        take(word, best, way, (LEFT, STRAIGHT, LEFT, 0.0, 0.0), (t, math.hypot(xi, eta), v, 0.0, 0.0))
    xi, eta = x + math.sin(phi), y - 1.0 - math.cos(phi)
    square, angle = xi * xi + eta * eta, math.atan2(eta, xi)
    if square >= 4.0:
        u = math.sqrt(square - 4.0)
        t = wrapped(angle + math.atan2(2.0, u))
        v = wrapped(t - phi)
        if t >= low and v >= low:
            take(word, best, way, (LEFT, STRAIGHT, RIGHT, 0.0, 0.0), (t, u, v, 0.0, 0.0))
        u = 4.0 - u
        if u <= -low:
            t = wrapped(math.atan2((4.0 - u) * xi - 2.0 * eta, -2.0 * xi + (u - 4.0) * eta))
            v = wrapped(t - phi)
            if t >= low and v >= low:
                quarter = -0.5 * math.pi
                turns = (LEFT, RIGHT, STRAIGHT, LEFT, RIGHT)
                take(word, best, way, turns, (t, quarter, u, quarter, v))


@compiled
def of_arcs(x: float, y: float, phi: float, way: tuple[float, float], word: Array, best: Array) -> None:
    """Four arcs (8.7, 8.8)."""
    low = -SHORT
    xi, eta = x + math.sin(phi), y - 1.0 - math.cos(phi)
    square = xi * xi + eta * eta
    turns = (LEFT, RIGHT, LEFT, RIGHT, 0.0)
    rho = 0.25 * (2.0 + math.sqrt(square))
    if rho <= 1.0:
        u = math.acos(rho)
        t, v = tau_omega(u, -u, xi, eta, phi)
        if t >= low and v <= -low:
            take(word, best, way, turns, (t, u, -u, v, 0.0))
    rho = (20.0 - square) / 16.0
    if 0.0 <= rho <= 1.0:
        u = -math.acos(rho)
        t, v = tau_omega(u, u, xi, eta, phi)
        if t >= low and v >= low:
            take(word, best, way, turns, (t, u, u, v, 0.0))


@compiled
def either_way(
    x: float, y: float, phi: float, way: tuple[float, float], back: bool, word: Array, best: Array
) -> None:
    """Three arcs (8.3, 8.4), and two with a quarter of a turn before a line and an arc (8.9, 8.10): each also
    from its end to its beginning (`back`)."""
    low = -SHORT
    xi, eta = x - math.sin(phi), y - 1.0 + math.cos(phi)
    rho, angle = math.hypot(xi, eta), math.atan2(eta, xi)
    if rho <= 4.0:
        u = -2.0 * math.asin(0.25 * rho)
        t = wrapped(angle + 0.5 * u + math.pi)
        v = wrapped(phi - t + u)
        if t >= low:
            t, v = (v, t) if back else (t, v)
            take(word, best, way, (LEFT, RIGHT, LEFT, 0.0, 0.0), (t, u, v, 0.0, 0.0))
    quarter = -0.5 * math.pi
    if rho >= 2.0:
        r = math.sqrt(rho * rho - 4.0)
        u = 2.0 - r
        t = wrapped(angle + math.atan2(r, -2.0))
        v = wrapped(phi + quarter - t)
        if t >= low and u <= -low and v <= -low:
            if back:
                take(word, best, way, (LEFT, STRAIGHT, RIGHT, LEFT, 0.0), (v, u, quarter, t, 0.0))
            else:
                take(word, best, way, (LEFT, RIGHT, STRAIGHT, LEFT, 0.0), (t, quarter, u, v, 0.0))
    xi, eta = x + math.sin(phi), y - 1.0 - math.cos(phi)
    rho, t = math.hypot(xi, eta), math.atan2(xi, -eta)
    if rho >= 2.0:
        u = 2.0 - rho
        v = wrapped(t - quarter - phi)
        if t >= low and u <= -low and v <= -low:
            if back:
                take(word, best, way, (RIGHT, STRAIGHT, RIGHT, LEFT, 0.0), (v, u, quarter, t, 0.0))
            else:
                take(word, best, way, (LEFT, RIGHT, STRAIGHT, RIGHT, 0.0), (t, quarter, u, v, 0.0))


@compiled
def reeds_shepp(x: float, y: float, phi: float, word: Array) -> float:
    """Write the shortest word to (x, y, phi), forwards and backwards, and return its length."""
    best = scratch(2)
    best[0] = best[1] = math.inf
    for time in (1.0, -1.0):
        for turn in (1.0, -1.0):
            a, b, c = time * x, turn * y, wrapped(time * turn * phi)
            way = (time, turn)
            with_straight(a, b, c, way, word, best)
            of_arcs(a, b, c, way, word, best)
            either_way(a, b, c, way, False, word, best)
            either_way(
                a * math.cos(c) + b * math.sin(c), a * math.sin(c) - b * math.cos(c), c, way, True, word, best
            )
    return best[0]


@compiled
def turned(angle: float) -> float:
    """The angle in [0, 2 π)."""
    remainder = angle - 2.0 * math.pi * math.floor(angle / (2.0 * math.pi))
    return 0.0 if 2.0 * math.pi - remainder < NONE else remainder


@compiled
def dubins(x: float, y: float, phi: float, word: Array) -> float:
    """Write the shortest word to (x, y, phi) that goes forwards, and return its length."""
    best = scratch(2)
    best[0] = best[1] = math.inf
    for turn in (1.0, -1.0):
        b, c, way = turn * y, turn * phi, (1.0, turn)
        xi, eta = x - math.sin(c), b - 1.0 + math.cos(c)
        rho = math.hypot(xi, eta)
        angle = math.atan2(eta, xi) if rho > NONE else 0.0
        t, v = turned(angle), turned(c - angle)
        take(word, best, way, (LEFT, STRAIGHT, LEFT, 0.0, 0.0), (t, rho, v, 0.0, 0.0))
        if rho <= 4.0:
            aside = math.acos(0.25 * rho)
            u = math.pi + 2.0 * aside
            t = turned(angle + aside + 0.5 * math.pi)
            v = turned(c - t + u)
            take(word, best, way, (LEFT, RIGHT, LEFT, 0.0, 0.0), (t, u, v, 0.0, 0.0))
        xi, eta = x + math.sin(c), b - 1.0 - math.cos(c)
        square = xi * xi + eta * eta
        if square >= 4.0 - NONE:
            u = math.sqrt(max(square - 4.0, 0.0))
            t = turned(math.atan2(eta, xi) + math.atan2(2.0, u))
            take(word, best, way, (LEFT, STRAIGHT, RIGHT, 0.0, 0.0), (t, u, turned(t - c), 0.0, 0.0))
    return best[0]
