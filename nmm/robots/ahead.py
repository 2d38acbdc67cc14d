"""Where a platform comes when it rolls on as it stands, and what that changes with where it stands."""

from __future__ import annotations

import numpy as np

from nmm.arrays import Array
from nmm.kernels.compiled import allocating, call_platform
from nmm.robots.robot import Robot

#: Steps of RK4 on the way; a unicycle's straight line and a turn of 90° come out to 1e-4 of the way.
STEPS = 4


@allocating
def roll(
    kernel: int, parameters: Array, n_p: int, p: int, q: Array, up: Array, way: float, steps: int
) -> tuple[Array, Array]:
    """qp (n_p,) after a way along G(qp) up, and its derivative (n_p, n_p) in the qp of the start.

    RK4 on qp' = G up and D' = (∂G/∂qp up) D, which is the exact derivative of what RK4 gives for qp.
    """
    at, D = q[:n_p].copy(), np.eye(n_p)
    G, G_q = np.zeros((n_p, p)), np.zeros((n_p, p, n_p))
    slope, slopes = np.zeros(n_p), np.zeros((n_p, n_p))
    h = way / steps
    for _ in range(steps):
        first, first_D = at.copy(), D.copy()
        for k in range(4):
            part = 0.0 if k == 0 else h if k == 3 else 0.5 * h
            stage, stage_D = first + part * slope, first_D + part * slopes
            G[:] = 0.0
            G_q[:] = 0.0
            call_platform(kernel, stage, parameters, G, G_q)
            for i in range(n_p):
                slope[i] = 0.0
                slopes[i] = 0.0
                for j in range(p):
                    slope[i] += G[i, j] * up[j]
                    for a in range(n_p):
                        for c in range(n_p):
                            slopes[i, c] += G_q[i, j, a] * up[j] * stage_D[a, c]
            share = h / (6.0 if k == 0 or k == 3 else 3.0)
            at += share * slope
            D += share * slopes
    return at, D


class Ahead:
    """The configuration in which a robot is when its platform has rolled on, its steering as it is.

    Attributes
    ----------
    up (p,) : the inputs that roll a platform on by 1 m where all its coordinates are 0; the least ones
    rolls : whether it has to roll to turn, as a car; not a unicycle, and not what goes to the side
    """

    def __init__(self, robot: Robot) -> None:
        platform = robot.platform
        self._platform = (platform.velocity_map.address, platform.parameters, platform.n_p, platform.p)
        self.up, self.rolls = np.zeros(platform.p), False
        if platform.n_p >= 3:
            body = platform.G(np.zeros(platform.n_p))[:3]
            self.up = np.linalg.pinv(body) @ [1.0, 0.0, 0.0]
            self.rolls = bool(np.linalg.matrix_rank(body) == 1)

    def __call__(self, q: Array, way: float) -> tuple[Array, Array]:
        """(q (n,) after a way, m, the derivative (n_p, n_p) of its platform's coordinates in those of q)."""
        n_p = self._platform[2]
        ahead = q.copy()
        ahead[:n_p], derivative = roll(*self._platform, q, self.up, way, STEPS)
        return ahead, derivative
