"""Newton's method, compiled, for configurations in which a task's value is its target."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from nmm.base.arrays import Array, Integers
from nmm.base.errors import InputError
from nmm.base.kernels.compiled import checked_by_caller, compiled, scratch
from nmm.base.kernels.linear_algebra import dot, eliminate
from nmm.base.kernels.record_layout import BLOCKS, IntegerCell, IntegerVector, Matrix, Vector, views
from nmm.base.kernels.signatures import float64, int64
from nmm.base.kernels.velocity_map import place_mimic_joints
from nmm.control.functions.program import BESIDE, COMPILED, LaidOut, Program, run_program
from nmm.control.functions.tasks.task import Comparison, Task
from nmm.control.goal import ANOTHER, Goal, norms, unit_codes
from nmm.model.robots.robot import Robot
from nmm.plugins.planning.collisions.legs_check import MovedShapes, too_near

#: Steps of Newton's method of each attempt.
STEPS = 60
#: An error is met where it is this small a share of the tolerances.
MET = 0.2


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
