"""How far an arm reaches: the lengths between its joints, added up."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pinocchio as pin

from nmm.arrays import Array
from nmm.robots.robot import Robot


class Reach(NamedTuple):
    """No point of a frame's origin is farther than `length` (m) from the origin of the joint `joint`."""

    joint: str
    length: float


def reach(robot: Robot, frame: str) -> Reach | None:
    """The reach of the arm that carries a frame; None where no joint of an arm does.

    An upper bound, for the joints stand at angles to each other: from the arm's first joint on, the distances
    from joint to joint and on to the frame's origin, and the most that each sliding joint travels (infinite
    where it has no limit).

    Parameters
    ----------
    robot : the robot
    frame : a frame of it

    Raises
    ------
    InputError : a frame that the robot does not have
    """
    model = robot.model
    there = model.frames[robot.frame_id(frame)]
    joints = [j for j in model.supports[there.parentJoint] if j > 0 and not _is_platforms(robot, j)]
    if not joints:
        return None
    length = robot.joint_reaches[there.parentJoint] + np.linalg.norm(there.placement.translation)
    return Reach(str(model.names[joints[0]]), float(length))


def joint_position(robot: Robot, q: Array, joint: str) -> Array:
    """A joint's origin (3,) in the world at q (n,), m; a sliding joint's, where it begins to slide."""
    data = robot.model.createData()
    pin.forwardKinematics(robot.model, data, q)
    index = robot.model.getJointId(joint)
    parent = data.oMi[robot.model.parents[index]]
    return np.array(parent.act(robot.model.jointPlacements[index]).translation)


def _is_platforms(robot: Robot, joint: int) -> bool:
    return bool(robot.model.joints[joint].idx_q < robot.platform.n_p)
