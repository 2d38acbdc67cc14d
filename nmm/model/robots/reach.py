"""Where a robot's arms end, and how far they reach: the lengths between their joints, added up."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pinocchio as pin

from nmm.base.arrays import Array
from nmm.model.robots.robot import Robot

#: What the frames at the end of an arm are called, the likeliest first.
TIPS = ("ee", "tcp", "effector", "tool", "grasp", "gripper", "hand", "flange", "tip")
#: Words in the names of joints that a hand grips with.
_FINGERS = ("finger", "grip", "jaw", "knuckle", "thumb", "hand")
#: A branch with no more joints is a finger, where at least as many joints as in `_CARRYING` carry it.
_FINGER, _CARRYING = 4, 3


class Reach(NamedTuple):
    """No point of a frame's origin is farther than `length` (m) from the origin of the joint `joint`."""

    joint: str
    length: float


def reach(robot: Robot, frame: str) -> Reach | None:
    """The reach of the arm that carries a frame, if any: from the arm's first joint on, the distances from
    joint to joint and to the frame's origin, and the travel of sliding joints (infinite without a limit). An
    upper bound, for the joints stand at angles to each other."""
    end = robot.model.frames[robot.frame_id(frame)]
    joints = _arm_joints(robot, end.parentJoint)
    if not joints:
        return None
    length = robot.joint_reaches[end.parentJoint] + np.linalg.norm(end.placement.translation)
    return Reach(str(robot.model.names[joints[0]]), float(length))


def _arm_joints(robot: Robot, joint: int) -> list[int]:
    joints, n_p = robot.model.joints, robot.platform.n_p
    return [i for i in robot.model.supports[joint] if i > 0 and joints[i].idx_q >= n_p]


def joint_position(robot: Robot, q: Array, joint: str) -> Array:
    """A joint's origin (3,) in the world at q (n,), m; a sliding joint's, where it begins to slide."""
    data = robot.model.createData()
    pin.forwardKinematics(robot.model, data, q)
    index = robot.model.getJointId(joint)
    parent = data.oMi[robot.model.parents[index]]
    return np.array(parent.act(robot.model.jointPlacements[index]).translation)


def tips(robot: Robot) -> tuple[str, ...]:
    """The frame at the end of each of `arm_branches`: the one whose name says so, or the farthest out."""
    ends = (arm_end(robot, branch[-1]) for branch in arm_branches(robot))
    return tuple(end for end in ends if end is not None)


def first_tip(robot: Robot) -> str | None:
    """Of the tips the one whose name says it best, or else the first; None for a robot without an arm."""
    return min(tips(robot), key=_rank, default=None)


def arm_end(robot: Robot, joint: int) -> str | None:
    """The frame at the end of a joint's body: the one whose name says so, or the farthest out."""
    kinds = (pin.FrameType.BODY, pin.FrameType.OP_FRAME)
    above = {frame.parentFrame for frame in robot.model.frames}
    candidates = [
        (i in above, _rank(frame.name), -float(np.linalg.norm(frame.placement.translation)), frame.name)
        for i, frame in enumerate(robot.model.frames)
        if frame.parentJoint == joint and frame.type in kinds
    ]
    return min(candidates)[-1] if candidates else None


def arm_branches(robot: Robot) -> tuple[tuple[int, ...], ...]:
    """Each arm's joints from the platform to its end (or palm, before fingers), by number in the model."""
    model, n_p = robot.model, robot.platform.n_p
    ends = {*range(1, model.njoints)} - {*model.parents}
    chains = [_arm_joints(robot, end) for end in sorted(ends) if model.joints[end].idx_q >= n_p]
    return tuple(dict.fromkeys(tuple(_without_fingers(model, chain)) for chain in chains))


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
    return 1 + max((_longest(model, child) for child in model.children[joint]), default=0)


def _rank(name: str) -> int:
    """The place in `TIPS` of the first word that a frame's name holds."""
    words = name.lower().replace("-", "_").split("_")
    ranks = [i for i, tip in enumerate(TIPS) if any(word.startswith(tip) for word in words)]
    return min(ranks, default=len(TIPS))
