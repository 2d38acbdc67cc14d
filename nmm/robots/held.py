"""Where a robot goes while its inputs are held."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import types

from nmm.arrays import Array, Integers
from nmm.kernels.compiled import call_platform, checked_by_caller, clear, compiled, scratch
from nmm.kernels.followers import place_followers
from nmm.kernels.memory import IntegerVector, Memory, Vector, views
from nmm.robots.robot import Robot


class Inputs(NamedTuple):
    """What a robot's inputs move.

    platform : the kernel of its velocity map, qp_dot = G(qp) up; parameters : what that reads
    coordinates : how many the platform has, n_p
    moved (m - p,) : the coordinates that the arm's inputs move
    followers (4 k,) : see `nmm.kernels.followers`
    """

    platform: int
    parameters: Vector
    coordinates: int
    moved: IntegerVector
    followers: Vector


@compiled
def hold(inputs: Inputs, q: Array, u: Array, dt: float, ahead: Array) -> None:
    """ahead (n,): q after dt with u held constant; RK4 on the platform's part, the joints' is exact."""
    n_p, p = inputs.coordinates, u.shape[0] - inputs.moved.shape[0]
    G, G_q, stage, slope = scratch((n_p, p)), scratch((n_p, p, n_p)), scratch(n_p), scratch(n_p)
    for i in range(q.shape[0]):
        ahead[i] = q[i]
    for k in range(4):
        for i in range(n_p):
            stage[i] = q[i] + (0.0 if k == 0 else (dt if k == 3 else 0.5 * dt) * slope[i])
        clear(G)
        clear(G_q)
        call_platform(inputs.platform, stage, inputs.parameters, G, G_q)
        for i in range(n_p):
            slope[i] = 0.0
            for j in range(p):
                slope[i] += G[i, j] * u[j]
            ahead[i] += dt * slope[i] / (6.0 if k == 0 or k == 3 else 3.0)
    for j in range(inputs.moved.shape[0]):
        ahead[inputs.moved[j]] += dt * u[p + j]
    place_followers(ahead, inputs.followers)


@compiled
def _hold(integers: Integers, floats: Array, q: Array, u: Array, dt: float, ahead: Array) -> None:
    hold(views(Inputs, integers, floats, 0), q, u, dt, ahead)


_FLAT = types.float64[::1]
_HOLD = types.void(types.int64[::1], _FLAT, _FLAT, _FLAT, types.float64, _FLAT)


def inputs_of(robot: Robot) -> Inputs:
    """The record of one robot."""
    platform = robot.platform
    return Inputs(
        platform.velocity_map.address,
        platform.parameters,
        platform.n_p,
        robot.arm_coordinates,
        robot.following.table.ravel(),
    )


class Held:
    """The motion of one robot with constant inputs."""

    def __init__(self, robot: Robot) -> None:
        memory = Memory()
        memory.add(inputs_of(robot))
        self._blocks = memory.blocks()
        self._hold = checked_by_caller(_hold, _HOLD)

    def __call__(self, q: Array, u: Array, dt: float) -> Array:
        """q (n,) after dt, s, with the inputs u (m,)."""
        q = np.ascontiguousarray(q, dtype=np.float64)
        u = np.ascontiguousarray(u, dtype=np.float64)
        ahead = np.empty_like(q)
        self._hold(*self._blocks, q, u, dt, ahead)
        return ahead
