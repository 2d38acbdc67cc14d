"""Which of a robot's numbers its file has words for."""

from __future__ import annotations

import statistics
from collections.abc import Collection, Mapping

from nmm.model.platforms.wheel_layout import NEAR
from nmm.model.robots.numbers import OF_SPEEDS, main_wheels, numbers_for
from nmm.model.robots.robot import Robot
from nmm.plugins.robot.calibration.arm_patch import arm_numbers

#: A number is another's where they differ by a smaller share.
CLOSE = 1e-6
#: Why numbers stay in calibration.yaml, by their kinds.
UNSAID = {
    "offset": "URDF has no word for a joint's offset",
    "ratio": "URDF has no word for a joint's ratio",
    "centre": "URDF has no word for where wheels slide: the ground makes these centres",
}


def expressible(
    base: Robot, goal: Mapping[str, float], expanded: bool
) -> tuple[dict[str, float], dict[str, str]]:
    """The numbers that a file could say, and why it cannot say the others; of radii that differ too much for
    the platform, it says their mean."""
    numbers, left = numbers_for(base, goal), dict[str, str]()
    writable = {name: value for name, value in goal.items() if value != numbers[name].value}
    of_arm = arm_numbers(base, writable)
    for name in [*writable]:
        if name in of_arm:
            if expanded:
                left[name] = "of a xacro file only its URDF is edited (xacro FILE > robot.urdf)"
                del writable[name]
        elif numbers[name].kind in UNSAID:
            left[name] = UNSAID[numbers[name].kind]
            del writable[name]
        elif name == "radius":
            left[name] = "the file shows no wheels"
            del writable[name]
    names = [f"radius.{wheel.joint}" for wheel in main_wheels(base)]
    radii = [goal[name] for name in names]
    if isinstance(base.platform, OF_SPEEDS) and radii and max(radii) - min(radii) > NEAR:
        mean = statistics.mean(radii)
        for name in names:
            writable[name] = mean
            left[name] = (
                f"a {base.platform.name} platform has one radius: the file gets the mean, {mean:.6g} m, and "
                "the difference stays"
            )
    return writable, left


def missed(
    goal: Mapping[str, float], reached: Mapping[str, float], left: Collection[str], gives: str
) -> dict[str, str]:
    """The numbers that the corrected file does not give, in spite of all."""
    return {
        name: f"the {gives} {reached[name]:.6g}"
        for name, value in goal.items()
        if name in reached and name not in left and not same(reached[name], value)
    }


def same(one: float, other: float) -> bool:
    return abs(one - other) <= CLOSE * max(abs(one), abs(other))
