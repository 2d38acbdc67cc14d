"""What a plan shall lead to: configurations that reach a goal, keep their distances and are within limits."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from nmm.arrays import Array
from nmm.collisions.motion_check import MotionCheck
from nmm.control.goal import Goal, error_sizes
from nmm.errors import InputError, RunError, few
from nmm.functions.program import COMPILED, Program
from nmm.functions.tasks.linear_coordinates import Posture
from nmm.functions.tasks.task import Comparison, Task
from nmm.robots.robot import Robot

#: A configuration, coordinates by name, a task with a target that stands, or several of these.
Wanted: TypeAlias = (
    "ArrayLike | Mapping[str, float] | Task | Sequence[ArrayLike | Mapping[str, float] | Task]"
)
#: Goal configurations that are looked for, attempts to find them, and steps of Newton's method of each.
MANY, ATTEMPTS, STEPS = 8, 200, 60
#: An error is met where it is this small a share of the tolerances.
MET = 0.2


def alternatives(wanted: Any) -> list[Any]:
    """The goals of which one is to be reached."""
    if not isinstance(wanted, Sequence) or isinstance(wanted, str) or not len(wanted):
        return [wanted]
    each = all(isinstance(one, Task | Mapping | Sequence | np.ndarray) for one in wanted)
    return list(wanted) if each else [wanted]


class GoalPostures:
    """Configurations that reach a goal, found from many starts; counts what kept others from being one.

    Parameters
    ----------
    low, high (n,) : where starts are drawn, m and rad
    check : which keeps distances
    """

    def __init__(self, robot: Robot, low: Array, high: Array, check: MotionCheck, tolerance: Goal) -> None:
        self.robot, self.low, self.high, self.check, self.tolerance = robot, low, high, check, tolerance
        self.tried = 0
        self.in_the_way: Counter[str] = Counter()

    def find(self, wanted: object, start: Array, rng: np.random.Generator, count: int = MANY) -> list[Array]:
        """Up to `count` configurations (n,) that reach a goal, those nearest to the start's joints first."""
        found: list[Array] = []
        tries = iter(self._reaching(wanted, start, rng))
        for q in tries:
            self.tried += 1
            if q is None or self.robot.outside(q):
                continue
            pair = self.check.too_near(q)
            if pair >= 0 and self.check.scene is not None:
                self.in_the_way[self.check.scene.words(pair)] += 1
            elif not any(np.allclose(q, other, atol=1e-3) for other in found):
                found.append(q)
            if len(found) == count:
                break
        first = min(3, self.robot.platform.n_p)
        return sorted(found, key=lambda q: float(np.abs(q[first:] - start[first:]).sum()))

    def _reaching(self, wanted: object, start: Array, rng: np.random.Generator) -> Iterator[Array | None]:
        robot = self.robot
        if isinstance(wanted, Task):
            solve = Reaching(robot, wanted, self.tolerance)
            yield solve(start)
            for _ in range(ATTEMPTS):
                yield solve(rng.uniform(self.low, self.high))
        elif isinstance(wanted, Mapping):
            named = robot.q(wanted)
            own = {robot.coordinate(name) for name in wanted if name in robot.q_names}
            if "posture" in wanted and "posture" not in robot.q_names:
                own |= {robot.coordinate(name) for name in robot.postures[str(wanted["posture"])]}
            free = [i for i in robot.following.independent if i not in own]
            for k in range(1 + (ATTEMPTS if free else 0)):
                q = start.copy() if k == 0 else rng.uniform(self.low, self.high)
                q[[*own]] = named[[*own]]
                q = robot.following.placed(q)
                yield q
                if k == 0 and not robot.outside(q) and self.check.too_near(q) < 0:
                    return  # what is free stays as it is at the start, where it can
        else:
            q = robot.q(wanted)  # type: ignore[arg-type]  # which says what is wrong with it
            robot.check_limits(q)
            yield q


def goal_task(robot: Robot, goal: Any, end: Array) -> Task:
    """A goal as a task; one of coordinates is that these are where they are at the end (n,)."""
    if isinstance(goal, Task):
        return goal
    named = [name for name in goal if name in robot.q_names] if isinstance(goal, Mapping) else []
    names = named or [robot.q_names[i] for i in robot.following.independent]
    return Task(Posture(*names), end[[robot.coordinate(name) for name in names]])


class TaskError:
    """A task's value, target and error along a motion, without a controller. units : of the rows"""

    def __init__(self, robot: Robot, task: Task) -> None:
        self.robot, self.units, following = robot, [row.unit for row in task.rows(robot)], robot.following
        self._program = Program(robot, (task.function, task.reference, Comparison(task)), COMPILED)
        self._program.lay_out()
        # What all coordinates do where those that follow no other move.
        self._leads = np.eye(robot.n)
        self._leads[following.columns] = following.multipliers[:, np.newaxis] * self._leads[following.leaders]

    def evaluate(self, q: Array, t: float = 0.0) -> tuple[Array, Array, Array, Array]:
        """Value, target and error e (e,) at q (n,) and t, s, and ∂e/∂q (e, n)."""
        value, target, compared = self._program.evaluate(t, q)
        if len(compared.value):
            return value.value, target.value, compared.value, compared.value_q @ self._leads
        error_q = (target.value_q - value.value_q) @ self._leads
        return value.value, target.value, target.value - value.value, error_q


class Reaching(TaskError):
    """Newton's method (Levenberg and Marquardt's) for a task whose target stands, within limits."""

    def __init__(self, robot: Robot, task: Task, tolerance: Goal) -> None:
        super().__init__(robot, task)
        self._tolerance = tolerance
        targets = [self.evaluate(robot.rest, t)[1] for t in (0.0, 1.0, np.e)]
        if not all(np.array_equal(target, targets[0]) for target in targets):
            raise InputError("its target moves", where="plan: goal", expected="a task whose target stands")

    def __call__(self, q: Array) -> Array | None:
        """A configuration near q (n,) that reaches the target within a share of the tolerances, or None."""
        robot = self.robot
        limits = np.where(robot.limited, robot.q_limits, [-np.inf, np.inf])
        # Angles of a platform and of joints without limits go where they like.
        q = robot.following.placed(np.clip(q, limits[:, 0], limits[:, 1]))
        free = np.ones(robot.n)
        for _ in range(STEPS):
            _, _, e, e_q = self.evaluate(q)
            sizes = error_sizes(e, self.units)
            rest = np.abs(e)[[unit not in ("m", "rad") for unit in self.units]]
            if (
                sizes[0] <= MET * self._tolerance.m
                and sizes[1] <= MET * self._tolerance.rad
                and np.all(rest < 1e-4)
            ):
                return q
            J = e_q * free
            damping = 1e-6 + 1e-2 * min(1.0, float(e @ e))
            step = -J.T @ np.linalg.solve(J @ J.T + damping * np.eye(len(e)), e)
            step *= min(1.0, 0.5 / max(float(np.abs(step).max()), 1e-12))
            new = robot.following.placed(np.clip(q + step, limits[:, 0], limits[:, 1]))
            # A joint at its limit stays there in the next step; afterwards it is asked again.
            free = np.where(np.abs(new - q - step) > 1e-12, 0.0, 1.0)
            q = new
        return None


def nothing_found(postures: GoalPostures) -> RunError:
    """What is said where no goal posture is free."""
    causes = [f"{words} ({count})" for words, count in postures.in_the_way.most_common(5)]
    why = f"too near: {few(causes)}" if causes else "none reaches it within limits"
    return RunError(f"no free goal posture found in {postures.tried} attempts: {why}", where="plan: goal")
