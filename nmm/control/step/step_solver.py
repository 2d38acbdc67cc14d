"""Computes a controller's inputs: its functions and step in memory, and their calls.

A `Controller` checks what users give; loops, the diagnosis and other packages use its `solver`.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from functools import cached_property
from typing import Any

import numpy as np

from nmm.base.arrays import Array, positive, scalar
from nmm.base.errors import InputError, RunError, SingularError
from nmm.base.kernels.compiled import checked_by_caller
from nmm.base.kernels.record_layout import Blocks
from nmm.control.directions import failure
from nmm.control.functions.function import Row
from nmm.control.functions.program import no_preparation
from nmm.control.limits.bounds import OFF, SAMPLE, STAGE
from nmm.control.period_monitor import PeriodMonitor
from nmm.control.resolvers.answer import Status
from nmm.control.resolvers.base import Resolver, State
from nmm.control.retreat import RetreatState
from nmm.control.steering import Steered
from nmm.control.step.acceleration import (
    AHEAD,
    BEHIND,
    accelerate,
    answer_led,
    evaluate_beside,
    evaluate_sample,
    follow_answer,
    move_beside,
)
from nmm.control.step.equations import (
    ANSWER,
    BOUNDS,
    STEP,
    WATCH,
    finish,
    replace_inputs,
    resolve,
    watch_error,
)
from nmm.control.step.equations import step as compiled_step
from nmm.control.step.limit_report import LimitReport
from nmm.control.step.recorded import OneSample, Recorded
from nmm.control.step.safety_filter import SafetyFilter
from nmm.control.step.sample import SampleState
from nmm.control.step.step import Step
from nmm.control.step.step_layout import ControllerArguments, lay_out
from nmm.control.step.step_size import StepSize
from nmm.control.step.stepping import write_errors
from nmm.model.collisions.scene import Scene

#: From this status on there are no inputs.
FAILED = float(Status.SINGULAR_J)
#: What `Step.more` has.
_WITHOUT_ATTRIBUTE = [name for name in Recorded._fields if name not in Step.__dataclass_fields__]
#: Samples per compiled call, which cannot be interrupted.
AT_ONCE = 5000


class StepSolver:
    """The inputs for one robot, task, objective and resolver, at any (t, q).

    Parameters
    ----------
    given : the controller's arguments
    steered : the steering law that may apply; `choose_steering` decides

    Attributes
    ----------
    tasks_on, added_on : the tasks and the added ones, with their rows on the robot
    rows : the task's components
    dimensions : what a resolver is set up with
    sizes : of a sample in a record: n, m, s, priority levels, values with limits
    limits_on : the limits, resolved for the robot
    scene : the shapes whose distances are kept; None without collisions
    safety_filter : what keeps them; None without collisions
    retreat_state : the state of retreats; None without
    step_size : what chooses α at each sample; None for a constant α
    steered : the steering law in force; None for none
    state : what the resolver remembers
    before (m,) : the previous inputs, from which accelerations count
    sample : all that a sample changes, as one snapshot
    report : the effect of limits and distances in the last call
    period_monitor : the period of the calls
    needs_dt : whether calls are dt apart: some decisions affect the next call
    samples : whether calls make decisions that hold for the stages after them
    busy : one flag, in a list that the controller shares: whether a call is in progress
    """

    def __init__(self, given: ControllerArguments, steered: Steered | None) -> None:
        robot, collisions, retreat, resolver = given.robot, given.collisions, given.retreat, given.resolver
        self.robot, self.task, self.added_task = robot, given.task, given.added_task
        self.resolver, self.objective = resolver, given.objective
        self._whole = type(resolver).finish is Resolver.finish
        self.scene: Scene | None = None if collisions is None else collisions.on(robot)
        kept = np.zeros(0) if self.scene is None else self.scene.keep_nearer(given.task.nearer())
        laid = lay_out(given, steered, kept)
        self.tasks_on, self.added_on = laid.tasks, laid.added
        self.rows: tuple[Row, ...] = self.tasks_on.rows
        self.program, self.step_memory, self.dimensions = laid.program, laid.step, laid.dimensions
        self.state: State = laid.state
        self.limits_on, self._steerable, self._terms = laid.limits_on, laid.steered, laid.terms
        self.steered: Steered | None = None
        self.before = self.step_memory.problem.before
        self.sample = SampleState(self.blocks, self.step_memory)
        self.report = LimitReport(robot, self.limits_on, self.scene, self.step_memory, self.program)
        self.safety_filter: SafetyFilter | None = None
        if self.scene is not None and collisions is not None:
            arguments = self.scene, self.step_memory, self.program, self._again(), collisions.horizon
            self.safety_filter = SafetyFilter(*arguments)
        self.second = given.order == 2
        if given.limits is None and collisions is None:
            self.step_memory.limits.mode[()] = OFF
        self.retreat_state: RetreatState | None = None
        if retreat is not None:
            self.retreat_state = RetreatState(retreat, robot, self.step_memory.retreat)
            self._watch_error = checked_by_caller(watch_error, WATCH)
            self.load_stop()
        self._wanted: Array | None = None
        self.step_size: StepSize | None = None
        self.needs_dt = (
            self.retreat_state is not None
            or self.safety_filter is not None
            or resolver.step != "constant"
            or (given.limits is not None and (self.second or self.limits_on.needs_dt))
        )
        self.samples = given.limits is not None or self.needs_dt or self.program.remembers
        self.period_monitor = PeriodMonitor(self.step_memory.period)
        self.dt: float | None = None
        self.busy = [False]
        limited = 0 if given.limits is None else len(self.limits_on.row_limits)
        self.sizes = robot.n, robot.n_u, len(self.rows), len(self.dimensions.levels), limited
        self._solve_calls()

    def choose_steering(self, unfelt: Callable[[Steered], bool]) -> None:
        """Adopt the law where its inputs do not affect the task; then set up the choice of α, if any."""
        if self._steerable is not None and unfelt(self._steerable):
            self.steered = self._steerable
        self.step_memory.steering.on[()] = int(self.steered is not None)
        if self.resolver.step != "constant":
            descended = [(weight, function, 0) for weight, function in self._terms]
            if descended and self.steered is not None:
                spring = float(self.step_memory.steering.spring)
                descended.append((spring, self.steered.pursuit, len(self.steered.inputs)))
            self.step_size = StepSize(self.robot, self.resolver, descended, self.step_memory, self.blocks)

    def _solve_calls(self) -> None:
        """Define `solve(t, q)` -> status, and `linearise`, which omits the resolver's Python part."""
        code = accelerate if self.second else compiled_step
        step, (integers, floats) = checked_by_caller(code.compiled, STEP), self.blocks
        prepare = self.program.prepare if self.safety_filter is None else self._measured(self.safety_filter)

        def solve(t: float, q: Array) -> float:
            if prepare is not no_preparation:
                prepare(t, q)
            return step(t, q, integers, floats)

        python = self.second and prepare is not no_preparation
        linearise: Callable[[float, Array], float] = self._beside_by_python(prepare) if python else solve

        def solve_and_finish(t: float, q: Array) -> float:
            linearise(t, q)
            return self._finished(q)

        self.linearise: Callable[[float, Array], float] = linearise
        self.solve: Callable[[float, Array], float] = linearise if self._whole else solve_and_finish
        self._plain_call = prepare, step, integers, floats

    def _beside_by_python(self, prepare: Callable[[float, Array], None]) -> Callable[[float, Array], float]:
        """Return `accelerate` with users' Python functions, which are called at each of its three places."""
        beside, blocks = self.step_memory.second.beside, self.blocks

        def solve(t: float, q: Array) -> float:
            prepare(t, q)
            evaluate_sample(t, q, *blocks)
            for side in (BEHIND, AHEAD):
                t_side = t + move_beside(q, side, *blocks)
                prepare(t_side, beside.copy())
                evaluate_beside(t_side, q, side, *blocks)
            return float(answer_led(q, *blocks))

        return solve

    def _finished(self, q: Array) -> float:
        """Run the resolver's Python part, if any, and what a step does after it; return the status."""
        answer = self.step_memory.answer
        if not self._whole:
            self.resolver.finish(self.step_memory.problem, self.dimensions, answer)
            finish(q, *self.blocks)
            if self.second:
                follow_answer(*self.blocks)
        return float(answer.status[()])

    def _measured(self, safety_filter: SafetyFilter) -> Callable[[float, Array], None]:
        """Return the program's `prepare`, followed at samples by the measurement of distances."""
        prepare, mode = self.program.prepare, self.step_memory.limits.mode

        def prepared(t: float, q: Array) -> None:
            prepare(t, q)
            if mode == SAMPLE:
                safety_filter.measure_distances(t, q)

        return prepared

    def _again(self) -> Callable[[Array], float]:
        """Return again(q) -> status, which solves the equations in memory once more."""
        once, blocks = checked_by_caller(resolve, ANSWER), self.blocks

        def again(q: Array) -> float:
            once(q, *blocks)
            if self._wanted is not None:
                self._replace_by(self._wanted)
                return float(Status.RELAXED)
            self._finished(q)
            if self.retreat_state is not None and self.retreat_state.now:
                self._replace_by(self._retreating(self.retreat_state, q))
            return float(self.step_memory.answer.status[()])

        return again

    def take_sample(self, t: float, q: Array) -> None:
        """Compute the inputs of a sample: the resolver's, or a retreat's where the error stalls."""
        self.expect_dt()
        earlier = None if self.safety_filter is None else self.before.copy()
        status = self.solve_whole(t, q)
        if self.retreat_state is not None and self._watch_error(*self.blocks):
            self._replace_by(self._retreating(self.retreat_state, q))
        elif status >= FAILED:
            raise self.failure(t, q)
        if self.safety_filter is not None and earlier is not None:
            self.safety_filter.certify(t, q, earlier)

    def take_nearest(self, t: float, q: Array, wanted: Array) -> None:
        """Compute the inputs of a sample as those within the limits nearest to `wanted` (m,), at order 2 the
        inputs at its end. They depend on neither the resolver nor the task, which may have no value."""
        self.expect_dt()
        earlier, self._wanted = self.before.copy(), wanted
        try:
            self.linearise(t, q)
            self.before[:] = earlier
            self._replace_by(wanted)
            if self.safety_filter is not None:
                self.safety_filter.certify(t, q, earlier)
        finally:
            self._wanted = None

    def take_stop(self, t: float, q: Array) -> None:
        """Compute the inputs nearest to rest; beyond a limit the robot stays and does not return."""
        returns = (
            self.step_memory.limits.recovery,
            self.step_memory.clearance.recovery,
            self.step_memory.clearance.margin,
        )
        usual = [number.copy() for number in returns]
        for number in returns:
            number[()] = 0.0
        try:
            self.take_nearest(t, q, np.zeros(self.robot.n_u))
        finally:
            for number, value in zip(returns, usual, strict=True):
                number[()] = value

    def _replace_by(self, wanted: Array, *, stage: bool = False) -> None:
        """Replace the resolver's inputs by those within the limits nearest to `wanted` (m,), at order 2 the
        inputs at the sample's end."""
        if self.second:  # it follows its answer by this share within a sample
            wanted = self.before + (wanted - self.before) / self.step_memory.second.share
        self._replace_inputs(wanted, *self.blocks)
        if self.second:
            follow_answer(*self.blocks)
        elif not stage:
            self.before[:] = self.step_memory.answer.u

    def load_stop(self) -> None:
        """Load what stops and retreats need, which else takes 25 ms within a control loop."""
        _ = self._replace_inputs

    @cached_property
    def _replace_inputs(self) -> Callable[..., None]:
        replaces: Callable[..., None] = checked_by_caller(replace_inputs, BOUNDS)
        return replaces

    def solve_whole(self, t: float, q: Array) -> float:
        """Compute a sample's inputs, without a retreat, and α; return the status."""
        if self.step_size is None:
            return self.solve(t, q)
        self.step_size.share = 1.0
        self.solve(t, q)
        self.step_size.shorten(t, q)
        return float(self.step_memory.answer.status[()])

    def solve_stage(self, t: float, q: Array) -> None:
        """Compute the inputs of a stage after a sample, whose bounds, step size and retreat hold."""
        mode = self.step_memory.limits.mode
        usual = int(mode)
        mode[()] = STAGE if usual == SAMPLE else usual
        self.program.stands[()] = 1
        try:
            failed = self.solve(t, q) >= FAILED
            if self.retreat_state is not None and self.retreat_state.now:
                self._replace_by(self._retreating(self.retreat_state, q), stage=True)
            elif failed:
                raise self.failure(t, q)
        finally:
            mode[()] = usual
            self.program.stands[()] = 0

    def at_stage(self, t: float, q: Array) -> None:
        """Compute the inputs at (t, q) with what the last sample decided; raises as a call does."""
        if self.samples:
            self.solve_stage(t, q)
        elif self.solve(t, q) >= FAILED:
            raise self.failure(t, q)

    def inputs_at(self, t: float, q: Array) -> Array:
        """The inputs u (m,) of `at_stage`."""
        with self.exclusive():
            self.at_stage(t, q)
            return self.step_memory.answer.u.copy()

    def count_from(self, held: Array) -> None:
        """Count accelerations from the inputs (m,) that are held after the sample."""
        if self.step_memory.limits.mode == SAMPLE:
            self.before[:] = held

    def _retreating(self, retreat_state: RetreatState, q: Array) -> Array:
        return retreat_state.inputs(q, self.program.buffers.G, self.step_memory.problem)

    def begin_run(self) -> None:
        """Begin a run: forget all samples, and restore the first values of numbers that runs replace."""
        self.sample.reset()
        for renewal in self.program.renewals:
            renewal.begin()

    @property
    def blocks(self) -> Blocks:
        """The memory of functions and step, for compiled code."""
        return self.program.blocks

    @property
    def at_hand(self) -> tuple[Any, ...] | None:
        """What `take_sample` calls, with its memory, where that is all it does; else None."""
        more = self.safety_filter or self.retreat_state or self.step_size or not self._whole
        more = more or (self.second and self.program.calls_python)
        return None if more else self._plain_call

    @property
    def compiles_steps(self) -> bool:
        """Whether only the kinematics need Python, so that a step in `compiled` is one compiled call."""
        return self.compiles_runs and not (self.retreat_state or self.step_size)

    @property
    def compiles_runs(self) -> bool:
        """Whether a run's samples can be compiled: as `compiles_steps`, but also with an α that compiled code
        chooses, or with a retreat, whose samples are made in Python."""
        whole = self._whole and not self.program.calls_python
        return whole and not self.safety_filter and (self.step_size is None or self.step_size.compiled)

    @contextmanager
    def compiled(self) -> Iterator[Blocks]:
        """`with solver.compiled() as blocks:` compiled kinematics for compiled steps; no other thread may
        call.
        """
        with self.exclusive(), self.program.compiled_kinematics():
            yield self.blocks

    @contextmanager
    def exclusive(self) -> Iterator[None]:
        """`with solver.exclusive():` other threads that call meanwhile get a `RunError`."""
        self.begin()
        try:
            yield
        finally:
            self.busy[0] = False

    def begin(self) -> None:
        """Begin a call; `RunError` where one is in progress."""
        if self.busy[0]:
            raise RunError(
                f"called in thread {threading.current_thread().name} while a call is under way; a controller "
                "does one thing at a time: give each thread a copy of its own (copy.copy(controller))",
                where="controller",
            )
        self.busy[0] = True

    def keep_dt(self, dt: float | None) -> None:
        """Set the time between two calls, s."""
        self.dt = None if dt is None else positive(dt, "dt")
        if self.second and self.needs_dt and dt is not None and dt * self.step_memory.second.servo > 1.0:
            raise InputError(
                where="servo",
                expected=f"at most 1 / dt, {1 / dt:g} 1/s",
                got=float(self.step_memory.second.servo),
            )
        self.step_memory.problem.dt[()] = math.nan if self.dt is None else self.dt
        self.period_monitor.keep(dt)

    def expect_dt(self) -> None:
        """`InputError` where dt is needed but was not given."""
        if self.needs_dt and self.dt is None:
            raise InputError(
                where="dt",
                expected="a number, which limits, distances, a retreat and a step by Armijo's rule need",
                got=None,
            )

    @property
    def failed(self) -> bool:
        """Whether the last call gave no inputs."""
        return bool(self.step_memory.answer.status >= FAILED)

    def failure(self, t: float, q: Array) -> SingularError:
        """Why the last call, at (t, q), gave no inputs; `InputError` for a t or q that is not finite."""
        self.robot.q(q)
        scalar(t, "t")
        status = Status(int(self.step_memory.answer.status[()]))
        details = (
            status,
            self.step_memory.problem,
            self.robot,
            self.task,
            float(t),
            q,
            self.limits_on.functions,
        )
        return SingularError(failure(*details))

    def errors(self, times: Array, configurations: Array) -> tuple[Array, Array]:
        """The task's errors e and ∂g/∂t + K e (without bounds of feedback) at times (N,) and q (N, n).

        The state is restored, as by `Controller.evaluate`, at lower cost.

        Returns
        -------
        (N, s) each, in the units of the rows, and those per second; NaN where a user's function raises
        """
        self.expect_dt()
        task = self.step_memory.task
        error, rate = (np.full((len(times), len(self.rows)), np.nan) for _ in range(2))
        if not self.program.calls_python:
            at = np.array(times, dtype=np.float64), np.array(configurations, dtype=np.float64, order="C")
            with self.sample.preserve_state(), self.compiled() as blocks:
                for first in range(0, len(times), AT_ONCE):
                    some = slice(first, first + AT_ONCE)
                    write_errors(*blocks, *(array[some] for array in (*at, error, rate)))
            return error, rate
        with self.exclusive(), self.sample.preserve_state():
            for k, q in enumerate(np.ascontiguousarray(configurations, dtype=np.float64)):
                try:
                    self.solve(float(times[k]), q)
                except Exception:  # a user's function may raise anything where it is not defined
                    continue
                error[k], rate[k] = task.error, task.full
        return error, rate

    @property
    def derivatives(self) -> tuple[Array, Array, Array]:
        """Derivatives by the inputs in the last call, views: J (s, m), the added task's (k, m), h (1, m)."""
        problem = self.step_memory.problem
        return problem.J, problem.added_J, problem.h[np.newaxis]

    def without_limits(self) -> AbstractContextManager[None]:
        """`with solver.without_limits():` answers as without limits; the state is then restored."""
        return self.sample.preserve_state(OFF)

    def last(self, t: float, q: Array) -> Step:
        """The quantities of the call just made at (t, q), as copies."""
        answer, share = self.step_memory.answer, 1.0 if self.step_size is None else self.step_size.share
        noted = self._one_sample.noted(q, share)
        noted["partition"] = self.state.partition(len(self.rows))  # states of users are Python's
        more = {name: noted.pop(name) for name in _WITHOUT_ATTRIBUTE}
        others: dict[str, Any] = {
            "t": float(t),
            "h": self.step_memory.problem.h.copy(),
            "status": Status(int(answer.status[()])),
            "measure": float(answer.measure[()]),
            "retreats": 0 if self.retreat_state is None else self.retreat_state.count,
        }
        return Step(**(others | noted), robot=self.robot, more=more)

    @cached_property
    def _one_sample(self) -> OneSample:
        return OneSample(self.blocks, *self.sizes)
