"""How alike a frame moves in all directions: the inverse condition number of its Jacobian."""

from __future__ import annotations

import math
from collections.abc import Sequence

from nmm.arrays import Array, positive
from nmm.errors import InputError
from nmm.functions.function import Stage
from nmm.functions.objectives.jacobian import JacobianObjective, Part, contract, decomposed, shape_of
from nmm.kernels.compiled import integer_scratch, kernel, scratch
from nmm.kernels.records import FUNCTION, At, Frames, Rows
from nmm.robots.input_weights import Weights
from nmm.robots.robot import Robot


@kernel(FUNCTION)
def inverse_condition(at: At, frames: Frames, numbers: Array, rows: Rows) -> None:
    """c = s / (‖J‖ ‖J⁺‖), ∂c/∂J = c (X Xᵀ X / ‖X‖² - J / ‖J‖²) with X = (J⁺)ᵀ; 0, without a gradient, where J
    has lost rank."""
    s, m = shape_of(numbers)
    J_q, J, L, X = scratch((s, at.q.shape[0])), scratch((s, m)), scratch((s, s)), scratch((s, m))
    if not decomposed(at, frames, numbers, J_q, J, integer_scratch(s), L, X):
        return
    of_J, of_X = 0.0, 0.0
    for i in range(s):
        for k in range(s):
            L[i, k] = 0.0  # from here on X Xᵀ
            for j in range(m):
                L[i, k] += X[i, j] * X[k, j]
        of_X += L[i, i]
        for j in range(m):
            of_J += J[i, j] * J[i, j]
    c = s / math.sqrt(of_J * of_X)
    rows.value[0] = c
    for i in range(s):
        for j in range(m):
            J[i, j] *= -c / of_J
            for k in range(s):
                J[i, j] += c / of_X * L[i, k] * X[k, j]
    contract(at, frames, numbers, J_q, J, rows.value_q[0])


class InverseCondition(JacobianObjective):
    """Inverse condition number 1/κ_F = s / (‖J‖_F ‖J⁺‖_F) of s rows of a frame's Jacobian, Frobenius norms
    (Angeles 2003), from 0 (rank lost) to 1 (isotropic); to maximise, minimise `-InverseCondition(...)`.

    Unlike σ_min / σ_max (which `nmm map` draws as `inverse_condition`) it is smooth wherever J has full rank,
    also where singular values meet. Where rank is lost it is 0, which it goes to continuously, and has no
    gradient: 0 stands for it.

    Parameters
    ----------
    frame : a frame of the robot
    rows : two or more rows of its Jacobian: "xy", "xyz", or a list of x, y, z, rx, ry, rz
    of : "robot", with the platform's inputs (m/s and rad/s), "arm", with the arm's joints alone, or
        "platform"
    weights : of the inputs, as for manipulability
    length : m, by which rows of metres are divided to be compared with those of radians; the robot's reach
        when not given. Without rows rx, ry, rz it has no effect

    Examples
    --------
    >>> robot = nmm.load("unicycle_2r")
    >>> H = nmm.InverseCondition("ee", "xy", of="arm")
    >>> round(H.value(nmm.Configuration(robot, robot.q({"q2": np.pi / 2}))), 3)
    0.698
    """

    called = "condition number"

    def __init__(
        self,
        frame: str,
        rows: str | Sequence[str] = "xyz",
        of: Part = "robot",
        weights: Weights | None = None,
        length: float | None = None,
    ) -> None:
        super().__init__(frame, rows, of, weights)
        if len(self.selected) < 2:
            raise InputError("condition number rows: expected at least two, that of one row is always 1")
        self.length = None if length is None else positive(length, "length")

    def stages(self, robot: Robot) -> tuple[Stage, ...]:
        return (Stage(inverse_condition, 1, (self.frame,), self.numbers(robot), hessians=True),)
