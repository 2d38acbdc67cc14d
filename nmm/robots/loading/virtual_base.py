"""Joints of a file that stand for a base which drives: without limits, one on another, all on the last."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from nmm.platforms import Fixed, Omnidirectional, Platform
from nmm.platforms.layout import NEAR
from nmm.robots.coordinates import UNLIMITED
from nmm.robots.loading.joint_kinds import kind
from nmm.robots.loading.layout import Measured, speed_limit

#: How far the two ways in which a base slides may be from level, rad.
_LEVEL = 1e-3


@dataclass(frozen=True)
class VirtualBase:
    """A base made of joints.

    Attributes
    ----------
    joints : their names, from the root link on
    drives : whether they are two: one turns the base, and the next slides it ahead
    speeds : their largest rates, rad/s or m/s, infinite without
    """

    joints: tuple[str, ...]
    drives: bool
    speeds: tuple[float, ...]

    @property
    def kind(self) -> str | None:
        """The kind of platform that moves as it does; None where that is the usual one."""
        return None if self.drives else Omnidirectional.name

    def limited(self, platform: Platform) -> Platform:
        """The platform with limits of its own, or with the joints' for v and omega that have none."""
        if not self.drives:
            return platform  # their rates are no inputs
        limits = zip(platform.inputs, platform.input_limits, strict=True)
        free = [name for name, limit in limits if limit == math.inf]
        turning, ahead = self.speeds
        own = {name: speed for name, speed in (("v", ahead), ("omega", turning)) if speed < math.inf}
        return platform.with_limits({name: own[name] for name in free if name in own})

    def note(self, platform: Platform) -> str:
        """What became of it."""
        names = ", ".join(self.joints)
        if isinstance(platform, Fixed):
            return f"{names} move the whole robot without limits: a base of joints, coordinates like others"
        return (
            f"{names} move the whole robot without limits: a base of joints, in whose place is platform "
            f"{platform.name}; platform fixed keeps them as coordinates"
        )


def find_virtual_base(model: pin.Model, where: str) -> VirtualBase | None:
    """The two or three joints next to the root link that turn it about an upright axis or slide it on the
    ground, without limits, each with all that moves on it; None where there are none.

    Parameters
    ----------
    model : on the chain
    where : what messages call the model
    """
    measured = Measured(model, (), where)
    found: list[int] = []
    ways: list[np.ndarray] = []
    joint = measured.root
    while len(found) < 3:
        below = [i for i in measured.joints.values() if int(model.parents[i]) == joint]
        if len(below) != 1 or not _is_endless(model, below[0]):
            break
        (joint,) = below
        way = _level_slide(measured, joint)
        moved = np.linalg.norm(model.jointPlacements[joint].translation) > NEAR
        # Real joints are apart, those of a base are at one point.
        if (found and moved) or (way is None and not measured.is_upright(joint)):
            break
        if way is not None and any(abs(way @ other) > 1.0 - _LEVEL for other in ways):
            break
        found.append(joint)
        ways += [] if way is None else [way]
    drives = (
        len(found) == 2
        and len(ways) == 1
        and measured.is_upright(found[0])
        and abs(ways[0][0]) > 1.0 - _LEVEL
    )
    if not drives and len(found) + len(ways) < 4:
        return None
    names = tuple(str(model.names[i]) for i in found)
    return VirtualBase(names, drives, tuple(speed_limit(model, i) for i in found))


def _is_endless(model: pin.Model, joint: int) -> bool:
    index = model.joints[joint].idx_q
    return bool(
        -model.lowerPositionLimit[index] >= UNLIMITED and model.upperPositionLimit[index] >= UNLIMITED
    )


def _level_slide(measured: Measured, joint: int) -> np.ndarray | None:
    """The level unit vector (3,) along which a joint slides; None where it does something else."""
    one = measured.model.joints[joint]
    if not kind(one).startswith("P"):
        return None
    data = one.createData()
    one.calc(data, measured.neutral)
    way = measured.placements[joint].rotation @ np.array(data.S).reshape(6)[:3]
    return np.asarray(way) if abs(way[2]) < _LEVEL else None
