"""Where a motion is between its limits, and how near it comes to them, as shares of their range."""

from __future__ import annotations

import numpy as np

from nmm.arrays import Array
from nmm.control.limits import LimitsOn
from nmm.robots.robot import Robot


def shares(kept: LimitsOn, robot: Robot, q: Array, u: Array, rows: Array) -> tuple[tuple[str, ...], Array]:
    """Names of what has limits on both sides, and (x - lower) / (upper - lower), (N, limited).

    Looked at are inputs, the coordinates that follow no other, and of what else is limited (`kept.rows`) the
    values given, (N, rows), or none, (N, 0). 0 is at the lower limit, 1 at the upper one.
    """
    own = robot.following.independent
    names = [*(f"u_{name}" for name in robot.u_names), *(robot.q_names[i] for i in own)]
    limits = [*kept.inputs, *kept.coordinates[own]]
    x = [*u.T, *q[:, own].T]
    for row, values in zip(kept.row_limits, rows.T, strict=False):
        if row.name not in names:  # coordinates without an input of their own are there already
            names.append(row.name)
            limits.append(np.array([row.lower, row.upper]))
            x.append(values)
    lower, upper = np.array(limits).T
    ranged = np.flatnonzero(np.isfinite(upper - lower) & (upper > lower))
    found = (np.array(x).T[:, ranged] - lower[ranged]) / (upper - lower)[ranged]
    return tuple(names[i] for i in ranged), found


def margin(shares: Array) -> Array:
    """min(x - lower, upper - x) / (upper - lower) of what is nearest to a limit, (N,); infinite for nothing.

    0.5 in the middle, below 0 beyond a limit.
    """
    return np.asarray(np.minimum(shares, 1.0 - shares).min(axis=1, initial=np.inf))
