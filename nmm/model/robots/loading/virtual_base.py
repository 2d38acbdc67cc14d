"""Joints of a file that stand for a mobile base: far-reaching, in a chain, carrying all else."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from nmm.base.arrays import Array
from nmm.base.findings import Finding
from nmm.model.platforms import Omnidirectional, Platform
from nmm.model.platforms.wheel_layout import NEAR
from nmm.model.robots.coordinates import UNLIMITED
from nmm.model.robots.joint_table import twist
from nmm.model.robots.loading.joint_kinds import kind
from nmm.model.robots.loading.measured_joints import Measured, ends_of, speed_limit

#: How far the two ways in which a base slides may be from level, rad.
_LEVEL = 1e-3
#: Slides with less room than this, m, are those of a table or a gantry.
_ROOM = 1.0


@dataclass(frozen=True)
class VirtualBase:
    """A base made of `joints`, from the root link on; `drives` if one turns it and the next slides it ahead.
    `speeds` are the joints' largest rates, rad/s or m/s, infinite without; `limits` where they end in the
    file, rad or m. With all joints at zero it stands at `place` in the root link: x, y and a yaw."""

    joints: tuple[str, ...]
    drives: bool
    speeds: tuple[float, ...]
    limits: Mapping[str, tuple[float, float]]
    place: pin.SE3

    @property
    def kind(self) -> str | None:
        """The kind of platform that moves as it does; None where that is the usual one."""
        return None if self.drives else Omnidirectional.name

    def limited(self, platform: Platform) -> Platform:
        """The platform with its own limits or, for v and omega without, the joints'."""
        if not self.drives:
            return platform  # their rates are no inputs
        own = dict(zip(("omega", "v"), self.speeds, strict=True))
        limits = zip(platform.inputs, platform.input_limits, strict=True)
        free = [name for name, limit in limits if limit == math.inf and own.get(name, limit) < math.inf]
        return platform.with_limits({name: own[name] for name in free})

    def note(self, platform: Platform) -> Finding:
        limits = {name: [*ends] for name, ends in self.limits.items()}
        return Finding(
            "base_of_joints", {"names": [*self.joints], "platform": platform.name, "limits": limits}
        )


def find_virtual_base(model: pin.Model, where: str) -> VirtualBase | None:
    """The joints, if any, by which the root link turns or slides all else on the ground: two or three that
    are endless, or two long slides and a turn, whatever their limits."""
    measured = Measured(model, (), where)
    joints, ways = _chain(measured, _is_endless)
    turns_first = len(joints) == 2 and len(ways) == 1 and measured.is_upright(joints[0])
    place = _place(measured, joints)
    drives = turns_first and abs(ways[0] @ place.rotation[:, 0]) > 1.0 - _LEVEL
    if not drives and len(joints) + len(ways) < 4:
        joints, ways = _chain(measured, _has_room)
        if len(joints) + len(ways) < 5:
            return None
        place = _place(measured, joints)
    names = tuple(str(model.names[i]) for i in joints)
    ends = {str(model.names[i]): ends_of(model, i) for i in joints if not _is_endless(model, i)}
    return VirtualBase(names, drives, tuple(speed_limit(model, i) for i in joints), ends, place)


def gantry(model: pin.Model, where: str) -> tuple[str, ...]:
    """The level slides, two at least, that move all else before a joint can turn it; none for a base."""
    measured = Measured(model, (), where)
    chain = _chain(measured, _moves)[0]
    if any(measured.is_upright(joint) for joint in chain):
        return ()
    slides, ways = _chain(measured, _moves, apart=True)
    slides = [joint for joint in slides if not measured.is_upright(joint)]
    return tuple(str(model.names[joint]) for joint in slides) if len(ways) > 1 else ()


def _place(measured: Measured, joints: list[int]) -> pin.SE3:
    """The base's placement at zero: about the joint that turns it, with the yaw of what the joints carry."""
    if not joints:
        return pin.SE3.Identity()
    turning = next((joint for joint in joints if measured.is_upright(joint)), joints[-1])
    x, y, _ = measured.placements[turning].translation
    forward = measured.placements[joints[-1]].rotation[:2, 0]
    yaw = float(np.arctan2(forward[1], forward[0])) if np.linalg.norm(forward) > _LEVEL else 0.0
    return pin.SE3(pin.utils.rotate("z", yaw), np.array([x, y, 0.0]))


def _chain(
    measured: Measured, is_usable: Callable[[pin.Model, int], bool], apart: bool = False
) -> tuple[list[int], list[Array]]:
    """Up to three joints at one point, or `apart`, that turn or slide all else on the ground, and the slides'
    directions."""
    model = measured.model
    joints: list[int] = []
    ways: list[Array] = []
    joint = measured.root
    while len(joints) < 3 and len(model.children[joint]) == 1:
        (joint,) = map(int, model.children[joint])
        way = _level_slide(measured, joint)
        moved = np.linalg.norm(model.jointPlacements[joint].translation) > NEAR
        # Real joints are apart, those of a base are at one point.
        if (
            not is_usable(model, joint)
            or (joints and moved and not apart)
            or (way is None and not measured.is_upright(joint))
        ):
            break
        if way is not None and any(abs(way @ other) > 1.0 - _LEVEL for other in ways):
            break
        joints.append(joint)
        ways += [] if way is None else [way]
    return joints, ways


def _is_endless(model: pin.Model, joint: int) -> bool:
    lower, upper = ends_of(model, joint)
    return min(-lower, upper) >= UNLIMITED


def _has_room(model: pin.Model, joint: int) -> bool:
    lower, upper = ends_of(model, joint)
    return upper - lower >= _ROOM


def _moves(model: pin.Model, joint: int) -> bool:
    lower, upper = ends_of(model, joint)
    return lower < upper


def _level_slide(measured: Measured, joint: int) -> Array | None:
    """The level unit vector (3,) along which a joint slides, if it does."""
    joint_model = measured.model.joints[joint]
    if not kind(joint_model).startswith("P"):
        return None
    way = np.asarray(measured.placements[joint].rotation @ twist(joint_model, measured.neutral)[0])
    return way if abs(way[2]) < _LEVEL else None
