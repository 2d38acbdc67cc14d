"""Robots with joints that follow others, for the tests that need one."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

from places import PANDA

import nmm
from nmm.model.robots.mimic_joints import MimicJoint
from nmm.model.robots.robot import Robot

FINGERS = ("panda_finger_joint1", "panda_finger_joint2")


@cache
def panda(base: str = "") -> Robot:
    """A Panda with its hand, alone or on a bundled base without arm."""
    alone = nmm.load(PANDA, platform="fixed")
    return nmm.mount(base, alone, at="arm_mount") if base else alone


@cache
def folding() -> Robot:
    """The bundled planar robot of three joints, of which the last follows the first."""
    followers = (MimicJoint("q3", "q1", -0.7, 0.2),)
    return replace(nmm.load("unicycle_3r"), name="unicycle_3r_folding", mimic_joints=followers)


@cache
def hitched() -> Robot:
    """An arm on a tractor, of which one joint follows a hitch of the platform and another the first joint."""
    robot = nmm.mount("trailer_base", "small_arm", at="arm_mount")
    followers = (MimicJoint("q3", "hitch1", 0.8, 0.1), MimicJoint("q4", "q1", -1.5))
    return replace(robot, mimic_joints=followers)
