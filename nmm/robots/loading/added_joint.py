"""A joint of a platform that a robot's file lacks: a wheel midway between two that steer."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pinocchio as pin

from nmm.errors import RobotError
from nmm.platforms import AddedJoint
from nmm.robots.loading.chain import CHAIN, Rebuilt


def with_joint(rebuilt: Rebuilt, added: AddedJoint, where: str) -> Rebuilt:
    """The model with the joint on the root's body, with nothing on it; where it has one of that name, that
    one with its limits narrowed.

    Parameters
    ----------
    rebuilt : a model on the chain
    where : what messages call the model

    Raises
    ------
    RobotError : a frame that is no joint has its name
    """
    model = rebuilt.model.copy()
    if model.existJointName(added.joint):
        joint = model.joints[model.getJointId(added.joint)]
        model.lowerPositionLimit[joint.idx_q] = max(model.lowerPositionLimit[joint.idx_q], added.lower)
        model.upperPositionLimit[joint.idx_q] = min(model.upperPositionLimit[joint.idx_q], added.upper)
        own = model.velocityLimit[joint.idx_v]
        model.velocityLimit[joint.idx_v] = min(own if own > 0.0 else np.inf, added.velocity)
        return replace(rebuilt, model=model)
    if model.existFrame(added.joint):
        raise RobotError(
            f"{where}: a frame is named {added.joint}, as the coordinate that this platform adds: give the "
            "frame another name, or the platform another for it, as in Car(wheelbase, steering=NAME)"
        )
    none, speed = np.full(1, np.inf), np.full(1, added.velocity)
    zero = np.zeros(1)
    place = pin.SE3(np.eye(3), np.array([added.x, added.y, 0.0]))
    limits = (-none, none, -speed, speed, np.full(1, added.lower), np.full(1, added.upper))
    model.addJoint(len(CHAIN), pin.JointModelRZ(), place, added.joint, *limits, zero, zero, zero)
    note = (
        f"{added.joint} is no joint of the file: the angle of a wheel midway between those that steer, which "
        "follow it (Ackermann)"
    )
    return replace(rebuilt, model=model, notes=(*rebuilt.notes, note))
