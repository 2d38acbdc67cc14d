"""Platforms: one file each, and `wheeled/`, the general one. `PLATFORMS` finds them by name."""

from __future__ import annotations

from nmm.kinds import PLATFORMS
from nmm.platforms.base import Platform
from nmm.platforms.car import Car, FrontDriveCar
from nmm.platforms.differential_drive import DifferentialDrive
from nmm.platforms.fixed import Fixed
from nmm.platforms.layout import Layout, Pivot, RollingJoint
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


def platform_by_name(name: str) -> type[Platform]:
    """The kind of platform of that name; `InputError` lists the names."""
    kind: type[Platform] = PLATFORMS.named(name)
    return kind


__all__ = [
    "PLATFORMS",
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
]
