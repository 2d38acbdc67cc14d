"""A robot's motors: driven wheels, steering joints and the arm's joints."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from nmm.base.arrays import Array
from nmm.model.robots.robot import Robot
from nmm.model.robots.wheel_rates import wheel_shares


class Actuators:
    """What moves a robot, and how forces on its inputs divide among it.

    Driven are the wheels on the main body that neither swivel nor are steered; where their turning does not
    say how the platform moves, all wheels. Of all torques τ that give the forces on the platform's inputs,
    the least (in ‖τ‖) are taken. Inputs that no wheel of the file moves keep their force as it is.

    Attributes
    ----------
    names : of wheels, steering coordinates and arm joints, (A,)
    units : N m, or N
    efforts (A,) : the file's limits, infinite where it has none
    """

    def __init__(
        self, robot: Robot, wheels: Sequence[str], rows: Array, efforts: Array, of_joints: Array
    ) -> None:
        self.robot, p = robot, robot.platform.p
        moved = robot.rate_coordinates
        self._own = [j for j in range(p) if moved[j] >= 0]  # steering: the rate of a coordinate
        everywhere = np.random.default_rng(0).uniform(-0.3, 0.3, (2, robot.n))
        fixed = [k for k, row in enumerate(rows) if row[4] < 0.0]
        for chosen in (fixed, [*range(len(rows))], []):
            self._rows = rows[chosen]
            ranks = np.linalg.matrix_rank(self._turned(everywhere)) if p else [0]
            if min(ranks) == p:
                break
        else:  # no wheels, or too few: forces of the inputs themselves
            self._own = [*range(p)]
        driven = [wheels[k] for k in chosen]
        platform = robot.platform
        own = [(robot.q_names[moved[j]] if moved[j] >= 0 else platform.inputs[j]) for j in self._own]
        arm = [robot.q_names[i] for i in robot.arm_coordinates]
        self.names = (*driven, *own, *arm)
        rates = ["rad/s"] * len(driven) + [robot.u_units[j] for j in (*self._own, *range(p, robot.n_u))]
        self.units = tuple("N" if rate == "m/s" else "N m" for rate in rates)
        steered = [of_joints[moved[j]] if moved[j] >= 0 else np.inf for j in self._own]
        self.efforts = np.concatenate([efforts[chosen], steered, of_joints[robot.arm_coordinates]])

    def rates(self, q: Array, u: Array) -> Array:
        """How fast each moves, (N, A) rad/s or m/s, at q (N, n) and u (N, n_u)."""
        p = self.robot.platform.p
        return np.hstack([np.einsum("kij,kj->ki", self._turned(q), u[:, :p]), u[:, p:]])

    def torques(self, q: Array, f: Array) -> Array:
        """Torques (N, A), N m, or forces, N, that make the forces f (N, n_u) on the inputs at q (N, n)."""
        p = self.robot.platform.p
        if not p:
            return f.copy()
        across = np.linalg.pinv(self._turned(q).transpose(0, 2, 1))
        return np.hstack([np.einsum("kij,kj->ki", across, f[:, :p]), f[:, p:]])

    def _turned(self, q: Array) -> Array:
        """R (N, platform's, p): rates of the wheels and of steering, R u_p."""
        platform = self.robot.platform
        G, _ = platform.velocity_maps(q[:, : platform.n_p])
        R = wheel_shares(self._rows, q)[:, :, : platform.n_p] @ G
        return np.hstack([R, np.tile(np.eye(platform.p)[self._own], (len(q), 1, 1))])
