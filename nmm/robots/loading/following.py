"""The joints that follow others, among the coordinates of a robot that is being made."""

from __future__ import annotations

from collections.abc import Sequence

from nmm.errors import RobotError
from nmm.robots.followers import Follower, first_leaders
from nmm.robots.robot import Robot


def among_coordinates(
    followers: Sequence[Follower], rolling: Sequence[str], where: str
) -> tuple[tuple[Follower, ...], list[str]]:
    """Those that are coordinates, each by a coordinate that follows nobody; and notes.

    Parameters
    ----------
    followers : each after the one that it follows
    rolling : wheels and swivels, which the ground turns: they are no coordinates
    where : what messages call the robot

    Raises
    ------
    RobotError : a coordinate that follows a wheel or a swivel
    """
    found = tuple(one for one in first_leaders(followers) if one.joint not in rolling)
    for one in found:
        if one.leader in rolling:
            raise RobotError(
                f"{where}: {one.joint} follows {one.leader}, which the ground turns and is no coordinate: "
                f"lock {one.joint}, or name the wheels without {one.leader} (--wheels, wheels)"
            )
    notes = []
    if found:
        notes.append(f"joints that follow others, without an input: {', '.join(map(str, found))}")
    if len(found) < len(followers):
        turned = ", ".join(one.joint for one in followers if one.joint in rolling)
        notes.append(f"turned by the ground, not by the joint that they follow: {turned}")
    return found, notes


def limit_notes(robot: Robot) -> list[str]:
    """The followers whose limits are not heeded, a sentence each."""
    lower, upper = robot.model.lowerPositionLimit, robot.model.upperPositionLimit
    return [
        f"{one}: its limits, from {lower[i]:g} to {upper[i]:g}, leave {one.leader} no room and do not count"
        for one, i in zip(
            robot.unheeded, map(robot.coordinate, (one.joint for one in robot.unheeded)), strict=True
        )
    ]
