"""Where a motion is between its limits, and how near it comes to them, as shares of their range."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from nmm.arrays import Array, Flags
from nmm.control.limits import LimitsOn
from nmm.functions.function import natural_size
from nmm.robots.robot import Robot

#: From the middle of a range on its other half counts; a limit that stands alone has none.
MIDDLE = 0.5
#: What moves by no more than this share of its range stands still.
STILL = 1e-9


def shares(kept: LimitsOn, robot: Robot, q: Array, u: Array, rows: Array) -> tuple[tuple[str, ...], Array]:
    """Names of what has limits, and (x - lower) / (upper - lower), (N, limited).

    Looked at are inputs, the coordinates that follow no other, and of what else is limited (`kept.rows`) the
    values given, (N, rows), or none, (N, 0). 0 is at the lower limit, 1 at the upper one. A limit on one side
    alone counts as the end of a range as long as the natural size of its unit (metres: the robot's reach;
    anything else: 1), whose other half is not there: what is farther than half of it away is at 0.5.
    """
    own = robot.following.independent
    names = [*(f"u_{name}" for name in robot.u_names), *(robot.q_names[i] for i in own)]
    units = [*(unit.partition("/")[0] for unit in robot.u_units), *(robot.q_units[i] for i in own)]
    limits = [*kept.inputs, *kept.coordinates[own]]
    x = [*u.T, *q[:, own].T]
    for row, values in zip(kept.row_limits, rows.T, strict=False):
        # Limits of coordinates without an input of their own are there already.
        if not any(
            row.name == name and np.array_equal(row[2:], ends)
            for name, ends in zip(names, limits, strict=True)
        ):
            names.append(row.name)
            units.append(row.unit)
            limits.append(np.array([row.lower, row.upper]))
            x.append(values)
    lower, upper = np.array(limits).T
    some = np.flatnonzero((np.isfinite(lower) | np.isfinite(upper)) & (upper > lower))
    found = [_share(x[i], lower[i], upper[i], natural_size(units[i], robot)) for i in some]
    return tuple(names[i] for i in some), np.array(found).reshape(len(some), len(q)).T


def _share(x: Array, lower: float, upper: float, size: float) -> Array:
    if np.isinf(upper):
        return np.asarray(np.minimum((x - lower) / size, MIDDLE))
    if np.isinf(lower):
        return np.asarray(np.maximum(1.0 - (upper - x) / size, MIDDLE))
    return np.asarray((x - lower) / (upper - lower))


def standing(robot: Robot, names: Sequence[str], shares: Array) -> Flags:
    """Which of `names` are coordinates that stay where they are, within their limits, in all samples,
    (limited,): a gripper that stays closed."""
    still = np.ptp(shares, axis=0) <= STILL if len(shares) > 1 else np.zeros(len(names), dtype=bool)
    within = np.all((shares >= -STILL) & (shares <= 1.0 + STILL), axis=0)
    return np.asarray(still & within & np.array([name in robot.q_names for name in names], dtype=bool))


def at_limits(robot: Robot, names: Sequence[str], shares: Array) -> list[str]:
    """The coordinates that stand at a limit in all samples."""
    still = standing(robot, names, shares)
    return [
        name
        for name, stands, share in zip(names, still, shares.T, strict=True)
        if stands and min(share[0], 1.0 - share[0]) <= STILL
    ]


def nearest(robot: Robot, names: Sequence[str], shares: Array) -> str:
    """What comes nearest to a limit, or farthest beyond it, of all that does not stand; "" for nothing."""
    distances = np.minimum(shares, 1.0 - shares).min(axis=0, initial=np.inf)
    distances[standing(robot, names, shares)] = np.inf
    return names[int(np.argmin(distances))] if np.isfinite(distances).any() else ""


def margin(shares: Array) -> Array:
    """min(x - lower, upper - x) / (upper - lower) of what is nearest to a limit, (N,); infinite for nothing.

    0.5 in the middle, below 0 beyond a limit; a limit on one side alone: see `shares`.
    """
    return np.asarray(np.minimum(shares, 1.0 - shares).min(axis=1, initial=np.inf))
