"""The limits of a joint as `pin.Model.addJoint` takes them."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from nmm.robots.loading.joint_kinds import is_continuous, is_mimic

# Pinocchio's "no limit" is the largest number there is.
_HUGE = 1e300


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
    lower, upper = source.lowerPositionLimit[q : q + 1], source.upperPositionLimit[q : q + 1]
    if is_continuous(source.joints[joint]):
        lower, upper = np.full(1, -np.inf), np.full(1, np.inf)
    limits = (
        *(source.lowerEffortLimit[v : v + 1], source.upperEffortLimit[v : v + 1], -velocity, velocity),
        *(lower, upper),
    )
    return (
        *(np.where(np.abs(limit) > _HUGE, np.copysign(np.inf, limit), limit) for limit in limits),
        *(source.lowerDryFrictionLimit[v : v + 1], source.upperDryFrictionLimit[v : v + 1]),
        source.damping[v : v + 1],
    )
