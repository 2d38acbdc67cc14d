"""How fast a frame can move along one direction."""

from __future__ import annotations

import math
from collections.abc import Sequence

from numpy.typing import ArrayLike

from nmm.arrays import Array, vector
from nmm.errors import InputError
from nmm.functions.function import Function, Stage
from nmm.functions.objectives.jacobian import JacobianObjective, Part, contract, decomposed, shape_of
from nmm.functions.references.polynomial import Constant
from nmm.kernels.compiled import integer_scratch, kernel, scratch
from nmm.kernels.records import FUNCTION, At, Frames, Rows
from nmm.robots.input_weights import Weights
from nmm.robots.robot import Robot


@kernel(FUNCTION)
def directional_manipulability(at: At, frames: Frames, numbers: Array, rows: Rows) -> None:
    """β = |g| / |z|, z = J⁺ g, by the chain rule, in place: the first s rows hold g and its derivatives.

    With y = (J⁺)ᵀ z = (J Jᵀ)⁻¹ g: ∂β/∂J = |g| y zᵀ / |z|³, ∂β/∂g = g / (|g| |z|) - |g| y / |z|³. Where J has
    lost rank, or g = 0, β is 0 without a gradient.
    """
    s, m = shape_of(numbers)
    n = at.q.shape[0]
    J_q, J, L, X = scratch((s, n)), scratch((s, m)), scratch((s, s)), scratch((s, m))
    z, y, gradient = scratch(m), scratch(s), scratch(n)
    square = 0.0
    for i in range(s):
        square += rows.value[i] * rows.value[i]
    size = math.sqrt(square)
    found = decomposed(at, frames, numbers, J_q, J, integer_scratch(s), L, X) and size > 0.0
    for k in range(n):
        gradient[k] = 0.0
    value, rate = 0.0, 0.0
    if found:
        square = 0.0
        for j in range(m):
            z[j] = 0.0
            for i in range(s):
                z[j] += X[i, j] * rows.value[i]
            square += z[j] * z[j]
        slowness = math.sqrt(square)
        value = size / slowness
        for i in range(s):
            y[i] = 0.0
            for j in range(m):
                y[i] += X[i, j] * z[j]
        for i in range(s):
            steep = value * y[i] / square
            for j in range(m):
                X[i, j] = steep * z[j]
            turned = rows.value[i] / (size * slowness) - steep
            rate += turned * rows.value_t[i]
            for k in range(n):
                gradient[k] += turned * rows.value_q[i, k]
        contract(at, frames, numbers, J_q, X, gradient)
    rows.value[0] = value
    rows.value_t[0] = rate
    for k in range(n):
        rows.value_q[0, k] = gradient[k]


class DirectionalManipulability(JacobianObjective):
    """Velocity transmission ratio β(q) = (dᵀ (J Jᵀ)⁻¹ d)^-1/2 along a unit vector d (Chiu 1988).

    That is how fast a frame moves that way, and no other, with inputs of size 1; to maximise, minimise
    `-DirectionalManipulability(...)`. It lies between J's least and largest singular value. Where J has lost
    rank 0 stands for it, without a gradient, as it does where a moving direction vanishes.

    Parameters
    ----------
    frame : a frame of the robot
    direction : along the rows, of any length but 0: a number a row, world axes, or a function with as many
        rows (velocity of a circle or a spline, ...)
    rows : rows of its Jacobian: "xy", "xyz", or a list of x, y, z, rx, ry, rz
    of : "robot", with the platform's inputs (m/s and rad/s), "arm", with the arm's joints alone, or
        "platform"
    weights : of the inputs, as for manipulability

    Examples
    --------
    >>> robot = nmm.load("unicycle_2r")
    >>> here = nmm.Configuration(robot, robot.q({"q2": np.pi / 2}))
    >>> ahead = nmm.DirectionalManipulability("ee", [1, 0], "xy", of="arm")
    >>> aside = nmm.DirectionalManipulability("ee", [0, 1], "xy", of="arm")
    >>> round(ahead.value(here), 3), round(aside.value(here), 3)
    (0.3, 0.354)
    """

    called = "directional manipulability"

    def __init__(
        self,
        frame: str,
        direction: Function | ArrayLike,
        rows: str | Sequence[str] = "xyz",
        of: Part = "robot",
        weights: Weights | None = None,
    ) -> None:
        super().__init__(frame, rows, of, weights)
        self.direction = (
            direction
            if isinstance(direction, Function)
            else Constant(vector(direction, None, "direction"), "1")
        )
        if isinstance(self.direction, Constant) and not self.direction.value.any():
            raise InputError("direction: expected a vector that is not zero")

    def stages(self, robot: Robot) -> tuple[Stage, ...]:
        s, came = len(self.selected), len(self.direction.rows(robot))
        if came != s:
            names = ", ".join(self.selected)
            raise InputError(f"direction: expected {s} components, as there are rows ({names}), got {came}")
        own = Stage(directional_manipulability, s, (self.frame,), self.numbers(robot), hessians=True)
        return (*self.direction.stages(robot), own)
