"""What is held while the platform moves, and the arm that keeps it: Newton's method along the platform's way.

Each step of the platform is followed by the arm from where it was (E. L. Allgower, K. Georg, Numerical
Continuation Methods, 1990). A step after which a joint is far from where it was is halved, so that the arm
does not change over to another solution.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from nmm.base.arrays import Array, Integers
from nmm.base.errors import InputError, expect_kind
from nmm.base.kernels.compiled import checked_by_caller, compiled, compiled_without_gil, scratch
from nmm.base.kernels.linear_algebra import copied
from nmm.base.kernels.record_layout import BLOCKS, views
from nmm.base.kernels.signatures import float64, int64
from nmm.control.functions.program import BESIDE, evaluate
from nmm.control.functions.tasks.pose import Pose
from nmm.control.functions.tasks.task import Task
from nmm.control.goal import Goal, norms, unit_codes
from nmm.model.robots.configuration import Configuration
from nmm.model.robots.robot import Robot
from nmm.plugins.planning.collisions.legs_check import (
    MovedShapes,
    along,
    leaves,
    leg_blocked,
    too_near,
)
from nmm.plugins.planning.collisions.motion_check import MotionCheck
from nmm.plugins.planning.targets import STEPS, Newton, TaskError, newton_step
from nmm.plugins.planning.tree import PLACE, Trees
from nmm.plugins.planning.ways import leg_time

#: Where what is held is off by no more, it is kept: m and rad.
EXACT = 1e-10
#: A step is this short at least, as a share of the usual one.
LEAST = 1e-3
#: Steps of Newton's method after a step of the platform.
CLOSE = 12
#: Joints keep off their limits by so much where the start does, rad and m: for what is between two nodes.
INSIDE = 1e-3
#: Why following ended: it arrived, the arm cannot hold any farther, something is near, no room is left.
ARRIVED, LOST, BLOCKED, FULL = 0, 1, 2, 3
#: Room for nodes of one path.
ROOM = 20_000


@compiled
def close(q: Array, steps: int, integers: Integers, floats: Array) -> int:
    """Bring q (n,) onto what is held, by what may move; 1 where it is kept."""
    own = views(Newton, integers, floats, BESIDE)
    for i in range(q.shape[0]):
        own.held[i] = 1.0
    for _ in range(steps):
        if newton_step(0.0, q, 1, integers, floats) == 1:
            return 1
    return newton_step(0.0, q, 0, integers, floats)


@compiled_without_gil
def follow(
    integers: Integers,
    floats: Array,
    own_integers: Integers,
    own_floats: Array,
    q: Array,
    legs: Array,
    tick: float,
    far: float,
    nodes: Array,
    places: Array,
    ended: Integers,
) -> int:
    """The arm follows the platform along legs (L, 3 + n) from q (n,), by steps of `tick` s and
    joints' of `far` rad or m at most: nodes (K, n), and in places (K, 2) the leg and how much of it is gone.
    Returns how many there are; ended (1,): why there are no more. Without legs, q itself is brought onto
    what is held."""
    scene = views(MovedShapes, integers, floats, 0)
    ways = views(Trees, integers, floats, PLACE).ways
    n, planar = q.shape[0], scene.planar[()]
    platform = ways.steering[()] + 1 if ways.steering[()] >= 0 else 3 * planar
    corner, current, trial, chord = scratch(n), scratch(n), scratch(n), scratch(3 + n)
    if legs.shape[0] == 0:
        ended[0] = ARRIVED if close(q, STEPS, own_integers, own_floats) == 1 else LOST
    copied(q, corner)
    copied(q, current)
    count = 0
    for k in range(legs.shape[0]):
        share, usual = 0.0, 1.0 / max(2.0, math.ceil(leg_time(ways, legs[k]) / tick))
        step = usual
        while share < 1.0:
            step = min(step, 1.0 - share)
            if 1.0 - share - step < 1e-9:
                step = 1.0 - share
            along(planar, corner, legs[k], share + step, scene.mimic_joints, trial)
            for i in range(platform, n):
                trial[i] = current[i]
            holds = close(trial, CLOSE, own_integers, own_floats)
            longest = 0.0
            for i in range(platform, n):
                longest = max(longest, abs(trial[i] - current[i]))
            if holds == 0 or longest > far:
                step *= 0.5
                if step < LEAST * usual:
                    ended[0] = LOST
                    return count
                continue
            for i in range(3 + n):
                chord[i] = step * legs[k, i]
            for i in range(platform, n):
                chord[3 + i] = trial[i] - current[i]
            if count == nodes.shape[0]:
                ended[0] = FULL
                return count
            gone = planar == 1 and leaves(scene, current, chord)
            if gone or too_near(scene, trial) >= 0 or leg_blocked(scene, current, chord) >= 0:
                ended[0] = BLOCKED
                return count
            share = 1.0 if step == 1.0 - share else share + step
            copied(trial, nodes[count])
            copied(trial, current)
            places[count, 0], places[count, 1] = k, share
            count += 1
            step = min(usual, 2.0 * step)
        copied(current, corner)
        ended[0] = ARRIVED
    return count


_FLAT, _ROWS = float64[::1], float64[:, ::1]
FOLLOW = int64(*(*BLOCKS.types, *BLOCKS.types, _FLAT, _ROWS, *(2 * [float64]), _ROWS, _ROWS, int64[::1]))


class FollowedPath(NamedTuple):
    """A path as far as the arm follows it: nodes (K, n), of each its leg and how much of it is gone
    (K, 2), and why it ended."""

    nodes: Array
    places: Array
    ended: int


class Held(TaskError):
    """What is held, where it is at a start (n,), and the arm that keeps it. within (n, 2) : its limits; the
    robot's when not given

    Raises
    ------
    InputError : what is held is not where the start has it, or the arm alone cannot keep it
    """

    def __init__(
        self,
        robot: Robot,
        hold: Task | str,
        q: Array,
        tolerance: Goal,
        check: MotionCheck,
        within: Array | None = None,
    ) -> None:
        if not isinstance(hold, Task | str):
            expect_kind(hold, Task, "plan: hold", "a frame's name, or a Task whose target stands")
        function = Pose(hold) if isinstance(hold, str) else hold.function
        value = evaluate(function, 0.0, Configuration(robot, q)).value
        super().__init__(robot, Task(function, value), tolerance, within)
        self.name = hold if isinstance(hold, str) else hold.name or type(function).__name__
        if self._program.calls_python:
            raise InputError("a function computed in Python is not held", where="plan: hold")
        if isinstance(hold, Task):
            self._expect_target(hold, q, tolerance)
        own, self.platform, self.check = self._own, robot.platform.n_p, check
        self._leads = own.leads.copy()
        self.arm = np.array([i for i in robot.following.independent if i >= self.platform], dtype=np.int64)
        self._arm_leads = np.zeros_like(self._leads)
        self._arm_leads[:, self.arm] = self._leads[:, self.arm]
        own.met[:] = EXACT
        own.limits[0] = np.minimum(own.limits[0] + INSIDE, np.maximum(q, own.limits[0]))
        own.limits[1] = np.maximum(own.limits[1] - INSIDE, np.minimum(q, own.limits[1]))
        own.limits[:, : self.platform] = [[-np.inf], [np.inf]]  # which its way decides
        self._expect_arm(q)
        self._follow = checked_by_caller(follow, FOLLOW)
        self._nodes, self._places = np.zeros((ROOM, robot.n)), np.zeros((ROOM, 2))
        self._ended = np.zeros(1, dtype=np.int64)

    def _expect_target(self, hold: Task, q: Array, tolerance: Goal) -> None:
        task_error = TaskError(self.robot, hold, tolerance)
        targets = [task_error.evaluate(q, t)[1] for t in (0.0, 1.0, math.e)]
        if not all(np.array_equal(target, targets[0]) for target in targets):
            raise InputError("its target moves", where="plan: hold", expected="a task whose target stands")
        metres, radians = norms(task_error.evaluate(q)[2], unit_codes(task_error.rows))
        if metres > tolerance.m or radians > tolerance.rad:
            got = f"{metres:.3g} m and {radians:.3g} rad from it"
            raise InputError(where="plan: hold", expected="a target where the start has it", got=got)

    def _expect_arm(self, q: Array) -> None:
        rng, ranks = np.random.default_rng(0), np.zeros(2, dtype=np.int64)
        low, high = np.where(self.robot.limited, self.robot.q_limits, [-np.pi, np.pi]).T
        for k in range(5):
            J = self._jacobian(q if k == 0 else self.robot.following.placed(rng.uniform(low, high)))
            both = [np.linalg.matrix_rank(matrix, tol=1e-6) for matrix in (J, J[:, self.arm])]
            ranks = np.maximum(ranks, both)
        if ranks[1] < ranks[0] or not ranks[1]:
            what = f"the arm alone moves it in {ranks[1]} of the {ranks[0]} ways in which the robot does"
            expected = "what the arm can keep, as Task(Position('tool'), target)"
            raise InputError(what, where="plan: hold", expected=expected)

    def _jacobian(self, q: Array) -> Array:
        """∂e/∂q (s, n) at q (n,), by all coordinates that follow no other."""
        self._own.leads[:] = self._leads
        J = self.evaluate(q)[3]
        self._own.leads[:] = self._arm_leads
        return J

    def __call__(self, q: Array) -> bool:
        """Bring the arm of q (n,) onto what is held, in place; whether it is kept."""
        return self.along(q, np.zeros((0, 3 + len(q))), 1.0, 1.0).ended == ARRIVED

    def along(self, q: Array, legs: Array, tick: float, far: float) -> FollowedPath:
        """How far the arm follows along legs (L, 3 + n) from q (n,), by steps of so many s, and of joints by
        so many rad or m, at most."""
        arguments = *self.check.blocks, *self._program.blocks, q, np.ascontiguousarray(legs), tick, far
        count = self._follow(*arguments, self._nodes, self._places, self._ended)
        return FollowedPath(self._nodes[:count].copy(), self._places[:count].copy(), int(self._ended[0]))

    def off(self, q: Array) -> tuple[float, float]:
        """By how much it is not kept at q (n,), m and rad."""
        return norms(self.evaluate(q)[2], unit_codes(self.rows))

    def tangent(self, q: Array, rates: Array) -> Array:
        """Rates (n,) at q (n,) of which the platform's (n_p,) are given, with the arm's least."""
        J, tangent = self._jacobian(q), np.zeros_like(q)
        tangent[: self.platform] = rates
        tangent[self.arm] = -np.linalg.pinv(J[:, self.arm], rcond=1e-8) @ (J[:, : self.platform] @ rates)
        return self._leads @ tangent
