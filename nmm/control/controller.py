"""Controllers: robot + task + objective + resolver, u = controller(t, q), fast enough for a 1 kHz loop."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike

from nmm.base.arrays import Array, positive, scalar, vector
from nmm.base.errors import InputError
from nmm.base.kernels.compiled import checked_by_caller
from nmm.base.text_format import listed
from nmm.control.functions.function import Row
from nmm.control.functions.objectives.base import Objective
from nmm.control.functions.program import PINOCCHIO, no_preparation
from nmm.control.functions.tasks.task import Stack, Task
from nmm.control.integrators import STEPPING
from nmm.control.limits.collisions import Collisions
from nmm.control.limits.limits import Limits
from nmm.control.period_monitor import PeriodMonitor
from nmm.control.plant import Plant, method_for
from nmm.control.resolvers.base import Resolver
from nmm.control.retreat import Retreat
from nmm.control.sequencing.sequence import Schedule
from nmm.control.steering import Steered, Steering
from nmm.control.step.idle_inputs import idle_inputs, inputs_without_effect
from nmm.control.step.limit_report import LimitReport
from nmm.control.step.safety_filter import SafetyFilter
from nmm.control.step.step import Step
from nmm.control.step.step_layout import SERVO, ControllerArguments, checked
from nmm.control.step.step_solver import FAILED, StepSolver
from nmm.control.step.stepping import ADVANCE, advance, tableau
from nmm.model.robots.robot import Robot

FLOAT64 = np.dtype(np.float64)


class Controller:
    """u = controller(t, q): the inputs with which `robot` does `task` and descends `objective`.

    Parameters
    ----------
    robot : the robot
    task : a `Task`, or several, done together
    resolver : how the redundancy is resolved
    objective : H(q) to minimise; None for the plain solution
    added_task : the added task y = h(q) of the extended Jacobian
    limits : limits of the inputs and of what they move; None for none
    dt : time between two calls, s; needed by limits of position and acceleration, distances, a retreat and a
        resolver whose step is "armijo"; a simulation sets its own
    retreat : what to do when the error stalls; None for a path that is tracked
    steering : the steering law for a platform whose steering does not affect the task (`Steering`): True for
        the default, False for none
    collisions : distances to keep, which need dt; None for none
    kinematics : "pinocchio", or "compiled": nmm's own, equal up to rounding and several times as fast; of
        order 2 they are compiled
    order : 1 for u = controller(t, q); 2 for u_dot = controller(t, q, u): inputs that accelerate
    servo : k of order 2, 1/s, with which u follows what the resolver answers, so that
        e_ddot + (k + K) e_dot + k K e = 0

    Attributes
    ----------
    rows : the task's components
    report : the effect of limits and distances in the last call
    safety_filter : what keeps distances; None without collisions
    period_monitor : its `period` is the measured one where calls are not dt apart; a warning says so once
    steered : the steering law in force; None for none
    solver : what computes the inputs, for code that drives a controller itself (`nmm.extending.StepSolver`)

    Raises
    ------
    InputError : a frame, coordinate or input that the robot lacks; more rows than inputs; an added task with
        a resolver that takes none, or none with one that needs it; a step "armijo" without an objective; at
        order 2 collisions, or a servo above 1 / dt with what needs dt

    Examples
    --------
    >>> robot = nmm.load("unicycle_2r")
    >>> task = nmm.Task(nmm.Position("ee", "xy"), nmm.Circle([2, 2], 3, rate=0.25))
    >>> objective = nmm.Quadratic(nmm.QuadraticTerm("q1", 0.5))
    >>> controller = nmm.Controller(robot, task, nmm.ReducedGradient(), objective)
    >>> dict(zip(robot.u_names, controller(0.0, robot.q({"q1": 0.5, "q2": 0.5})).round(3).tolist()))
    {'v': 5.333, 'omega': 2.506, 'q1': -0.0, 'q2': -0.0}
    """

    #: k of order 2, 1/s, unless given.
    SERVO: ClassVar[float] = SERVO
    #: Which tasks are active; None where all of them always are.
    schedule: Schedule | None = None

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
        order: int = 1,
        servo: float = SERVO,
    ) -> None:
        added = Stack() if added_task is None else Stack.of(added_task)
        arguments = (robot, Stack.of(task), resolver, objective, added)
        self.given = checked(
            ControllerArguments(
                *arguments, limits, dt, retreat, steering, collisions, kinematics, order, servo
            )
        )
        for part in (*self.given.task, *added):
            if part.when:
                raise InputError("is for a SequencedController", where=f"task {part.called(robot)}: when")
        law = Steering() if steering is True else steering
        solver = self.solver = StepSolver(self.given, law.on(robot, self.given.task) if law else None)
        solver.choose_steering(self._steering_unused)
        self._u, self._q_dot, self._shape = solver.step_memory.answer.u, solver.step_memory.q_dot, (robot.n,)
        if order == 2:
            self._u = solver.step_memory.second.u_dot
        self._busy, self._at_hand, self._needs_dt = solver.busy, solver.at_hand, solver.needs_dt
        self._steppers: dict[str, Callable[[float, Array, float], tuple[Array, Array]]] = {}
        self.dt = dt
        self.reset()

    def _steering_unused(self, law: Steered) -> bool:
        """Whether nothing uses the inputs of the law, and the task moves the platform by other inputs."""
        idle = {*idle_inputs(self.solver)}
        platform = {*self.given.robot.groups["platform"]}
        return idle >= {*law.inputs} and not platform <= {*inputs_without_effect(self.solver)}

    @property
    def robot(self) -> Robot:
        """The robot."""
        return self.given.robot

    @property
    def task(self) -> Stack:
        """The tasks that are active."""
        return self.solver.task

    @property
    def resolver(self) -> Resolver:
        """How the redundancy is resolved."""
        return self.given.resolver

    @property
    def limits(self) -> Limits | None:
        """Limits of the inputs and of what they move."""
        return self.given.limits

    @property
    def rows(self) -> tuple[Row, ...]:
        """The components of the active tasks."""
        return self.solver.rows

    @property
    def report(self) -> LimitReport:
        """The effect of limits and distances in the last call."""
        return self.solver.report

    @property
    def safety_filter(self) -> SafetyFilter | None:
        """What keeps distances."""
        return self.solver.safety_filter

    @property
    def period_monitor(self) -> PeriodMonitor:
        """The period of the calls."""
        return self.solver.period_monitor

    @property
    def steered(self) -> Steered | None:
        """The steering law in force; None for none."""
        return self.solver.steered

    @property
    def dt(self) -> float | None:
        """Time between two calls, s; None where it was not given."""
        return self.solver.dt

    @dt.setter
    def dt(self, dt: float | None) -> None:
        self.solver.keep_dt(dt)

    def __reduce__(self) -> tuple[object, ...]:
        """Copies and pickles are built anew, as views of memory and addresses of kernels cannot be copied."""
        return type(self), tuple(self.given._replace(dt=self.dt))

    def with_arguments(self, **arguments: Any) -> Self:
        """A new controller with other arguments (`ControllerArguments`), without what this one remembers."""
        return type(self)(*self.given._replace(**{"dt": self.dt, **arguments}))

    @property
    def order(self) -> int:
        """1 where it gives u, 2 where it gives u_dot."""
        return self.given.order

    def __call__(self, t: float, q: ArrayLike, u: ArrayLike | None = None) -> Array:
        """Inputs u (m,) at time t (s) and configuration q (n,), in the units of `robot.u_units`; at order 2
        their accelerations u_dot (m,), from the inputs u (m,) at t, in those per second; without u from those
        of the call before, after a `reset` from rest.

        With limits each call is a sample, dt after the previous one. At order 2 u_dot is then held for dt,
        and the next u is u + dt u_dot: not a measured one, which lags behind.

        Raises
        ------
        SingularError : the matrix to invert lost rank, or an input is not finite
        InputError : q has the wrong length; t or q is not finite
        """
        # Arrays of any other type or layout are copied, as the step would be compiled anew for them.
        if type(q) is not np.ndarray or q.dtype != FLOAT64 or q.shape != self._shape or not q.flags.carray:
            q = self._copied(q)
        # Read and set without a call between, where threads could switch: a lock would take 6 % of a step.
        busy = self._busy
        if busy[0]:
            self.solver.begin()
        busy[0] = True
        try:
            t, solver = float(t), self.solver
            if self._needs_dt:
                monitor = solver.period_monitor
                called = monitor.called
                if t - called[()] > monitor.latest:
                    monitor.late(t)
                called[()] = t
                if solver.dt is None:
                    solver.expect_dt()
            if u is not None:
                self._move(u)
            if self._at_hand is None:
                solver.take_sample(t, q)
            else:  # `take_sample` written out: some calls and lookups fewer save a tenth of a step
                prepare, step, integers, floats = self._at_hand
                prepare(t, q)
                if step(t, q, integers, floats) >= FAILED:
                    raise solver.failure(t, q)
            return self._u.copy()
        finally:
            busy[0] = False

    def stop(self, t: float, q: ArrayLike, u: ArrayLike | None = None) -> Array:
        """The inputs of a call that brings the robot to rest instead of doing its task: those nearest to 0
        that limits and distances allow; call it every dt until they are 0. At order 2 it is u_dot.

        Each input falls as fast as its limit of acceleration lets it, all by the same share where distances
        would else be lost. Beyond a limit the robot stays, and returns only when called again. It moves on
        where something with a path comes towards it.

        Parameters
        ----------
        t, q, u : as of a call; the task may have no value there

        Raises
        ------
        InputError : q has the wrong length; t or q is not finite; limits need dt

        Examples
        --------
        >>> robot = nmm.load("unicycle_2r")
        >>> task = nmm.Task(nmm.Position("ee", "xy"), [3.0, 1.0])
        >>> limits = nmm.Limits({"v": 0.5, "omega": 1.0}, acceleration=5.0)
        >>> controller = nmm.Controller(robot, task, nmm.ProjectedGradient(), limits=limits, dt=0.02)
        >>> q = nmm.simulate(controller, {"q2": 0.5}, 0.5, 0.02).q[-1]
        >>> [round(float(controller.stop(0.5, q)[0]), 3) for _ in range(6)]
        [0.4, 0.3, 0.2, 0.1, 0.0, 0.0]
        """
        solver, q = self.solver, self.robot.q(q)
        with solver.exclusive():
            if u is not None:
                self._move(u)
            solver.take_stop(scalar(t, "t"), q)
            solver.period_monitor.called[()] = t
            return (solver.step_memory.second.u_dot if solver.second else solver.step_memory.answer.u).copy()

    def _move(self, u: ArrayLike) -> None:
        """The robot moves with the inputs u (m,)."""
        before = self.solver.before
        if not self.solver.second:
            raise InputError(where="u", expected="none at order 1, whose answer it is", got=u)
        if type(u) is not np.ndarray or u.dtype != FLOAT64 or u.shape != before.shape:
            u = vector(u, self.robot.n_u, "u")
        before[:] = u

    def step(
        self, t: float, q: ArrayLike, dt: float, method: str = "rk4", *, plant: Plant | None = None
    ) -> tuple[Array, Array]:
        """One sample of the closed loop: q (n,) at t + dt, and the inputs u (m,) at t; of "zoh_midpoint"
        those at t + dt/2, q + dt/2 S u, which are to be held over dt. At order 2 the next sample is at the
        inputs that u_dot leads to.

        It is one compiled call unless it involves users' Python functions, distances, a retreat or a step by
        Armijo's rule, if the kinematics are compiled, too, or the method has one stage ("euler", "zoh").

        Parameters
        ----------
        dt : s; also becomes the controller's dt where it needs one
        method : "rk4", "midpoint", "euler", "zoh" or "zoh_midpoint"
        plant : a robot that does not do as it is told (`Disturbances.plant`), with "zoh"; None for the ideal

        Raises
        ------
        SingularError, InputError : as a call; a method that does not go with limits at order 2, or a plant;
            "zoh_midpoint" with distances, which the sample's inputs keep
        """
        if type(q) is not np.ndarray or q.dtype != FLOAT64 or q.shape != self._shape or not q.flags.carray:
            q = self._copied(q)
        if not 0.0 < dt < math.inf:
            positive(dt, "dt")
        if plant is not None:
            return plant.step(self, float(t), q, dt, method)
        if self.solver.samples and dt != self.solver.dt:
            self.dt = dt
        if method not in self._steppers:
            self._steppers[method] = self._stepper(method)
        return self._steppers[method](float(t), q, dt)

    def _stepper(self, method: str) -> Callable[[float, Array, float], tuple[Array, Array]]:
        solver = self.solver
        plain = method_for((self,), method)
        if plain.tolerance:
            raise InputError(where="method", expected=listed(STEPPING, "or"), got=method)
        if method == "zoh_midpoint" and self.safety_filter is not None:
            raise InputError(
                "a step with distances holds the inputs that keep them, the sample's",
                where="method",
                expected="zoh",
                got=method,
            )
        butcher, prepare, ideal = tableau(plain), solver.program.prepare, Plant(plain).under(self)
        stages = butcher is None or len(butcher.weights) > 1
        # What Python prepares is valid at (t, q) only, but methods with stages evaluate elsewhere, too.
        if butcher is None or (stages and prepare is not no_preparation) or not solver.compiles_steps:

            def from_python(t: float, q: Array, dt: float) -> tuple[Array, Array]:
                answer, q_dot = self(t, q), self._q_dot.copy()
                u = solver.before.copy() if solver.second else answer
                left, held = solver.sample.snapshot(), u
                try:
                    held = ideal.inputs(solver.inputs_at, t, q, q_dot, u, dt)
                    return ideal.advance(self.velocity, t, q, q_dot, held, dt), held
                finally:
                    solver.sample.end_stages(left)
                    if held is not u:
                        solver.count_from(held)

            return from_python
        run, blocks = checked_by_caller(advance, ADVANCE), solver.blocks
        n, m = self.robot.n, self.robot.n_u

        def compiled(t: float, q: Array, dt: float) -> tuple[Array, Array]:
            with solver.exclusive():
                prepare(t, q)
                q_next, u = np.empty(n), np.empty(m)
                if run(t, dt, q, *blocks, butcher, q_next, u) >= FAILED:
                    raise solver.failure(t, q)
            return q_next, u

        return compiled

    def evaluate(self, t: float, q: ArrayLike, u: ArrayLike | None = None) -> Step:
        """All quantities at (t, q), at order 2 with the inputs u (m,), or those of the last sample; a
        singular matrix is reported in `status`, not raised.

        The controller's state, what the resolver remembers included, is left as it was.
        """
        solver = self.solver
        solver.expect_dt()
        q = self._copied(q)
        with solver.exclusive(), solver.sample.preserve_state():
            if u is not None:
                self._move(u)
            solver.solve_whole(float(t), q)
            return solver.last(t, q)

    def velocity(self, t: float, q: ArrayLike) -> Array:
        """q_dot = S(q) u (n,) of the closed loop at (t, q); raises as a call does.

        At the stages of a sample the last call's decisions hold: bounds, the step size, a retreat, and at
        order 2 the inputs.
        """
        solver, busy = self.solver, self._busy
        if self._needs_dt:
            solver.expect_dt()
        if type(q) is not np.ndarray or q.dtype != FLOAT64 or q.shape != self._shape or not q.flags.carray:
            q = self._copied(q)
        if busy[0]:  # as in a call
            solver.begin()
        busy[0] = True
        try:
            solver.at_stage(float(t), q)
        finally:
            busy[0] = False
        return self._q_dot.copy()

    def last(self, t: float, q: Array) -> Step:
        """The quantities of the call just made at (t, q), as copies."""
        return self.solver.last(t, q)

    def without_limits(self) -> AbstractContextManager[None]:
        """`with controller.without_limits():` answers as without limits; the state is then restored."""
        return self.solver.without_limits()

    def reset(self) -> None:
        """Forget what the resolver remembers and the previous inputs: the next call starts from rest."""
        self.solver.sample.reset()

    def switch(self) -> Controller:
        """The controller for the tasks that are now active: this one, as its tasks always are."""
        return self

    def _copied(self, q: ArrayLike | None) -> Array:
        if q is None:
            raise InputError(where="q", expected=f"{self.robot.n} numbers", got=None)
        return self.robot.q(q)
