"""Keeps distances where linear rows do not suffice: the motion of a sample is checked before it is made.

Rows are linear, the motion is not, and nearest points jump. So where a pair could come too near within the
sample, or while the robot then brakes (all inputs alike, as hard as accelerations allow), distances are
measured along that motion. Where one falls short, a row for its points is added and the problem is solved
again; after a few rounds the inputs are changed towards braking, as little as possible. That braking motion
was found clear one sample earlier, so there is always a safe one among standing obstacles.

Obstacles with a path are looked at for longer, while the robot stands after braking. Where it would stand in
their way whatever it does, it gives way by the first of some motions of the platform that ends clear.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import product
from typing import NamedTuple

import numpy as np

from nmm.base.arrays import Array
from nmm.base.kernels.compiled import checked_by_caller
from nmm.control.functions.program import BESIDE, Program
from nmm.control.resolvers.answer import RELAXED, Status
from nmm.control.resolvers.limit_check import LEFT
from nmm.control.step.equations import DRIVE, ControlStep, drive_inputs
from nmm.model.collisions.scene import Scene
from nmm.model.collisions.swept_check import Short, SweptCheck

#: Rows keep MARGIN more than the distance asked for, m, checked motions SLACK more: distances may dip
#: between the points checked.
MARGIN, SLACK = 5e-4, 5e-5
#: Number of rows reserved for added points, and of times that the problem is solved again.
CUTS, ROUNDS = 8, 5
#: Then inputs between braking (0) and those wanted (1) are tried, in this order.
SHARES = (0.75, 0.5, 0.25, 0.1, 0.0)
#: The platform gives way by motions of these lengths, s, with its inputs at their limits, at most UNLIMITED.
GIVES_WAY, UNLIMITED = (0.5, 1.0, 2.0), 1.0


class Counts(NamedTuple):
    """How often a safety filter had to act since its controller was reset, in samples.

    looked : it checked the motion; added : it added rows; braked : the inputs were changed towards braking;
    short : no inputs that it tried keep the distance
    """

    looked: int = 0
    added: int = 0
    braked: int = 0
    short: int = 0


class SafetyFilter:
    """Keeps a controller's distances; again(q) -> status solves the current equations once more."""

    def __init__(
        self,
        scene: Scene,
        step: ControlStep,
        program: Program,
        again: Callable[[Array], float],
        horizon: float,
    ) -> None:
        self._scene, self._queries = scene, scene.queries
        self._near, self._keep, self._step = step.near, step.clearance, step
        self._program, self._again = program, again
        self._drive = checked_by_caller(drive_inputs, DRIVE)
        changes = np.array([step.limits.falling, step.limits.rising])
        self._lookout = SweptCheck(scene.queries, changes, scene.distance, scene.distance + SLACK, horizon)

    @property
    def counts(self) -> Counts:
        return Counts(*self._keep.counts.tolist())

    @property
    def held(self) -> bool:
        """Whether it checked the last sample's motion, which is then made with constant inputs."""
        return bool(self._keep.held)

    def measure_distances(self, t: float, q: Array) -> None:
        """Measure the distances at a sample at (t, q); no row has to keep another rate than its own yet."""
        self._keep.least.fill(-np.inf)
        self._queries.update(t, q, *self._program.blocks, BESIDE)

    def clear(self, moved: float) -> bool:
        """Whether all pairs stay apart while coordinates move by at most this, m and rad added up."""
        room = float(self._queries.scene.bounds.min(initial=np.inf)) - self._scene.distance
        return moved * (1.0 + self._scene.robot.reach) < room

    def _count(self, what: str) -> None:
        self._keep.counts[Counts._fields.index(what)] += 1

    def certify(self, t: float, q: Array, before: Array) -> None:
        """Check the motion of the inputs found, and change them where it comes too near; before (m,) are the
        previous inputs, from which accelerations count."""
        self._keep.held[()] = 0
        step, dt = self._step, float(self._step.problem.dt)
        u = step.answer.u
        self._lookout.look_ahead(t)
        if not self._lookout.list_risky(step.q_dot, u, dt, anew=True):
            return
        self._keep.held[()] = 1
        self._count("looked")
        short = self._lookout.first_short(t, q, u, dt)
        for round_ in range(ROUNDS):
            if short is None:
                return
            if not self._add_row(t, q, short):
                break
            if round_ == 0:
                self._count("added")
            step.problem.before[:] = before
            if self._again(q) >= Status.SINGULAR_J:
                break
            self._lookout.list_risky(step.q_dot, u, dt, anew=False)
            short = self._lookout.first_short(t, q, u, dt)
        if short is not None:
            self._count("braked")
            self._brake(t, q, before, short)

    def _brake(self, t: float, q: Array, before: Array, short: Short) -> None:
        """Take the inputs between braking and those wanted that change least and keep distances, or the best.
        They are within the limits of inputs."""
        problem = self._step.problem
        dt = float(problem.dt)
        wanted = self._step.answer.u.copy()
        if not np.isfinite(wanted).all():
            wanted = before.copy()
        slower = (1.0 - self._lookout.slower(before, dt)) * before
        rest = np.clip(slower, problem.u_lower, problem.u_upper)
        best, least = wanted, short.by
        for share in SHARES:
            tried = rest + share * (wanted - rest)
            closest = self._lookout.first_short(t, q, tried, dt)
            if closest is None:
                best, least = tried, 0.0
                break
            if closest.by < least:
                best, least = tried, closest.by
        if least > 0.0 and self._lookout.sees_paths:
            best, least = self._give_way(t, q, before, best, least)
        if least > 0.0:
            self._count("short")
        rows = problem.limit_rows @ best
        beyond = np.maximum(rows - problem.upper, problem.lower - rows).max(initial=0.0)
        step, answer = self._step, self._step.answer
        answer.u[:] = problem.before[:] = best
        answer.status[()] = RELAXED
        answer.residual[()] = np.linalg.norm(problem.J @ best - step.task.full)
        answer.excess[()] = beyond if beyond > LEFT else 0.0
        step.scale[:] = 0.0
        self._drive(*self._program.blocks)

    def _give_way(self, t: float, q: Array, before: Array, best: Array, least: float) -> tuple[Array, float]:
        """Where the robot cannot stop without something coming there: the first inputs of a motion of the
        platform that ends clear, the shortest of some, or else the one that stays clear for longest; with by
        how much it falls short, 0 or `least`."""
        problem, limits = self._step.problem, self._step.limits
        dt, p = float(problem.dt), self._scene.robot.platform.p
        self._lookout.list_obstacles()
        stays = np.zeros_like(best)
        longest = self._lookout.contact(t, q, best, dt, stays, 0.0)
        for lasts, signs in product(GIVES_WAY, product((0.0, 1.0, -1.0), repeat=p)):
            driven, sign = stays.copy(), np.array(signs)
            sizes = np.where(sign < 0.0, -limits.slowest[:p], limits.fastest[:p])
            driven[:p] = sign * np.minimum(sizes, UNLIMITED)
            first = before + np.clip(driven - before, -dt * limits.falling, dt * limits.rising)
            first = np.clip(first, problem.u_lower, problem.u_upper)
            clear = self._lookout.contact(t, q, first, dt, driven, lasts)
            if clear > longest:
                best, longest = first, clear
            if np.isinf(clear):
                return best, 0.0
        return best, least

    def _add_row(self, t: float, q: Array, short: Short) -> bool:
        """Add a row for the points that come too near; False where there is no room for it."""
        near, keep = self._near, self._keep
        slot = int(near.used)
        if slot == len(near.d):
            self._queries.place(t, q)  # the check has moved the shapes
            return False
        self._queries.carry(short.pair, (t, q), (t + short.after, short.q), near, slot)
        near.used[()] = slot + 1
        rate = float(near.d_q[slot] @ self._step.q_dot + near.d_t[slot])
        keep.least[slot] = rate + (short.by + 1e-6) / short.weight
        return True
