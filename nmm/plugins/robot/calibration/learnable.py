"""The numbers that drives may show: of a robot, of where the reference is on it, and of the clocks."""

from __future__ import annotations

from collections.abc import Sequence

from nmm.model.robots.numbers import robot_numbers
from nmm.model.robots.origins import arm_joints
from nmm.model.robots.robot import Robot
from nmm.plugins.robot.calibration.drives import RobotDrive
from nmm.plugins.robot.calibration.parameters import CLOCK, DELAY, MOUNT, Learned, learned
from nmm.plugins.robot.odometry import Counters


def learnable(robot: Robot, counters: Counters, drives: Sequence[RobotDrive]) -> list[Learned]:
    """In the order in which they are learned."""
    known = robot_numbers(robot)
    found = []
    for name in counters.names:
        if f"radius.{name}" in known:
            found.append(learned(f"radius.{name}", "m", known[f"radius.{name}"].value))
    for name in counters.names:
        if name in robot.platform.inputs:
            found.append(learned(f"scale.{name}", "1", 1.0))
    unseen = {*arm_joints(robot)}  # wheels do not show an arm's numbers, nor where frames are
    for name, number in known.items():
        if number.kind in ("radius", "origin") or number.of in unseen:
            continue
        if number.kind == "hitch" and not all(drive.hitches for drive in drives):
            continue
        found.append(learned(name, number.unit, number.value))
    looked = [drive.rows for drive in drives if not drive.ends]
    if looked:
        found += [learned(name, "m" if name != MOUNT[2] else "rad", 0.0) for name in MOUNT[: max(looked)]]
    for drive in drives:
        if not drive.ends:
            more = f".{drive.number}" if drive.number else ""
            found += [learned(DELAY + more, "s", drive.delay), learned(CLOCK + more, "1", 0.0)]
    return found
