"""G of the platforms with a name, as trigonometric polynomials."""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction
from typing import Any

from nmm.analysis.symbolic_expansion import Expansion, Ring
from nmm.analysis.symbolic_geometry import Geometry
from nmm.errors import InputError
from nmm.platforms import Car, DifferentialDrive, Fixed, FrontDriveCar, Omnidirectional, Unicycle
from nmm.platforms.base import Platform

#: G times one factor a column, and these factors.
Columns = tuple[list[list[Expansion]], list[Expansion]]


def platform_columns(platform: Platform, geometry: Geometry) -> Columns:
    """The rows of G (n_p, p), each column multiplied by a common denominator, and the denominators (p).

    Raises
    ------
    InputError : a platform whose formula is not here
    """
    for kind, build in _FORMULAS.items():
        if type(platform) is kind:
            return build(platform, geometry)
    known = ", ".join(kind.name for kind in _FORMULAS)
    raise InputError(f"symbolic: no formula for the platform {platform.name}; there are {known}")


def _unicycle(platform: Platform, geometry: Geometry) -> Columns:
    ring = geometry.ring
    c, s, zero, one = *_heading(ring), ring.number(0), ring.number(1)
    return [[c, zero], [s, zero], [zero, one]], [one, one]


def _differential(platform: DifferentialDrive, geometry: Geometry) -> Columns:
    ring = geometry.ring
    c, s = _heading(ring)
    half = geometry.length(platform.radius, "r").scaled(Fraction(1, 2))
    # Both columns times the track b: r b c / 2, r b s / 2, -+r.
    b = geometry.length(platform.track, "b")
    along, across, turn = half * b * c, half * b * s, half + half
    return [[along, along], [across, across], [-turn, turn]], [b, b]


def _omnidirectional(platform: Platform, geometry: Geometry) -> Columns:
    ring = geometry.ring
    c, s, zero, one = *_heading(ring), ring.number(0), ring.number(1)
    return [[c, -s, zero], [s, c, zero], [zero, zero, one]], [one, one, one]


def _car(platform: Car, geometry: Geometry) -> Columns:
    ring = geometry.ring
    c, s, zero, one = *_heading(ring), ring.number(0), ring.number(1)
    steering = {ring.variable(platform.steering, True): 1}
    L = geometry.length(platform.wheelbase, "L")
    across = L * ring.cos(steering)
    rows = [[across * c, zero], [across * s, zero], [ring.sin(steering), zero], [zero, one]]
    return rows, [across, one]


def _front_drive_car(platform: FrontDriveCar, geometry: Geometry) -> Columns:
    ring = geometry.ring
    c, s, zero, one = *_heading(ring), ring.number(0), ring.number(1)
    steering = {ring.variable(platform.steering, True): 1}
    L = geometry.length(platform.wheelbase, "L")
    along = L * ring.cos(steering)
    return [[along * c, zero], [along * s, zero], [ring.sin(steering), zero], [zero, one]], [L, one]


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
    Omnidirectional: _omnidirectional,
    Fixed: _fixed,
}
