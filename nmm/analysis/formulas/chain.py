"""The joints from the root to a frame, as plain numbers: what the symbolic analysis reads of a robot."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from nmm.arrays import Array
from nmm.errors import InputError
from nmm.robots.robot import Robot


@dataclass(frozen=True, eq=False)
class ChainJoint:
    """A joint with one degree of freedom.

    Attributes
    ----------
    name : the joint's, which is its coordinate's
    kind : "revolute" or "prismatic"
    axis : (3,) unit axis in the joint's frame
    translation, rotation : (3,) m and (3, 3), of the joint's frame in the frame of the joint before
    """

    name: str
    kind: str
    axis: Array
    translation: Array
    rotation: Array


@dataclass(frozen=True, eq=False)
class Chain:
    """The joints that move a frame, from the root on, and where it is on the last of them."""

    frame: str
    joints: tuple[ChainJoint, ...]
    translation: Array
    rotation: Array


def chain_to(robot: Robot, frame: str) -> Chain:
    """The chain of a frame.

    Raises
    ------
    InputError : the robot lacks the frame, or a joint on the way neither turns nor slides
    """
    model = robot.model
    at = model.frames[robot.frame_id(frame)]
    joints: list[ChainJoint] = []
    index = int(at.parentJoint)
    while index > 0:
        joints.insert(0, chain_joint(robot, index))
        index = int(model.parents[index])
    return Chain(frame, tuple(joints), np.array(at.placement.translation), np.array(at.placement.rotation))


def chain_joint(robot: Robot, index: int) -> ChainJoint:
    """One joint, by Pinocchio's index; `InputError` for one that neither turns nor slides."""
    model = robot.model
    joint, placement = model.joints[index], model.jointPlacements[index]
    data = joint.createData()
    joint.calc(data, np.zeros(model.nq))
    motion = np.array(data.S, dtype=np.float64).reshape(-1)
    if motion.size != 6 or motion[:3].any() == motion[3:].any():
        raise InputError(
            f"symbolic: expected joints that turn or slide, {model.names[index]} is a "
            f"{str(joint.shortname()).removeprefix('JointModel')}"
        )
    slides = bool(motion[:3].any())
    return ChainJoint(
        str(model.names[index]),
        "prismatic" if slides else "revolute",
        motion[:3] if slides else motion[3:],
        np.array(placement.translation),
        np.array(placement.rotation),
    )
