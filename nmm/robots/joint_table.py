"""A model's joints as compiled kinematics read them."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from nmm.arrays import Array
from nmm.kernels.kinematics import Joints


def joint_table(model: pin.Model) -> Joints:
    """The joints of a model whose joints have one number each (`Robot.model`)."""
    count = len(model.joints)
    twists = np.zeros((count, 6))
    q = pin.neutral(model)
    for i in range(1, count):
        data = model.joints[i].createData()
        model.joints[i].calc(data, q)  # the only way to the axis that all joint types offer
        twists[i] = np.array(data.S).reshape(6)
    return Joints(
        parent=np.array(list(model.parents), dtype=np.int64),
        coordinate=np.array([0, *(joint.idx_q for joint in list(model.joints)[1:])], dtype=np.int64),
        placement=np.array([as_row(placement) for placement in model.jointPlacements]),
        twist=twists,
    )


def as_row(placement: pin.SE3) -> Array:
    """(12,): R column by column, then p."""
    return np.concatenate([placement.rotation.ravel(order="F"), placement.translation])
