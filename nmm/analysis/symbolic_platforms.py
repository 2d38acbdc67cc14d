"""G of the platforms with a name, as trigonometric polynomials."""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction

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


def _differential(platform: Platform, geometry: Geometry) -> Columns:
    assert isinstance(platform, DifferentialDrive)
    ring = geometry.ring
    c, s = _heading(ring)
    half = geometry.length(platform.radius, "r").scaled(Fraction(1, 2))
    # Both columns times the track b: r b c / 2, r b s / 2, -+r.
    along, across, turn = half * _length(platform.track, "b", geometry) * c, half, half + half
    across = half * _length(platform.track, "b", geometry) * s
    b = _length(platform.track, "b", geometry)
    return [[along, along], [across, across], [-turn, turn]], [b, b]


def _omnidirectional(platform: Platform, geometry: Geometry) -> Columns:
    ring = geometry.ring
    c, s, zero, one = *_heading(ring), ring.number(0), ring.number(1)
    return [[c, -s, zero], [s, c, zero], [zero, zero, one]], [one, one, one]


def _car(platform: Platform, geometry: Geometry) -> Columns:
    assert isinstance(platform, Car)
    ring = geometry.ring
    c, s, zero, one = *_heading(ring), ring.number(0), ring.number(1)
    steering = {ring.variable(platform.steering, True): 1}
    L = _length(platform.wheelbase, "L", geometry)
    across = L * ring.cos(steering)
    rows = [[across * c, zero], [across * s, zero], [ring.sin(steering), zero], [zero, one]]
    return rows, [across, one]


def _front_drive_car(platform: Platform, geometry: Geometry) -> Columns:
    assert isinstance(platform, FrontDriveCar)
    ring = geometry.ring
    c, s, zero, one = *_heading(ring), ring.number(0), ring.number(1)
    steering = {ring.variable(platform.steering, True): 1}
    L = _length(platform.wheelbase, "L", geometry)
    along = L * ring.cos(steering)
    return [[along * c, zero], [along * s, zero], [ring.sin(steering), zero], [zero, one]], [L, one]


def _fixed(platform: Platform, geometry: Geometry) -> Columns:
    return [], []


def _heading(ring: Ring) -> tuple[Expansion, Expansion]:
    theta = {ring.variable("theta", True): 1}
    return ring.cos(theta), ring.sin(theta)


def _length(value: float, name: str, geometry: Geometry) -> Expansion:
    return geometry.length(value, name)


_FORMULAS: dict[type[Platform], Callable[[Platform, Geometry], Columns]] = {
    Unicycle: _unicycle,
    DifferentialDrive: _differential,
    Car: _car,
    FrontDriveCar: _front_drive_car,
    Omnidirectional: _omnidirectional,
    Fixed: _fixed,
}
