"""Which frame of a robot is led along a path, and why that one."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from nmm.robots.loading.tips import branches, end_at
from nmm.robots.reach import reach
from nmm.robots.robot import Robot
from nmm.words import counted

#: A range this small is none, m or rad.
_NO_ROOM = 1e-6


@dataclass(frozen=True)
class Hand:
    """A frame, and what moves it.

    Attributes
    ----------
    frame : its name; "" for a robot that has none to offer
    joints : the arm's inputs on the way to it
    why : a line that says why this one
    """

    frame: str
    joints: tuple[str, ...]
    why: str


def hands(robot: Robot) -> list[Hand]:
    """Frames to lead, the best first: ends of arms, or of a robot without any what its platform carries."""
    n_p = robot.platform.n_p
    found, free = [], movable(robot)
    for chain in branches(robot):
        frame = end_at(robot, chain[-1])
        joints = tuple(name for name in map(robot.model.names.__getitem__, chain) if name in free)
        if frame and joints:
            length = reach(robot, frame)
            far = length.length if length is not None and np.isfinite(length.length) else 0.0
            found.append((-len(joints), -far, frame, joints))
    found.sort()
    made = []
    for less, nearer, frame, joints in found:
        others = [other for _, _, other, _ in found if other != frame]
        beside = f"; other ends: {', '.join(others[:4])}" if others else ""
        why = f"the end of the longest chain: {counted(-less, 'joint')}, {-nearer:.2g} m long{beside}"
        made.append(Hand(frame, joints, why))
    if made or not n_p:
        return made
    why = "there is no arm: a point of the platform's body, ahead of its axle"
    return [Hand(name, (), why) for name in sorted(_carried(robot), key=lambda name: -_ahead(robot, name))]


def movable(robot: Robot) -> list[str]:
    """The inputs that move something: all but those of joints whose limits leave no room."""
    room = robot.q_limits[:, 1] - robot.q_limits[:, 0]
    return [
        name
        for name, i in zip(robot.u_names, robot.rate_coordinates, strict=True)
        if i < 0 or room[i] > _NO_ROOM
    ]


def _carried(robot: Robot) -> Iterator[str]:
    """Links of the platform's body ahead of the axle, not those of its wheels."""
    for name in robot.frames:
        joints = [
            model.names[model.frames[model.getFrameId(name)].parentJoint]
            for model in (robot.model, robot.display_model)
        ]
        kind = robot.model.frames[robot.model.getFrameId(name)].type.name
        if joints == ["theta", "theta"] and kind in ("BODY", "OP_FRAME") and _ahead(robot, name) > 0.0:
            yield name


def _ahead(robot: Robot, name: str) -> float:
    return float(robot.model.frames[robot.frame_id(name)].placement.translation[0])
