"""Least squares of an arm's numbers, also where some of what was seen is far off."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.optimize import least_squares

from nmm.base.arrays import Array
from nmm.plugins.robot.calibration.arm.model import ArmModel


def robust(
    model: ArmModel,
    values: Array,
    free: Sequence[int],
    noise: Array,
    pull: Array,
    centre: Array,
    rounds: int,
    most: int = 40,
) -> Array:
    """The values with free numbers (f,) of least squares, of residuals over their noise (g,) and of pulls
    (p, f) to a centre (f,); of soft L1 with weights taken anew in so many rounds, plain with none; of so many
    evaluations at most each."""
    for _ in range(max(rounds, 1)):
        rows = model.rows(values)
        w = 1.0 / noise[rows.group]
        if rounds:
            w = w * (1.0 + (rows.r * w) ** 2) ** -0.25
        values = _solved(model, values, [*free], w, pull, centre, most)
    return values


def _solved(
    model: ArmModel, values: Array, free: list[int], w: Array, pull: Array, centre: Array, most: int
) -> Array:
    def at(x: Array) -> Array:
        made = values.copy()
        made[free] = x
        return made

    def off(x: Array) -> Array:
        return np.concatenate([w * model.rows(at(x)).r, pull @ (x - centre)])

    def slopes(x: Array) -> Array:
        return np.concatenate([w[:, np.newaxis] * model.rows(at(x), free).J, pull])

    scales = model.scales[free]
    result = least_squares(
        off, values[free], slopes, method="lm", x_scale=scales, ftol=1e-9, xtol=1e-9, max_nfev=most
    )
    return at(result.x)
