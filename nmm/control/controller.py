"""The controller: robot + task + objective + resolver, u = controller(t, q), fit for a 1 kHz loop."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager

import numpy as np
from numpy.typing import ArrayLike

from nmm.arrays import Array, positive, scalar
from nmm.collisions.setting import Setting
from nmm.control.bounds import OFF, SAMPLE, STAGE
from nmm.control.collisions import Collisions
from nmm.control.equations import ANSWER, STEP, drive, finish, resolve, told
from nmm.control.equations import step as compiled_step
from nmm.control.failure import reason
from nmm.control.guard import Guard
from nmm.control.idle_inputs import idle_inputs, inputs_without_effect
from nmm.control.integrators import integrator
from nmm.control.layout import lay_out
from nmm.control.limit_report import LimitReport
from nmm.control.limits import Limits
from nmm.control.pace import Pace
from nmm.control.retreat import Backing, Retreat
from nmm.control.sample import SampleState
from nmm.control.steering import Steered, Steering
from nmm.control.step import Step
from nmm.control.step_size import StepSize
from nmm.control.stepping import Stepper, tableau, write_errors
from nmm.errors import InputError, RunError, SingularError, expect_known
from nmm.functions.function import Row
from nmm.functions.objectives.base import Objective
from nmm.functions.program import COMPILED, PINOCCHIO, nothing
from nmm.functions.tasks.task import Stack, Task
from nmm.kernels.compiled import checked_by_caller
from nmm.kernels.memory import Blocks
from nmm.resolvers.answer import Status, added_residual
from nmm.resolvers.base import Resolver
from nmm.resolvers.limited import instead
from nmm.resolvers.state import State
from nmm.robots.robot import Robot

FLOAT64 = np.dtype(np.float64)
_FAILED = float(Status.SINGULAR_J)
#: Looks of one compiled call, which nothing interrupts.
AT_ONCE = 5000


class Controller:
    """u = controller(t, q): the inputs with which `robot` does `task` and descends `objective`.

    Parameters
    ----------
    robot : the robot
    task : a `Task`, or several, done together
    resolver : how the redundancy is resolved
    objective : H(q) to minimise; None for the plain solution
    added_task : the added task y = h(q) of the extended Jacobian
    limits : what the inputs are kept within; None for none
    dt : time between two calls, s, which limits of position and acceleration need, a retreat, and a resolver
        whose step is "armijo"; a simulation sets its own
    retreat : what to do when the error stalls; None for a path that is tracked
    steering : the law for the steering of a platform that the task does not feel (`Steering`): True for the
        usual one, False for none
    collisions : what the robot keeps off; None for nothing. It needs dt, too
    kinematics : "pinocchio", or "compiled": nmm's own, to the last digits the same and a multiple as fast

    Attributes
    ----------
    setting : the shapes whose distances are kept; None without collisions
    guard : what keeps them; None without collisions
    report : what limits and distances did in the last call
    before : (m,) the inputs of the call before, from which accelerations count; a call changes it
    steered : the law in force for steering that the task does not feel; None where there is none
    step_size : what chooses α at each sample; None where it is constant
    sample : what the last call leaves for the stages of its sample and for the next call
    pace : the period of the calls, where that is not dt (`pace.period`); a warning says so once

    Raises
    ------
    InputError : a frame, coordinate or input that the robot lacks; more rows than inputs; an
        added task with a resolver that takes none, or none with one that does; a step size to be chosen
        where there is no objective

    Examples
    --------
    >>> robot = nmm.load("unicycle_2r")
    >>> task = nmm.Task(nmm.Position("ee", "xy"), nmm.Circle([2, 2], 3, rate=0.25))
    >>> controller = nmm.Controller(robot, task, nmm.ReducedGradient(), nmm.Quadratic(nmm.Square("q1", 0.5)))
    >>> dict(zip(robot.u_names, controller(0.0, robot.q({"q1": 0.5, "q2": 0.5})).round(3).tolist()))
    {'v': 5.333, 'omega': 2.506, 'q1': -0.0, 'q2': -0.0}
    """

    report: LimitReport

    def __init__(
        self,
        robot: Robot,
        task: Task | Stack | Sequence[Task],
        resolver: Resolver,
        objective: Objective | None = None,
        added_task: Task | Stack | Sequence[Task] | None = None,
        limits: Limits | None = None,
        dt: float | None = None,
        retreat: Retreat | None = None,
        steering: Steering | bool = True,
        collisions: Collisions | None = None,
        kinematics: str = PINOCCHIO,
    ) -> None:
        _expect(robot, Robot, "robot")
        _expect(resolver, Resolver, "resolver")
        if objective is not None:
            _expect(objective, Objective, "objective")
        if retreat is not None:
            _expect(retreat, Retreat, "retreat")
        if limits is not None:
            _expect(limits, Limits, "limits")
        if collisions is not None:
            _expect(collisions, Collisions, "collisions")
        self._busy = False
        self.robot = robot
        self.limits = limits
        self.collisions = collisions
        expect_known("kinematics", kinematics, (PINOCCHIO, COMPILED), "controller")
        self.kinematics = kinematics
        self.retreat = retreat
        self.task = Stack.of(task)
        self.resolver = resolver
        self.objective = objective
        self.added_task = Stack() if added_task is None else Stack.of(added_task)
        if self.added_task.tasks and not resolver.takes_added_task:
            raise InputError(f"added_task: resolver {resolver.name} takes none, ej does")
        for one in (*self.task, *self.added_task):
            if one.when:
                raise InputError(
                    f"task {one.called(robot)}: when: a SequencedController takes tasks that come and go"
                )
        if not isinstance(steering, bool):
            _expect(steering, Steering, "steering")
        self.steering = steering
        law = Steering() if steering is True else steering
        steered: Steered | None = law.on(robot, self.task) if law else None
        self.rows: tuple[Row, ...] = self.task.rows(robot)
        self.setting: Setting | None = None if collisions is None else collisions.on(robot)
        laid = lay_out(
            robot, self.task, self.added_task, resolver, objective, limits, steered, collisions, kinematics
        )
        self._program, self._step, self._dimensions = laid.program, laid.step, laid.dimensions
        self.state: State = laid.state
        self.kept, steered = laid.kept, laid.steered
        self._u = self._step.answer.u
        self.report = LimitReport(robot, self.kept, self.setting, self._step, self._program)
        self._shape = (robot.n,)
        self.guard: Guard | None = (
            None if self.setting is None else Guard(self.setting, self._step, self._program, self._answerer())
        )
        self._solve = self._solver()
        self.before = self._step.problem.before
        if limits is None and collisions is None:
            self._step.limits.mode[()] = OFF
        self.backing = None if retreat is None else retreat.on(robot, self.rows)
        self.step_size: StepSize | None = None
        self._needs_dt = (
            self.backing is not None
            or self.guard is not None
            or resolver.step != "constant"
            or (limits is not None and self.kept.needs_dt)
        )
        self.pace = Pace()
        self.dt = dt
        self.steered: Steered | None = None
        if steered is not None and self._unfelt(steered.inputs):
            self.steered = steered
        self._step.steering.on[()] = int(self.steered is not None)
        if resolver.step != "constant":
            descended = [(weight, function, 0) for weight, function in laid.terms]
            if descended and self.steered is not None:
                spring = float(self._step.steering.spring)
                descended.append((spring, self.steered.pursuit, len(self.steered.inputs)))
            self.step_size = StepSize(robot, resolver, descended, self._step, self._program.blocks)
        self._steppers: dict[str, Callable[[float, Array, float], tuple[Array, Array]]] = {}
        self.sample = SampleState(
            self._step.problem,
            self._step.limits,
            self.step_size,
            self.backing,
            (*self._step.near, self._step.clearance.least),
        )
        self.reset()

    def _unfelt(self, inputs: Sequence[str]) -> bool:
        """Whether nothing moves these inputs, and the task moves the platform by others."""
        idle = {*idle_inputs(self)}
        platform = {*self.robot.groups["platform"]}
        return idle >= {*inputs} and not platform <= {*inputs_without_effect(self)}

    @property
    def dt(self) -> float | None:
        """Time between two calls, s; None where it was not said."""
        dt = float(self._step.problem.dt)
        return None if math.isnan(dt) else dt

    @dt.setter
    def dt(self, dt: float | None) -> None:
        self._step.problem.dt[()] = math.nan if dt is None else positive(dt, "dt")
        self.pace.keep(dt)
        self._step.limits.elapsed[()] = self._step.problem.dt

    @property
    def samples(self) -> bool:
        """Whether something is decided at its calls and kept for the stages after them."""
        return self.limits is not None or self._needs_dt

    def __call__(self, t: float, q: ArrayLike) -> Array:
        """Inputs u (m,) at time t (s) and configuration q (n,), in the units of `robot.u_units`.

        With limits each call is a sample: dt after the one before.

        Raises
        ------
        SingularError : the matrix to invert lost rank, or an input is not finite
        InputError : q has the wrong length; t is, or q holds, a number that is not finite
        """
        # Another kind of array would be compiled for anew, so anything but the plain kind is copied.
        if type(q) is not np.ndarray or q.dtype != FLOAT64 or q.shape != self._shape or not q.flags.carray:
            q = self._copied(q)
        # Read and set with no call in between, where threads change: no lock, which takes 6 % of a step.
        if self._busy:
            self._refuse()
        self._busy = True
        try:
            if self._needs_dt:
                t, pace = float(t), self.pace
                if t - pace.called > pace.latest:
                    pace.late(t)
                pace.called = t
                self._sample(t, q)
            elif self._at_hand is None:
                if self._solve(float(t), q) >= _FAILED:
                    self._fail(t, q)
            else:  # `_solve` written out: one call and some lookups less are a tenth of a step
                prepare, step, integers, floats = self._at_hand
                t = float(t)
                prepare(t, q)
                if step(t, q, integers, floats) >= _FAILED:
                    self._fail(t, q)
            return self._u.copy()
        finally:
            self._busy = False

    def step(self, t: float, q: ArrayLike, dt: float, method: str = "rk4") -> tuple[Array, Array]:
        """One sample of the closed loop: q (n,) at t + dt, and the inputs u (m,) at t.

        Without users' Python functions, distances, a retreat and a step by Armijo's rule it is one compiled
        call, whose kinematics are compiled, too, or whose method has one stage ("euler", "zoh").

        Parameters
        ----------
        dt : s; the controller's, from now on, where it needs one
        method : "rk4", "midpoint", "euler" or "zoh"

        Raises
        ------
        SingularError, InputError : as a call
        """
        if type(q) is not np.ndarray or q.dtype != FLOAT64 or q.shape != self._shape or not q.flags.carray:
            q = self._copied(q)
        if not 0.0 < dt < math.inf:
            positive(dt, "dt")
        if self.samples and dt != self.dt:
            self.dt = dt
        if method not in self._steppers:
            self._steppers[method] = self._stepper(method)
        return self._steppers[method](float(t), q, dt)

    def _stepper(self, method: str) -> Callable[[float, Array, float], tuple[Array, Array]]:
        integrates = integrator(method, self.robot, 1e-9)
        if integrates.tolerance:
            raise InputError("method: expected rk4, midpoint, euler or zoh for one step, got adaptive")
        found, prepare = tableau(integrates), self._program.prepare
        # What is prepared in Python holds at (t, q); methods with stages ask elsewhere, too.
        at_stages = found is not None and len(found.weights) > 1 and prepare is not nothing
        if found is None or at_stages or not self.compilable:

            def from_python(t: float, q: Array, dt: float) -> tuple[Array, Array]:
                u, q_dot = self(t, q), self._step.q_dot.copy()
                return integrates.advance(self.velocity, t, q, q_dot, u, dt), u

            return from_python
        advance = Stepper(self._program.blocks, found, self.robot.n, self.robot.n_u)

        def compiled(t: float, q: Array, dt: float) -> tuple[Array, Array]:
            self._begin()
            try:
                prepare(t, q)
                status, ahead, u = advance(t, q, dt)
                if status >= _FAILED:
                    self._fail(t, q)
            finally:
                self._busy = False
            return ahead, u

        return compiled

    @property
    def blocks(self) -> Blocks:
        """Its memory, where compiled code reads what the last call left."""
        return self._program.blocks

    @property
    def costs(self) -> tuple[str, ...]:
        """What makes its users' Python functions dear, a sentence each."""
        return self._program.costs

    @property
    def compilable(self) -> bool:
        """Whether nothing but its kinematics needs Python, so that `compiled` makes it one compiled call."""
        return self.flies and not (self.backing or self.step_size)

    @property
    def flies(self) -> bool:
        """Whether samples of a run can be compiled: as `compilable`, or with an α that compiled code chooses
        between, or a retreat, whose own samples are not."""
        whole = type(self.resolver).finish is Resolver.finish and not self._program.calls_python
        return whole and not self.guard and (self.step_size is None or self.step_size.compiled)

    def compiled_kinematics(self) -> AbstractContextManager[None]:
        """`with controller.compiled_kinematics():` steps compute them, whatever `kinematics` says."""
        return self._program.compiled_kinematics()

    @contextmanager
    def compiled(self) -> Iterator[Blocks]:
        """`with controller.compiled() as blocks:` for compiled code that makes the steps: with compiled
        kinematics, and no other thread may call."""
        self._begin()
        try:
            with self.compiled_kinematics():
                yield self._program.blocks
        finally:
            self._busy = False

    def kinematics_off(self, configurations: Array) -> float:
        """The most by which Pinocchio's kinematics and the compiled ones differ at q (N, n), m and rad."""
        return self._program.kinematics_off(configurations)

    def _begin(self) -> None:
        if self._busy:
            self._refuse()
        self._busy = True

    def _refuse(self) -> None:
        raise RunError(
            f"controller: called in thread {threading.current_thread().name} while a call is under way; a "
            "controller does one thing at a time: give each thread a copy of its own (copy.copy(controller))"
        )

    def _expect_dt(self) -> None:
        if self._needs_dt and self.dt is None:
            raise InputError(
                "dt: expected a number, which limits, distances, a retreat and a step by Armijo's rule need, "
                "got none"
            )

    def _sample(self, t: float, q: Array) -> None:
        """A call that lasts dt: the resolver's inputs, or a retreat's where the error stalls."""
        self._expect_dt()
        earlier = None if self.guard is None else self.before.copy()
        status = self._solve_whole(t, q)
        if self.backing is not None:
            self.backing.watch(self._step.task.error, float(self._step.problem.dt))
        if self.backing is not None and self.backing.now:
            self._back_off(self.backing, q)
            self.before[:] = self._u
        elif status >= _FAILED:
            self._fail(t, q)
        if self.guard is not None and earlier is not None:
            self.guard.certify(t, q, earlier)

    def _answerer(self) -> Callable[[Array], float]:
        """again(q) -> status: the inputs for the equations that are there, once more."""
        once, blocks = checked_by_caller(resolve, ANSWER), self._program.blocks
        resolver, finishes = self.resolver, type(self.resolver).finish is not Resolver.finish

        def again(q: Array) -> float:
            once(q, *blocks)
            if finishes:
                resolver.finish(self._step.problem, self._dimensions, self._step.answer)
                finish(q, *blocks)
            if self.backing is not None and self.backing.now:
                self._back_off(self.backing, q)
                self.before[:] = self._u
            return float(self._step.answer.status[()])

        return again

    def _solve_whole(self, t: float, q: Array) -> float:
        """What a sample's inputs are without a retreat, its α chosen; returns the status."""
        if self.step_size is None:
            return self._solve(t, q)
        self.step_size.share = 1.0
        self._solve(t, q)
        self.step_size.shorten(t, q)
        return float(self._step.answer.status[()])

    def _back_off(self, backing: Backing, q: Array) -> None:
        """The retreat's inputs in place of the resolver's."""
        found, G = self._step, self._program.buffers.G
        instead(found.problem, backing.inputs(q, G), found.answer)
        told(found.task, found.problem, found.answer)
        drive(found.answer.u, G, found.arm, found.q_dot)

    def _copied(self, q: ArrayLike | None) -> Array:
        if q is None:
            raise InputError(f"q: expected {self.robot.n} numbers, got None")
        return self.robot.q(q)

    def __reduce__(self) -> tuple[object, ...]:
        """Copies and pickles are built anew: views of memory and addresses of kernels do not travel."""
        given = (self.robot, self.task, self.resolver, self.objective, self.added_task, self.limits, self.dt)
        return type(self), (*given, self.retreat, self.steering, self.collisions, self.kinematics)

    def _solver(self) -> Callable[[float, Array], float]:
        """solve(t, q) -> status, with everything it needs at hand."""
        program, found, resolver = self._program, self._step, self.resolver
        step = checked_by_caller(compiled_step.compiled, STEP)
        dimensions, (integers, floats) = self._dimensions, program.blocks
        prepare = program.prepare if self.guard is None else self._measured(self.guard)

        def solve(t: float, q: Array) -> float:
            if prepare is not nothing:
                prepare(t, q)
            return step(t, q, integers, floats)

        self.linearise: Callable[[float, Array], float] = solve

        def solve_and_finish(t: float, q: Array) -> float:
            solve(t, q)
            resolver.finish(found.problem, dimensions, found.answer)
            finish(q, integers, floats)
            return float(found.answer.status[()])

        whole = type(resolver).finish is Resolver.finish
        self._at_hand = (prepare, step, integers, floats) if whole else None
        return solve if whole else solve_and_finish

    def _measured(self, guard: Guard) -> Callable[[float, Array], None]:
        """`prepare` of the program, and distances at samples."""
        prepare, mode = self._program.prepare, self._step.limits.mode

        def prepared(t: float, q: Array) -> None:
            prepare(t, q)
            if mode == SAMPLE:
                guard.look(t, q)

        return prepared

    def _fail(self, t: float, q: Array) -> None:
        raise self.failure(t, q)

    @property
    def failed(self) -> bool:
        """Whether the last call left no inputs."""
        return bool(self._step.answer.status >= _FAILED)

    def failure(self, t: float, q: Array) -> SingularError:
        """Why the last call, at (t, q), left no inputs; `InputError` for a t or q that is not finite."""
        self.robot.q(q)
        scalar(t, "t")
        apart = self.robot.platform.problem(q[: self.robot.platform.n_p])
        problem = self._step.problem
        status = Status(int(self._step.answer.status[()]))
        also = "" if apart is None else f"; {apart}"
        why = reason(status, problem, self.robot, self.task, q)
        return SingularError(f"at t = {t:g} s: {status.meaning}{why}{also}")

    def evaluate(self, t: float, q: ArrayLike) -> Step:
        """All quantities at (t, q); a singular matrix is reported in `status`, not raised.

        It is a look and no sample: what the last call left for its stages and the next one stays (`sample`).
        Like a call, it may change what the resolver remembers (see `reset`).
        """
        self._expect_dt()
        q = self._copied(q)
        self._begin()
        try:
            with self.sample.aside():
                self._solve_whole(float(t), q)
                return self.last(t, q)
        finally:
            self._busy = False

    def errors(self, times: Array, configurations: Array) -> tuple[Array, Array]:
        """The task's errors e and ∂g/∂t + K e (without bounds of feedback) at times (N,) and q (N, n).

        They are looks, as `evaluate`'s, at less cost. Not a number where one of a user's functions raises.

        Returns
        -------
        (N, s) each, in the units of the rows, and those per second
        """
        self._expect_dt()
        task = self._step.task
        error, rate = (np.full((len(times), len(self.rows)), np.nan) for _ in range(2))
        if not self._program.calls_python:
            at = np.array(times, dtype=np.float64), np.array(configurations, dtype=np.float64, order="C")
            with self.sample.aside(), self.compiled() as blocks:
                for first in range(0, len(times), AT_ONCE):
                    some = slice(first, first + AT_ONCE)
                    write_errors(*blocks, *(one[some] for one in (*at, error, rate)))
            return error, rate
        self._begin()
        try:
            with self.sample.aside():
                for k, q in enumerate(np.ascontiguousarray(configurations, dtype=np.float64)):
                    try:
                        self._solve(float(times[k]), q)
                    except Exception:  # a user's function may raise anything, where it was not made for
                        continue
                    error[k], rate[k] = task.error, task.full
        finally:
            self._busy = False
        return error, rate

    def last(self, t: float, q: Array) -> Step:
        """The quantities of the call just made at (t, q), as copies."""
        found = self._step
        task, problem, answer = found.task, found.problem, found.answer
        return Step(
            t=float(t),
            q=q.copy(),
            r=task.r.copy(),
            r_d=task.r_d.copy(),
            error=task.error.copy(),
            rate=task.full.copy(),
            J=problem.J.copy(),
            objective=float(found.H[()]),
            h=problem.h.copy(),
            u=answer.u.copy(),
            q_dot=found.q_dot.copy(),
            status=Status(int(answer.status[()])),
            scale=answer.scale.copy(),
            residual=float(answer.residual[()]),
            measure=float(answer.measure[()]),
            excess=float(answer.excess[()]),
            retreats=0 if self.backing is None else self.backing.count,
            step_size=1.0 if self.step_size is None else self.step_size.share,
            partition=self.state.partition(len(self.rows)),
            added_residual=added_residual(problem, answer.u),
            side=int(answer.side[()]),
        )

    def velocity(self, t: float, q: ArrayLike) -> Array:
        """q_dot = S(q) u (n,) of the closed loop at (t, q); raises as a call does.

        What the last call decided holds at the stages of its sample: bounds, the step size, a retreat.
        """
        if not self.samples:
            self(t, q)
            return self._step.q_dot.copy()
        self._expect_dt()
        q = self._copied(q)
        self._begin()
        mode, before = self._step.limits.mode, self.before.copy()
        usual = int(mode)
        mode[()] = STAGE if usual == SAMPLE else usual
        try:
            failed = self._solve(float(t), q) >= _FAILED
            if self.backing is not None and self.backing.now:
                self._back_off(self.backing, q)
            elif failed:
                self._fail(t, q)
        finally:
            mode[()] = usual
            self.before[:] = before
            self._busy = False
        return self._step.q_dot.copy()

    def without_limits(self) -> AbstractContextManager[None]:
        """`with controller.without_limits():` it answers as if there were none, and remembers no inputs."""
        return self.sample.aside(OFF)

    def reset(self) -> None:
        """Forget what the resolver remembers and the inputs before: the next call decides anew, from rest."""
        self.state.reset()
        self.pace.forget()
        self.before[:] = 0.0
        self._step.problem.active[0] = 0
        if self.guard is not None:
            self.guard.reset()
        if self.backing is not None:
            self.backing.reset()
        if self.step_size is not None:
            self.step_size.share = 1.0

    @property
    def derivatives(self) -> tuple[Array, Array, Array]:
        """What the inputs move, in the last call, as views: J (s, m), the added task's (k, m), h (1, m)."""
        problem = self._step.problem
        return problem.J, problem.added_J, problem.h[np.newaxis]

    def equation_solver(self) -> tuple[Callable[[float, Array], float], Array]:
        """(solve, J) for loops over many configurations: solve(t, q) does a step, whose matrix is then in the
        view J (s, m). q is (n,), float64, contiguous; nothing is checked."""
        return self._solve, self._step.problem.J


def _expect(given: object, kind: type, name: str) -> None:
    if not isinstance(given, kind):
        raise InputError(f"controller: expected a {kind.__name__} as {name}, got {given!r}")
