"""Manipulability of the whole robot or of its arm, with its exact gradient."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np

from nmm.arrays import Array
from nmm.errors import InputError, expect_known
from nmm.functions.function import Stage
from nmm.functions.objectives.base import Objective
from nmm.kernels.compiled import integer_scratch, kernel, scratch, view
from nmm.kernels.followers import add_to_leaders
from nmm.kernels.linear_algebra import orthonormal_rows, pseudoinverse_transposed
from nmm.kernels.records import FUNCTION, At, Frames, Rows
from nmm.robots.robot import Robot

ROWS = {"x": 0, "y": 1, "z": 2, "rx": 3, "ry": 4, "rz": 5}


@kernel(FUNCTION)
def manipulability(at: At, frames: Frames, numbers: Array, rows: Rows) -> None:
    """w = sqrt(det(J Jᵀ)) and ∂w/∂q_k = w tr(J⁺ ∂J/∂q_k); where w = 0 it has no gradient, and 0 is given.

    J = (rows of the frame's Jacobian) S for the robot, its arm's columns for the arm;
    ∂J/∂q_k = H_k S + J_q ∂S/∂q_k. numbers = [platform inputs that count, rows s, arm inputs; the rows; the
    coordinates that the arm inputs move; followers (`nmm.kernels.followers`)].
    """
    frame = frames.slots[0]
    n = at.q.shape[0]
    n_p = at.G.shape[0]
    p, s, arm = int(numbers[0]), int(numbers[1]), int(numbers[2])
    m = p + arm
    selected, moved = view(numbers, 3, (s,)), view(numbers, 3 + s, (arm,))
    followers = view(numbers, 3 + s + arm, (numbers.shape[0] - 3 - s - arm,))
    J_q = scratch((s, n))
    J = scratch((s, m))
    scales = scratch(s)
    for i in range(s):
        scales[i] = 1.0
        for a in range(n):
            J_q[i, a] = frames.jacobians[frame, int(selected[i]), a]
        add_to_leaders(J_q, i, followers)
        for j in range(p):
            J[i, j] = 0.0
            for a in range(n_p):
                J[i, j] += J_q[i, a] * at.G[a, j]
        for j in range(arm):
            J[i, p + j] = J_q[i, int(moved[j])]
    order = integer_scratch(s)
    L = scratch((s, s))
    Q = scratch((s, m))
    if orthonormal_rows(J, scales, order, L, Q) <= 1e-12:  # zero to rounding
        rows.value[0] = 0.0
        return
    w = 1.0
    for i in range(s):
        w *= L[i, i]
    rows.value[0] = w
    X = scratch((s, m))
    pseudoinverse_transposed(order, L, Q, X)
    H_k = scratch((1, n))
    for k in range(n):
        trace = 0.0
        for i in range(s):
            for a in range(n):
                H_k[0, a] = frames.hessians[frame, int(selected[i]), a, k]
            add_to_leaders(H_k, 0, followers)
            for j in range(p):
                derivative = 0.0
                for a in range(n_p):
                    derivative += H_k[0, a] * at.G[a, j]
                    if k < n_p:
                        derivative += J_q[i, a] * at.G_q[a, j, k]
                trace += X[i, j] * derivative
            for j in range(arm):
                trace += X[i, p + j] * H_k[0, int(moved[j])]
        rows.value_q[0, k] = w * trace


class Manipulability(Objective):
    """Manipulability w(q) = sqrt(det(J Jᵀ)) (Yoshikawa 1985) of a frame; minimise `-Manipulability(...)`.

    Parameters
    ----------
    frame : a frame of the robot
    rows : rows of its Jacobian: "xy", "xyz", or a list of x, y, z, rx, ry, rz
    of : "robot", with J = (∂f/∂q) S and the platform's inputs (in m/s and rad/s, unweighted), or
        "arm", with the arm's joints alone
    """

    def __init__(
        self, frame: str, rows: str | Sequence[str] = "xyz", of: Literal["robot", "arm"] = "robot"
    ) -> None:
        self.frame = frame
        self.selected = tuple(rows)
        if not self.selected or len(set(self.selected)) != len(self.selected):
            raise InputError(
                f"manipulability rows: expected some of {', '.join(ROWS)}, each once, got {rows!r}"
            )
        for row in self.selected:
            expect_known("manipulability row", row, ROWS)
        expect_known("manipulability of", of, ("robot", "arm"))
        self.of = of

    def stages(self, robot: Robot) -> tuple[Stage, ...]:
        platform, arm = 0 if self.of == "arm" else robot.platform.p, robot.arm_coordinates
        inputs = platform + len(arm)
        if len(self.selected) > inputs:
            raise InputError(
                f"manipulability of the {self.of}: {len(self.selected)} rows with {inputs} inputs is "
                f"always 0; expected at most {inputs} rows"
            )
        rows = [ROWS[row] for row in self.selected]
        numbers = np.array(
            [platform, len(rows), len(arm), *rows, *arm, *robot.following.table.ravel()], float
        )
        return (Stage(manipulability, 1, (self.frame,), numbers, hessians=True),)
