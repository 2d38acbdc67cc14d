"""A barrier at the limits of coordinates."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from nmm.arrays import Array, positive
from nmm.errors import InputError
from nmm.functions.function import Stage
from nmm.functions.objectives.base import Objective
from nmm.functions.objectives.joint_range import ranges
from nmm.kernels.compiled import kernel
from nmm.kernels.records import FUNCTION, At, Frames, Rows
from nmm.robots.robot import Robot


@kernel(FUNCTION)
def limit_barrier(at: At, frames: Frames, numbers: Array, rows: Rows) -> None:
    """H = Σ b(x), x = (q - l) / (u - l), b = 1 / (4 x (1 - x)), its Taylor parabola beyond the margin.

    numbers = [margin, then for every coordinate its index, l, u - l].
    """
    margin = numbers[0]
    for i in range(1, numbers.shape[0], 3):
        k = int(numbers[i])
        x = (at.q[k] - numbers[i + 1]) / numbers[i + 2]
        kept = min(max(x, margin), 1.0 - margin)
        y = 1.0 - kept
        slope = 0.25 / (y * y) - 0.25 / (kept * kept)
        curvature = 0.5 / (kept * kept * kept) + 0.5 / (y * y * y)
        beyond = x - kept
        rows.value[0] += 0.25 / (kept * y) + beyond * (slope + 0.5 * curvature * beyond)
        rows.value_q[0, k] += (slope + curvature * beyond) / numbers[i + 2]


class LimitBarrier(Objective):
    """Barrier at the limits, H = Σ (u - l)² / (4 (u - q) (q - l)) (Zghal, Dubey, Euler 1990), from 1 in the
    middle of a range, growing without bound towards its limits, but for the last of the way.

    Within `margin` of a limit, and beyond the limit, the term goes on as the parabola that has its value,
    slope and curvature there (a relaxed barrier: Feller, Ebenbauer 2017). So H is finite and twice
    differentiable everywhere, a start at a limit is no error, and a coordinate outside is pulled back. It is
    an objective: what has to hold is said by `Limits`. Near the limits H is steep, 1 / (2 margin³) in
    curvature over the range squared: α dt has to be small there, or chosen by the resolver (`step: armijo`).

    Parameters
    ----------
    joints : names of coordinates; all that have a lower and an upper limit, but those that follow others,
        when not given
    lower : their lower limits, rad or m; the robot's own when not given
    upper : their upper limits
    margin : share of the range, above 0 and below 1/2, next to each limit in which the parabola stands

    Examples
    --------
    >>> robot = nmm.load("unicycle_3r")
    >>> H = nmm.LimitBarrier(["q2"], lower=[-1.0], upper=[1.0])
    >>> [round(H.value(nmm.Configuration(robot, robot.q({"q2": q2}))), 2) for q2 in (0.0, 0.5, 0.9)]
    [1.0, 1.33, 5.26]
    """

    def __init__(
        self,
        joints: Sequence[str] | None = None,
        lower: ArrayLike | None = None,
        upper: ArrayLike | None = None,
        margin: float = 0.01,
    ) -> None:
        self.joints = None if joints is None else tuple(joints)
        self.lower = lower
        self.upper = upper
        self.margin = positive(margin, "margin")
        if self.margin >= 0.5:
            raise InputError(f"margin: expected a number above 0 and below 0.5, got {self.margin:g}")

    def stages(self, robot: Robot) -> tuple[Stage, ...]:
        joints = self._limited(robot) if self.joints is None else self.joints
        if not joints:
            raise InputError(
                f"limit barrier: robot {robot.name} has no coordinate with a lower and an upper limit"
            )
        lower, upper = ranges(joints, self.lower, self.upper, robot, "limit barrier")
        indices = [robot.coordinate(name) for name in joints]
        table = np.column_stack([indices, lower, upper - lower])
        return (Stage(limit_barrier, 1, (), np.append(self.margin, table.ravel())),)

    @staticmethod
    def _limited(robot: Robot) -> tuple[str, ...]:
        return tuple(robot.q_names[i] for i in robot.following.independent if robot.limited[i].all())
