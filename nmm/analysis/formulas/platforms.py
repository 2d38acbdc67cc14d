"""G of the platforms with a name, as trigonometric polynomials."""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction
from typing import Any

from nmm.analysis.formulas.expansion import Expansion, Ring
from nmm.analysis.formulas.geometry import Geometry
from nmm.errors import InputError
from nmm.platforms import (
    Car,
    DifferentialDrive,
    Fixed,
    FrontDriveCar,
    Mecanum,
    Omnidirectional,
    Tractor,
    Unicycle,
)
from nmm.platforms.base import Platform

#: G times one factor a column, and these factors.
Columns = tuple[list[list[Expansion]], list[Expansion]]


def platform_columns(platform: Platform, geometry: Geometry) -> Columns:
    """The rows of G (n_p, p), each column multiplied by a common denominator, and the denominators (p).

    Lengths are divided by as they are: a denominator is what may vanish, such as cos(steering).

    Raises
    ------
    InputError : a platform whose formula is not here
    """
    for kind, build in _FORMULAS.items():
        if type(platform) is kind:
            return build(platform, geometry)
    known = ", ".join(kind.name for kind in _FORMULAS)
    raise InputError(
        f"symbolic: no formula for G of the platform {platform.name!r}; there are {known} "
        "(the numeric analysis takes every platform)"
    )


def _unicycle(platform: Platform, geometry: Geometry) -> Columns:
    ring = geometry.ring
    c, s, zero, one = *_heading(ring), ring.number(0), ring.number(1)
    return [[c, zero], [s, zero], [zero, one]], [one, one]


def _differential(platform: DifferentialDrive, geometry: Geometry) -> Columns:
    ring = geometry.ring
    (c, s), one = _heading(ring), ring.number(1)
    r = geometry.length(platform.radius, "r")
    turn = r * geometry.inverse(platform.track, "b")
    along, across = ((r * part).scaled(Fraction(1, 2)) for part in (c, s))
    return [[along, along], [across, across], [-turn, turn]], [one, one]


def _omnidirectional(platform: Platform, geometry: Geometry) -> Columns:
    ring = geometry.ring
    c, s, zero, one = *_heading(ring), ring.number(0), ring.number(1)
    return [[c, -s, zero], [s, c, zero], [zero, zero, one]], [one, one, one]


def _mecanum(platform: Mecanum, geometry: Geometry) -> Columns:
    ring = geometry.ring
    c, s, zero, one = *_heading(ring), ring.number(0), ring.number(1)
    r = geometry.length(platform.radius, "r")
    turn = r * geometry.inverse((platform.length + platform.width) / 2.0, "k")
    if "k" in geometry.values:
        geometry.notes.append("k is half the sum of the mecanum wheels' length and width")
    return [[r * c, -(r * s), zero], [r * s, r * c, zero], [zero, zero, turn]], [one, one, one]


def _car(platform: Car, geometry: Geometry) -> Columns:
    ring = geometry.ring
    c, s, zero, one = *_heading(ring), ring.number(0), ring.number(1)
    steering = {ring.variable(platform.steering, True): 1}
    across = ring.cos(steering)
    turn = ring.sin(steering) * geometry.inverse(platform.wheelbase, "L")
    return [[across * c, zero], [across * s, zero], [turn, zero], [zero, one]], [across, one]


def _front_drive_car(platform: FrontDriveCar, geometry: Geometry) -> Columns:
    ring = geometry.ring
    c, s, zero, one = *_heading(ring), ring.number(0), ring.number(1)
    steering = {ring.variable(platform.steering, True): 1}
    along = ring.cos(steering)
    turn = ring.sin(steering) * geometry.inverse(platform.wheelbase, "L")
    return [[along * c, zero], [along * s, zero], [turn, zero], [zero, one]], [one, one]


def _tractor(platform: Tractor, geometry: Geometry) -> Columns:
    """From body to body: ω' = -(v sin b + h ω cos b) / l, v' = v cos b - h ω sin b, b_dot = ω' - ω."""
    ring = geometry.ring
    c, s, zero, one = *_heading(ring), ring.number(0), ring.number(1)
    rows = [[c, zero], [s, zero], [zero, one]]
    v, w = [one, zero], [zero, one]
    for i, trailer in enumerate(platform.trailers, 1):
        # L and H with the trailer's number; L alone is the only one's.
        number = str(i) if len(platform.trailers) > 1 else ""
        angle = {ring.variable(trailer.joint, True): 1}
        cb, sb = ring.cos(angle), ring.sin(angle)
        h = geometry.length(trailer.hitch, f"H{number}")
        over = geometry.inverse(trailer.length, f"L{number}")
        behind = [-(over * (x * sb + h * y * cb)) for x, y in zip(v, w, strict=True)]
        v = [x * cb - h * y * sb for x, y in zip(v, w, strict=True)]
        rows.append([new - old for new, old in zip(behind, w, strict=True)])
        w = behind
    return rows, [one, one]


def _fixed(platform: Platform, geometry: Geometry) -> Columns:
    return [], []


def _heading(ring: Ring) -> tuple[Expansion, Expansion]:
    theta = {ring.variable("theta", True): 1}
    return ring.cos(theta), ring.sin(theta)


#: Each takes platforms of its own kind.
_FORMULAS: dict[type[Platform], Callable[[Any, Geometry], Columns]] = {
    Unicycle: _unicycle,
    DifferentialDrive: _differential,
    Car: _car,
    FrontDriveCar: _front_drive_car,
    Tractor: _tractor,
    Omnidirectional: _omnidirectional,
    Mecanum: _mecanum,
    Fixed: _fixed,
}
