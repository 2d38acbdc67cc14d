"""Potential energy: how high the robot carries its masses."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from nmm.base.arrays import Array, nonzero_vector
from nmm.base.kernels.compiled import kernel
from nmm.base.kernels.records import FUNCTION, At, Frames, Rows
from nmm.control.functions.function import Stage
from nmm.control.functions.objectives.base import Objective
from nmm.control.functions.tasks.position import CenterOfMass
from nmm.model.robots.robot import CENTER_OF_MASS, Robot


@kernel(FUNCTION)
def potential_energy(at: At, frames: Frames, numbers: Array, rows: Rows) -> None:
    """V = w·c, c the centre of mass; numbers = w = -m g (3,), N."""
    for i in range(3):
        rows.value[0] += numbers[i] * frames.placements[frames.slots[0], i, 3]
        for k in range(at.q.shape[0]):
            rows.value_q[0, k] += numbers[i] * frames.jacobians[frames.slots[0], i, k]


class PotentialEnergy(Objective):
    """Potential energy V(q) = -m g·c(q), J, of all masses in gravity, c their centre.

    Its gradient is the torques and forces that hold the robot against gravity. It is in J: beside objectives
    near 1, weigh it by 1 / (m g l) or so. Kinetic energy is of u, not of q: a resolver's `weights`.

    Parameters
    ----------
    gravity : g, m/s², three numbers in world axes; the model's own, as a rule (0, 0, -9.81), when not given

    Examples
    --------
    >>> robot = nmm.load("unicycle_3r")
    >>> V = nmm.PotentialEnergy()
    >>> up, ahead = (nmm.Configuration(robot, robot.q({"q2": q2})) for q2 in (0.0, np.pi / 2))
    >>> V.value(up) > V.value(ahead)
    True
    """

    def __init__(self, gravity: ArrayLike | None = None) -> None:
        self.gravity = None if gravity is None else nonzero_vector(gravity, 3, "gravity")

    def stages(self, robot: Robot) -> tuple[Stage, ...]:
        CenterOfMass().rows(robot)
        g: Array = np.array(robot.model.gravity.linear) if self.gravity is None else self.gravity
        mass = sum(inertia.mass for inertia in robot.model.inertias)
        return (Stage(potential_energy, 1, (CENTER_OF_MASS,), -mass * g),)
