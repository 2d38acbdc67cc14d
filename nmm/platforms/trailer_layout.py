"""Trailers in a robot's file: hitches chained from the root's body, and the axles of what hangs on them."""

from __future__ import annotations

from typing import NamedTuple

from nmm.platforms.layout import Layout, Pivot
from nmm.platforms.measuring import (
    NEAR,
    check_axle,
    misfit,
    rolls_forward,
    same,
    say_pivots,
    say_wheels,
    symmetric_limit,
    wheels_on,
)


class MeasuredTrailer(NamedTuple):
    """As `Trailer`: lengths in m, angle in rad, None without a symmetric limit."""

    length: float
    hitch: float
    joint: str
    max_angle: float | None


def measure_trailers(layout: Layout, platform: str) -> list[MeasuredTrailer]:
    """The trailers of a file, from the tractor backwards.

    Raises
    ------
    InputError : see `Tractor.fit`
    """
    found: list[MeasuredTrailer] = []
    carrier, axle = "theta", 0.0
    while (pivot := _hitch_on(layout, platform, carrier)) is not None:
        length = _length(layout, platform, pivot)
        found.append(MeasuredTrailer(length, axle - pivot.x, pivot.joint, symmetric_limit(pivot)))
        carrier, axle = pivot.joint, -length
    if not found:
        expected = 'an upright joint on the root\'s body with "hitch" or "trailer" in its name'
        raise misfit(layout, platform, expected, "there is none", say_pivots(layout.pivots))
    check_axle(layout, platform)
    return found


def _hitch_on(layout: Layout, platform: str, carrier: str) -> Pivot | None:
    """The hitch behind one body, None behind the last."""
    named = [pivot for pivot in layout.pivots if pivot.carrier == carrier and pivot.hitches]
    if not named:
        return None
    found = say_pivots(named)
    if len(named) > 1:
        raise misfit(layout, platform, "at most one hitch on each body", f"{carrier} carries several", found)
    if abs(named[0].y) > NEAR:
        expected = "hitches midway between the wheels of the body in front"
        raise misfit(layout, platform, expected, f"{named[0].joint} is off the x axis", found)
    return named[0]


def _length(layout: Layout, platform: str, pivot: Pivot) -> float:
    """From the hitch to the trailer's axle, m."""
    wheels = wheels_on(layout, pivot.joint)
    wrong = None
    if not wheels:
        wrong = f"the trailer on {pivot.joint} has none"
    elif not all(rolls_forward(wheel) for wheel in wheels):
        wrong = f"those on {pivot.joint} do not all roll forward"
    elif not same(wheel.x for wheel in wheels):
        wrong = f"those on {pivot.joint} are on several axles"
    elif wheels[0].x >= -NEAR:
        wrong = f"those on {pivot.joint} are not behind it"
    if wrong is not None:
        expected = "each trailer to have wheels on one axle behind its hitch"
        raise misfit(layout, platform, expected, wrong, say_wheels(wheels))
    return -wheels[0].x
