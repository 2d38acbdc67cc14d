"""Platforms: one file each, and `wheeled/`, the general one. `PLATFORMS` finds them by name."""

from __future__ import annotations

from contextlib import suppress

from nmm.errors import InputError
from nmm.kinds import PLATFORMS
from nmm.platforms.base import Platform
from nmm.platforms.car import Car, FrontDriveCar
from nmm.platforms.differential_drive import DifferentialDrive
from nmm.platforms.fixed import Fixed
from nmm.platforms.layout import AddedJoint, Layout, Pivot, RollingJoint
from nmm.platforms.mecanum import Mecanum
from nmm.platforms.omnidirectional import Omnidirectional
from nmm.platforms.skid_steer import SkidSteer
from nmm.platforms.tractor import Tractor, Trailer
from nmm.platforms.unicycle import Unicycle
from nmm.platforms.wheeled import (
    CasterWheel,
    CommonSpeed,
    FixedWheel,
    Hitch,
    OmniWheel,
    Speed,
    Spin,
    Spins,
    SteeredWheel,
    WheeledPlatform,
)


def usual_platform(layout: Layout | None) -> tuple[Platform, str]:
    """The platform of a file that says none, and why it: a car where wheels steer as a car's do ("wheels"),
    else a unicycle ("default")."""
    steered = {pivot.joint for pivot in layout.pivots if pivot.steers} if layout is not None else set()
    if layout is not None and any(wheel.carrier in steered for wheel in layout.wheels):
        with suppress(InputError):
            return Car.fit(layout), "wheels"
    return Unicycle(), "default"


def platform_by_name(name: str) -> type[Platform]:
    """The kind of platform of that name; `InputError` lists the names."""
    kind: type[Platform] = PLATFORMS.named(name)
    return kind


__all__ = [
    "PLATFORMS",
    "AddedJoint",
    "Car",
    "CasterWheel",
    "CommonSpeed",
    "DifferentialDrive",
    "Fixed",
    "FixedWheel",
    "FrontDriveCar",
    "Hitch",
    "Layout",
    "Mecanum",
    "OmniWheel",
    "Omnidirectional",
    "Pivot",
    "Platform",
    "RollingJoint",
    "SkidSteer",
    "Speed",
    "Spin",
    "Spins",
    "SteeredWheel",
    "Tractor",
    "Trailer",
    "Unicycle",
    "WheeledPlatform",
    "platform_by_name",
    "usual_platform",
]
