"""Joints that are measured where they cannot be."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from nmm.base.arrays import Array
from nmm.model.robots.robot import Robot


class FarLimits:
    """Bounds a share of the range beyond the limits of coordinates: the file's, or those that are kept (n, 2)
    where these are wider or the file has none. Where one side has none, the range is 1 m or rad. Mimic joints
    are left to their leaders."""

    def __init__(self, robot: Robot, kept: Array, share: float) -> None:
        self._robot = robot
        lower, upper = np.where(np.isfinite(robot.q_limits), robot.q_limits, kept).T
        self._limits = np.column_stack([np.minimum(lower, kept[:, 0]), np.maximum(upper, kept[:, 1])])
        bounded = np.isfinite(self._limits).all(axis=1)
        span = np.where(bounded, self._limits[:, 1] - self._limits[:, 0], 1.0)
        span = np.maximum(span, 1e-9)  # of a joint that is held
        span[[robot.coordinate(one.joint) for one in robot.mimic_joints]] = math.inf
        with np.errstate(invalid="ignore"):  # 0 of an infinite range
            self._least, self._most = self._limits.T + np.array([[-share], [share]]) * span

    def beyond(self, q: Array) -> list[dict[str, Any]]:
        """The coordinates of q (n,) beyond the bounds: name, value, unit, and their limits, None for none."""
        out = (q < self._least) | (q > self._most)
        if not out.any():
            return []
        found = []
        for i in np.flatnonzero(out):
            lower, upper = (float(one) if math.isfinite(one) else None for one in self._limits[i])
            name, unit = self._robot.q_names[i], self._robot.q_units[i]
            found.append({"name": name, "value": float(q[i]), "unit": unit, "lower": lower, "upper": upper})
        return found
