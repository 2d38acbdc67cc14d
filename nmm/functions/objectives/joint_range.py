"""Distance of joints from the middle of their ranges."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from nmm.arrays import Array, vector
from nmm.errors import InputError
from nmm.functions.function import Stage
from nmm.functions.objectives.base import Objective
from nmm.functions.objectives.differences import Term, difference_stages
from nmm.robots.robot import Robot


class JointRange(Objective):
    """Distance from the middle of the joint ranges, H = 1/(2N) Σ ((q - middle) / (upper - lower))²
    (Liégeois 1977); N joints, H from 0 (all in the middle) to 1/8 (all at a limit).

    Parameters
    ----------
    joints : names of coordinates; all the arm's, but those that follow others, when not given
    lower : their lower limits, rad or m; the robot's own when not given
    upper : their upper limits

    Examples
    --------
    >>> robot = nmm.load("unicycle_3r")
    >>> H = nmm.JointRange(["q2"], lower=[-1.0], upper=[1.0])
    >>> H.value(nmm.Configuration(robot, robot.q({"q2": 1.0})))
    0.125
    """

    def __init__(
        self,
        joints: Sequence[str] | None = None,
        lower: ArrayLike | None = None,
        upper: ArrayLike | None = None,
    ) -> None:
        self.joints = None if joints is None else tuple(joints)
        self.lower = lower
        self.upper = upper

    def stages(self, robot: Robot) -> tuple[Stage, ...]:
        joints = robot.u_names[robot.platform.p :] if self.joints is None else self.joints
        if not joints:
            raise InputError(f"joint range: robot {robot.name} has no arm joint")
        lower, upper = ranges(joints, self.lower, self.upper, robot, "joint range")
        weights = 1.0 / (len(joints) * (upper - lower) ** 2)
        middles = (lower + upper) / 2
        return difference_stages(list(map(Term, joints, middles, weights)), robot)


def ranges(
    joints: Sequence[str], lower: ArrayLike | None, upper: ArrayLike | None, robot: Robot, what: str
) -> tuple[Array, Array]:
    """Lower and upper limits of joints, (N,) each, rad and m: those given, or the robot's own.

    Raises
    ------
    InputError : an unknown joint, one without limits, a lower limit that is not below the upper
    """
    indices = [robot.coordinate(name) for name in joints]
    own = robot.q_limits[indices]
    low = np.array(own[:, 0]) if lower is None else vector(lower, len(indices), f"{what}: lower")
    high = np.array(own[:, 1]) if upper is None else vector(upper, len(indices), f"{what}: upper")
    for name, a, b in zip(joints, low, high, strict=True):
        if not (np.isfinite(a) and np.isfinite(b)):
            raise InputError(f"{what}: {name} of robot {robot.name} has no limits; give lower and upper")
        if a >= b:
            raise InputError(f"{what}: expected lower below upper for {name}, got {a:g} and {b:g}")
    return low, high
