"""Manipulability of the whole robot or of its arm, with its exact gradient."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np

from nmm.arrays import Array
from nmm.errors import InputError, unknown
from nmm.functions.function import Stage
from nmm.functions.objectives.base import Objective
from nmm.kernels.compiled import kernel
from nmm.kernels.linear_algebra import orthonormal_rows, pseudoinverse_transposed
from nmm.kernels.records import FUNCTION, At, Frames, Rows
from nmm.robots.robot import Robot

ROWS = {"x": 0, "y": 1, "z": 2, "rx": 3, "ry": 4, "rz": 5}


@kernel(FUNCTION)
def manipulability(at: At, frames: Frames, numbers: Array, rows: Rows) -> None:
    """w = sqrt(det(J Jᵀ)) and ∂w/∂q_k = w tr(J⁺ ∂J/∂q_k); where w = 0 it has no gradient, and 0 is given.

    J = (rows of the frame's Jacobian) S for the robot, its arm's columns for the arm;
    ∂J/∂q_k = H_k S + J_q ∂S/∂q_k. numbers = [first column: 0 robot, 1 arm; rows...].
    """
    frame = frames.slots[0]
    n = at.q.shape[0]
    n_p, p = at.G.shape
    arm_only = numbers[0] > 0.0
    s = numbers.shape[0] - 1
    m = n - n_p if arm_only else n - n_p + p
    offset = 0 if arm_only else p
    J = np.zeros((s, m))
    for i in range(s):
        row = int(numbers[1 + i])
        if not arm_only:
            for j in range(p):
                for k in range(n_p):
                    J[i, j] += frames.jacobians[frame, row, k] * at.G[k, j]
        for j in range(n - n_p):
            J[i, offset + j] = frames.jacobians[frame, row, n_p + j]
    order = np.empty(s, dtype=np.int64)
    L = np.empty((s, s))
    Q = np.empty((s, m))
    if orthonormal_rows(J, np.ones(s), order, L, Q) <= 1e-12:  # zero to rounding
        rows.value[0] = 0.0
        return
    w = 1.0
    for i in range(s):
        w *= L[i, i]
    rows.value[0] = w
    X = np.empty((s, m))
    pseudoinverse_transposed(order, L, Q, X)
    for k in range(n):
        trace = 0.0
        for i in range(s):
            row = int(numbers[1 + i])
            for j in range(m):
                derivative = 0.0
                if j >= offset:
                    derivative = frames.hessians[frame, row, n_p + j - offset, k]
                else:
                    for a in range(n_p):
                        derivative += frames.hessians[frame, row, a, k] * at.G[a, j]
                        if k < n_p:
                            derivative += frames.jacobians[frame, row, a] * at.G_q[a, j, k]
                trace += X[i, j] * derivative
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
            if row not in ROWS:
                raise InputError(unknown("manipulability row", row, ROWS))
        if of not in ("robot", "arm"):
            raise InputError(unknown("manipulability of", of, ("robot", "arm")))
        self.of = of

    def stages(self, robot: Robot) -> tuple[Stage, ...]:
        inputs = robot.n - robot.platform.n_p if self.of == "arm" else robot.n_u
        if len(self.selected) > inputs:
            raise InputError(
                f"manipulability of the {self.of}: {len(self.selected)} rows with {inputs} inputs is "
                f"always 0; expected at most {inputs} rows"
            )
        numbers = np.array([float(self.of == "arm"), *(ROWS[row] for row in self.selected)])
        return (Stage(manipulability, 1, (self.frame,), numbers, hessians=True),)
