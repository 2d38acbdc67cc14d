"""A path of legs made one smooth motion, which takes less time than with a rest after each of them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Protocol

import numpy as np

from nmm.base.arrays import Array
from nmm.base.kernels.compiled import checked_by_caller
from nmm.base.kernels.record_layout import Memory, views
from nmm.control.limits.limits import LimitsOn
from nmm.model.robots.robot import Robot
from nmm.model.robots.wheel_rates import turning_wheels
from nmm.plugins.planning.collisions.motion_check import MotionCheck
from nmm.plugins.planning.interior import SHOOT, shoot
from nmm.plugins.planning.objective import SampleCosts
from nmm.plugins.planning.problem import MU, largest_inputs, shooting_problem, steps_within
from nmm.plugins.planning.samples import MotionSamples, SampledMotion
from nmm.plugins.planning.search_space import allowed
from nmm.plugins.planning.shooting import LOOK, Shooting, first_blocked_sample

#: How many samples a motion has: one for each so many seconds of the path's time, within limits.
EACH, FEWEST, MOST = 0.27, 24, 80
#: Rounds of the first solution, of each that begins with one before, and of all together.
FIRST, ROUNDS, ALL = 100, 25, 200
#: The next motion takes this share of the time of the one before; after a failure, of the best.
FASTER, LESS = 0.8, 0.92
#: An objective is minimised in so many rounds, or as many more as it takes; products of slacks and
#: multipliers to begin with, of smaller ones rounds are short; and the shares of it that are tried in turn.
LOWERED, LONGEST, BEGIN, SHARES = 20, 60, 10.0, (1.0, 0.2, 0.04)
#: Samples' ends that are blocked between keep so much more than the distance, m.
MORE = 0.015
#: What is left of gaps between samples and of the end's error when a motion is found.
EXACT = 1e-11


class Path(Protocol):
    """What a motion is looked for along: q (N, n) and u (N, m) at times from 0 to `duration`, s."""

    @property
    def duration(self) -> float: ...

    def at(self, t: Array) -> tuple[Array, Array]: ...


class Smoothing:
    """Looks for the shortest smooth motion along a timed path's way round obstacles.

    The first takes as long as the path. The time is then cut down as far as the limits allow on the same way,
    and by a fifth more, and a motion is looked for that takes no longer, from the one before; until none is
    found. In the time of the last, an objective is minimised then. usual : speeds of inputs without limits,
    m/s and rad/s
    """

    def __init__(
        self,
        robot: Robot,
        limits: LimitsOn,
        usual: float,
        check: MotionCheck,
        costs: SampleCosts | None = None,
    ) -> None:
        self.robot, self.limits, self.check, self.costs = robot, limits, check, costs
        self.top = largest_inputs(robot, limits, usual)
        self._shoot = checked_by_caller(shoot, SHOOT)
        self._first_blocked = checked_by_caller(first_blocked_sample, LOOK)

    def __call__(self, path: Path, rough: bool = False) -> SampledMotion | None:
        """A motion that takes less time than a path, or any where that is rough and no motion of the robot;
        None where none is found that keeps everything."""
        self.begin(path)
        x = self.x
        stored: list[Array] = []
        best: SampledMotion | None = None
        share = 1.0
        while self._left > 0:
            if self.solved(FIRST if best is None else ROUNDS):
                self._quicken(self._spare())
                best = self._motion()
                stored = [values.copy() for values in (x.q, x.u, x.a, x.step)]
                share = FASTER
            elif best is None or share == LESS:
                break
            else:
                self._restore(stored)
                share = LESS
            self._quicken(share)
        if best is None or not (rough or best.duration < path.duration):
            return None
        return best if self.costs is None else self._lowered(self.costs, stored) or best

    def _restore(self, stored: Sequence[Array]) -> None:
        x = self.x
        for values, before in zip((x.q, x.u, x.a, x.step), stored, strict=True):
            values[...] = before

    def _lowered(self, costs: SampleCosts, stored: Sequence[Array]) -> SampledMotion | None:
        """A motion as long as the stored one, with less of an objective; None where none keeps everything."""
        x, least, margin = self.x, costs.at(stored[0])[0].mean(), self.x.margin.copy()
        for share in SHARES:
            self._restore(stored)
            x.margin[:], x.s[:], x.z[:], x.duals[:], x.mu[()] = margin, 0.0, 0.0, 0.0, BEGIN
            for k in range(LONGEST):
                costs.write(x, share)
                allowed = self._shoot(*self.check.blocks, *self._own, int(k < LOWERED), 1, EXACT) > 0
                if allowed and not self._refined():
                    motion = self._motion()
                    if self._within(motion) and costs.at(x.q)[0].mean() < least:
                        return motion
                    break
        return None

    def begin(self, path: Path) -> None:
        """Set the problem up, with a path in its own time to begin with."""
        N = int(np.clip(path.duration / EACH, FEWEST, MOST))
        q, u = path.at(np.linspace(0.0, path.duration, N + 1))
        u[0] = u[-1] = 0.0
        memory = Memory()
        setup, aims = (self.robot, self.limits, self.top, self.check), 0 if self.costs is None else len(q[0])
        memory.add(shooting_problem(*setup, q, u, path.duration / N, True, aims))
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
        most = np.where(x.u >= 0.0, self.top[:, 1], self.top[:, 0])  # 0 for what may not reverse
        needed = float(np.max(np.divide(x.u, most, out=np.zeros_like(x.u), where=most != 0.0)))
        B, w = len(x.column), len(x.spin)
        if w:  # c is the limit less the rate, and plus it
            left = x.c[1:-1, B : B + 2 * w].reshape(-1, w, 2).min(axis=2)
            needed = max(needed, float(np.max((x.spin - left) / x.spin)))
        hardest = float(np.max(x.a / np.where(x.a >= 0.0, *limits.changes.T[::-1])))
        return min(1.0, max(needed, math.sqrt(hardest)) * (1.0 + 1e-8))

    def solved(self, most: int = FIRST) -> bool:
        """Look for a motion in the time that is set; whether one was found that keeps everything. most :
        rounds of a solution"""
        x = self.x
        while self._left > 0:
            x.s[:], x.z[:], x.duals[:], x.mu[()] = 0.0, 0.0, 0.0, MU
            rounds = self._shoot(*self.check.blocks, *self._own, 0, min(most, self._left), EXACT)
            self._left -= abs(rounds)
            if rounds < 0:
                return False
            if not self._refined():
                return self._within(self._motion())
        return False

    def _refined(self) -> bool:
        """Make samples finer that turn far, or keep more where one is blocked; whether there was any."""
        x = self.x
        steps = steps_within(self.robot, x.q, x.u, float(x.step))
        if steps > 1.2 * x.substeps[()]:
            x.substeps[()] = math.ceil(steps)
            return True
        blocked = self._first_blocked(*self.check.blocks, *self._own)
        if blocked >= 0:
            x.margin[blocked : blocked + 2] += MORE
        return bool(blocked >= 0)

    def _motion(self) -> SampledMotion:
        x, N = self.x, len(self.x.a)
        a, u = x.a.copy(), x.u.copy()
        u[-1] = 0.0
        a[-1] = -u[-2] / x.step
        begin = np.append(np.arange(N) * x.step, N * x.step)
        return SampledMotion(MotionSamples(x.inputs, begin, x.substeps, x.q, u, a), ())

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
        low, high = allowed(self.robot, limits).T
        if np.any(q < low) or np.any(q > high):
            return False
        names, turning = turning_wheels(self.robot, q, q_dot)
        turning = turning[:, [names.index(name) for name in limits.rows[: len(limits.spin)]]]
        return bool(np.all(np.abs(turning) <= limits.spin))
