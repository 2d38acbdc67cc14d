"""Objectives of a frame's Jacobian J = D (its rows) S W^-1/2, its decomposition, and gradients.

D divides rows in metres by a length, S is the velocity map of platform and arm, or of one of them, W weights
inputs. φ(J) has the gradient Σ_ij X_ij ∂J_ij/∂q_k, X = ∂φ/∂J, which `contract` computes for any X."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from typing import ClassVar, Literal, NamedTuple, get_args

import numpy as np

from nmm.base.arrays import Array, positive, vector
from nmm.base.errors import expect, expect_known
from nmm.base.kernels.compiled import Kernel, clear, compiled, scratch, view
from nmm.base.kernels.linear_algebra import add, orthonormal_rows, pseudoinverse_transposed
from nmm.base.kernels.records import At, Frames
from nmm.base.kernels.velocity_map import to_coordinates, to_inputs
from nmm.control.functions.function import Stage, natural_size
from nmm.control.functions.objectives.base import Objective
from nmm.model.robots.input_weights import Weights, by_name
from nmm.model.robots.robot import Robot

ROWS = {"x": 0, "y": 1, "z": 2, "rx": 3, "ry": 4, "rz": 5}
Part = Literal["robot", "arm", "platform"]
#: J has lost rank, to rounding, where `orthonormal_rows` is at most this.
LOST = 1e-12


class Header(NamedTuple):
    """A stage's numbers: `platform` is p, how many of its inputs take part; `scales` D's diagonal, 1/m or 1;
    `factors` W^-1/2's. For `moved` and `mimic_joints` see `nmm.base.kernels.velocity_map`."""

    platform: int
    rows: Array
    scales: Array
    moved: Array
    factors: Array
    mimic_joints: Array


@compiled
def header(numbers: Array) -> Header:
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
    """J = L Q[order] and X = (J⁺)ᵀ, all (s, m) but L (s, s), J_q (s, n); whether J has full row rank. J_q = D
    (rows of the frame's Jacobian), where columns of mimic joints are added to their leaders'."""
    s, m = J.shape
    n, frame = at.q.shape[0], frames.slots[0]
    of = header(numbers)
    plain, Q = scratch(s), scratch((s, m))
    for i in range(s):
        plain[i] = 1.0
        for a in range(n):
            J_q[i, a] = of.scales[i] * frames.jacobians[frame, int(of.rows[i]), a]
        to_inputs(J_q, i, at.G, of.platform, of.moved, of.mimic_joints, J[i])
        for j in range(m):
            J[i, j] *= of.factors[j]
    if not orthonormal_rows(J, plain, order, L, Q) > LOST:
        return False
    pseudoinverse_transposed(order, L, Q, X)
    return True


@compiled
def contract(at: At, frames: Frames, numbers: Array, J_q: Array, X: Array, gradient: Array) -> None:
    """gradient (n,) += Σ_ij X_ij ∂J_ij/∂q_k, by ∂J/∂q_k = D (H_k S + J_q ∂S/∂q_k) W^-1/2. Z = D X W^-1/2 Sᵀ
    (s, n) meets the frame's Hessian once, whatever the number of inputs."""
    n, n_p, frame = at.q.shape[0], at.G.shape[0], frames.slots[0]
    of = header(numbers)
    x, z = scratch(X.shape[1]), scratch(n)
    clear(z)
    for i in range(X.shape[0]):
        row = int(of.rows[i])
        for j in range(X.shape[1]):
            x[j] = X[i, j] * of.factors[j]
        to_coordinates(x, at.G, of.platform, of.moved, of.mimic_joints, z)
        for j in range(of.platform):
            for a in range(n_p):
                for k in range(n_p):
                    gradient[k] += x[j] * J_q[i, a] * at.G_q[a, j, k]
        for a in range(n):
            share = of.scales[i] * z[a]
            if share != 0.0:
                add(gradient, share, frames.hessians[frame, row, a])


class JacobianObjective(Objective):
    """An objective of s Jacobian rows; `InputError` for unknown names, more rows than inputs, bad weights."""

    called: ClassVar[str]
    #: What rows in metres are divided by, m; the robot's reach when None.
    length: float | None = 1.0

    def __init__(
        self,
        frame: str,
        rows: str | Sequence[str] = "xyz",
        of: Part = "robot",
        weights: Weights | None = None,
    ) -> None:
        self.frame = frame
        self.selected = tuple(rows)
        once = self.selected and len(set(self.selected)) == len(self.selected)
        expect(once, f"{self.called} rows", f"some of {', '.join(ROWS)}, each once", rows)
        for row in self.selected:
            expect_known(f"{self.called} row", row, ROWS)
        expect_known(f"{self.called} of", of, get_args(Part))
        self.of = of
        self.weights = weights

    @property
    @abstractmethod
    def measure(self) -> Kernel:
        """The kernel that computes it."""

    def stages(self, robot: Robot) -> tuple[Stage, ...]:
        return (Stage(self.measure, 1, (self.frame,), self.numbers(robot), hessians=True),)

    def numbers(self, robot: Robot) -> Array:
        """What `header` reads."""
        own = robot.platform.p
        p = 0 if self.of == "arm" else own
        arm = robot.arm_coordinates[: 0 if self.of == "platform" else None]
        inputs = p + len(arm)
        few = f"at most {inputs} rows: with more it is always 0"
        expect(len(self.selected) <= inputs, f"{self.called} of the {self.of}", few, self.selected)
        factors = _factors(self.weights, robot)[[*range(p), *range(own, own + len(arm))]]
        metres = natural_size("m", robot) if self.length is None else self.length
        rows = [ROWS[row] for row in self.selected]
        scales = [1.0 / metres if row < 3 else 1.0 for row in rows]
        table = robot.following.table.ravel()
        return np.r_[p, len(rows), len(arm), rows, scales, arm, factors, table].astype(float)


def _factors(weights: Weights | None, robot: Robot) -> Array:
    """W^-1/2, (n_u,)."""
    if weights is None:
        return np.ones(robot.n_u)
    if isinstance(weights, Mapping):
        values = by_name(weights, robot.u_names, robot.groups)
    else:
        values = vector(weights, robot.n_u, "weights")
    for weight, name in zip(values, robot.u_names, strict=True):
        positive(weight, f"weights: {name}")
    return np.asarray(1.0 / np.sqrt(values))
