"""A caster: a wheel that trails behind its swivel and turns it, because it does not slide sideways."""

from __future__ import annotations

import cmath
import math

# Largest turn (rad) and way (in trails) of a part of a step: the swivel then turns by less than half a turn.
_TURN, _WAY = 0.5, 3.0


def caster_step(angle: float, twist: tuple[float, float, float], trail: float) -> tuple[float, float]:
    """The swivel's angle (rad) after one second at a constant twist, and how far the wheel has rolled (m).

    With the pivot's velocity (v, w) along and across the direction in which the wheel rolls at angle 0, the
    body's turning rate Ω and the wheel's centre at `trail` from the pivot along that direction (negative:
    behind it), rolling without sideways slip says

        angle_dot = (v sin angle - w cos angle) / trail - Ω.

    For s = exp(j angle) that is a Riccati equation, s_dot = c2 s² + c1 s + c0 with constant coefficients: s
    is the quotient of two solutions of a linear one, and the way is a logarithm of the denominator.
    """
    v, w, turn = twist
    parts = math.ceil(max(abs(turn) / _TURN, math.hypot(v, w) / (abs(trail) * _WAY), 1.0))
    along, across, turn = v / trail / parts, w / trail / parts, turn / parts
    c2, c1, c0 = complex(along, -across) / 2.0, complex(0.0, -turn), -complex(along, across) / 2.0
    square = (along**2 + across**2 - turn**2) / 4.0
    kappa = math.sqrt(abs(square))
    if square > 0.0:
        grown, ratio = math.cosh(kappa), math.tanh(kappa) / kappa if kappa > 1e-8 else 1.0
    else:
        grown, ratio = math.cos(kappa), math.tan(kappa) / kappa if kappa > 1e-8 else 1.0
    way = 0.0
    for _ in range(parts):
        s = cmath.exp(1j * angle)
        numerator = s + ratio * (0.5 * c1 * s + c0)
        denominator = 1.0 - ratio * (c2 * s + 0.5 * c1)
        change = cmath.phase(numerator / denominator / s)
        angle += change
        way -= 2.0 * trail * math.log(grown * abs(denominator))
    return angle, way
