"""The controller: robot + task + objective + resolver, u = controller(t, q), fit for a 1 kHz loop."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from nmm.arrays import Array, Integers
from nmm.control.equations import PLAIN, WRAPPED, Laws, Results, drive, empty_results, step
from nmm.errors import InputError, SingularError
from nmm.functions.function import Row
from nmm.functions.objectives.base import Objective
from nmm.functions.program import BESIDE, Program
from nmm.functions.tasks.comparison import Comparison
from nmm.functions.tasks.task import Stack, Task
from nmm.kernels.memory import views
from nmm.resolvers.base import FREE, HELD, OVERDUE, Resolver, Shape, Status
from nmm.robots.robot import Robot

FLOAT64 = np.dtype(np.float64)


@dataclass(frozen=True, eq=False)
class Step:
    """Everything that a controller found at (t, q): copies, in the units of the task's rows.

    r, target, error, rate (s,), J (s, m) of J_bar u = rate; objective H and gradient h (m,);
    u (m,), q_dot = S u (n,); residual ‖J u - rate‖; status; measure (see `Resolution`); partition
    (s,) the columns of Ja, -1 where there is none.
    """

    t: float
    q: Array
    r: Array
    target: Array
    error: Array
    rate: Array
    J: Array
    objective: float
    h: Array
    u: Array
    q_dot: Array
    residual: float
    status: Status
    measure: float
    partition: Integers


class Controller:
    """u = controller(t, q): the inputs with which `robot` does `task` and descends `objective`.

    Parameters
    ----------
    robot : the robot
    task : a `Task`, or several, done together
    resolver : how the redundancy is resolved
    objective : H(q) to minimise; None for the plain solution
    constraint : the added task y = h(q) of the extended Jacobian

    Raises
    ------
    InputError : a frame, coordinate or input that the robot lacks; more rows than inputs; a
        constraint with a resolver that takes none, or none with one that does
    """

    def __init__(
        self,
        robot: Robot,
        task: Task | Stack | Sequence[Task],
        resolver: Resolver,
        objective: Objective | None = None,
        constraint: Task | Stack | Sequence[Task] | None = None,
    ) -> None:
        _expect(robot, Robot, "robot")
        _expect(resolver, Resolver, "resolver")
        if objective is not None:
            _expect(objective, Objective, "objective")
        self.robot = robot
        self.task = Stack.of(task)
        self.resolver = resolver
        self.objective = objective
        self.constraint = Stack() if constraint is None else Stack.of(constraint)
        if self.constraint.tasks and not resolver.uses_constraint:
            raise InputError(f"constraint: resolver {resolver.name} takes none, ej does")
        self.rows: tuple[Row, ...] = self.task.rows(robot)
        constraint_rows = self.constraint.rows(robot)

        every = (*self.task, *self.constraint)
        weighted = () if objective is None else objective.terms_on(robot)
        functions = [f for task in every for f in (task.function, task.reference, Comparison(task))]
        program = Program(robot, [*functions, *(function for _, function in weighted)])
        first = program.first_rows
        listed = [
            (first[3 * i] + j, first[3 * i + 1] + j, _error_row(task, first[3 * i + 2], j, row))
            for i, task in enumerate(every)
            for j, row in enumerate(task.rows(robot))
        ]
        table = np.array(listed, dtype=np.int64).reshape(-1, 3)
        s, k, m = len(self.rows), len(constraint_rows), robot.n_u
        setup = resolver.setup(Shape(s, k, robot.u_names, robot.groups))
        program.lay_out(
            Laws(
                results=empty_results(s, k, m, robot.n),
                rows=table[:s],
                gain=_gains(self.task, robot),
                constraint_rows=table[s:],
                constraint_gain=_gains(self.constraint, robot),
                terms=np.array(first[3 * len(every) :], dtype=np.int64),
                weights=np.array([weight for weight, _ in weighted]),
                resolver=resolver.kernel.address,
                numbers=setup.parameters,
                options=setup.options,
            )
        )
        self._program = program
        self._start = setup.state
        self._state = setup.state.copy()
        self._results: Results = views(Laws, *program.blocks, BESIDE).results
        self._u = self._results.u
        self._shape = (robot.n,)
        self._solve = self._solver()

    def __call__(self, t: float, q: ArrayLike) -> Array:
        """Inputs u (m,) at time t (s) and configuration q (n,), in the units of `robot.u_units`.

        Raises
        ------
        SingularError : the matrix to invert lost rank, or an input is not finite
        InputError : q has the wrong length or holds numbers that are not finite
        """
        # Another kind of array would be compiled for anew, so anything but the plain kind is copied.
        if type(q) is not np.ndarray or q.dtype != FLOAT64 or q.shape != self._shape or not q.flags.carray:
            q = self._copied(q)
        if self._solve(float(t), q):
            self._fail(t, q)
        return self._u.copy()

    def _copied(self, q: ArrayLike | None) -> Array:
        if q is None:
            raise InputError(f"q: expected {self.robot.n} numbers, got None")
        return self.robot.q(q)

    def __reduce__(self) -> tuple[object, ...]:
        """Copies and pickles are built anew: views of memory and addresses of kernels do not travel."""
        return type(self), (self.robot, self.task, self.resolver, self.objective, self.constraint)

    def _solver(self) -> Callable[[float, Array], float]:
        """solve(t, q) -> status, with everything it needs at hand."""
        program, state, found, resolver = self._program, self._state, self._results, self.resolver
        prepare, (integers, floats) = program.prepare, program.blocks

        def solve(t: float, q: Array) -> float:
            prepare(t, q)
            return step(t, q, integers, floats, state)

        def solve_and_finish(t: float, q: Array) -> float:
            solve(t, q)
            resolver.finish(found.task.J, found.task.rate, found.h, found.u, found.report)
            drive(found.u, program.buffers.G, found.q_dot)
            return float(found.report[0])

        return solve if type(resolver).finish is Resolver.finish else solve_and_finish

    def _fail(self, t: float, q: Array) -> None:
        self.robot.q(q)  # a q that is not finite is the caller's error
        problem = self.robot.platform.problem(q[: self.robot.platform.n_p])
        status = Status(int(self._results.report[0]))
        also = "" if problem is None else f"; {problem}"
        raise SingularError(f"at t = {t:g} s: {status.meaning}{also}")

    def evaluate(self, t: float, q: ArrayLike) -> Step:
        """All quantities at (t, q); a singular matrix is reported in `status`, not raised.

        Like a call, it may choose another partition (see `reset`).
        """
        q = self._copied(q)
        self._solve(float(t), q)
        return self.last(t, q)

    def last(self, t: float, q: Array) -> Step:
        """The quantities of the call just made at (t, q), as copies."""
        found = self._results
        task = found.task
        return Step(
            t=float(t),
            q=q.copy(),
            r=task.r.copy(),
            target=task.target.copy(),
            error=task.error.copy(),
            rate=task.rate.copy(),
            J=task.J.copy(),
            objective=float(found.H[0]),
            h=found.h.copy(),
            u=found.u.copy(),
            q_dot=found.q_dot.copy(),
            residual=float(found.report[1]),
            status=Status(int(found.report[0])),
            measure=abs(float(found.report[2])),
            partition=self._state[1:].copy(),
        )

    def velocity(self, t: float, q: ArrayLike) -> Array:
        """q_dot = S(q) u (n,) of the closed loop at (t, q); raises as a call does."""
        self(t, q)
        return self._results.q_dot.copy()

    def reset(self) -> None:
        """Forget the partition: the next call chooses it anew."""
        self._state[:] = self._start

    def hold_partition(self, hold: bool) -> None:
        """Keep the partition through the calls that follow (the stages of an integration step), or not."""
        self._state[0] = HELD if hold else FREE

    @property
    def derivatives(self) -> tuple[Array, Array, Array]:
        """What the inputs move, in the last call, as views: J (s, m), the constraint's (k, m), h (1, m)."""
        found = self._results
        return found.task.J, found.constraint.J, found.h[np.newaxis]

    def equation_solver(self) -> tuple[Callable[[float, Array], float], Array]:
        """(solve, J) for loops over many configurations: solve(t, q) does a step, whose matrix is then in the
        view J (s, m). q is (n,), float64, contiguous; nothing is checked."""
        return self._solve, self._results.task.J

    @property
    def partition_sign(self) -> int:
        """Sign of det Ja in the last call (0 without a partition): between two signs Ja is singular."""
        determinant = self._results.report[2] if self._state[1] >= 0 else 0.0
        return int(determinant > 0.0) - int(determinant < 0.0)

    @property
    def partition_overdue(self) -> bool:
        """Whether a call since `hold_partition(True)` kept a partition that is below its threshold."""
        return bool(self._state[0] == OVERDUE)


def _expect(given: object, kind: type, name: str) -> None:
    if not isinstance(given, kind):
        raise InputError(f"controller: expected a {kind.__name__} as {name}, got {given!r}")


def _error_row(task: Task, computed: int, component: int, row: Row) -> int:
    if task.function.comparison is not None:
        return computed + component
    return WRAPPED if row.angular else PLAIN


def _gains(stack: Stack, robot: Robot) -> Array:
    """The block-diagonal gain of a stack."""
    s = len(stack.rows(robot))
    K = np.zeros((s, s))
    first = 0
    for task in stack:
        block = task.gain_matrix(robot)
        K[first : first + len(block), first : first + len(block)] = block
        first += len(block)
    return K
