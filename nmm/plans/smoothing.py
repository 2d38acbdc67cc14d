"""A path of legs made one smooth motion, which takes less time than with a rest after each of them."""

from __future__ import annotations

import math

import numpy as np
from numba import types

from nmm.arrays import Array
from nmm.collisions.motion_check import MotionCheck
from nmm.control.limits import LimitsOn
from nmm.kernels.compiled import checked_by_caller
from nmm.kernels.record_layout import BLOCKS, Memory, views
from nmm.plans.samples import SampledMotion, Samples
from nmm.plans.shooting import Shooting, first_blocked_sample, shoot
from nmm.plans.timing import TimedLegs
from nmm.robots.robot import Robot
from nmm.robots.wheel_rates import turning_wheels
from nmm.robots.zero_order_hold import inputs_of

#: How many samples a motion has: one for each so many seconds of the path's time, within limits.
EACH, FEWEST, MOST = 0.27, 24, 80
#: Rounds of the first solution, of each that begins with one before, and of all together.
FIRST, ROUNDS, ALL = 100, 25, 200
#: The next motion takes this share of the time of the one before; after a failure, of the best.
FASTER, LESS = 0.8, 0.92
#: Samples' ends keep this much more than the distance, m; ends of one that is blocked between so much more.
MARGIN, MORE = 0.005, 0.015
#: The most that the platform turns in one step of its integration, rad.
TURN = 0.1
#: Wheels and joints keep this share of their limits between the ends of samples.
WITHIN = 0.99
#: Weight of inputs beside that of their rates, both as shares of their limits.
EFFORT = 0.3
#: Products of slacks and multipliers to begin with.
MU = 1e-2


class Smoothing:
    """Looks for the shortest smooth motion along a timed path's way round obstacles.

    The first takes as long as the path. The time is then cut down as far as the limits allow on the same way,
    and by a fifth more, and a motion is looked for that takes no longer, from the one before; until none is
    found. usual : speeds of inputs without limits, m/s and rad/s
    """

    def __init__(self, robot: Robot, limits: LimitsOn, usual: float, check: MotionCheck) -> None:
        self.robot, self.limits, self.check = robot, limits, check
        largest = np.full(
            robot.n_u, usual
        )  # of inputs without limits; rates of wheels as drive the platform so
        if robot.platform.n_p:
            G = robot.platform.G(np.zeros(robot.platform.n_p))
            largest[: robot.platform.p] *= np.abs(np.linalg.pinv(G)).max(axis=1)
        self.top = np.where(np.isfinite(limits.inputs), limits.inputs, np.column_stack([-largest, largest]))
        self._shoot = checked_by_caller(shoot, types.int64(*BLOCKS.types, *BLOCKS.types, types.int64))
        self._first_blocked = checked_by_caller(
            first_blocked_sample, types.int64(*BLOCKS.types, *BLOCKS.types)
        )

    def __call__(self, path: TimedLegs) -> SampledMotion | None:
        """A motion that takes less time than a path, or None where none is found that keeps everything."""
        self.begin(path)
        x = self.x
        kept: list[Array] = []
        best: SampledMotion | None = None
        share = 1.0
        while self._left > 0:
            if self.solved(FIRST if best is None else ROUNDS):
                self._quicken(self._spare())
                best = self._motion()
                kept = [one.copy() for one in (x.q, x.u, x.a, x.step)]
                share = FASTER
            elif best is None or share == LESS:
                break
            else:
                for one, before in zip((x.q, x.u, x.a, x.step), kept, strict=True):
                    one[...] = before
                share = LESS
            self._quicken(share)
        return best if best is not None and best.duration < path.duration else None

    def begin(self, path: TimedLegs) -> None:
        """Set the problem up, with a path in its own time to begin with."""
        N = int(np.clip(path.duration / EACH, FEWEST, MOST))
        q, u = path.at(np.linspace(0.0, path.duration, N + 1))
        u[0] = u[-1] = 0.0
        memory = Memory()
        memory.add(self._shooting(q, u, path.duration / N))
        self._own = memory.blocks()
        self.x = views(Shooting, *self._own, 0)
        self._left = ALL

    def _quicken(self, share: float) -> None:
        """The same path in a share of its time."""
        x = self.x
        x.step[()] *= share
        x.u[:] /= share
        x.a[:] /= share * share

    def _spare(self) -> float:
        """The share of its time that the motion needs within the limits of inputs and wheels, just."""
        x, limits = self.x, self.limits
        needed = float(np.max(np.where(x.u >= 0.0, x.u / self.top[:, 1], x.u / self.top[:, 0])))
        B, w = len(x.column), len(x.spin)
        if w:  # c is the limit less the rate, and plus it
            left = x.c[1:-1, B : B + 2 * w].reshape(-1, w, 2).min(axis=2)
            needed = max(needed, float(np.max((x.spin - left) / x.spin)))
        hardest = float(np.max(np.abs(x.a) / limits.accelerations))
        return min(1.0, max(needed, math.sqrt(hardest)) * (1.0 + 1e-8))

    def solved(self, most: int = FIRST) -> bool:
        """Look for a motion in the time that is set; whether one was found that keeps everything. most :
        rounds of a solution"""
        x = self.x
        while self._left > 0:
            x.s[:], x.z[:], x.duals[:], x.mu[()] = 0.0, 0.0, 0.0, MU
            rounds = self._shoot(*self.check.blocks, *self._own, min(most, self._left))
            self._left -= abs(rounds)
            if rounds < 0:
                return False
            turn = float(np.abs(np.diff(x.q[:, 2 : self.robot.platform.n_p], axis=0)).max(initial=0.0))
            if turn > 1.2 * TURN * x.substeps[()]:
                x.substeps[()] = math.ceil(turn / TURN)
                continue
            blocked = self._first_blocked(*self.check.blocks, *self._own)
            if blocked < 0:
                return self._within(self._motion())
            x.margin[blocked : blocked + 2] += MORE
        return False

    def _motion(self) -> SampledMotion:
        x, N = self.x, len(self.x.a)
        a, u = x.a.copy(), x.u.copy()
        u[-1] = 0.0
        a[-1] = -u[-2] / x.step
        begin = np.append(np.arange(N) * x.step, N * x.step)
        return SampledMotion(Samples(x.inputs, begin, x.substeps, x.q, u, a), ())

    def _within(self, motion: SampledMotion) -> bool:
        """Whether coordinates and wheels keep their limits within samples, too: where joints turn round."""
        samples, limits, N = motion.samples, self.limits, len(motion.samples.a)
        with np.errstate(divide="ignore", invalid="ignore"):
            turns = -samples.u[:-1] / samples.a
        inside = (turns > 0.0) & (turns < self.x.step)
        t = np.concatenate(
            [(samples.begin[:-1, np.newaxis] + turns)[inside], np.linspace(0.0, motion.duration, 4 * N + 1)]
        )
        q, _, q_dot = motion.moving(np.sort(t))
        low, high = limits.coordinates.T
        if np.any(q < low) or np.any(q > high):
            return False
        names, turning = turning_wheels(self.robot, q, q_dot)
        turning = turning[:, [names.index(name) for name in limits.rows[: len(limits.spin)]]]
        return bool(np.all(np.abs(turning) <= limits.spin))

    def _shooting(self, q: Array, u: Array, step: float) -> Shooting:
        """The problem, with a motion to begin with: q (N + 1, n) and u (N + 1, m) every step, s."""
        robot, limits, zeros = self.robot, self.limits, np.zeros
        n, m, N = robot.n, robot.n_u, len(q) - 1
        hardest = limits.accelerations
        # Between two ends of samples a joint can go farther than at both, while it turns round.
        room = np.minimum(q[[0, -1]] - limits.coordinates[:, 0], limits.coordinates[:, 1] - q[[0, -1]])
        over = np.zeros(n)
        moved = robot.rate_coordinates
        over[moved[moved >= 0]] = (np.where(np.isfinite(hardest), hardest, 0.0) * step * step / 8.0)[
            moved >= 0
        ]
        over = np.minimum(over, 0.5 * np.maximum(room.min(axis=0), 0.0))
        ends = np.vstack(
            [
                limits.coordinates + np.column_stack([over, -over]),
                self.top,
                np.column_stack([-hardest, hardest]),
            ]
        )
        column, side = np.nonzero(np.isfinite(ends))
        sign = np.where(side == 0, 1.0, -1.0)
        largest = np.abs(self.top).max(axis=1)
        hardest = np.where(np.isfinite(hardest), hardest, 10.0 * largest)
        scene, kept = self.check.scene, self.check.kept
        spare = zeros(0)
        if scene is not None:
            pairs = range(len(kept))
            apart = np.minimum(*(scene.queries.distances(0.0, one, pairs) for one in q[[0, -1]]))
            spare = np.maximum(0.5 * (apart - kept), 0.0)
        R = len(column) + 2 * len(limits.spin) + len(kept)
        turn = float(np.abs(np.diff(q[:, 2 : robot.platform.n_p], axis=0)).max(initial=0.0))
        return Shooting(
            inputs=inputs_of(robot),
            step=np.array(step),
            substeps=np.array(max(2, math.ceil(turn / TURN)), dtype=np.int64),
            column=column.astype(np.int64),
            sign=sign,
            offset=-sign * ends[column, side],
            wheels=limits.wheels,
            spin=WITHIN * limits.spin,
            weights=np.concatenate([EFFORT / largest**2, 1.0 / hardest**2]),
            goal=q[-1],
            room=spare,
            margin=np.full(N + 1, MARGIN),
            q=q,
            u=u,
            a=np.diff(u, axis=0) / step,
            moves=zeros((N + 1, n + 2 * m)),
            gaps=zeros((N, n)),
            D=zeros((N, n, n + 2 * m)),
            c=zeros((N + 1, R)),
            s=zeros((N + 1, R)),
            z=zeros((N + 1, R)),
            ds=zeros((N + 1, R)),
            dz=zeros((N + 1, R)),
            rows=zeros((N + 1, R - len(column), n + m)),
            K=zeros((N, m, n + m + 1)),
            V=zeros((n + m, n + m + 1)),
            Q=zeros((n + 2 * m, n + 2 * m + 1)),
            W=zeros((n + m, n + 2 * m)),
            duals=zeros(n + m),
            mu=np.array(MU),
        )
