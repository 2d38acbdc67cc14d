"""Where a robot's arms end: the frames that a person means by "the hand" when none is named."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pinocchio as pin

from nmm.robots.robot import Robot

#: What the frames at the end of an arm are called, the likeliest first.
TIPS = ("ee", "tcp", "effector", "tool", "grasp", "gripper", "hand", "flange", "tip")
#: Words in the names of joints that a hand grips with.
_FINGERS = ("finger", "grip", "jaw", "knuckle", "thumb", "hand")
#: A branch with no more joints is a finger, where at least as many joints as in `_CARRYING` carry it.
_FINGER, _CARRYING = 4, 3


def tips(robot: Robot) -> tuple[str, ...]:
    """The frame at the end of each of `branches`: the one whose name says so, or the farthest out."""
    ends = (end_at(robot, branch[-1]) for branch in branches(robot))
    return tuple(end for end in ends if end is not None)


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


def branches(robot: Robot) -> tuple[tuple[int, ...], ...]:
    """The joints of the arm from the platform to each end, by their numbers in the model: to the palm where
    fingers follow it."""
    return tuple(dict.fromkeys(tuple(_without_fingers(robot.model, chain)) for chain in _chains(robot)))


def _chains(robot: Robot) -> Iterator[list[int]]:
    """The joints of the arm from the platform to each end, by their numbers in the model."""
    model, n_p = robot.model, robot.platform.n_p
    parents = set(model.parents)
    for joint in range(1, model.njoints):
        if joint not in parents and model.joints[joint].idx_q >= n_p:
            yield [one for one in model.supports[joint] if one > 0 and model.joints[one].idx_q >= n_p]


def _without_fingers(model: pin.Model, chain: list[int]) -> list[int]:
    """The chain up to the palm, where its last joints are fingers."""
    for i, joint in enumerate(chain[:-1]):
        several = len(model.children[joint]) > 1
        if several and i + 1 >= _CARRYING and _longest(model, joint) <= 1 + _FINGER:
            return chain[: i + 1]
    names = [model.names[joint].lower() for joint in chain]
    grips = [any(word in name for word in _FINGERS) for name in names]
    while not all(grips) and grips[-1]:  # a finger alone is an arm
        chain, grips = chain[:-1], grips[:-1]
    return chain


def _longest(model: pin.Model, joint: int) -> int:
    """How many joints the longest way from one on outwards has, itself included."""
    return 1 + max((_longest(model, child) for child in model.children[joint]), default=0)


def _how_little_a_tip(frame: pin.Frame) -> tuple[int, float]:
    return _rank(frame.name), -float(np.linalg.norm(frame.placement.translation))


def _rank(name: str) -> int:
    """The place in `TIPS` of the first word that a frame's name holds."""
    words = name.lower().replace("-", "_").split("_")
    ranks = [i for i, tip in enumerate(TIPS) if any(word.startswith(tip) for word in words)]
    return min(ranks, default=len(TIPS))
