"""Where a robot goes while its inputs are held, and where its platform gets by rolling on."""

from typing import NamedTuple

import numpy as np

from nmm.base.arrays import Array, Integers
from nmm.base.kernels.compiled import call_platform, checked_by_caller, clear, compiled, scratch
from nmm.base.kernels.linear_algebra import copied
from nmm.base.kernels.record_layout import IntegerVector, Memory, Vector, views
from nmm.base.kernels.signatures import float64, int64, void
from nmm.base.kernels.velocity_map import place_mimic_joints
from nmm.model.robots.robot import Robot


class Inputs(NamedTuple):
    """What a robot's inputs move: the platform's first `coordinates` by its kernel, qp_dot = G(qp) up, and
    `parameters`; the coordinates `moved` (m - p,) by the arm's; `mimic_joints` (4 k,) as in
    `nmm.base.kernels.velocity_map`."""

    platform: int
    parameters: Vector
    coordinates: int
    moved: IntegerVector
    mimic_joints: Vector


@compiled
def hold(inputs: Inputs, q: Array, u: Array, dt: float, ahead: Array) -> None:
    """ahead (n,): q after dt with u held constant; RK4 on the platform's part, the joints' is exact."""
    hold_rates(inputs, q, u, scratch(0), dt, ahead)


@compiled
def hold_rates(inputs: Inputs, q: Array, u: Array, u_dot: Array, dt: float, ahead: Array) -> None:
    """As `hold`, with u_dot (m,) held constant, from u on; (0,) for inputs that are constant."""
    n_p, p = inputs.coordinates, u.shape[0] - inputs.moved.shape[0]
    G, G_q, stage, slope = scratch((n_p, p)), scratch((n_p, p, n_p)), scratch(n_p), scratch(n_p)
    copied(q, ahead)
    for k in range(4):
        for i in range(n_p):
            stage[i] = q[i] + (0.0 if k == 0 else (dt if k == 3 else 0.5 * dt) * slope[i])
        later = 0.0 if k == 0 else (dt if k == 3 else 0.5 * dt)
        clear(G)
        clear(G_q)
        call_platform(inputs.platform, stage, inputs.parameters, G, G_q)
        for i in range(n_p):
            slope[i] = 0.0
            for j in range(p):
                rate = u[j] + later * u_dot[j] if u_dot.shape[0] > 0 else u[j]
                slope[i] += G[i, j] * rate
            ahead[i] += dt * slope[i] / (6.0 if k == 0 or k == 3 else 3.0)
    for j in range(inputs.moved.shape[0]):
        ahead[inputs.moved[j]] += dt * u[p + j]
        if u_dot.shape[0] > 0:
            ahead[inputs.moved[j]] += 0.5 * dt * dt * u_dot[p + j]
    place_mimic_joints(ahead, inputs.mimic_joints)


@compiled
def _hold(
    integers: Integers, floats: Array, q: Array, u: Array, u_dot: Array, dt: float, ahead: Array
) -> None:
    hold_rates(views(Inputs, integers, floats, 0), q, u, u_dot, dt, ahead)


_FLAT = float64[::1]
_HOLD = void(int64[::1], _FLAT, _FLAT, _FLAT, _FLAT, float64, _FLAT)
#: Of inputs that are constant.
NO_RATES = np.zeros(0)


def inputs_of(robot: Robot) -> Inputs:
    platform = robot.platform
    return Inputs(
        platform.velocity_map.address,
        platform.parameters,
        platform.n_p,
        robot.arm_coordinates,
        robot.following.table.ravel(),
    )


class HeldInputs:
    def __init__(self, robot: Robot) -> None:
        memory = Memory()
        memory.add(inputs_of(robot))
        self._blocks = memory.blocks()
        self._hold = checked_by_caller(_hold, _HOLD)

    def __call__(self, q: Array, u: Array, dt: float, u_dot: Array = NO_RATES) -> Array:
        """q (n,) after dt, s, with the inputs u (m,), or with u_dot (m,) from u on."""
        q = np.ascontiguousarray(q, dtype=np.float64)
        u = np.ascontiguousarray(u, dtype=np.float64)
        ahead = np.empty_like(q)
        self._hold(*self._blocks, q, u, u_dot, dt, ahead)
        return ahead


#: Steps of RK4 on the way; a unicycle's straight line and a turn of 90° come out to 1e-4 of the way.
STEPS = 4


@compiled
def roll(
    kernel: int, parameters: Array, p: int, q: Array, up: Array, way: float, steps: int, at: Array, D: Array
) -> None:
    """at = qp (n_p,) after a way along G(qp) up by RK4; D (n_p, n_p) = its derivative in the first qp."""
    n_p = at.shape[0]
    G, G_q = scratch((n_p, p)), scratch((n_p, p, n_p))
    first, stage, slope = scratch(n_p), scratch(n_p), scratch(n_p)
    first_D, stage_D, slopes = scratch((n_p, n_p)), scratch((n_p, n_p)), scratch((n_p, n_p))
    clear(slope)
    clear(slopes)
    for i in range(n_p):
        at[i] = q[i]
        for j in range(n_p):
            D[i, j] = 1.0 if i == j else 0.0
    h = way / steps
    for _ in range(steps):
        copied(at, first)
        for i in range(n_p):
            copied(D[i], first_D[i])
        for k in range(4):
            part = 0.0 if k == 0 else h if k == 3 else 0.5 * h
            for i in range(n_p):
                stage[i] = first[i] + part * slope[i]
                for j in range(n_p):
                    stage_D[i, j] = first_D[i, j] + part * slopes[i, j]
            clear(G)
            clear(G_q)
            call_platform(kernel, stage, parameters, G, G_q)
            clear(slope)
            clear(slopes)
            share = h / (6.0 if k == 0 or k == 3 else 3.0)
            for i in range(n_p):
                for j in range(p):
                    slope[i] += G[i, j] * up[j]
                    for a in range(n_p):
                        for c in range(n_p):
                            slopes[i, c] += G_q[i, j, a] * up[j] * stage_D[a, c]
                at[i] += share * slope[i]
                for j in range(n_p):
                    D[i, j] += share * slopes[i, j]


class RollingPreview:
    """The configuration after the platform has rolled on with its steering as it is.
    up (p,) : the smallest inputs that roll it on by 1 m at coordinates 0
    rolls : whether it has to roll to turn (a car, not a unicycle nor what moves sideways)"""

    def __init__(self, robot: Robot) -> None:
        platform = robot.platform
        self._platform = (platform.velocity_map.address, platform.parameters, platform.p)
        self._n_p = platform.n_p
        self.up, self.rolls = np.zeros(platform.p), False
        if platform.n_p >= 3:
            body = platform.G(np.zeros(platform.n_p))[:3]
            self.up = np.linalg.pinv(body) @ [1.0, 0.0, 0.0]
            self.rolls = bool(np.linalg.matrix_rank(body) == 1)

    def __call__(self, q: Array, way: float) -> tuple[Array, Array]:
        """q (n,) after a way, m, and the derivative (n_p, n_p) of its platform coordinates in those of q."""
        n_p = self._n_p
        ahead, at, derivative = q.copy(), np.empty(n_p), np.empty((n_p, n_p))
        roll(*self._platform, q, self.up, way, STEPS, at, derivative)
        ahead[:n_p] = at
        return ahead, derivative
