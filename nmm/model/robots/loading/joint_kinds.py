"""Pinocchio's joint types: which have one degree of freedom, their form with one number, their limits."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from nmm.model.robots.joint_table import twist

_SIMPLE = (
    *("RX", "RY", "RZ", "RevoluteUnaligned"),
    *("PX", "PY", "PZ", "PrismaticUnaligned"),
    *("HX", "HY", "HZ", "HelicalUnaligned"),
)
# Continuous kinds, whose configuration is (cos, sin), and what they become. With one number q + q_dot dt is
# a configuration, and Hessians are those of the coordinates.
_CONTINUOUS = {"RUBX": pin.JointModelRX, "RUBY": pin.JointModelRY, "RUBZ": pin.JointModelRZ}
_CONTINUOUS_UNALIGNED = "RevoluteUnboundedUnaligned"
_HUGE = 1e300


def kind(joint: Any) -> str:
    """The joint's type without the prefix that all have: RX, RUBZ, FreeFlyer, ..."""
    return str(joint.shortname()).removeprefix("JointModel")


def is_continuous(joint: Any) -> bool:
    return kind(joint) in _CONTINUOUS or kind(joint) == _CONTINUOUS_UNALIGNED


def is_mimic(joint: Any) -> bool:
    """Whether Pinocchio has it follow another joint, without a number of its own (`mimic=True`)."""
    return kind(joint) == "Mimic"


def is_simple(joint: Any) -> bool:
    """Whether it has one degree of freedom that one number can describe."""
    return kind(joint) in _SIMPLE or is_continuous(joint) or (is_mimic(joint) and _free(joint) is not None)


def _free(mimic: Any) -> Any:
    """The joint type of a mimic joint on its own; None where it neither only turns nor only slides."""
    if not mimic.extract().scaling:
        return None  # its axis is not to be had
    q = np.zeros(mimic.idx_q + 2)
    q[mimic.idx_q] = 1.0  # an angle 0, if the leader has cosine and sine
    linear, angular = (part / mimic.extract().scaling for part in twist(mimic, q))
    if not linear.any():
        return pin.JointModelRevoluteUnaligned(angular)
    return None if angular.any() else pin.JointModelPrismaticUnaligned(linear)


def is_revolute(joint: Any) -> bool:
    """Whether it turns about an axis."""
    return is_continuous(joint) or kind(joint) in _SIMPLE[:4]


def axis(joint: Any, q: NDArray[np.float64]) -> NDArray[np.float64]:
    """The unit axis of a revolute joint in its own frame; q is any configuration of the joint's model."""
    return twist(joint, q)[1]


def value_at(joint: Any, q: NDArray[np.float64]) -> float:
    """The joint's one number in a configuration of its model; of a continuous one, its angle in (-π, π]."""
    if is_continuous(joint):
        return float(np.arctan2(q[joint.idx_q + 1], q[joint.idx_q]))
    return float(q[joint.idx_q])


def one_number(joint: Any, q: NDArray[np.float64]) -> Any:
    """The joint itself, or the one-number form of a continuous or mimic joint."""
    if is_mimic(joint):
        return _free(joint)
    if not is_continuous(joint):
        return joint
    if kind(joint) == _CONTINUOUS_UNALIGNED:
        return pin.JointModelRevoluteUnaligned(axis(joint, q))
    return _CONTINUOUS[kind(joint)]()


def reversed_joint(joint: Any, q: NDArray[np.float64]) -> Any:
    """The one-number form of a revolute joint about the opposite axis: its angle has the other sign."""
    return pin.JointModelRevoluteUnaligned(-axis(joint, q))


def reversed_limits(limits: tuple[NDArray[np.float64], ...]) -> tuple[NDArray[np.float64], ...]:
    """What `joint_limits` returns, for the opposite sign: each pair's ends change places."""
    pairs = zip(limits[0:8:2], limits[1:8:2], strict=True)
    return (*(end for lower, upper in pairs for end in (-upper, -lower)), *limits[8:])


def no_limits(joint: Any) -> tuple[NDArray[np.float64], ...]:
    nq, nv = joint.nq, joint.nv
    nothing = np.zeros(nv)
    lower, upper = np.full(nq, -np.inf), np.full(nq, np.inf)
    # Cosine and sine, or a quaternion, as Pinocchio bounds them.
    angles = {4: slice(2, 4), 7: slice(3, 7)}.get(nq, slice(0, 0))
    lower[angles], upper[angles] = -1.01, 1.01
    infinite = np.full(nv, np.inf)
    return (-infinite, infinite, -infinite, infinite, lower, upper, nothing, nothing, nothing)


def joint_limits(source: pin.Model, joint: int) -> tuple[NDArray[np.float64], ...]:
    """Limits of effort, velocity, position and friction (lower, upper), and damping; infinite where none."""
    if is_mimic(source.joints[joint]):
        return no_limits(pin.JointModelRX())  # Pinocchio has dropped them
    v, q = source.joints[joint].idx_v, source.joints[joint].idx_q
    velocity = source.velocityLimit[v : v + 1]  # `lowerVelocityLimit` comes back with the wrong sign
    ends = source.lowerPositionLimit[q : q + 1], source.upperPositionLimit[q : q + 1]
    if is_continuous(source.joints[joint]):
        ends = np.full(1, -np.inf), np.full(1, np.inf)
    efforts = source.lowerEffortLimit[v : v + 1], source.upperEffortLimit[v : v + 1]
    limits = (*efforts, -velocity, velocity, *ends)
    others = source.lowerDryFrictionLimit, source.upperDryFrictionLimit, source.damping
    return (
        *(np.where(np.abs(limit) > _HUGE, np.copysign(np.inf, limit), limit) for limit in limits),
        *(other[v : v + 1] for other in others),
    )
