"""Where a motion goes beyond the limits of its robot: said, not prevented."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from nmm.arrays import Array
from nmm.control.limits import LimitsOn
from nmm.robots.robot import Robot
from nmm.robots.wheel_rates import turning

#: Beyond a limit by less than this part of it is rounding.
SLACK = 1e-6


def outside_at_start(robot: Robot, kept: LimitsOn, q: Array) -> list[str]:
    """A sentence for the coordinates of a start q (n,) that are outside limits, and come back."""
    outside = robot.outside(q, kept.coordinates)
    if not outside:
        return []
    return [
        f"the start is outside limits: {', '.join(outside)}; what is outside comes back at "
        f"{kept.recovery:g} m/s or rad/s"
    ]


def broken_limits(robot: Robot, t: Array, q: Array, u: Array) -> list[str]:
    """A sentence for the coordinates, and one for the inputs, that leave their limits.

    Parameters
    ----------
    t (N,) s, q (N, n), u (N, n_u) : the motion
    """
    lower, upper = robot.q_limits.T
    beyond = np.maximum(q - upper, lower - q)
    coordinates = [
        f"{name} at {t[k]:.3g} s ({q[k, i]:.4g} {unit}; from {lower[i]:.4g} to {upper[i]:.4g})"
        for i, (name, unit) in enumerate(zip(robot.q_names, robot.q_units, strict=True))
        if i in robot.following.independent  # what follows it has its limits, too
        and (k := _first(beyond[:, i], max(1.0, abs(lower[i]), abs(upper[i])))) is not None
    ]
    limits = robot.u_limits
    inputs = [
        f"{name} ({np.abs(u[:, i]).max():.3g} {unit}; at most {limits[i]:.3g})"
        for i, (name, unit) in enumerate(zip(robot.u_names, robot.u_units, strict=True))
        if _first(np.abs(u[:, i]) - limits[i], limits[i]) is not None
    ]
    sentences = []
    if coordinates:
        sentences.append(f"coordinates leave their limits: {', '.join(coordinates)}")
    if inputs:
        sentences.append(f"inputs exceed their limits: {', '.join(inputs)}")
    return sentences


def fast_wheels(robot: Robot, q: Array, q_dot: Array, kept: Collection[str]) -> dict[str, float]:
    """Of the wheels that turn faster than their file's limit, their largest rate, rad/s; q and q_dot (N, n).

    kept : those that had limits in the run, and are not looked at
    """
    names, rates = turning(robot, q, q_dot)
    own = {wheel.joint: wheel.velocity for wheel in robot.wheels}
    largest = dict(zip(names, np.abs(rates).max(axis=0, initial=0.0).tolist(), strict=True))
    return {
        name: rate for name, rate in largest.items() if name not in kept and rate > own[name] * (1.0 + SLACK)
    }


def broken_rows(kept: LimitsOn, t: Array, rows: Array) -> list[str]:
    """A sentence for the functions that leave their limits; rows (N, rows), as `kept.rows` names them."""
    broken = []
    for row, x in zip(kept.row_limits, rows.T, strict=False):
        beyond = np.maximum(x - row.upper, row.lower - x)
        ends = [abs(end) for end in (row.lower, row.upper) if np.isfinite(end)]
        k = _first(beyond, max(1.0, *ends)) if ends else None
        if k is not None:
            samples = np.count_nonzero(beyond > SLACK * max(1.0, *ends))
            broken.append(
                f"{row.name} at {t[k]:.3g} s ({x[k]:.4g} {row.unit}; from {row.lower:.4g} to "
                f"{row.upper:.4g}), by {beyond.max():.3g} at most, in {samples} of {len(t)} samples"
            )
    return [f"limits of functions are broken: {'; '.join(broken)}"] if broken else []


def _first(beyond: Array, size: float) -> int | None:
    """The first sample that is beyond a limit of that size, if there is a limit and one is."""
    if not np.isfinite(size):
        size = 1.0
    found = np.flatnonzero(beyond > SLACK * size)
    return int(found[0]) if found.size else None
