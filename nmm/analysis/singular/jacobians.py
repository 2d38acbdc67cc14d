"""What is analysed: J_bar of the task and of an added task at any (t, q), with names, units and sizes."""

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from nmm.analysis.singular.parts import rank_of
from nmm.base.arrays import Array, Integers, array, positive, scalar, vector
from nmm.base.cores import Work, over_cores
from nmm.base.errors import InputError, SingularError, expect, expect_known
from nmm.base.kernels.compiled import compiled_without_gil, kernel, view
from nmm.base.kernels.record_layout import views
from nmm.base.kernels.records import FUNCTION, At, Frames, Rows
from nmm.base.progress import Progress
from nmm.control.controller import Controller
from nmm.control.functions.function import Function, Row, Stage, row_scales
from nmm.control.functions.program import BESIDE, COMPILED, LaidOut, run_program
from nmm.control.functions.tasks.task import Stack, Task
from nmm.control.resolvers.projected_gradient import ProjectedGradient
from nmm.control.resolvers.reduced_gradient import Partition
from nmm.control.step.equations import ControlStep, write_equation
from nmm.model.platforms.base import Platform
from nmm.model.robots.robot import Robot

#: What an analysis takes as the task: functions f(q) are enough, it needs no targets.
Tasks: TypeAlias = Task | Function | Stack | Sequence[Task | Function]
#: What can be analysed: a controller, or a robot and its task (functions are enough, without targets).
Subject: TypeAlias = Controller | tuple[Robot, Tasks]
#: Candidates for RG's partition: "automatic" or lists of inputs; None for the controller's own.
Candidates: TypeAlias = str | Sequence[Partition] | None

#: Step of the central differences, m and rad: the cube root of the machine's precision.
STEP = float(np.cbrt(np.finfo(float).eps))


@kernel(FUNCTION)
def stand_still(at: At, frames: Frames, numbers: Array, rows: Rows) -> None:
    for i in range(rows.value.shape[0]):
        rows.value_t[i] = 0.0
        for j in range(rows.value_q.shape[1]):
            rows.value_q[i, j] = 0.0


class Reached(Function):
    """g = f(q) at this q, held constant: the error is 0 and J_bar = (∂f/∂q) S. For an orientation or a pose,
    whose rows are those of its error, J is in the frame's own axes."""

    def __init__(self, function: Function) -> None:
        self.function = function

    def rows(self, robot: Robot) -> tuple[Row, ...]:
        return self.function.rows(robot)

    def stages(self, robot: Robot) -> tuple[Stage, ...]:
        return (*self.function.stages(robot), Stage(stand_still, len(self.rows(robot))))


def stacked(tasks: Tasks) -> Stack:
    """A stack of the tasks, of functions with the target just reached; `InputError` for anything else."""
    if isinstance(tasks, Stack):
        return tasks
    items = [tasks] if isinstance(tasks, Task | Function) else tasks
    if not isinstance(items, Sequence) or not all(isinstance(item, Task | Function) for item in items):
        raise InputError(
            where="task",
            expected="a task, a function of the robot as Position('ee'), or a list of these",
            got=tasks,
        )
    return Stack(tuple(item if isinstance(item, Task) else Task(item, Reached(item)) for item in items))


#: Configurations per compiled call, which cannot be interrupted.
AT_ONCE = 128


@compiled_without_gil
def write_matrices(t: Array, q: Array, integers: Integers, floats: Array, J_at: Array) -> None:
    """Write to J_at (N, s, m) the equation's matrix at t (N,) and q (N, n); NaN where any entry is."""
    e = views(ControlStep, integers, floats, BESIDE)
    b = views(LaidOut, integers, floats, 0).buffers
    J, n = e.problem.J, q.shape[1]
    for k in range(q.shape[0]):
        run_program(t[k], view(q, k * n, (n,)), integers, floats)
        write_equation(e.task, b, e.arm, J, e.problem.rate)
        finite = True
        for i in range(J.shape[0]):
            for j in range(J.shape[1]):
                finite = finite and math.isfinite(J[i, j])
        for i in range(J.shape[0]):
            for j in range(J.shape[1]):
                J_at[k, i, j] = J[i, j] if finite else math.nan


def matrices(controller: Controller, t: Array, q: Array, progress: Progress | None = None) -> Array:
    """J (N, s, m) of the controller's task at t (N,), s, and q (N, n), NaN where there is none: over the
    cores, or one by one if a Python function keeps the controller from being compiled as a whole."""
    q = np.ascontiguousarray(q, dtype=np.float64)
    J_at = np.empty((len(q), len(controller.rows), controller.robot.n_u))
    if controller.solver.compiles_steps:
        with controller.solver.compiled() as (integers, floats):
            integers, floats = integers.copy(), floats.copy()

        def worker() -> Work:
            own = floats.copy()
            return lambda first, last: write_matrices(
                t[first:last], q[first:last], integers, own, J_at[first:last]
            )

        over_cores(len(q), AT_ONCE, worker, progress)
        return J_at
    solve, J, every = controller.solver.solve, controller.solver.derivatives[0], max(1, len(q) // 100)
    for k, point in enumerate(q):
        if progress is not None and k % every == 0:
            progress(k / len(q))
        solve(float(t[k]), point)
        J_at[k] = J
    J_at[~np.isfinite(J_at).all(axis=(1, 2))] = np.nan
    return J_at


class Jacobians:
    """J (s, m) of the task and added_J (k, m) of the added task (by default the controller's own) at any
    (t, q). The subject's controller is not run and keeps its partition. `InputError` for another subject,
    more rows than inputs, or an added task that does not make J_e square."""

    def __init__(self, subject: Subject, added_task: Tasks | None = None) -> None:
        self.resolver = None
        if isinstance(subject, Controller):
            self.robot, self.task, self.resolver = subject.robot, subject.task, subject.resolver
            added = subject.given.added_task if added_task is None else stacked(added_task)
        elif isinstance(subject, tuple) and len(subject) == 2 and isinstance(subject[0], Robot):
            self.robot, self.task = subject[0], stacked(subject[1])
            added = Stack() if added_task is None else stacked(added_task)
        else:
            raise InputError(where="analysis", expected="a Controller or (robot, task)", got=subject)
        self._of_task = self._controller(self.task)
        self._of_added = self._controller(added) if len(added) else None
        self.rows: tuple[Row, ...] = self._of_task.rows
        self.scales = row_scales(self.rows, self.robot)
        self.added_rows: tuple[Row, ...] = self._of_added.rows if self._of_added else ()
        free = self.robot.n_u - len(self.rows)
        expected = f"{free} rows ({self.robot.n_u} inputs less {len(self.rows)} rows of the task)"
        count = len(self.added_rows)
        expect(count in (0, free), "added_task", f"{expected}, got {count}")

    def _controller(self, task: Stack) -> Controller:
        """What evaluates a task; compiled, so that single configurations give what `batch` gives."""
        return Controller(self.robot, task, ProjectedGradient(), steering=False, kinematics=COMPILED)

    @property
    def row_names(self) -> tuple[str, ...]:
        return tuple(row.name for row in self.rows)

    def J(self, t: float, q: Array) -> Array:
        """J_bar (s, m), eq. 13; `SingularError` where it is undefined or the wheels cannot roll."""
        return self._finite(self._of_task, t, q)

    def added_J(self, t: float, q: Array) -> Array:
        """J_bar of the added task (k, m); no rows without one."""
        if self._of_added is None:
            return np.zeros((0, self.robot.n_u))
        return self._finite(self._of_added, t, q)

    def along(self, t: float, q: Array, directions: Array) -> Array:
        """dJ/dε at q + ε directions[:, j] and fixed t, (columns, s, m), by central differences."""
        derivatives = [
            (self.J(t, q + STEP * direction) - self.J(t, q - STEP * direction)) / (2.0 * STEP)
            for direction in directions.T
        ]
        return np.array(derivatives).reshape(directions.shape[1], len(self.rows), self.robot.n_u)

    def batch(self, q: Array, t: float = 0.0, progress: Progress | None = None) -> Array:
        """J (N, s, m) at q (N, n), mimic joints placed by their leaders, and one time, over the cores; NaN
        where the wheels cannot roll or the task is undefined. `progress` gets the fraction done."""
        points = self.robot.following.placed(np.asarray(q, dtype=np.float64))
        return self._many(self._of_task, np.full(len(points), float(t)), points, progress)

    def history(self, t: Array, q: Array) -> tuple[Array, Array]:
        """J (N, s, m) and added_J (N, k, m) at t (N,) and q (N, n); `SingularError` as from `J`."""
        J, added_J = self._many(self._of_task, t, q), np.zeros((len(t), 0, self.robot.n_u))
        if self._of_added is not None:
            added_J = self._many(self._of_added, t, q)
        undefined = ~np.isfinite(np.concatenate([J, added_J], axis=1)).all(axis=(1, 2))
        for k in np.flatnonzero(undefined):  # the first one raises, and says why
            self.J(float(t[k]), q[k])
            self.added_J(float(t[k]), q[k])
        return J, added_J

    def _many(self, controller: Controller, t: Array, q: Array, progress: Progress | None = None) -> Array:
        """J (N, rows, m) of a controller at t (N,) and q (N, n); NaN where there is none."""
        J = matrices(controller, t, q, progress)
        platform = self.robot.platform
        if type(platform).problem is not Platform.problem and len(q):
            places = q[:, : platform.n_p]
            if np.all(places == places[0]):  # it stands, as in maps of the workspace
                places = places[:1]
            stuck = [platform.problem(place) is not None for place in places]
            J[np.broadcast_to(stuck, len(q))] = np.nan
        return J

    def sizes(self, length: float | None, sizes: Mapping[str, float] | None) -> tuple[Array, Array, Array]:
        """How much of each row (s,), added row (k,) and input (m,) counts as 1, in their own units."""
        L = 1.0 if length is None else positive(length, "length")
        by_name = {} if sizes is None else dict(sizes)
        names = (*self.row_names, *(row.name for row in self.added_rows), *self.robot.u_names)
        for name, value in by_name.items():
            expect_known("row or input", name, names, "sizes")
            by_name[name] = positive(value, f"size of {name}")

        def of(named: Iterable[tuple[str, str]]) -> Array:
            return np.array(
                [by_name.get(row, L if unit.split("/")[0] == "m" else 1.0) for row, unit in named]
            )

        rows, added = (((row.name, row.unit) for row in rows) for rows in (self.rows, self.added_rows))
        return of(rows), of(added), of(zip(self.robot.u_names, self.robot.u_units, strict=True))

    def natural(self, sizes: Array) -> float:
        """The least natural size of a row when `sizes` (s,) count as 1: singular values are judged beside it
        where even the largest is smaller, as a J of one row has no other."""
        return float(np.min(self.scales / sizes))

    def rank(self, J: Array, tolerance: float) -> int:
        """Rank of a matrix (s, any) of the task's rows as they are, rows in their natural sizes."""
        return rank_of(J / self.scales[:, np.newaxis], tolerance)

    def samples(self, t: ArrayLike, q: ArrayLike) -> tuple[Array, Array]:
        """Times (N,), increasing, and configurations (N, n), checked."""
        times, points = vector(t, None, "t"), array(q, "q")
        row = f"a row of {self.robot.n} numbers ({', '.join(self.robot.q_names)})"
        expected = f"{row} for each of {max(times.size, 1)} times, got shape {points.shape}"
        expect(times.size and points.shape == (times.size, self.robot.n), "q", expected)
        expect(np.all(np.diff(times) > 0.0), "t", "increasing times")
        return times, points

    def _finite(self, controller: Controller, t: float, q: Array) -> Array:
        J = controller.evaluate(t, q).J
        problem = self.robot.platform.problem(q[: self.robot.platform.n_p])
        if problem is not None or not np.all(np.isfinite(J)):
            why = problem or "the task or its reference is undefined there"
            raise SingularError(why, where=f"at t = {t:g} s")
        return J


def checked(jacobians: Jacobians, t: float, q: ArrayLike | Mapping[str, float] | None) -> tuple[float, Array]:
    expect(q is not None, "q", f"{jacobians.robot.n} numbers, got None")
    q = jacobians.robot.q(q)
    jacobians.robot.check_followers(q)
    return scalar(t, "t"), q
