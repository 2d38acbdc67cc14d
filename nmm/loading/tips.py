"""Where a robot's arms end: the frames that a person means by "the hand" when none is named."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pinocchio as pin

from nmm.robot import Robot

#: What the frames at the end of an arm are called, the likeliest first.
TIPS = ("ee", "tcp", "tool", "grasp", "gripper", "hand", "flange", "tip")


def tips(robot: Robot) -> tuple[str, ...]:
    """The frame at the end of each branch of the arm: the one whose name says so, or the farthest out."""
    return tuple(_tips(robot))


def first_tip(robot: Robot) -> str | None:
    """Of the tips one whose name says so, or else the first; None for a robot without an arm."""
    ends = tips(robot)
    named = [name for tip in TIPS for name in ends if tip in name.lower().split("_")]
    return next(iter([*named, *ends]), None)


def _tips(robot: Robot) -> Iterator[str]:
    model = robot.model
    carrying = set(model.parents)
    above = {frame.parentFrame for frame in model.frames}
    for name in robot.q_names[robot.platform.n_p :]:
        joint = model.getJointId(name)
        kinds = (pin.FrameType.BODY, pin.FrameType.OP_FRAME)
        ends = [
            frame
            for i, frame in enumerate(model.frames)
            if frame.parentJoint == joint and frame.type in kinds and i not in above
        ]
        if joint not in carrying and ends:
            yield min(ends, key=_how_little_a_tip).name


def _how_little_a_tip(frame: pin.Frame) -> tuple[int, float]:
    words = frame.name.lower().replace("-", "_").split("_")
    ranks = [i for i, tip in enumerate(TIPS) if any(word.startswith(tip) for word in words)]
    return min(ranks, default=len(TIPS)), -float(np.linalg.norm(frame.placement.translation))
