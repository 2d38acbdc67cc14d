"""A robot whose numbers are being changed: its platform, wheels and joints, before it is made anew."""

from __future__ import annotations

import copy
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from nmm.base.arrays import Array
from nmm.model.platforms import WheeledPlatform
from nmm.model.robots.robot import Robot
from nmm.model.robots.wheel import Wheel


class RobotChange:
    """A robot whose lengths are being changed.

    platform : a copy of its platform; wheels : by joint; moved : how far joints of the models go, (3,) m, in
        the frames of the joints that carry them; parts : of a platform described by its wheels, these and its
        hitches, by name
    """

    def __init__(self, robot: Robot) -> None:
        self.robot, self.platform = robot, copy.copy(robot.platform)
        self.wheels = {wheel.joint: wheel for wheel in robot.wheels}
        self.moved: dict[str, Array] = {}
        self.parts: dict[str, Any] = {}
        if isinstance(robot.platform, WheeledPlatform):
            self.parts = {wheel.name: wheel for wheel in robot.platform.wheels}
            self.parts |= {hitched(hitch.joint): hitch for hitch in robot.platform.hitches}

    def roll_at(self, joint: str, x: float, y: float) -> None:
        """The wheel touches the ground at x, y, m, of its carrier."""
        wheel = self.wheels[joint]
        self.wheels[joint] = replace(wheel, rolls_at=np.array([x, y, wheel.rolls_at[2]]))

    def move(self, joint: str, x: float, y: float = 0.0) -> None:
        """A joint of the models goes by x, y, m, along its carrier's axes."""
        self.moved[joint] = self.moved.get(joint, np.zeros(3)) + np.array([x, y, 0.0])

    def resize(self, joint: str, radius: float) -> None:
        """A wheel gets another radius, m."""
        self.wheels[joint] = replace(self.wheels[joint], radius=radius)
        if joint in self.parts:
            self.parts[joint] = replace(self.parts[joint], radius=radius)

    def scale(self, wheels: Iterable[Wheel], x: float, y: float) -> None:
        """Wheels on the main body touch the ground so many times farther from the reference point."""
        for wheel in wheels:
            at = self.wheels[wheel.joint].rolls_at
            self.roll_at(wheel.joint, float(at[0]) * x, float(at[1]) * y)

    def made(self) -> Robot:
        """The robot with what was changed."""
        robot, platform = self.robot, self.platform
        if isinstance(platform, WheeledPlatform):
            parts = [self.parts[wheel.name] for wheel in platform.wheels]
            hitches = [self.parts[hitched(hitch.joint)] for hitch in platform.hitches]
            if (*parts, *hitches) != (*platform.wheels, *platform.hitches):
                platform = platform.with_parts(parts, hitches)
        models = {name: _moved(getattr(robot, name), self.moved) for name in ("model", "display_model")}
        wheels = tuple(self.wheels[wheel.joint] for wheel in robot.wheels)
        return replace(robot, **robot.shapes._asdict(), **models, wheels=wheels, platform=platform)


class Length(NamedTuple):
    """A length, m; `change` puts another into a draft, `least` is what it has to be above."""

    value: float
    kind: str
    change: Callable[[RobotChange, float], None]
    least: float = 0.0


def hitched(joint: str) -> str:
    """A hitch among the parts: a wheel may have its name."""
    return f"hitch {joint}"


def _moved(model: pin.Model, moved: Mapping[str, Array]) -> pin.Model:
    """The model with joints elsewhere on what carries them; the same one where it has none of them."""
    joints = {name: by for name, by in moved.items() if model.existJointName(name) and by.any()}
    if not joints:
        return model
    model = model.copy()
    for name, by in joints.items():
        joint = model.getJointId(name)
        placement = model.jointPlacements[joint]
        model.jointPlacements[joint] = pin.SE3(placement.rotation, placement.translation + by)
    return model
