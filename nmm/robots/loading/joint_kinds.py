"""Pinocchio's joint types: which have one degree of freedom, and their form with one number."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

# Kinds with one number and one velocity.
_SIMPLE = (
    *("RX", "RY", "RZ", "RevoluteUnaligned"),
    *("PX", "PY", "PZ", "PrismaticUnaligned"),
    *("HX", "HY", "HZ", "HelicalUnaligned"),
)
# Continuous kinds, whose configuration is (cos, sin), and what they become. With one number q + q_dot dt is
# a configuration, and Hessians are those of the coordinates.
_CONTINUOUS = {"RUBX": pin.JointModelRX, "RUBY": pin.JointModelRY, "RUBZ": pin.JointModelRZ}
_CONTINUOUS_UNALIGNED = "RevoluteUnboundedUnaligned"


def kind(joint: Any) -> str:
    """The joint's type without the prefix that all have: RX, RUBZ, FreeFlyer, ..."""
    return str(joint.shortname()).removeprefix("JointModel")


def is_continuous(joint: Any) -> bool:
    """Whether it turns without limit, with a configuration (cos, sin)."""
    return kind(joint) in _CONTINUOUS or kind(joint) == _CONTINUOUS_UNALIGNED


def is_mimic(joint: Any) -> bool:
    """Whether Pinocchio has it follow another joint, without a number of its own (`mimic=True`)."""
    return kind(joint) == "Mimic"


def is_simple(joint: Any) -> bool:
    """Whether it has one degree of freedom that one number can describe."""
    return kind(joint) in _SIMPLE or is_continuous(joint) or (is_mimic(joint) and _free(joint) is not None)


def _free(mimic: Any) -> Any:
    """The joint that a follower would be on its own; None where it neither only turns nor only slides."""
    if not mimic.extract().scaling:
        return None  # its axis is not to be had
    data, q = mimic.createData(), np.zeros(mimic.idx_q + 2)
    q[mimic.idx_q] = 1.0  # an angle 0, if the leader has cosine and sine
    mimic.calc(data, q)
    linear, angular = (np.array(data.S) / mimic.extract().scaling).reshape(2, 3)
    if not linear.any():
        return pin.JointModelRevoluteUnaligned(angular)
    return None if angular.any() else pin.JointModelPrismaticUnaligned(linear)


def is_revolute(joint: Any) -> bool:
    """Whether it turns about an axis."""
    return is_continuous(joint) or kind(joint) in _SIMPLE[:4]


def axis(joint: Any, q: NDArray[np.float64]) -> NDArray[np.float64]:
    """The unit axis of a revolute joint in its own frame; q is any configuration of the joint's model."""
    data = joint.createData()
    joint.calc(data, q)  # the only way to the axis that all joint types offer
    return np.array(data.S, dtype=np.float64).reshape(6)[3:]


def value_at(joint: Any, q: NDArray[np.float64]) -> float:
    """The joint's one number in a configuration of its model; of a continuous one, its angle in (-π, π]."""
    if is_continuous(joint):
        return float(np.arctan2(q[joint.idx_q + 1], q[joint.idx_q]))
    return float(q[joint.idx_q])


def one_number(joint: Any, q: NDArray[np.float64]) -> Any:
    """The joint itself, or the one-number form of a continuous one or of a follower."""
    if is_mimic(joint):
        return _free(joint)
    if not is_continuous(joint):
        return joint
    if kind(joint) == _CONTINUOUS_UNALIGNED:
        return pin.JointModelRevoluteUnaligned(axis(joint, q))
    return _CONTINUOUS[kind(joint)]()
