"""Platforms: one file each, and `wheeled/`, the general one. `PLATFORMS` finds them by name."""

from __future__ import annotations

from nmm.base.kinds import PLATFORMS as PLATFORMS
from nmm.model.platforms.base import Platform as Platform
from nmm.model.platforms.car import Car as Car
from nmm.model.platforms.car import FrontDriveCar as FrontDriveCar
from nmm.model.platforms.omnidirectional import FixedBase as FixedBase
from nmm.model.platforms.omnidirectional import Mecanum as Mecanum
from nmm.model.platforms.omnidirectional import Omnidirectional as Omnidirectional
from nmm.model.platforms.skid_steer import SkidSteer as SkidSteer
from nmm.model.platforms.tractor import Tractor as Tractor
from nmm.model.platforms.tractor import Trailer as Trailer
from nmm.model.platforms.unicycle import DifferentialDrive as DifferentialDrive
from nmm.model.platforms.unicycle import Unicycle as Unicycle
from nmm.model.platforms.wheel_layout import AddedJoint as AddedJoint
from nmm.model.platforms.wheel_layout import Layout as Layout
from nmm.model.platforms.wheel_layout import Pivot as Pivot
from nmm.model.platforms.wheel_layout import RollingJoint as RollingJoint
from nmm.model.platforms.wheeled.descriptions import CasterWheel as CasterWheel
from nmm.model.platforms.wheeled.descriptions import FixedWheel as FixedWheel
from nmm.model.platforms.wheeled.descriptions import Hitch as Hitch
from nmm.model.platforms.wheeled.descriptions import OmniWheel as OmniWheel
from nmm.model.platforms.wheeled.descriptions import SteeredWheel as SteeredWheel
from nmm.model.platforms.wheeled.inputs import CommonSpeed as CommonSpeed
from nmm.model.platforms.wheeled.inputs import WeightedSpins as WeightedSpins
from nmm.model.platforms.wheeled.inputs import WheelSpeed as WheelSpeed
from nmm.model.platforms.wheeled.inputs import WheelSpin as WheelSpin
from nmm.model.platforms.wheeled.platform import WheeledPlatform as WheeledPlatform


def platform_by_name(name: str) -> type[Platform]:
    """The kind of platform of that name; `InputError` lists the names."""
    kind: type[Platform] = PLATFORMS.named(name)
    return kind
