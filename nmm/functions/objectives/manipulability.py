"""Manipulability of the whole robot, its arm or its platform, with its exact gradient; and of two weighed."""

from __future__ import annotations

from collections.abc import Sequence

from nmm.arrays import Array, scalar
from nmm.errors import InputError
from nmm.functions.function import Stage
from nmm.functions.objectives.base import Sum
from nmm.functions.objectives.jacobian import JacobianObjective, Part, contract, decomposed, shape_of
from nmm.kernels.compiled import integer_scratch, kernel, scratch
from nmm.kernels.records import FUNCTION, At, Frames, Rows
from nmm.robots.input_weights import Weights
from nmm.robots.robot import Robot


@kernel(FUNCTION)
def manipulability(at: At, frames: Frames, numbers: Array, rows: Rows) -> None:
    """w = sqrt(det(J Jᵀ)), ∂w/∂J = w (J⁺)ᵀ; where w = 0 it has no gradient, and 0 is given."""
    s, m = shape_of(numbers)
    J_q, J, L, X = scratch((s, at.q.shape[0])), scratch((s, m)), scratch((s, s)), scratch((s, m))
    if not decomposed(at, frames, numbers, J_q, J, integer_scratch(s), L, X):
        return
    w = 1.0
    for i in range(s):
        w *= L[i, i]
    rows.value[0] = w
    for i in range(s):
        for j in range(m):
            X[i, j] *= w
    contract(at, frames, numbers, J_q, X, rows.value_q[0])


class Manipulability(JacobianObjective):
    """Manipulability w(q) = sqrt(det(J Jᵀ)) (Yoshikawa 1985) of a frame; minimise `-Manipulability(...)`.

    Parameters
    ----------
    frame : a frame of the robot
    rows : rows of its Jacobian: "xy", "xyz", or a list of x, y, z, rx, ry, rz
    of : "robot", with J = (∂f/∂q) S and the platform's inputs (in m/s and rad/s), "arm", with the arm's
        joints alone, or "platform"
    weights : None; a positive number for each of the robot's inputs; or a mapping from names of inputs or of
        their groups ("platform", "arm"), 1 for the rest. J's columns are divided by their roots, so that
        {"platform": 4} makes the platform count half

    Examples
    --------
    >>> robot = nmm.load("unicycle_2r")
    >>> w = nmm.Manipulability("ee", "xy", of="arm")
    >>> round(w.value(nmm.Configuration(robot, robot.q({"q2": np.pi / 2}))), 3)
    0.15
    >>> task = nmm.Task(nmm.Position("ee", "xy"), [1, 0.3])
    >>> dexterous = nmm.Controller(robot, task, nmm.ProjectedGradient(), objective=-w)
    """

    called = "manipulability"

    def __init__(
        self,
        frame: str,
        rows: str | Sequence[str] = "xyz",
        of: Part = "robot",
        weights: Weights | None = None,
    ) -> None:
        super().__init__(frame, rows, of, weights)

    def stages(self, robot: Robot) -> tuple[Stage, ...]:
        return (Stage(manipulability, 1, (self.frame,), self.numbers(robot), hessians=True),)


class WeighedManipulability(Sum):
    """Manipulability of the arm and of the whole robot, weighed: α w_b + (1 - α) w (Bayle, Fourquet, Renaud
    2003), so that the arm keeps a good posture of its own though the platform makes up for a bad one.

    Parameters
    ----------
    frame : a frame of the robot
    rows : rows of its Jacobian: "xy", "xyz", or a list of x, y, z, rx, ry, rz
    alpha : α from 0, the whole robot's alone, to 1, the arm's alone
    weights : of the inputs, as for manipulability, in both

    Examples
    --------
    >>> robot = nmm.load("unicycle_2r")
    >>> here = nmm.Configuration(robot, robot.q({"q2": np.pi / 2}))
    >>> [round(nmm.WeighedManipulability("ee", "xy", alpha).value(here), 3) for alpha in (0.0, 0.5, 1.0)]
    [0.989, 0.57, 0.15]
    """

    def __init__(
        self,
        frame: str,
        rows: str | Sequence[str] = "xyz",
        alpha: float = 0.5,
        weights: Weights | None = None,
    ) -> None:
        self.alpha = scalar(alpha, "alpha")
        if not 0.0 <= self.alpha <= 1.0:
            raise InputError(f"alpha: expected a number from 0 to 1, got {self.alpha:g}")
        super().__init__(
            (self.alpha, Manipulability(frame, rows, "arm", weights)),
            (1.0 - self.alpha, Manipulability(frame, rows, "robot", weights)),
        )
