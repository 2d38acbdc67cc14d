"""Where a robot's arms end: the frames that a person means by "the hand" when none is named."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pinocchio as pin

from nmm.robots.robot import Robot

#: What the frames at the end of an arm are called, the likeliest first.
TIPS = ("ee", "tcp", "effector", "tool", "grasp", "gripper", "hand", "flange", "tip")


def tips(robot: Robot) -> tuple[str, ...]:
    """The frame at the end of each branch of the arm: the one whose name says so, or the farthest out."""
    return tuple(_tips(robot))


def first_tip(robot: Robot) -> str | None:
    """Of the tips the one whose name says it best, or else the first; None for a robot without an arm."""
    return min(tips(robot), key=_rank, default=None)


def end_at(robot: Robot, joint: int) -> str | None:
    """The frame at the end of a joint's body: the one whose name says so, or the farthest out."""
    kinds = (pin.FrameType.BODY, pin.FrameType.OP_FRAME)
    above = {frame.parentFrame for frame in robot.model.frames}
    there = [
        (i in above, *_how_little_a_tip(frame), frame.name)
        for i, frame in enumerate(robot.model.frames)
        if frame.parentJoint == joint and frame.type in kinds
    ]
    return min(there)[-1] if there else None


def _tips(robot: Robot) -> Iterator[str]:
    model = robot.model
    carrying = set(model.parents)
    for name in robot.q_names[robot.platform.n_p :]:
        joint = model.getJointId(name)
        end = None if joint in carrying else end_at(robot, joint)
        if end is not None:
            yield end


def _how_little_a_tip(frame: pin.Frame) -> tuple[int, float]:
    return _rank(frame.name), -float(np.linalg.norm(frame.placement.translation))


def _rank(name: str) -> int:
    """The place in `TIPS` of the first word that a frame's name holds."""
    words = name.lower().replace("-", "_").split("_")
    ranks = [i for i, tip in enumerate(TIPS) if any(word.startswith(tip) for word in words)]
    return min(ranks, default=len(TIPS))
