"""Where a robot goes while its inputs are held."""

from __future__ import annotations

import numpy as np

from nmm.arrays import Array
from nmm.kernels.compiled import allocating, call_platform
from nmm.robots.robot import Robot


@allocating
def drive(kernel: int, parameters: Array, n_p: int, p: int, q: Array, u: Array, dt: float) -> Array:
    """The platform's coordinates (n_p,) after dt with the inputs held constant: RK4 on qp_dot = G(qp) up."""
    ahead = q[:n_p].copy()
    G = np.zeros((n_p, p))
    G_q = np.zeros((n_p, p, n_p))
    stage = q[:n_p].copy()
    slope = np.zeros(n_p)
    for k in range(4):
        if k > 0:
            stage[:] = q[:n_p] + (dt if k == 3 else 0.5 * dt) * slope
        G[:] = 0.0
        call_platform(kernel, stage, parameters, G, G_q)
        for i in range(n_p):
            slope[i] = 0.0
            for j in range(p):
                slope[i] += G[i, j] * u[j]
            ahead[i] += dt * slope[i] / (6.0 if k == 0 or k == 3 else 3.0)
    return ahead


class Held:
    """The motion of one robot with constant inputs; the joints' part is exact."""

    def __init__(self, robot: Robot) -> None:
        platform = robot.platform
        self._platform = (platform.velocity_map.address, platform.parameters, platform.n_p, platform.p)
        self._arm = robot.arm_coordinates
        self._following = robot.following if robot.followers else None

    def __call__(self, q: Array, u: Array, dt: float) -> Array:
        """q (n,) after dt, s, with the inputs u (m,)."""
        n_p, p = self._platform[2:]
        ahead = q.copy()
        ahead[:n_p] = drive(*self._platform, q, u, dt)
        ahead[self._arm] += dt * u[p:]
        return ahead if self._following is None else self._following.placed(ahead)
