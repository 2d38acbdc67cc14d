"""What a plan shall lead to: configurations that reach a goal, keep their distances and are within limits."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from nmm.base.arrays import Array
from nmm.base.errors import InputError, RunError, few
from nmm.control.functions.tasks.linear_coordinates import Posture
from nmm.control.functions.tasks.task import Task
from nmm.control.goal import Goal
from nmm.model.robots.mimic_joints import SLACK
from nmm.model.robots.robot import Robot
from nmm.plugins.planning.collisions.motion_check import MotionCheck
from nmm.plugins.planning.targets import TargetSolver

#: A configuration, coordinates by name, a task with a target that stands, or several of these.
Wanted: TypeAlias = (
    "ArrayLike | Mapping[str, float] | Task | Sequence[ArrayLike | Mapping[str, float] | Task]"
)
#: Goal configurations that are looked for, and attempts to find them.
MANY, ATTEMPTS = 8, 200
#: So far inside limits that are asked for a task is reached where it can be, m and rad.
INSIDE = 0.01


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


def nothing_found(postures: GoalPostures) -> RunError:
    """What is said where no goal posture is free."""
    causes = [f"{words} ({count})" for words, count in postures.in_the_way.most_common(5)]
    why = f"too near: {few(causes)}" if causes else "none reaches it within limits"
    return RunError(f"no free goal posture found in {postures.tried} attempts: {why}", where="plan: goal")
