"""Integration of the closed loop q_dot = S(q) u(t, q) from one sample to the next.

Methods are data: an explicit Runge-Kutta method is its tableau and its stability polynomial.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from nmm.arrays import Array
from nmm.errors import InputError, RunError, unknown
from nmm.kernels.compiled import allocating
from nmm.robots.held import Held
from nmm.robots.robot import Robot

Velocity = Callable[[float, Array], Array]


class Integrator(Protocol):
    """Takes one sample of the closed loop to the next."""

    @property
    def order(self) -> int:
        """The error of a step dt is of the order dt^(order + 1)."""

    @property
    def tolerance(self) -> float:
        """What the error of a step is kept below where steps adapt, m and rad; 0 where they do not."""

    @property
    def stability(self) -> tuple[float, ...]:
        """Coefficients c of the stability polynomial R(z) = Σ c_k z^k, lowest first; () if steps adapt."""

    def advance(self, velocity: Velocity, t: float, q: Array, q_dot: Array, u: Array, dt: float) -> Array:
        """q at t + dt, from q, q_dot and u at t."""


@allocating
def combined(q: Array, dt: float, weights: Array, slopes: Array) -> Array:
    """q + dt Σ weights[k] slopes[k]; the slopes are summed first, so that q is rounded once."""
    ahead = np.empty_like(q)
    for i in range(q.shape[0]):
        total = 0.0
        for k in range(weights.shape[0]):
            total += weights[k] * slopes[k, i]
        ahead[i] = q[i] + dt * total
    return ahead


class RungeKutta:
    """An explicit method: order, nodes c, rows of the matrix A, weights b, stability polynomial."""

    tolerance = 0.0

    def __init__(
        self,
        order: int,
        nodes: tuple[float, ...],
        matrix: tuple[tuple[float, ...], ...],
        weights: tuple[float, ...],
        stability: tuple[float, ...],
    ) -> None:
        self.order = order
        self.stability = stability
        self._stages = [(node, np.array(row)) for node, row in zip(nodes, matrix, strict=True)]
        self._weights = np.array(weights)

    @property
    def tableau(self) -> tuple[Array, Array, Array]:
        """Nodes (s,), the matrix (s, s) and weights (s,), the stage at the beginning included."""
        s = self._weights.size
        A = np.zeros((s, s))
        for k, (_, row) in enumerate(self._stages, start=1):
            A[k, : row.size] = row
        return np.array([0.0, *(node for node, _ in self._stages)]), A, self._weights

    def advance(self, velocity: Velocity, t: float, q: Array, q_dot: Array, u: Array, dt: float) -> Array:
        slopes = np.empty((self._weights.size, q.size))
        slopes[0] = q_dot
        for k, (node, row) in enumerate(self._stages, start=1):
            slopes[k] = velocity(t + node * dt, combined(q, dt, row, slopes))
        ahead: Array = combined(q, dt, self._weights, slopes)
        return ahead


EULER = RungeKutta(1, (), (), (1.0,), (1.0, 1.0))
MIDPOINT = RungeKutta(2, (0.5,), ((0.5,),), (0.0, 1.0), (1.0, 1.0, 1 / 2))
RK4 = RungeKutta(
    4,
    (0.5, 0.5, 1.0),
    ((0.5,), (0.0, 0.5), (0.0, 0.0, 1.0)),
    (1 / 6, 1 / 3, 1 / 3, 1 / 6),
    (1.0, 1.0, 1 / 2, 1 / 6, 1 / 24),
)


#: Adaptive steps from a sample to the next; fast motions take a few.
MOST_STEPS = 20_000


class Adaptive:
    """SciPy's DOP853 between the samples, with a step that keeps the local error below `tolerance`."""

    order = 8
    stability: tuple[float, ...] = ()

    def __init__(self, tolerance: float) -> None:
        self.tolerance = tolerance

    def advance(self, velocity: Velocity, t: float, q: Array, q_dot: Array, u: Array, dt: float) -> Array:
        from scipy.integrate import DOP853  # here: a quarter of a second that other methods need not pay

        solver = DOP853(
            velocity, t, q, t + dt, rtol=max(self.tolerance, 1e-13), atol=self.tolerance, first_step=dt
        )
        taken = 0
        while solver.status == "running":
            if taken == MOST_STEPS:
                raise RunError(
                    f"at t = {solver.t:g} s: {MOST_STEPS} adaptive steps did not lead from t = {t:g} s to "
                    f"the next sample at {t + dt:g} s: gains are too high, or the tolerance is too small or "
                    "dt too large for method adaptive"
                )
            taken += 1
            message = solver.step()
            if solver.status == "failed":
                raise RunError(
                    f"at t = {solver.t:g} s: {message.rstrip('.')}: the inputs change without bound "
                    "there, as near a singular configuration"
                )
        ahead: Array = solver.y
        return ahead


class ZeroOrderHold:
    """The inputs stay constant over dt, as on a robot with a sampled controller; the arm's part is exact."""

    order, tolerance = 1, 0.0
    stability: tuple[float, ...] = (1.0, 1.0)

    def __init__(self, robot: Robot) -> None:
        self._held = Held(robot)

    def advance(self, velocity: Velocity, t: float, q: Array, q_dot: Array, u: Array, dt: float) -> Array:
        return self._held(q, u, dt)


@dataclass(frozen=True)
class Around:
    """What changes the steps of another integrator, and is of its order and stability."""

    integrator: Integrator

    @property
    def order(self) -> int:
        return self.integrator.order

    @property
    def tolerance(self) -> float:
        return self.integrator.tolerance

    @property
    def stability(self) -> tuple[float, ...]:
        return self.integrator.stability


@dataclass(frozen=True)
class Followed(Around):
    """An integrator after which the joints that follow others are where these have them, to the digit."""

    robot: Robot

    def advance(self, velocity: Velocity, t: float, q: Array, q_dot: Array, u: Array, dt: float) -> Array:
        return self.robot.following.placed(self.integrator.advance(velocity, t, q, q_dot, u, dt))


METHODS = ("rk4", "midpoint", "euler", "zoh", "adaptive")


def integrator(method: str, robot: Robot, tolerance: float) -> Integrator:
    """The integrator of that name; `InputError` lists the names."""
    found = _integrator(method, robot, tolerance)
    return Followed(found, robot) if robot.followers else found


def _integrator(method: str, robot: Robot, tolerance: float) -> Integrator:
    fixed = {"rk4": RK4, "midpoint": MIDPOINT, "euler": EULER}
    if method in fixed:
        return fixed[method]
    if method == "zoh":
        return ZeroOrderHold(robot)
    if method == "adaptive":
        return Adaptive(tolerance)
    raise InputError(unknown("method", method, METHODS))
