"""A plan as a task: the way back to it, with its own rates ahead, for controllers that follow it."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from nmm.arrays import Array
from nmm.control.goal import Goal, error_sizes
from nmm.errors import expect
from nmm.findings import Finding
from nmm.functions.function import Function, Row, Stage
from nmm.kernels.compiled import kernel, scratch
from nmm.kernels.records import FUNCTION, At, Frames, Rows
from nmm.robots.robot import Robot

#: Between two knots of a table pass at most so many s.
KNOT = 0.02
#: Numbers of a table before its knots.
HEADER = 2


@kernel(FUNCTION)
def from_plan(at: At, frames: Frames, numbers: Array, rows: Rows) -> None:
    """W(t) (q - q_plan(t)), the angle of the platform wrapped; at rest before the first and after the last
    knot. numbers = [knots, 1 with a platform that turns, times..., then for each knot q (n,), q_dot (n,) and
    W (n_u, n)]: q is cubic between two knots and W linear."""
    n, m, count = at.q.shape[0], rows.value.shape[0], int(numbers[0])
    size = (2 + m) * n
    k, last = 0, count - 2
    while k < last:  # the last knot that is not after t
        middle = (k + last + 1) // 2
        if numbers[HEADER + middle] <= at.t:
            k = middle
        else:
            last = middle - 1
    h = numbers[HEADER + k + 1] - numbers[HEADER + k]
    share = (at.t - numbers[HEADER + k]) / h
    rests = share < 0.0 or share > 1.0
    s = min(max(share, 0.0), 1.0)
    a = HEADER + count + k * size
    b = a + size
    off, rate = scratch(n), scratch(n)
    for i in range(n):
        p, p_end, v, v_end = numbers[a + i], numbers[b + i], numbers[a + n + i], numbers[b + n + i]
        rise = p_end - p
        c, d = 3.0 * rise - h * (2.0 * v + v_end), h * (v + v_end) - 2.0 * rise
        off[i] = at.q[i] - (p + s * (h * v + s * (c + s * d)))
        rate[i] = 0.0 if rests else v + s * (2.0 * c + 3.0 * s * d) / h
    if numbers[1] == 1.0:
        off[2] -= 2.0 * math.pi * math.floor(0.5 + off[2] / (2.0 * math.pi))
    for j in range(m):
        for i in range(n):
            one = a + (2 + j) * n + i
            change = numbers[one + size] - numbers[one]
            W = numbers[one] + s * change
            rows.value[j] += W * off[i]
            rows.value_t[j] -= W * rate[i]
            if not rests:
                rows.value_t[j] += change / h * off[i]
            rows.value_q[j, i] = W


class FromPlan(Function):
    """How far the robot is from a plan, a row an input: W(t) (q - q_plan(t)), m and rad.

    W S(q_plan) is the identity: along the plan each row is what its input has moved too far. Where a platform
    has fewer inputs than coordinates, W is the left inverse of S that is least in the metric P(t) of a linear
    quadratic regulator along the plan, which turns a robot that is beside its way towards it: where the rows
    are zero, xᵀ P x of what is left, x, falls as the plan moves.

    Parameters
    ----------
    at : q (N, n) and u (N, n_u) of the plan at times (N,), s
    stops (K,) : where its rates have corners, from its beginning to its end, s
    gain : with which the rows are controlled, 1/s
    length : the way along which a platform comes back from beside it, about, m
    tube : how far from the plan is worth a finding
    """

    def __init__(
        self,
        robot: Robot,
        at: Callable[[Array], tuple[Array, Array]],
        stops: Array,
        gain: float,
        length: float,
        tube: Goal,
    ) -> None:
        self.robot, self.at, self.tube = robot, at, tube
        parts = [np.linspace(a, b, 1 + math.ceil((b - a) / KNOT))[:-1] for a, b in pairwise(stops)]
        self.times = np.concatenate([*parts, [stops[-1], stops[-1] + KNOT]])
        q, u = at(self.times)
        q_dot = np.array([robot.S(one) @ rates for one, rates in zip(q, u, strict=True)])
        W = left_inverses(robot, self.times, q, u, 1.0 / gain, length)
        self._table = np.concatenate([q, q_dot, W.reshape(len(q), -1)], axis=1).ravel()

    @property
    def duration(self) -> float:
        """Of the plan, s."""
        return float(self.times[-2])

    def rows(self, robot: Robot) -> tuple[Row, ...]:
        same = robot.q_names == self.robot.q_names and robot.u_names == self.robot.u_names
        expect(same, "plan", f"the robot that it is of, {self.robot.name}", robot.name)
        units = (unit.removesuffix("/s") for unit in robot.u_units)
        return tuple(Row(f"plan.{name}", unit) for name, unit in zip(robot.u_names, units, strict=True))

    def stages(self, robot: Robot) -> tuple[Stage, ...]:
        header = [len(self.times), float(robot.platform.n_p >= 3)]
        return (Stage(from_plan, robot.n_u, (), np.concatenate([header, self.times, self._table])),)

    def apart(self, t: ArrayLike, q: ArrayLike) -> Array:
        """How far configurations (N, n) are from the plan at their times (N,), s: (N, 2), m and rad."""
        off = np.asarray(q, dtype=np.float64) - self.at(np.clip(np.asarray(t), 0.0, self.duration))[0]
        if self.robot.platform.n_p >= 3:
            off[:, 2] -= 2.0 * np.pi * np.round(off[:, 2] / (2.0 * np.pi))
        return np.array([error_sizes(one, self.robot.q_units) for one in off]).reshape(-1, 2)

    def noticed(self, t: Array, q: Array) -> Iterator[Finding]:
        """Where a run left the plan."""
        apart = self.apart(t, q)
        (out,) = np.nonzero(np.any(apart > [self.tube.m, self.tube.rad], axis=1))
        if len(out):
            m, rad = apart.max(axis=0)
            tube = {"tube_m": self.tube.m, "tube_rad": self.tube.rad}
            back = None if out[-1] == len(t) - 1 else float(t[out[-1] + 1])
            values = {"m": float(m), "rad": float(rad), "samples": len(out), "back": back, **tube}
            yield Finding("left_plan", values, {"t": float(t[out[0]])})


def left_inverses(robot: Robot, times: Array, q: Array, u: Array, tau: float, length: float) -> Array:
    """W (N, n_u, n) along a motion, W S = 1: see `FromPlan`; tau, s, weighs inputs."""
    platform, n_p, p = robot.platform, robot.platform.n_p, robot.platform.p
    W = np.zeros((len(times), robot.n_u, robot.n))
    for j, i in enumerate(robot.rate_coordinates[p:]):
        W[:, p + j, i] = 1.0
    if n_p == 0:
        return W
    Q = np.diag([1.0 / length**2 if unit == "m" else 1.0 for unit in robot.q_units[:n_p]])
    P, axes, G, G_q = tau * Q, np.eye(n_p), np.zeros((n_p, p)), np.zeros((n_p, p, n_p))
    for k in range(len(times) - 1, -1, -1):
        platform.velocity_map(q[k, :n_p], platform.parameters, G, G_q)
        if k + 1 < len(times):
            h = times[k + 1] - times[k]
            step = axes + h * np.einsum("ijk,j->ik", G_q, u[k, :p])
            own = np.linalg.solve(tau**2 * G.T @ Q @ G, G.T)
            P = h * Q + step.T @ P @ np.linalg.solve(axes + h * G @ own @ P, step)
        W[k, :p, :n_p] = np.linalg.solve(G.T @ P @ G, G.T @ P)
    return W
