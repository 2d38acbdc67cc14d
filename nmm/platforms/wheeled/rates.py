"""How fast the wheels of a platform spin and turn when it moves: from the rolling alone."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

from nmm.arrays import Array, scalar
from nmm.errors import expect_known
from nmm.platforms.wheeled.descriptions import CasterWheel, SteeredWheel, WheelDescription
from nmm.platforms.wheeled.geometry import Bodies, Term, rolling_term


class WheelRate(NamedTuple):
    """Spin about the wheel's axis, and turn of its pivot relative to the carrier (0 without), rad/s.

    Examples
    --------
    >>> sides = [nmm.FixedWheel(name, 0.0, y, radius=0.1) for name, y in (("left", 0.3), ("right", -0.3))]
    >>> platform = nmm.WheeledPlatform(sides)
    >>> rate = platform.wheel_rates([0, 0, 0], [1.0, 0.0])["left"]
    >>> isinstance(rate, nmm.WheelRate), round(rate.spin, 6), rate.turn
    (True, 10.0, 0.0)
    """

    spin: float
    turn: float


def wheel_rates(
    bodies: Bodies, wheels: Sequence[WheelDescription], qp: Array, qp_dot: Array, swivels: Mapping[str, float]
) -> dict[str, WheelRate]:
    """The rates of every wheel; `swivels` are the casters' angles now (rad), zero for those not named."""
    casters = [wheel.name for wheel in wheels if isinstance(wheel, CasterWheel)]
    for name in swivels:
        expect_known("caster", name, casters, "swivels")
    found = {}
    for wheel in wheels:
        if isinstance(wheel, CasterWheel):
            angle = scalar(swivels.get(wheel.name, 0.0), f"swivel of {wheel.name}")
            found[wheel.name] = _caster(bodies, wheel, qp, qp_dot, angle)
            continue
        spin = float(bodies.row([rolling_term(bodies, wheel)], qp) @ qp_dot)
        turn = qp_dot[2 + bodies.number(wheel.joint)] if isinstance(wheel, SteeredWheel) else 0.0
        found[wheel.name] = WheelRate(spin, float(turn))
    return found


def _caster(bodies: Bodies, wheel: CasterWheel, qp: Array, qp_dot: Array, angle: float) -> WheelRate:
    """The pivot's velocity along the heading rolls the wheel, across it swings the trail.

    The wheel's centre is at pivot - trail t, so its sideways speed n·v - trail (Ω + turn) is zero when
    turn = n·v / trail - Ω, with Ω the carrier's own rate.
    """
    pivot = bodies.contact(wheel, angle)
    sideways = Term(pivot.body, pivot.point, pivot.direction + math.pi / 2)
    along, across = (float(bodies.row([term], qp) @ qp_dot) for term in (pivot, sideways))
    carrier = sum(float(qp_dot[2 + body]) for body in bodies.chain(pivot.body))
    return WheelRate(along / wheel.radius, across / wheel.trail - carrier)
