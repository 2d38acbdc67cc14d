"""Platforms: one file each. `PLATFORMS` finds them by name."""

from __future__ import annotations

from nmm.errors import InputError, unknown
from nmm.platforms.base import Platform
from nmm.platforms.car import Car, FrontDriveCar
from nmm.platforms.differential_drive import DifferentialDrive
from nmm.platforms.fixed import Fixed
from nmm.platforms.layout import Layout, Pivot, RollingJoint
from nmm.platforms.mecanum import Mecanum
from nmm.platforms.omnidirectional import Omnidirectional
from nmm.platforms.tractor import Tractor, Trailer
from nmm.platforms.unicycle import Unicycle

PLATFORMS: dict[str, type[Platform]] = {
    kind.name: kind
    for kind in (
        Unicycle, DifferentialDrive, Car, FrontDriveCar, Tractor, Omnidirectional, Mecanum, Fixed
    )
}  # fmt: skip


def platform_by_name(name: str) -> type[Platform]:
    """The kind of platform of that name; `InputError` lists the names."""
    if name not in PLATFORMS:
        raise InputError(unknown("platform", name, PLATFORMS))
    return PLATFORMS[name]


__all__ = [
    "PLATFORMS",
    "Car",
    "DifferentialDrive",
    "Fixed",
    "FrontDriveCar",
    "Layout",
    "Mecanum",
    "Omnidirectional",
    "Pivot",
    "Platform",
    "RollingJoint",
    "Tractor",
    "Trailer",
    "Unicycle",
    "platform_by_name",
]
