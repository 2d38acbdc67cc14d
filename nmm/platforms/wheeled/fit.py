"""A robot's file read as a description by wheels: its upright joints' names say what they are."""

from __future__ import annotations

import cmath
import math

from nmm.errors import InputError
from nmm.platforms.layout import HITCHES, Layout, Pivot, RollingJoint
from nmm.platforms.wheeled.descriptions import (
    MAIN,
    CasterWheel,
    FixedWheel,
    Hitch,
    SteeredWheel,
    WheelDescription,
)

#: How far a wheel's centre may be from a pivot's axis and count as on it, m.
_ON_AXIS = 1e-6


def parts_from(layout: Layout) -> tuple[list[WheelDescription], list[Hitch]]:
    """Wheels and hitches of a robot's file.

    - a pivot with "hitch" or "trailer" in its joint's name: a hitch; wheels on its body are fixed
    - a pivot with "steer" in its joint's name: its wheels are steered
    - another pivot whose wheel is behind or before its axis: a caster
    - a wheel on the main body: fixed. Rollers are not to be seen in a file: describe omni wheels by hand

    Raises
    ------
    InputError : no wheels; a pivot of no kind; a caster or a steered wheel on another pivot
    """
    if not layout.wheels:
        raise InputError(f"{layout.robot}: no wheels found: a platform described by its wheels needs some")
    pivots = {pivot.joint: pivot for pivot in layout.pivots}
    carriers = {wheel.carrier for wheel in layout.wheels} | {pivot.carrier for pivot in layout.pivots}
    hitches = [
        Hitch(pivot.joint, pivot.x, pivot.y, pivot.carrier, pivot.lower, pivot.upper)
        for pivot in layout.pivots
        if pivot.hitches and pivot.joint in carriers
    ]
    bodies = {MAIN, *(hitch.joint for hitch in hitches)}
    return [_wheel(wheel, pivots, bodies, layout.robot) for wheel in layout.wheels], hitches


def _wheel(wheel: RollingJoint, pivots: dict[str, Pivot], bodies: set[str], robot: str) -> WheelDescription:
    if wheel.carrier in bodies:
        return FixedWheel(wheel.joint, wheel.x, wheel.y, wheel.radius, wheel.heading, wheel.carrier)
    if wheel.carrier not in pivots:
        raise InputError(f"{robot}: wheel {wheel.joint} hangs on {wheel.carrier}, which is no upright joint")
    pivot = pivots[wheel.carrier]
    if pivot.carrier not in bodies:
        raise InputError(
            f"{robot}: the pivot {pivot.joint} of wheel {wheel.joint} hangs on {pivot.carrier}: expected the "
            f"main body or a joint with one of {', '.join(HITCHES)} in its name"
        )
    place = complex(wheel.x, wheel.y)
    ahead = place * cmath.rect(1.0, -wheel.heading)  # in the wheel's own axes
    at = (wheel.joint, pivot.x, pivot.y, wheel.radius)
    if pivot.steers:
        return SteeredWheel(
            *at, wheel.heading, pivot.carrier, pivot.joint, -ahead.real, ahead.imag, pivot.lower, pivot.upper
        )
    if abs(place) < _ON_AXIS:
        raise InputError(
            f"{robot}: wheel {wheel.joint} is on the axis of {pivot.joint}, so it is no caster; name the "
            "joint with 'steer' if it is steered, or fix it"
        )
    if abs(ahead.imag) > 1e-3 * abs(place):
        raise InputError(
            f"{robot}: wheel {wheel.joint} is {ahead.imag:g} m beside the axis of {pivot.joint}: a caster's "
            "is behind or before it; name the joint with 'steer' if it is steered"
        )
    # A caster that looks backwards at zero has its trail ahead.
    return CasterWheel(*at, math.remainder(wheel.heading, 2 * math.pi), pivot.carrier, -ahead.real)
