"""Spatial arms of example-robot-data on unicycles, and what the tests of spatial tasks share."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

import nmm
from nmm.control.functions.references import Circle
from nmm.model.robots.configuration import Configuration
from nmm.model.robots.loading.packages import Packages
from nmm.model.robots.robot import Robot

Array = NDArray[np.float64]

#: An arm that is far from singular.
UR5 = {
    "shoulder_pan_joint": 0.4,
    "shoulder_lift_joint": -1.1,
    "elbow_joint": 1.6,
    "wrist_1_joint": -0.9,
    "wrist_2_joint": -1.2,
    "wrist_3_joint": 0.3,
}
MOVING = Circle([0.6, -0.4, 0.8], 0.5, 0.7, 0.3, "yz")


def from_example_robot_data(package: str, file: str) -> Robot:
    share = next(f for f in Packages(Path(__file__)).folders if (f / "example-robot-data").is_dir())
    return nmm.load(share / "example-robot-data" / "robots" / package / file)


@cache
def load_ur5() -> Robot:
    return from_example_robot_data("ur_description", "urdf/ur5_robot.urdf")


@cache
def load_tiago() -> Robot:
    return from_example_robot_data("tiago_description", "robots/tiago_no_hand.urdf")


def pose(configuration: Configuration, frame: str, seen_from: str | None = None) -> pin.SE3:
    placement = configuration.placement(frame)
    return placement if seen_from is None else configuration.placement(seen_from).actInv(placement)


def near(robot: Robot, q0: Array, frame: str, offset: Array) -> pin.SE3:
    return Configuration(robot, q0).placement(frame) * pin.exp6(offset)
