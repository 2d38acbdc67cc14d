"""Where a motion is between its limits, and how near it comes to them, as shares of their range."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from nmm.base.arrays import Array, Flags
from nmm.control.functions.function import natural_size
from nmm.control.limits.limits import LimitsOn
from nmm.model.robots.robot import Robot

#: The middle of a range, where what is far from a one-sided limit is placed.
MIDDLE = 0.5
#: What moves by no more than this share of its range stands still.
STILL = 1e-9


def shares(kept: LimitsOn, robot: Robot, q: Array, u: Array, rows: Array) -> tuple[tuple[str, ...], Array]:
    """Names of limited quantities and (x - lower) / (upper - lower), (N, limited): inputs, independent
    coordinates and `rows` (N, rows), named by `kept.rows`. A one-sided limit ends a range of its unit's
    natural size (m: the robot's reach, else 1); what is farther than half of it away is at 0.5."""
    own = robot.following.independent
    names = [*(f"u_{name}" for name in robot.u_names), *(robot.q_names[i] for i in own)]
    units = [*(unit.partition("/")[0] for unit in robot.u_units), *(robot.q_units[i] for i in own)]
    sizes = [natural_size(unit, robot) for unit in units]
    limits = [*kept.inputs, *kept.coordinates[own]]
    x = [*u.T, *q[:, own].T]
    for row, values in zip(kept.row_limits, rows.T, strict=False):
        # Limits of coordinates without an input of their own are there already.
        ranges = [ends for name, ends in zip(names, limits, strict=True) if name == row.name]
        if not any(np.array_equal(row[2:], ends) for ends in ranges):
            names.append(row.name)
            sizes.append(kept.sizes.get(row.name, natural_size(row.unit, robot)))
            limits.append(np.array([row.lower, row.upper]))
            x.append(values)
    lower, upper = np.array(limits).T
    some = np.flatnonzero((np.isfinite(lower) | np.isfinite(upper)) & (upper > lower))
    columns = [_share(x[i], lower[i], upper[i], sizes[i]) for i in some]
    return tuple(names[i] for i in some), np.array(columns).reshape(len(some), len(q)).T


def _share(x: Array, lower: float, upper: float, size: float) -> Array:
    if np.isinf(upper):
        return np.asarray(np.minimum((x - lower) / size, MIDDLE))
    if np.isinf(lower):
        return np.asarray(np.maximum(1.0 - (upper - x) / size, MIDDLE))
    return np.asarray((x - lower) / (upper - lower))


def standing(robot: Robot, names: Sequence[str], shares: Array) -> Flags:
    """Which of `names` are coordinates at rest within their limits, (limited,): a closed gripper, say."""
    still = np.ptp(shares, axis=0) <= STILL if len(shares) > 1 else np.zeros(len(names), dtype=bool)
    within = np.all((shares >= -STILL) & (shares <= 1.0 + STILL), axis=0)
    return np.asarray(still & within & np.array([name in robot.q_names for name in names], dtype=bool))


def at_limits(robot: Robot, names: Sequence[str], shares: Array) -> list[str]:
    still = standing(robot, names, shares)
    return [
        names[i] for i in np.flatnonzero(still).tolist() if min(shares[0, i], 1.0 - shares[0, i]) <= STILL
    ]


def nearest_limits(robot: Robot, names: Sequence[str], shares: Array) -> str:
    """The moving quantity nearest to, or farthest beyond, a limit; "" for none."""
    distances = np.minimum(shares, 1.0 - shares).min(axis=0, initial=np.inf)
    distances[standing(robot, names, shares)] = np.inf
    return names[int(np.argmin(distances))] if np.isfinite(distances).any() else ""


def margin(shares: Array) -> Array:
    """The least min(x - lower, upper - x) / (upper - lower), (N,): 0.5 in the middle, below 0 beyond a limit,
    inf without limits; for one-sided limits see `shares`."""
    return np.asarray(np.minimum(shares, 1.0 - shares).min(axis=1, initial=np.inf))
