"""The Jacobian that objectives speak of, its decomposition, and derivatives of what is made of it.

J = D (rows of a frame's Jacobian) S W^-1/2: D divides rows of metres by a length, S is the platform's and the
arm's velocity map (or the part asked for), W holds weights of the inputs, a heavy one counting for less.
Every function φ(J) has the gradient Σ_ij X_ij ∂J_ij/∂q_k, X = ∂φ/∂J: `contract` does that for any X.

numbers = [platform inputs that count p, rows s, arm inputs; the rows; their factors; coordinates that the arm
inputs move; factors of the inputs; followers (`nmm.kernels.followers`)].
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Literal

import numpy as np

from nmm.arrays import Array, positive, vector
from nmm.errors import InputError, expect_known
from nmm.functions.function import natural_size
from nmm.kernels.compiled import compiled, scratch, view
from nmm.kernels.followers import add_to_leaders
from nmm.kernels.linear_algebra import orthonormal_rows, pseudoinverse_transposed
from nmm.kernels.records import At, Frames
from nmm.robots.input_weights import Weights, by_name
from nmm.robots.robot import Robot

ROWS = {"x": 0, "y": 1, "z": 2, "rx": 3, "ry": 4, "rz": 5}
#: Whose inputs count.
Part = Literal["robot", "arm", "platform"]
#: J has lost rank, to rounding, where `orthonormal_rows` is at most this.
LOST = 1e-12


@compiled
def shape_of(numbers: Array) -> tuple[int, int]:
    """(s, m) of J."""
    return int(numbers[1]), int(numbers[0]) + int(numbers[2])


@compiled
def decomposed(
    at: At, frames: Frames, numbers: Array, J_q: Array, J: Array, order: Array, L: Array, X: Array
) -> bool:
    """J = L Q[order] and X = (J⁺)ᵀ, all (s, m) but L (s, s) and J_q (s, n); whether J has full row rank.

    J_q = D (rows of the frame's Jacobian), with what is by a follower added to its leader's.
    """
    s, m = J.shape
    n, n_p, p, arm = at.q.shape[0], at.G.shape[0], int(numbers[0]), int(numbers[2])
    frame = frames.slots[0]
    moved = view(numbers, 3 + 2 * s, (arm,))
    factors = view(numbers, 3 + 2 * s + arm, (m,))
    first = 3 + 2 * s + arm + m
    followers = view(numbers, first, (numbers.shape[0] - first,))
    scales = scratch(s)
    Q = scratch((s, m))
    for i in range(s):
        scales[i] = 1.0
        for a in range(n):
            J_q[i, a] = numbers[3 + s + i] * frames.jacobians[frame, int(numbers[3 + i]), a]
        add_to_leaders(J_q, i, followers)
        for j in range(p):
            J[i, j] = 0.0
            for a in range(n_p):
                J[i, j] += J_q[i, a] * at.G[a, j]
        for j in range(arm):
            J[i, p + j] = J_q[i, int(moved[j])]
        for j in range(m):
            J[i, j] *= factors[j]
    if not orthonormal_rows(J, scales, order, L, Q) > LOST:
        return False
    pseudoinverse_transposed(order, L, Q, X)
    return True


@compiled
def contract(at: At, frames: Frames, numbers: Array, J_q: Array, X: Array, gradient: Array) -> None:
    """gradient (n,) += Σ_ij X_ij ∂J_ij/∂q_k, by ∂J/∂q_k = D (H_k S + J_q ∂S/∂q_k) W^-1/2.

    Z = D X W^-1/2 Sᵀ (s, n) meets the frame's Hessian once, whatever the number of inputs.
    """
    s, m = X.shape
    n, n_p, p, arm = at.q.shape[0], at.G.shape[0], int(numbers[0]), int(numbers[2])
    frame = frames.slots[0]
    moved = view(numbers, 3 + 2 * s, (arm,))
    factors = view(numbers, 3 + 2 * s + arm, (m,))
    first = 3 + 2 * s + arm + m
    z = scratch(n)
    for i in range(s):
        row = int(numbers[3 + i])
        for a in range(n):
            z[a] = 0.0
        for j in range(p):
            x = X[i, j] * factors[j]
            for a in range(n_p):
                z[a] += x * at.G[a, j]
                for k in range(n_p):
                    gradient[k] += x * J_q[i, a] * at.G_q[a, j, k]
        for j in range(arm):
            z[int(moved[j])] = X[i, p + j] * factors[p + j]
        for f in range(first, numbers.shape[0], 4):
            z[int(numbers[f])] += numbers[f + 2] * z[int(numbers[f + 1])]
        for a in range(n):
            x = numbers[3 + s + i] * z[a]
            if x != 0.0:
                for k in range(n):
                    gradient[k] += x * frames.hessians[frame, row, a, k]


def picked_rows(rows: str | Sequence[str], what: str) -> tuple[str, ...]:
    """Some of x, y, z, rx, ry, rz, each once."""
    picked = tuple(rows)
    if not picked or len(set(picked)) != len(picked):
        raise InputError(f"{what} rows: expected some of {', '.join(ROWS)}, each once, got {rows!r}")
    for row in picked:
        expect_known(f"{what} row", row, ROWS)
    return picked


def jacobian_numbers(
    robot: Robot,
    rows: Sequence[str],
    of: Part,
    what: str,
    weights: Weights | None = None,
    length: float | None = 1.0,
) -> Array:
    """What the kernels above read.

    Parameters
    ----------
    rows : names of `ROWS`
    of : whose inputs count
    what : the objective's name, for errors
    weights : of all the robot's inputs; a heavy one counts for less
    length : by which rows of metres are divided; the robot's reach when None

    Raises
    ------
    InputError : more rows than inputs, bad weights
    """
    p = 0 if of == "arm" else robot.platform.p
    arm = robot.arm_coordinates[: 0 if of == "platform" else None]
    inputs = p + len(arm)
    if len(rows) > inputs:
        raise InputError(
            f"{what} of the {of}: {len(rows)} rows with {inputs} inputs is "
            f"always 0; expected at most {inputs} rows"
        )
    own = robot.platform.p
    counted = [*range(p), *(own + j for j in range(len(arm)))]
    metres = natural_size("m", robot) if length is None else length
    scales = [1.0 / metres if ROWS[row] < 3 else 1.0 for row in rows]
    factors = _factors(weights, robot)[counted]
    return np.array(
        [
            p,
            len(rows),
            len(arm),
            *(ROWS[row] for row in rows),
            *scales,
            *arm,
            *factors,
            *robot.following.table.ravel(),
        ],
        dtype=float,
    )


def _factors(weights: Weights | None, robot: Robot) -> Array:
    """W^-1/2, (n_u,)."""
    if weights is None:
        return np.ones(robot.n_u)
    if isinstance(weights, Mapping):
        found = by_name(weights, robot.u_names, robot.groups)
    else:
        found = vector(weights, robot.n_u, "weights")
    for weight, name in zip(found, robot.u_names, strict=True):
        positive(weight, f"weights: {name}")
    return np.asarray(1.0 / np.sqrt(found))
