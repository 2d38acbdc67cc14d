"""Arms on platforms, all bundled or from example-robot-data, for the tests that go through all of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache

from places import DATA

import nmm
from nmm.model.robots.robot import Robot


@dataclass(frozen=True)
class Arm:
    """Where the file is, the frame that works, and a configuration in which the arm is dexterous."""

    source: str
    frame: str
    q0: dict[str, float]
    lock: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Base:
    """A robot without arm: its file, how it moves, the frame for the arm, and a configuration."""

    source: str
    platform: str | None
    at: str
    q0: dict[str, float]


ARMS = {
    "small arm": Arm("small_arm", "ee", {"q1": 0.3, "q2": 0.2, "q3": 1.7, "q4": 0.6}),
    "UR5": Arm(
        DATA + "ur_description/urdf/ur5_robot.urdf",
        "tool0",
        {
            "shoulder_pan_joint": 0.3,
            "shoulder_lift_joint": -1.2,
            "elbow_joint": 1.5,
            "wrist_1_joint": -1.8,
            "wrist_2_joint": -1.4,
        },
    ),
    "Panda": Arm(
        DATA + "panda_description/urdf/panda.urdf",
        "panda_hand",
        {"panda_joint2": -0.4, "panda_joint4": -2.0, "panda_joint6": 1.8, "panda_joint7": 0.6},
        {"panda_finger_joint1": 0.02},
    ),
    "Kinova": Arm(
        DATA + "kinova_description/robots/kinova.urdf",
        "j2s6s200_end_effector",
        {
            "j2s6s200_joint_1": 0.3,
            "j2s6s200_joint_2": 3.6,
            "j2s6s200_joint_3": 1.9,
            "j2s6s200_joint_4": 0.8,
            "j2s6s200_joint_5": 1.1,
        },
    ),
}

BASES = {
    "unicycle": Base("differential_base", "unicycle", "arm_mount", {}),
    "differential": Base("differential_base", None, "arm_mount", {"theta": 0.4}),
    "car": Base("car_base", None, "arm_mount", {"steering": 0.3}),
    "front-driven car": Base("car_base", "front_drive_car", "arm_mount", {"steering": 0.3}),
    "tractor": Base("trailer_base", None, "arm_mount", {"hitch1": 0.3, "hitch2": -0.2}),
    "second trailer": Base("trailer_base", None, "trailer2_mount", {"hitch1": 0.3, "hitch2": -0.2}),
    "mecanum": Base("omni_base", None, "arm_mount", {"theta": -0.5}),
    "described by its wheels": Base("trailer_base", "wheeled", "trailer1_mount", {"hitch1": 0.3}),
    "fixed": Base("", "fixed", "", {}),
}


@cache
def built(base: str, arm: str) -> Robot:
    """The arm on the base."""
    alone = nmm.load(ARMS[arm].source, platform="fixed", lock=ARMS[arm].lock)
    if base == "fixed":
        return alone
    platform = nmm.load(BASES[base].source, platform=BASES[base].platform)
    return nmm.mount(platform, alone, at=BASES[base].at)


def start(base: str, arm: str) -> dict[str, float]:
    """A configuration from which a motion begins; mounting may have put the arm's name before its joints'."""
    names = built(base, arm).q_names
    found = {next(name for name in names if name.endswith(joint)): q for joint, q in ARMS[arm].q0.items()}
    return BASES[base].q0 | found


def frame_of(base: str, arm: str) -> str:
    """The frame that works, with the arm's name before it if mounting put it there."""
    return next(name for name in reversed(built(base, arm).frames) if name.endswith(ARMS[arm].frame))
