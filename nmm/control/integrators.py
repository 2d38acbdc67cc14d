"""Integration of the closed loop q_dot = S(q) u(t, q) from one sample to the next.

An explicit Runge-Kutta method is given by its tableau and its stability polynomial.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from nmm.base.arrays import Array
from nmm.base.errors import RunError, expect_known
from nmm.base.kernels.compiled import compiled
from nmm.model.robots.robot import Robot
from nmm.model.robots.zero_order_hold import HeldInputs

Velocity = Callable[[float, Array], Array]
#: The inputs (m,) at a stage, t and q (n,).
Inputs = Callable[[float, Array], Array]


class Integrator(ABC):
    """Takes one sample of the closed loop to the next.

    Attributes
    ----------
    order : the error of a step dt is of order dt^(order + 1)
    tolerance : bound on the error of an adaptive step, m and rad; 0 for constant steps
    stability : coefficients c of the stability polynomial R(z) = Σ c_k z^k, lowest first; () if steps adapt
    at_middle : whether a step's inputs are those of its middle, t + dt/2, q + dt/2 S u
    """

    order: int
    tolerance = 0.0
    stability: tuple[float, ...] = ()
    at_middle = False

    def inputs(self, stage: Inputs, t: float, q: Array, q_dot: Array, u: Array, dt: float) -> Array:
        """The inputs (m,) of the step, from q, q_dot and u at t: u where the method takes no others."""
        return u

    @abstractmethod
    def advance(self, velocity: Velocity, t: float, q: Array, q_dot: Array, u: Array, dt: float) -> Array:
        """q at t + dt, from q and q_dot at t and the step's inputs u."""


@compiled
def combine(q: Array, dt: float, weights: Array, slopes: Array, q_next: Array) -> None:
    """q_next = q + dt Σ weights[k] slopes[k]; the slopes are summed first, so q is rounded once."""
    for i in range(q.shape[0]):
        total = 0.0
        for k in range(weights.shape[0]):
            total += weights[k] * slopes[k, i]
        q_next[i] = q[i] + dt * total


def combined(q: Array, dt: float, weights: Array, slopes: Array) -> Array:
    """q + dt Σ weights[k] slopes[k]."""
    q_next = np.empty(q.shape)
    combine(q, dt, weights, slopes, q_next)
    return q_next


class RungeKutta(Integrator):
    """An explicit method: order, nodes c (s,), the matrix A (s, s), weights b (s,), stability polynomial."""

    def __init__(
        self, order: int, nodes: ArrayLike, matrix: ArrayLike, weights: ArrayLike, stability: Sequence[float]
    ) -> None:
        self.order, self.stability = order, tuple(stability)
        self.tableau: tuple[Array, Array, Array] = np.array(nodes), np.array(matrix), np.array(weights)
        c, A, self._weights = self.tableau
        self._stages = [(k, float(c[k]), A[k, :k].copy()) for k in range(1, c.size)]

    def advance(self, velocity: Velocity, t: float, q: Array, q_dot: Array, u: Array, dt: float) -> Array:
        slopes = np.empty((self._weights.size, q.size))
        slopes[0] = q_dot
        for k, node, row in self._stages:
            slopes[k] = velocity(t + node * dt, combined(q, dt, row, slopes))
        q_next: Array = combined(q, dt, self._weights, slopes)
        return q_next


EULER = RungeKutta(1, [0.0], [[0.0]], [1.0], (1.0, 1.0))
MIDPOINT = RungeKutta(2, [0.0, 0.5], [[0.0, 0.0], [0.5, 0.0]], [0.0, 1.0], (1.0, 1.0, 1 / 2))
RK4 = RungeKutta(
    4,
    [0.0, 0.5, 0.5, 1.0],
    [[0.0, 0.0, 0.0, 0.0], [0.5, 0.0, 0.0, 0.0], [0.0, 0.5, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]],
    [1 / 6, 1 / 3, 1 / 3, 1 / 6],
    (1.0, 1.0, 1 / 2, 1 / 6, 1 / 24),
)


#: Limit on adaptive steps between two samples; even fast motions need only a few.
MOST_STEPS = 20_000


class Adaptive(Integrator):
    """SciPy's DOP853 between the samples, with the local error of a step below `tolerance`."""

    order = 8

    def __init__(self, tolerance: float) -> None:
        self.tolerance = tolerance

    def advance(self, velocity: Velocity, t: float, q: Array, q_dot: Array, u: Array, dt: float) -> Array:
        from scipy.integrate import DOP853  # here, as the import takes a quarter of a second

        solver = DOP853(
            velocity, t, q, t + dt, rtol=max(self.tolerance, 1e-13), atol=self.tolerance, first_step=dt
        )
        taken = 0
        while solver.status == "running":
            if taken == MOST_STEPS:
                raise RunError(
                    f"{MOST_STEPS} adaptive steps did not lead from t = {t:g} s to the next sample at "
                    f"{t + dt:g} s: gains are too high, or the tolerance is too small or dt too large for "
                    "method adaptive",
                    where=f"at t = {solver.t:g} s",
                )
            taken += 1
            message = solver.step()
            if solver.status == "failed":
                raise RunError(
                    f"{message.rstrip('.')}: the inputs change without bound there, as near a singular "
                    "configuration",
                    where=f"at t = {solver.t:g} s",
                )
        q_next: Array = solver.y
        return q_next


class ZeroOrderHold(Integrator):
    """Constant inputs over dt, as on a robot with a sampled controller; the arm's motion is exact."""

    def __init__(self, robot: Robot, at_middle: bool = False) -> None:
        self._held, self.at_middle = HeldInputs(robot), at_middle
        like = MIDPOINT if at_middle else EULER
        self.order, self.stability = like.order, like.stability

    def inputs(self, stage: Inputs, t: float, q: Array, q_dot: Array, u: Array, dt: float) -> Array:
        if not self.at_middle:
            return u
        _, matrix, _ = MIDPOINT.tableau
        return stage(t + 0.5 * dt, combined(q, dt, matrix[1, :1].copy(), q_dot[np.newaxis]))

    def advance(self, velocity: Velocity, t: float, q: Array, q_dot: Array, u: Array, dt: float) -> Array:
        return self._held(q, u, dt)


@dataclass(frozen=True)
class Around(Integrator):
    """An integrator that modifies another one's steps and has its order and stability."""

    integrator: Integrator

    def __post_init__(self) -> None:
        for name in ("order", "tolerance", "stability", "at_middle"):
            object.__setattr__(self, name, getattr(self.integrator, name))

    def inputs(self, stage: Inputs, t: float, q: Array, q_dot: Array, u: Array, dt: float) -> Array:
        return self.integrator.inputs(stage, t, q, q_dot, u, dt)


@dataclass(frozen=True)
class WithMimicJoints(Around):
    """An integrator that sets mimic joints exactly after each step."""

    robot: Robot

    def advance(self, velocity: Velocity, t: float, q: Array, q_dot: Array, u: Array, dt: float) -> Array:
        return self.robot.following.placed(self.integrator.advance(velocity, t, q, q_dot, u, dt))


class Accelerated(Integrator):
    """An integrator of (q, u) with u_dot: at second order.

    inputs, u_dot (m,) : views of what a call of the controller reads and writes; afterwards the inputs are
        those at the end of the step
    """

    def __init__(self, integrator: Integrator, robot: Robot, inputs: Array, u_dot: Array) -> None:
        inner = integrator.integrator if isinstance(integrator, WithMimicJoints) else integrator
        self._inner, self._robot, self._inputs, self._u_dot = inner, robot, inputs, u_dot
        self.order, self.tolerance, self.stability = inner.order, inner.tolerance, inner.stability
        self._held = HeldInputs(robot)
        self.plain = integrator

    def advance(self, velocity: Velocity, t: float, q: Array, q_dot: Array, u: Array, dt: float) -> Array:
        n, inputs, u_dot = q.size, self._inputs, self._u_dot
        if isinstance(self._inner, ZeroOrderHold):
            q_next = self._held(q, inputs, dt, u_dot)
            inputs += dt * u_dot
            return q_next

        def flow(t: float, z: Array) -> Array:
            inputs[:] = z[n:]
            return np.concatenate([velocity(t, z[:n].copy()), u_dot])

        both = np.concatenate([q, inputs]), np.concatenate([q_dot, u_dot])
        z = self._inner.advance(flow, t, *both, u, dt)
        inputs[:] = z[n:]
        return self._robot.following.placed(z[:n])


METHODS = ("rk4", "midpoint", "euler", "zoh", "zoh_midpoint", "adaptive")
#: Those with steps of one length, which limits need.
STEPPING = METHODS[:-1]


def integrator(method: str, robot: Robot, tolerance: float) -> Integrator:
    """The integrator of that name; `InputError` lists the names."""
    expect_known("method", method, METHODS)
    chosen: Integrator
    if method in ("zoh", "zoh_midpoint"):
        chosen = ZeroOrderHold(robot, at_middle=method == "zoh_midpoint")
    elif method == "adaptive":
        chosen = Adaptive(tolerance)
    else:
        chosen = {"rk4": RK4, "midpoint": MIDPOINT, "euler": EULER}[method]
    return WithMimicJoints(chosen, robot) if robot.mimic_joints else chosen
