"""What a plan shall lead to: configurations that reach a goal, keep their distances and are within limits."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from nmm.base.arrays import Array, Integers
from nmm.base.errors import InputError, RunError, few
from nmm.base.kernels.compiled import checked_by_caller, compiled, scratch
from nmm.base.kernels.linear_algebra import dot, eliminate
from nmm.base.kernels.record_layout import BLOCKS, IntegerCell, IntegerVector, Matrix, Vector, views
from nmm.base.kernels.signatures import float64, int64
from nmm.base.kernels.velocity_map import place_mimic_joints
from nmm.control.functions.program import BESIDE, COMPILED, LaidOut, Program, run_program
from nmm.control.functions.tasks.linear_coordinates import Posture
from nmm.control.functions.tasks.task import Comparison, Task
from nmm.control.goal import ANOTHER, Goal, norms, unit_codes
from nmm.model.robots.mimic_joints import SLACK
from nmm.model.robots.robot import Robot
from nmm.plugins.planning.collisions.legs_check import MovedShapes, too_near
from nmm.plugins.planning.collisions.motion_check import MotionCheck

#: A configuration, coordinates by name, a task with a target that stands, or several of these.
Wanted: TypeAlias = (
    "ArrayLike | Mapping[str, float] | Task | Sequence[ArrayLike | Mapping[str, float] | Task]"
)
#: Goal configurations that are looked for, attempts to find them, and steps of Newton's method of each.
MANY, ATTEMPTS, STEPS = 8, 200, 60
#: So far inside limits that are asked for a task is reached where it can be, m and rad.
INSIDE = 0.01
#: An error is met where it is this small a share of the tolerances.
MET = 0.2


def alternatives(wanted: Any) -> list[Any]:
    """The goals of which one is to be reached."""
    if not isinstance(wanted, Sequence) or isinstance(wanted, str) or not len(wanted):
        return [wanted]
    each = all(isinstance(goal, Task | Mapping | Sequence | np.ndarray) for goal in wanted)
    return list(wanted) if each else [wanted]


class GoalPostures:
    """Configurations that reach a goal, found from many starts; counts what kept others from being one.

    Parameters
    ----------
    low, high (n,) : where starts are drawn, m and rad
    check : which keeps distances
    within (n, 2) : their limits; the robot's when not given
    """

    def __init__(
        self,
        robot: Robot,
        low: Array,
        high: Array,
        check: MotionCheck,
        tolerance: Goal,
        within: Array | None = None,
    ) -> None:
        self.robot, self.low, self.high, self.check, self.tolerance = robot, low, high, check, tolerance
        self.within = within
        limits = robot.q_limits if within is None else within
        ends = np.ascontiguousarray(limits.T) + np.array([[-SLACK], [SLACK]])
        ends[:, robot.following.columns] = [[-np.inf], [np.inf]]  # their leaders' limits are theirs, too
        self._ends = ends
        self.tried = 0
        self.in_the_way: Counter[str] = Counter()

    def find(self, wanted: object, start: Array, rng: np.random.Generator, count: int = MANY) -> list[Array]:
        """Up to `count` configurations (n,) that reach a goal, those nearest to the start's joints first."""
        configurations: list[Array] = []
        tries = iter(self._reaching(wanted, start, rng))
        for q in tries:
            self.tried += 1
            if q is None or np.any(q < self._ends[0]) or np.any(q > self._ends[1]):
                continue
            pair = self.check.too_near(q)
            if pair >= 0 and self.check.scene is not None:
                self.in_the_way[self.check.scene.words(pair)] += 1
            elif not configurations or self._off(q, configurations) >= 1e-3:
                configurations.append(q)
            if len(configurations) == count:
                break
        first = min(3, self.robot.platform.n_p)
        return sorted(
            configurations, key=lambda q: float(np.abs(self.robot.short_way(q - start)[first:]).sum())
        )

    def _tried(self, solve: TargetSolver, starts: Array) -> Iterator[Array | None]:
        """What is reached from starts (K, n), those that are free where no Python function is in the way."""
        if solve.calls_python:
            yield from map(solve, starts)
            return
        pairs, k = np.zeros(len(starts), dtype=np.int64), 0
        while k < len(starts):
            arguments = *self.check.blocks, *solve.blocks, starts, k, self._ends, pairs
            free = solve.try_starts(*arguments)
            self.tried += free - k
            near, counts = np.unique(pairs[k:free], return_counts=True)
            for pair, count in zip(near.tolist(), counts.tolist(), strict=True):
                if pair >= 0 and self.check.scene is not None:
                    self.in_the_way[self.check.scene.words(pair)] += count
            if free < len(starts):
                yield starts[free]
            k = free + 1

    def _off(self, q: Array, others: Sequence[Array]) -> float:
        """How far q (n,) is from the nearest of others, in the coordinate that differs most, m or rad."""
        return float(np.abs(self.robot.short_way(q - np.array(others))).max(axis=1).min())

    def _limits(self) -> Iterator[Array | None]:
        """Limits to reach a task within: first a little inside those asked for, which leaves a smooth motion
        room, then these."""
        if self.within is not None:
            own = np.where(self.robot.limited, self.robot.q_limits, [-np.inf, np.inf])
            room = np.minimum(INSIDE, 0.1 * (self.within[:, 1] - self.within[:, 0]))
            inside = self.within + np.where(self.within != own, room[:, np.newaxis] * [1.0, -1.0], 0.0)
            if np.any(inside != self.within):
                yield inside
        yield self.within

    def _reaching(self, wanted: object, start: Array, rng: np.random.Generator) -> Iterator[Array | None]:
        robot = self.robot
        if isinstance(wanted, Task):
            for within in self._limits():
                starts = np.vstack([start, rng.uniform(self.low, self.high, (ATTEMPTS, robot.n))])
                yield from self._tried(TargetSolver(robot, wanted, self.tolerance, within), starts)
        elif isinstance(wanted, Mapping):
            named = robot.q(wanted)
            own = {robot.coordinate(name) for name in wanted if name in robot.q_names}
            if "posture" in wanted and "posture" not in robot.q_names:
                own |= {robot.coordinate(name) for name in robot.postures[str(wanted["posture"])]}
            expect_within(robot, named, own, self.within)
            free = [i for i in robot.following.independent if i not in own]
            for k in range(1 + (ATTEMPTS if free else 0)):
                q = start.copy() if k == 0 else rng.uniform(self.low, self.high)
                q[[*own]] = named[[*own]]
                q = robot.following.placed(q)
                yield q
                if k == 0 and not robot.outside(q, self.within) and self.check.too_near(q) < 0:
                    return  # what is free stays as it is at the start, where it can
        else:
            q = robot.q(wanted)  # type: ignore[arg-type]  # which says what is wrong with it
            robot.check_limits(q)
            expect_within(robot, q, range(robot.n), self.within)
            yield q


def expect_within(robot: Robot, q: Array, which: Iterable[int], within: Array | None) -> None:
    """`InputError` for a goal of which these coordinates of q (n,) are outside limits (n, 2)."""
    outside, names = robot.outside(q, within), {robot.q_names[i] for i in which}
    words = [text for name, text in outside.items() if name in names]
    if words:
        raise InputError(f"outside its limits: {few(words)}", where="plan: goal")


def goal_task(robot: Robot, goal: Any, end: Array) -> Task:
    """A goal as a task; one of coordinates is that these are where they are at the end (n,)."""
    if isinstance(goal, Task):
        return goal
    named = [name for name in goal if name in robot.q_names] if isinstance(goal, Mapping) else []
    names = named or [robot.q_names[i] for i in robot.following.independent]
    return Task(Posture(*names), end[[robot.coordinate(name) for name in names]])


class Newton(NamedTuple):
    """A task to reach, beside its `Program` in memory.

    units (s,) : of its rows (`unit_codes`); met (3,) : errors that are small enough, m, rad and other units
    wrapped (s,) : 1 where target less value is an angle that goes the short way, else 0
    compared () : 1 where the rows of the error are the task's own comparison, 0 for target less value
    limits (2, n) : the least and the largest q; mimic_joints : the robot's; leads (n, n) : what all
    coordinates do where those that follow no other move
    error (s,), error_q (s, n) : e and ∂e/∂q; held (n,) : 0 for a joint that a step left at its limit, else 1
    """

    units: IntegerVector
    met: Vector
    wrapped: IntegerVector
    compared: IntegerCell
    limits: Matrix
    mimic_joints: Vector
    leads: Matrix
    error: Vector
    error_q: Matrix
    held: Vector


@compiled
def newton_step(t: float, q: Array, moves: int, integers: Integers, floats: Array) -> int:
    """Write e and ∂e/∂q at q (n,); where it is not reached, and if `moves` is 1, move q by a step of
    Levenberg's and Marquardt's, within limits. 1 where it is reached."""
    run_program(t, q, integers, floats)
    b, own = views(LaidOut, integers, floats, 0).buffers, views(Newton, integers, floats, BESIDE)
    e, J, s, n, compared = own.error, own.error_q, own.error.shape[0], q.shape[0], own.compared[()] == 1
    for i in range(s):
        e[i] = b.value[2 * s + i] if compared else b.value[s + i] - b.value[i]
        if own.wrapped[i] == 1:
            e[i] = math.pi - (math.pi - e[i]) % (2.0 * math.pi)
        for j in range(n):
            J[i, j] = 0.0
            for k in range(n):
                if own.leads[k, j] != 0.0:
                    e_q = b.value_q[2 * s + i, k] if compared else b.value_q[s + i, k] - b.value_q[i, k]
                    J[i, j] += e_q * own.leads[k, j]
    metres, radians = norms(e, own.units)
    others = 0.0
    for i in range(s):
        if own.units[i] == ANOTHER:
            others = max(others, abs(e[i]))
    if metres <= own.met[0] and radians <= own.met[1] and others <= own.met[2]:
        return 1
    if moves == 0:
        return 0
    M, scales, step = scratch((s, s + 1)), scratch(s), scratch(n)
    for i in range(s):
        scales[i] = 1.0
        for k in range(s):
            M[i, k] = 1e-6 + 1e-2 * min(1.0, dot(e, e)) if i == k else 0.0
            for j in range(n):
                M[i, k] += J[i, j] * own.held[j] * J[k, j]
        M[i, s] = e[i]
    eliminate(M, scales)
    longest = 1e-12
    for j in range(n):
        step[j] = 0.0
        for i in range(s):
            step[j] -= J[i, j] * own.held[j] * M[i, s]
        longest = max(longest, abs(step[j]))
    for j in range(n):
        # A joint at its limit stays there in the next step; afterwards it is asked again.
        wanted = q[j] + min(1.0, 0.5 / longest) * step[j]
        q[j] = min(max(wanted, own.limits[0, j]), own.limits[1, j])
        own.held[j] = 1.0 if abs(q[j] - wanted) <= 1e-12 else 0.0
    place_mimic_joints(q, own.mimic_joints)
    return 0


@compiled
def reach(t: float, q: Array, steps: int, begins: int, integers: Integers, floats: Array) -> int:
    """`newton_step` so many times, or until it is reached (1); of no steps e and ∂e/∂q at q. begins: 1 where
    q is to be brought within limits first."""
    own = views(Newton, integers, floats, BESIDE)
    if steps == 0:
        return newton_step(t, q, 0, integers, floats)
    if begins == 1:
        for j in range(q.shape[0]):
            q[j] = min(max(q[j], own.limits[0, j]), own.limits[1, j])
            own.held[j] = 1.0
        place_mimic_joints(q, own.mimic_joints)
    for _ in range(steps):
        if newton_step(t, q, 1, integers, floats) == 1:
            return 1
    return 0


@compiled
def try_starts(
    integers: Integers,
    floats: Array,
    own_integers: Integers,
    own_floats: Array,
    starts: Array,
    first: int,
    ends: Array,
    pairs: Integers,
) -> int:
    """Reach a task from starts (K, n), from `first` on, until one is within ends (2, n) and free: its number
    or K. They are moved; pairs (K,): the one that is too near there, or -1 where it is not reached."""
    scene = views(MovedShapes, integers, floats, 0)
    for k in range(first, starts.shape[0]):
        q, inside, pairs[k] = starts[k], reach(0.0, starts[k], STEPS, 1, own_integers, own_floats) == 1, -1
        for i in range(q.shape[0]):
            inside = inside and ends[0, i] <= q[i] <= ends[1, i]
        if inside:
            pairs[k] = too_near(scene, q)
            if pairs[k] < 0:
                return k
    return starts.shape[0]


_REACH = int64(float64, float64[::1], int64, int64, *BLOCKS.types)


_TRY_STARTS = int64(*(*BLOCKS.types, *BLOCKS.types, float64[:, ::1], int64, float64[:, ::1], int64[::1]))


class TaskError:
    """A task's value, target and error along a motion, without a controller. rows : its components"""

    def __init__(
        self, robot: Robot, task: Task, tolerance: Goal | None = None, within: Array | None = None
    ) -> None:
        rows, following, tolerance = task.rows(robot), robot.following, tolerance or Goal()
        self.robot, self.rows = robot, rows
        self._program = Program(robot, (task.function, task.reference, Comparison(task)), COMPILED)
        leads = np.eye(robot.n)
        leads[following.columns] = following.multipliers[:, np.newaxis] * leads[following.leaders]
        # Angles of a platform and of joints without limits go where they like.
        limits = np.where(robot.limited, robot.q_limits, [-np.inf, np.inf]) if within is None else within
        newton = Newton(
            units=unit_codes(rows),
            met=np.array([MET * tolerance.m, MET * tolerance.rad, 1e-4]),
            wrapped=np.array(
                [row.angular and task.function.comparison is None for row in rows], dtype=np.int64
            ),
            compared=np.array(int(task.function.comparison is not None), dtype=np.int64),
            limits=limits.T.copy(),
            mimic_joints=following.table.ravel(),
            leads=leads,
            error=np.zeros(len(rows)),
            error_q=np.zeros((len(rows), robot.n)),
            held=np.ones(robot.n),
        )
        self._program.lay_out(newton)
        self._own = views(Newton, *self._program.blocks, BESIDE)
        self._reach = checked_by_caller(reach, _REACH)

    def evaluate(self, q: Array, t: float = 0.0) -> tuple[Array, Array, Array, Array]:
        """Value, target and error e (s,) at q (n,) and t, s, and ∂e/∂q (s, n)."""
        self._program.prepare(t, q)
        self._reach(t, q, 0, 0, *self._program.blocks)
        s, value = len(self._own.error), self._program.buffers.value
        return value[:s].copy(), value[s : 2 * s].copy(), self._own.error.copy(), self._own.error_q.copy()


class TargetSolver(TaskError):
    """Newton's method for a task whose target stands, within limits."""

    def __init__(self, robot: Robot, task: Task, tolerance: Goal, within: Array | None = None) -> None:
        super().__init__(robot, task, tolerance, within)
        self.calls_python, self.blocks = self._program.calls_python, self._program.blocks
        self.try_starts = checked_by_caller(try_starts, _TRY_STARTS)
        targets = [self.evaluate(robot.rest, t)[1] for t in (0.0, 1.0, np.e)]
        if not all(np.array_equal(target, targets[0]) for target in targets):
            raise InputError("its target moves", where="plan: goal", expected="a task whose target stands")

    def __call__(self, q: Array) -> Array | None:
        """A configuration near q (n,) that reaches the target within a share of the tolerances, or None."""
        q, program = self.robot.following.placed(np.clip(q, *self._own.limits)), self._program
        for k in range(STEPS):
            program.prepare(0.0, q)
            if self._reach(0.0, q, 1, int(k == 0), *program.blocks):
                return q
        return None


def nothing_found(postures: GoalPostures) -> RunError:
    """What is said where no goal posture is free."""
    causes = [f"{words} ({count})" for words, count in postures.in_the_way.most_common(5)]
    why = f"too near: {few(causes)}" if causes else "none reaches it within limits"
    return RunError(f"no free goal posture found in {postures.tried} attempts: {why}", where="plan: goal")
