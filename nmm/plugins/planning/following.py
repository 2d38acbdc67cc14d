"""A plan as a task: the way back to it, with its own rates ahead, for controllers that follow it."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from itertools import pairwise
from types import MappingProxyType
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from nmm.base.arrays import Array, Integers
from nmm.base.errors import NmmError, RunError, expect
from nmm.base.findings import Finding
from nmm.base.kernels.compiled import checked_by_caller, compiled, kernel, scratch, view
from nmm.base.kernels.records import FUNCTION, At, Frames, Rows
from nmm.base.kernels.signatures import float64, int64
from nmm.control.functions.function import Function, Renewal, Row, Shown, Stage
from nmm.control.goal import Goal, error_sizes, norms, unit_codes
from nmm.model.robots.frame_path import FramePath
from nmm.model.robots.reach import first_tip
from nmm.model.robots.robot import Robot

#: Between two knots of a table pass at most so many s.
KNOT = 0.02
#: Numbers of a table before `Robot.turns` and `Robot.own_or_leader`, n each, and its knots.
HEADER = 1
#: A table that is renewed has room for so many times the plan's knots, and for so many s at least.
ROOM, ROOM_FOR = 4, 120.0
#: How near to its end a plan is reached.
END = Goal(m=0.005, rad=0.02)
#: After another plan was made, or none was found, the next is made so much later at the earliest, s.
WAIT = 1.0


@compiled
def off_plan(t: float, q: Array, numbers: Array, m: int, off: Array, rate: Array) -> int:
    """Write q - q_plan(t) (n,) by the short way round, and the plan's q_dot (n,), by a table of
    `from_plan` for m inputs; returns where the knot before t is in it."""
    n = q.shape[0]
    size, first = 1 + (2 + m) * n, HEADER + 2 * n
    k, last = 0, int(numbers[0]) - 2
    while k < last:  # the last knot that is not after t
        middle = (k + last + 1) // 2
        if numbers[first + middle * size] <= t:
            k = middle
        else:
            last = middle - 1
    a = first + k * size
    b = a + size
    h = numbers[b] - numbers[a]
    share = (t - numbers[a]) / h
    rests = share < 0.0 or share > 1.0
    s = min(max(share, 0.0), 1.0)
    for i in range(n):
        p, v, v_end = numbers[a + 1 + i], numbers[a + 1 + n + i], numbers[b + 1 + n + i]
        rise = numbers[b + 1 + i] - p
        c, d = 3.0 * rise - h * (2.0 * v + v_end), h * (v + v_end) - 2.0 * rise
        off[i] = q[i] - (p + s * (h * v + s * (c + s * d)))
        rate[i] = 0.0 if rests else v + s * (2.0 * c + 3.0 * s * d) / h
    full = scratch(n)
    for i in range(n):
        own = off[int(numbers[HEADER + n + i])]
        full[i] = numbers[HEADER + i] * math.floor(0.5 + own / (2.0 * math.pi))
    for i in range(n):
        off[i] -= 2.0 * math.pi * full[i]
    return a


@kernel(FUNCTION)
def from_plan(at: At, frames: Frames, numbers: Array, rows: Rows) -> None:
    """W(t) (q - q_plan(t)) by the short way round; at rest before the first and after the last knot.
    numbers = [knots, turns (n,), own or leader (n,), then for each knot its time, q (n,), q_dot (n,) and W
    (n_u, n)]: q is cubic between two knots and W linear. Of two knots at one time the second counts."""
    n, m = at.q.shape[0], rows.value.shape[0]
    off, rate = scratch(n), scratch(n)
    a = off_plan(at.t, at.q, numbers, m, off, rate)
    size = 1 + (2 + m) * n
    h = numbers[a + size] - numbers[a]
    share = (at.t - numbers[a]) / h
    rests = share < 0.0 or share > 1.0
    s = min(max(share, 0.0), 1.0)
    for j in range(m):
        for i in range(n):
            index = a + 1 + (2 + j) * n + i
            change = numbers[index + size] - numbers[index]
            W = numbers[index] + s * change
            rows.value[j] += W * off[i]
            rows.value_t[j] -= W * rate[i]
            if not rests:
                rows.value_t[j] += change / h * off[i]
            rows.value_q[j, i] = W


OUTSIDE = int64(
    *(float64[::1], float64[:, ::1], float64[::1], int64, int64[::1]),
    *(float64[::1], float64),
)


@compiled
def outside(
    times: Array, q: Array, numbers: Array, m: int, units: Integers, tube: Array, since: float
) -> int:
    """The first of samples at times (N,) and q (N, n), not before `since`, that is farther from the plan than
    the tube (2,), m and rad, or N."""
    n = q.shape[1]
    off, rate = scratch(n), scratch(n)
    for k in range(times.shape[0]):
        if times[k] >= since:
            off_plan(times[k], view(q, k * n, (n,)), numbers, m, off, rate)
            metres, radians = norms(off, units)
            if metres > tube[0] or radians > tube[1]:
                return k
    return times.shape[0]


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
    anew : what follows another plan, from q (n,); then a run that is outside the tube goes on with it
    nearer : pairs, by name, that the plan leads nearer to each other than what it keeps, and how near, m
    """

    separate: ClassVar[bool] = True

    def __init__(
        self,
        robot: Robot,
        at: Callable[[Array], tuple[Array, Array]],
        stops: Array,
        gain: float,
        length: float,
        tube: Goal,
        anew: Callable[[Array], FromPlan] | None = None,
        nearer: Mapping[tuple[str, str], float] = MappingProxyType({}),
    ) -> None:
        self.robot, self.at, self.tube, self.anew, self.nearer = robot, at, tube, anew, nearer
        parts = [np.linspace(a, b, 1 + math.ceil((b - a) / KNOT))[:-1] for a, b in pairwise(stops)]
        times = np.concatenate([*parts, [stops[-1], stops[-1] + KNOT]])
        q, u = at(times)
        q_dot = np.array([robot.S(row) @ rates for row, rates in zip(q, u, strict=True)])
        W = left_inverses(robot, times, q, u, 1.0 / gain, length)
        #: Its knots, as `from_plan` reads them.
        self.knots = np.column_stack([times, q, q_dot, W.reshape(len(q), -1)])

    @property
    def duration(self) -> float:
        """Of the plan, s."""
        return float(self.knots[-2, 0])

    def rows(self, robot: Robot) -> tuple[Row, ...]:
        same = robot.q_names == self.robot.q_names and robot.u_names == self.robot.u_names
        expect(same, "plan", f"the robot that it is of, {self.robot.name}", robot.name)
        units = (unit.removesuffix("/s") for unit in robot.u_units)
        return tuple(Row(f"plan.{name}", unit) for name, unit in zip(robot.u_names, units, strict=True))

    def stages(self, robot: Robot) -> tuple[Stage, ...]:
        if self.anew is not None:
            live = Renewed(self)
            return (Stage(from_plan, robot.n_u, (), live.numbers, live=live),)
        return (Stage(from_plan, robot.n_u, (), self.table(self.knots)),)

    def table(self, knots: Array, room: int = 0) -> Array:
        """What `from_plan` reads, of knots, with room for so many."""
        head = np.concatenate([[len(knots)], self.robot.turns(), self.robot.own_or_leader])
        free = max(len(knots), room) * knots.shape[1] - knots.size
        return np.concatenate([head, knots.ravel(), np.zeros(free)])

    def apart(self, t: ArrayLike, q: ArrayLike) -> Array:
        """How far configurations (N, n) are from the plan at their times (N,), s: (N, 2), m and rad."""
        off = self.robot.short_way(np.asarray(q, dtype=np.float64) - self.planned(np.asarray(t)))
        return np.array([error_sizes(row, self.robot.q_units) for row in off]).reshape(-1, 2)

    def shown(self) -> Shown:
        return Shown(turns=first_tip(self.robot))

    def planned(self, t: Array) -> Array:
        return self.at(np.clip(t, 0.0, self.duration))[0]

    def left(self, t: float, q: Array, roughly: bool = False) -> tuple[float, float] | None:
        """What is left to the plan's end, unless another took its place (`Renewed.left`): of the coordinates
        and, in m, of the end-effector."""
        return None if self.anew is not None else self.to_end(q, roughly)

    def to_end(self, q: Array, roughly: bool) -> tuple[float, float] | None:
        """What is left at q (n,) to the plan's end, m and rad, where it is more than `END` or, roughly, the
        tube."""
        m, rad = self.apart([self.duration], [q])[0].tolist()
        tip, within = first_tip(self.robot), self.tube if roughly else END
        if tip is not None:
            (end,) = self.planned(np.array([self.duration]))
            reached, there = FramePath(self.robot, tip).positions(np.array([q, end]))
            m = max(m, float(np.linalg.norm(reached - there)))
        return None if m <= within.m and rad <= within.rad else (m, rad)

    def noticed(self, t: Array, q: Array) -> Iterator[Finding]:
        """Where a run left the plan, unless another took its place (`Renewed.noticed`)."""
        if self.anew is not None:
            return
        apart = self.apart(t, q)
        (out,) = np.nonzero(np.any(apart > [self.tube.m, self.tube.rad], axis=1))
        if len(out):
            m, rad = apart.max(axis=0)
            tube = {"tube_m": self.tube.m, "tube_rad": self.tube.rad}
            back = None if out[-1] == len(t) - 1 else float(t[out[-1] + 1])
            values = {"m": float(m), "rad": float(rad), "samples": len(out), "back": back, **tube}
            yield Finding("left_plan", values, {"t": float(t[out[0]])})


class Renewed(Renewal):
    """The numbers of `from_plan` along a run in which another plan takes the place of one whose tube the
    robot has left, from that sample on. What was before stays in the table: it is a function of time."""

    def __init__(self, first: FromPlan) -> None:
        robot, tube = first.robot, first.tube
        self._first, self._room = first, max(ROOM * len(first.knots), math.ceil(ROOM_FOR / KNOT))
        self._given = robot.n_u, unit_codes(robot.q_units), np.array([tube.m, tube.rad])
        self._outside = checked_by_caller(outside, OUTSIDE)
        super().__init__(first.table(first.knots, self._room))
        self.begin()

    def begin(self) -> None:
        self._plans, self._since = [(0.0, self._first)], -math.inf
        self._knots = self._first.knots
        self._made: list[dict[str, float]] = []
        self._refused: list[tuple[float, str]] = []
        self.events = []
        self.set(self._first.table(self._knots, self._room))

    def stays(self, times: Array, q: Array) -> int:
        at = np.ascontiguousarray(times), np.ascontiguousarray(q)
        return int(self._outside(*at, self.numbers, *self._given, self._since))

    def renew(self, t: float, q: Array, real: Array | None = None) -> None:
        begun, now = self._plans[-1]
        if now.anew is None or self.stays(np.array([t]), q[np.newaxis]):
            return
        self._since = t + WAIT
        m, rad = now.apart([t - begun], [q])[0].tolist()
        try:
            new = now.anew(q)
            if len(new.knots) > self._room:
                raise RunError(
                    f"the new plan takes {new.duration:.4g} s, which is too long to be put in its place"
                )
        except NmmError as error:
            self._refused.append((t, str(error)))
            return
        # The plan before ends where it was at t.
        (at_end,), (u,) = now.at(np.array([t - begun]))
        before = self._knots[self._knots[:, 0] < t - 1e-6]
        end = [
            t,
            *at_end,
            *(new.robot.S(at_end) @ u),
            *self._knots[max(len(before) - 1, 0), 1 + 2 * len(q) :],
        ]
        after = new.knots + t * (np.arange(new.knots.shape[1]) == 0)
        self._knots = np.vstack([before, end, after]) if len(before) else after
        self._plans.append((t, new))
        self._made.append({"t": t, "m": m, "rad": rad, "duration": new.duration})
        why = f"{m:.3g} m and {rad:.3g} rad from it; another one takes {new.duration:.3g} s"
        self.events.append((t, "plan", "is made anew", why))
        self.set(self._first.table(self._knots[-self._room :], self._room))

    def planned(self, t: Array) -> Array:
        configurations = np.empty((len(t), self._first.robot.n))
        for since, function in self._plans:
            configurations[t >= since] = function.planned(t[t >= since] - since)
        return configurations

    def left(self, t: float, q: Array, roughly: bool = False) -> tuple[float, float] | None:
        return self._plans[-1][1].to_end(q, roughly)

    def noticed(self, end: float) -> Iterator[Finding]:
        if self._made:
            yield Finding("replanned", {"plans": self._made}, {"t": self._made[0]["t"]})
        if self._refused:
            t, why = self._refused[0]
            yield Finding("not_replanned", {"times": len(self._refused), "why": why}, {"t": t})
        begun, last = self._plans[-1]
        left = begun + last.duration - end
        if self._made and left > KNOT:
            yield Finding("plan_cut", {"left": left}, {"t": end})


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
