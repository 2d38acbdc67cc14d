"""How near a motion comes to limits, as a share of their range."""

from __future__ import annotations

import numpy as np

from nmm.arrays import Array
from nmm.control.limits import LimitsOn
from nmm.robots.robot import Robot


def margins(kept: LimitsOn, robot: Robot, q: Array, u: Array) -> tuple[tuple[str, ...], Array]:
    """Names of what has limits on both sides, and min(x - lower, upper - x) / (upper - lower), (N, limited).

    Looked at are inputs and the coordinates that follow no other; 0.5 in the middle, below 0 beyond a limit.
    """
    own = robot.following.independent
    lower, upper = np.concatenate([kept.inputs, kept.coordinates[own]]).T
    x = np.hstack([u, q[:, own]])
    names = (*(f"u_{name}" for name in robot.u_names), *(robot.q_names[i] for i in own))
    ranged = np.isfinite(upper - lower) & (upper > lower)
    x, lower, upper = x[:, ranged], lower[ranged], upper[ranged]
    shares = np.minimum(x - lower, upper - x) / (upper - lower)
    return tuple(name for name, has in zip(names, ranged, strict=True) if has), np.asarray(shares)
