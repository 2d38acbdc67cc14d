"""The Jacobian that objectives speak of, its decomposition, and derivatives of what is made of it.

J = D (rows of a frame's Jacobian) S W^-1/2: D divides rows of metres by a length, S is the platform's and the
arm's velocity map (or the part asked for), W holds weights of the inputs, a heavy one counting for less.
Every function φ(J) has the gradient Σ_ij X_ij ∂J_ij/∂q_k, X = ∂φ/∂J: `contract` does that for any X.

numbers = [platform inputs that count p, rows s, arm inputs; the rows; their factors; coordinates that the arm
inputs move; factors of the inputs; followers (`nmm.kernels.followers`)]: `Header` has their names.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import ClassVar, Literal, NamedTuple, get_args

import numpy as np

from nmm.arrays import Array, positive, vector
from nmm.errors import InputError, expect_known
from nmm.functions.function import natural_size
from nmm.functions.objectives.base import Objective
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


class Header(NamedTuple):
    """The numbers that say which Jacobian it is, as views.

    platform : p, how many of the platform's inputs count
    rows (s,) : of the frame's Jacobian; scales (s,) : D's diagonal, 1/m or 1
    moved (arm inputs,) : the coordinates that they move
    factors (m,) : W^-1/2's diagonal
    followers : see `nmm.kernels.followers`
    """

    platform: int
    rows: Array
    scales: Array
    moved: Array
    factors: Array
    followers: Array


@compiled
def header(numbers: Array) -> Header:
    """The numbers by their names."""
    p, s, arm = int(numbers[0]), int(numbers[1]), int(numbers[2])
    first = 3 + 2 * s + arm + p + arm
    return Header(
        p,
        view(numbers, 3, (s,)),
        view(numbers, 3 + s, (s,)),
        view(numbers, 3 + 2 * s, (arm,)),
        view(numbers, 3 + 2 * s + arm, (p + arm,)),
        view(numbers, first, (numbers.shape[0] - first,)),
    )


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
    n, n_p, frame = at.q.shape[0], at.G.shape[0], frames.slots[0]
    of = header(numbers)
    p = of.platform
    plain, Q = scratch(s), scratch((s, m))
    for i in range(s):
        plain[i] = 1.0
        for a in range(n):
            J_q[i, a] = of.scales[i] * frames.jacobians[frame, int(of.rows[i]), a]
        add_to_leaders(J_q, i, of.followers)
        for j in range(p):
            J[i, j] = 0.0
            for a in range(n_p):
                J[i, j] += J_q[i, a] * at.G[a, j]
        for j in range(of.moved.shape[0]):
            J[i, p + j] = J_q[i, int(of.moved[j])]
        for j in range(m):
            J[i, j] *= of.factors[j]
    if not orthonormal_rows(J, plain, order, L, Q) > LOST:
        return False
    pseudoinverse_transposed(order, L, Q, X)
    return True


@compiled
def contract(at: At, frames: Frames, numbers: Array, J_q: Array, X: Array, gradient: Array) -> None:
    """gradient (n,) += Σ_ij X_ij ∂J_ij/∂q_k, by ∂J/∂q_k = D (H_k S + J_q ∂S/∂q_k) W^-1/2.

    Z = D X W^-1/2 Sᵀ (s, n) meets the frame's Hessian once, whatever the number of inputs.
    """
    n, n_p, frame = at.q.shape[0], at.G.shape[0], frames.slots[0]
    of = header(numbers)
    p = of.platform
    z = scratch(n)
    for i in range(X.shape[0]):
        row = int(of.rows[i])
        for a in range(n):
            z[a] = 0.0
        for j in range(p):
            x = X[i, j] * of.factors[j]
            for a in range(n_p):
                z[a] += x * at.G[a, j]
                for k in range(n_p):
                    gradient[k] += x * J_q[i, a] * at.G_q[a, j, k]
        for j in range(of.moved.shape[0]):
            z[int(of.moved[j])] = X[i, p + j] * of.factors[p + j]
        for f in range(0, of.followers.shape[0], 4):
            z[int(of.followers[f])] += of.followers[f + 2] * z[int(of.followers[f + 1])]
        for a in range(n):
            x = of.scales[i] * z[a]
            if x != 0.0:
                for k in range(n):
                    gradient[k] += x * frames.hessians[frame, row, a, k]


class JacobianObjective(Objective):
    """An objective of s rows of a frame's Jacobian.

    Parameters
    ----------
    frame : a frame of the robot
    rows : rows of its Jacobian: "xy", "xyz", or a list of x, y, z, rx, ry, rz
    of : whose inputs count
    weights : of all the robot's inputs; a heavy one counts for less

    Attributes
    ----------
    called : the objective's name, for errors
    selected : the rows' names
    length : by which rows of metres are divided, m; the robot's reach when None

    Raises
    ------
    InputError : rows or inputs of other names; on a robot, more rows than inputs, bad weights
    """

    called: ClassVar[str]
    length: float | None = 1.0

    def __init__(self, frame: str, rows: str | Sequence[str], of: Part, weights: Weights | None) -> None:
        self.frame = frame
        self.selected = tuple(rows)
        if not self.selected or len(set(self.selected)) != len(self.selected):
            raise InputError(
                f"{self.called} rows: expected some of {', '.join(ROWS)}, each once, got {rows!r}"
            )
        for row in self.selected:
            expect_known(f"{self.called} row", row, ROWS)
        expect_known(f"{self.called} of", of, get_args(Part))
        self.of = of
        self.weights = weights

    def numbers(self, robot: Robot) -> Array:
        """What `header` reads."""
        own = robot.platform.p
        p = 0 if self.of == "arm" else own
        arm = robot.arm_coordinates[: 0 if self.of == "platform" else None]
        inputs = p + len(arm)
        if len(self.selected) > inputs:
            raise InputError(
                f"{self.called} of the {self.of}: {len(self.selected)} rows with {inputs} inputs is "
                f"always 0; expected at most {inputs} rows"
            )
        counted = [*range(p), *(own + j for j in range(len(arm)))]
        metres = natural_size("m", robot) if self.length is None else self.length
        return np.array(
            [
                p,
                len(self.selected),
                len(arm),
                *(ROWS[row] for row in self.selected),
                *(1.0 / metres if ROWS[row] < 3 else 1.0 for row in self.selected),
                *arm,
                *_factors(self.weights, robot)[counted],
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
