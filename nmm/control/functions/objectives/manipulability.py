"""How well a frame moves: manipulability, also along one direction, and the inverse condition number."""

from __future__ import annotations

import math
from collections.abc import Sequence

from numpy.typing import ArrayLike

from nmm.base.arrays import Array, nonzero_vector, positive, scalar
from nmm.base.errors import expect, few
from nmm.base.kernels.compiled import clear, integer_scratch, kernel, scratch
from nmm.base.kernels.linear_algebra import add, copied
from nmm.base.kernels.records import FUNCTION, At, Frames, Rows
from nmm.control.functions.function import Function, Stage
from nmm.control.functions.objectives.base import WeightedSum
from nmm.control.functions.objectives.jacobian import JacobianObjective, Part, contract, decomposed, shape_of
from nmm.control.functions.references.polynomial import Constant
from nmm.model.robots.input_weights import Weights
from nmm.model.robots.robot import Robot


@kernel(FUNCTION)
def manipulability(at: At, frames: Frames, numbers: Array, rows: Rows) -> None:
    """w = sqrt(det(J Jᵀ)), ∂w/∂J = w (J⁺)ᵀ; both 0 where J has lost rank."""
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
    """Manipulability w(q) = sqrt(det(J Jᵀ)) (Yoshikawa 1985) of a frame.

    Parameters
    ----------
    frame : a frame of the robot
    rows : rows of its Jacobian: "xy", "xyz", or a list of x, y, z, rx, ry, rz
    of : the inputs of the "robot" (J = (∂f/∂q) S), the "arm" or the "platform"
    weights : numbers above 0, one an input, or by input or group ("platform", "arm"), 1 for the rest; J's
        columns are divided by their roots: {"platform": 4} halves the platform's share

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
    measure = manipulability


@kernel(FUNCTION)
def inverse_condition(at: At, frames: Frames, numbers: Array, rows: Rows) -> None:
    """c = s / (‖J‖ ‖J⁺‖), ∂c/∂J = c (X Xᵀ X / ‖X‖² - J / ‖J‖²), X = (J⁺)ᵀ; both 0 where J has lost rank."""
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
    """Inverse condition number 1/κ_F = s / (‖J‖_F ‖J⁺‖_F) of s rows of a frame's Jacobian (Angeles 2003),
    from 0 (rank lost) to 1 (isotropic).

    Unlike σ_min / σ_max (which `nmm map` draws as `inverse_condition`) it is smooth wherever J has full rank,
    also where singular values meet. Where rank is lost it is 0 and has no gradient, which is set to 0.

    Parameters
    ----------
    frame : a frame of the robot
    rows : two or more rows of its Jacobian: "xy", "xyz", or a list of x, y, z, rx, ry, rz
    of : the inputs of the "robot" (J = (∂f/∂q) S), the "arm" or the "platform"
    weights : of the inputs, as for manipulability
    length : m, by which rows of metres are divided where there are rows rx, ry, rz; by default the robot's
        reach

    Examples
    --------
    >>> robot = nmm.load("unicycle_2r")
    >>> H = nmm.InverseCondition("ee", "xy", of="arm")
    >>> round(H.value(nmm.Configuration(robot, robot.q({"q2": np.pi / 2}))), 3)
    0.698
    """

    called = "condition number"
    measure = inverse_condition

    def __init__(
        self,
        frame: str,
        rows: str | Sequence[str] = "xyz",
        of: Part = "robot",
        weights: Weights | None = None,
        length: float | None = None,
    ) -> None:
        super().__init__(frame, rows, of, weights)
        expect(len(self.selected) >= 2, "condition number rows", "at least two, that of one row is always 1")
        self.length = None if length is None else positive(length, "length")


class WeightedManipulability(WeightedSum):
    """Weighted sum of the arm's manipulability and the whole robot's, α w_arm + (1 - α) w (Bayle, Fourquet,
    Renaud 2003).

    Parameters
    ----------
    frame : a frame of the robot
    rows : rows of its Jacobian: "xy", "xyz", or a list of x, y, z, rx, ry, rz
    alpha : α, from 0 (only the whole robot's) to 1 (only the arm's)
    weights : of the inputs, as for manipulability

    Examples
    --------
    >>> robot = nmm.load("unicycle_2r")
    >>> here = nmm.Configuration(robot, robot.q({"q2": np.pi / 2}))
    >>> [round(nmm.WeightedManipulability("ee", "xy", alpha).value(here), 3) for alpha in (0.0, 0.5, 1.0)]
    [0.989, 0.57, 0.15]
    """

    def __init__(
        self,
        frame: str,
        rows: str | Sequence[str] = "xyz",
        alpha: float = 0.5,
        weights: Weights | None = None,
    ) -> None:
        self.alpha = scalar(alpha, "alpha", least=0.0, most=1.0)
        super().__init__(
            (self.alpha, Manipulability(frame, rows, "arm", weights)),
            (1.0 - self.alpha, Manipulability(frame, rows, "robot", weights)),
        )


@kernel(FUNCTION)
def directional_manipulability(at: At, frames: Frames, numbers: Array, rows: Rows) -> None:
    """β = |g| / |z|, z = J⁺ g, in place of the first s rows, which hold g and its derivatives. With y = (J⁺)ᵀ
    z = (J Jᵀ)⁻¹ g: ∂β/∂J = |g| y zᵀ / |z|³, ∂β/∂g = g / (|g| |z|) - |g| y / |z|³.
    Where J has lost rank, or g = 0, β and its gradient are 0."""
    s, m = shape_of(numbers)
    n = at.q.shape[0]
    J_q, J, L, X = scratch((s, n)), scratch((s, m)), scratch((s, s)), scratch((s, m))
    z, y, gradient = scratch(m), scratch(s), scratch(n)
    clear(gradient)
    square = 0.0
    for i in range(s):
        square += rows.value[i] * rows.value[i]
    size = math.sqrt(square)
    regular = decomposed(at, frames, numbers, J_q, J, integer_scratch(s), L, X) and size > 0.0
    value, rate = 0.0, 0.0
    if regular:
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
            add(gradient, turned, rows.value_q[i])
        contract(at, frames, numbers, J_q, X, gradient)
    rows.value[0] = value
    rows.value_t[0] = rate
    copied(gradient, rows.value_q[0])


class DirectionalManipulability(JacobianObjective):
    """Velocity transmission ratio β(q) = (dᵀ (J Jᵀ)⁻¹ d)^-1/2 along a unit vector d (Chiu 1988).

    It is the frame's speed along d, and d only, for inputs of norm 1, between the least and the largest
    singular value of J; to maximise, minimise `-DirectionalManipulability(...)`. Where J has lost rank, or a
    moving direction vanishes, β and its gradient are 0.

    Parameters
    ----------
    frame : a frame of the robot
    direction : d, of any length but 0: a number a row, world axes, or a function of so many rows (velocity,
        ...)
    rows : rows of its Jacobian: "xy", "xyz", or a list of x, y, z, rx, ry, rz
    of : the inputs of the "robot" (J = (∂f/∂q) S), the "arm" or the "platform"
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
    measure = directional_manipulability

    def __init__(
        self,
        frame: str,
        direction: Function | ArrayLike,
        rows: str | Sequence[str] = "xyz",
        of: Part = "robot",
        weights: Weights | None = None,
    ) -> None:
        super().__init__(frame, rows, of, weights)
        if not isinstance(direction, Function):
            direction = Constant(nonzero_vector(direction, None, "direction"), "1")
        self.direction = direction

    def stages(self, robot: Robot) -> tuple[Stage, ...]:
        s, came = len(self.selected), len(self.direction.rows(robot))
        expect(came == s, "direction", f"{s} components, as there are rows ({few(self.selected)})", came)
        own = Stage(self.measure, s, (self.frame,), self.numbers(robot), hessians=True)
        return (*self.direction.stages(robot), own)
