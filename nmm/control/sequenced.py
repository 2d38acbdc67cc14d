"""Sequenced tasks: a controller for each set of active tasks, and the transition between them."""

from __future__ import annotations

from collections.abc import Sequence as Several
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from nmm.base.arrays import Array, positive
from nmm.base.errors import InputError, RunError
from nmm.base.text_format import listed
from nmm.control.controller import Controller
from nmm.control.functions.objectives.base import Objective
from nmm.control.functions.program import PINOCCHIO
from nmm.control.functions.references import Constant
from nmm.control.functions.tasks.task import Stack, Task
from nmm.control.limits.collisions import Collisions
from nmm.control.limits.limits import Limits
from nmm.control.plant import Plant
from nmm.control.resolvers.base import Resolver
from nmm.control.resolvers.callable_resolver import CallableResolver
from nmm.control.resolvers.problem import Problem
from nmm.control.retreat import Retreat
from nmm.control.sequencing.sequence import Event, Moment, Schedule, Sequence
from nmm.control.steering import Steering
from nmm.control.step.step_layout import SERVO, ControllerArguments, checked
from nmm.control.step.step_solver import StepSolver
from nmm.model.robots.robot import Robot


class SequencedController(Controller):
    """u = controller(t, q), like a `Controller`, of tasks with conditions (`Task(..., when=)`).

    At each call the conditions decide which tasks are active until the next call. `current` is the controller
    of the active tasks, to which `rows` and `report` belong; there is one for each set of tasks, built when
    first needed. The previous inputs, from which accelerations count, are handed over: with acceleration
    limits u never changes by more than they allow, without them it may jump when a task begins or ends. A
    retreat continues. Where no task is active the robot descends the objective alone, u = -α h with the
    resolver's α, or stands still without an objective.

    Parameters
    ----------
    robot, task, resolver, objective, limits, dt, retreat, steering, collisions, kinematics, order,
    servo : see `Controller`

    Attributes
    ----------
    schedule : which tasks are active, and the changes so far
    current : the controller of the active tasks

    Raises
    ------
    RunError : when called, where the active tasks are incompatible
    InputError : as `Controller` and `Sequence`; a resolver with an added task, as the number of its rows
        depends on the active tasks

    Examples
    --------
    >>> robot = nmm.load("unicycle_2r")
    >>> reach = nmm.Task(nmm.Position("ee", "xy"), [2.0, 1.0], name="reach")
    >>> aim = nmm.Task(nmm.Posture("q1"), [0.5], name="aim", priority=2, when=nmm.Between(1.0, 2.0))
    >>> controller = nmm.SequencedController(robot, [reach, aim], nmm.ProjectedGradient())
    >>> [event.what for event in nmm.simulate(controller, robot.q({"q2": 0.5}), 3.0).events]
    ['begins', 'ends']
    """

    def __init__(
        self,
        robot: Robot,
        task: Task | Stack | Several[Task],
        resolver: Resolver,
        objective: Objective | None = None,
        limits: Limits | None = None,
        dt: float | None = None,
        retreat: Retreat | None = None,
        steering: Steering | bool = True,
        collisions: Collisions | None = None,
        kinematics: str = PINOCCHIO,
        order: int = 1,
        servo: float = SERVO,
    ) -> None:
        tasks = Stack.of(task)
        if not tasks.tasks:
            raise InputError(where="task", expected="at least one")
        arguments = (robot, tasks, resolver, objective, Stack(), limits, dt, retreat, steering)
        self.given = checked(ControllerArguments(*arguments, collisions, kinematics, order, servo))
        if resolver.takes_added_task:
            raise InputError(
                "its added task has as many rows as the tasks leave, which changes where tasks come and go",
                where=f"resolver {resolver.name}",
                expected="pg, rg or dls",
            )
        self.schedule: Schedule = Schedule(tasks, robot)
        self._controllers: dict[tuple[bool, ...], Controller] = {}
        for part in tasks:  # report errors in a task now, not when it begins
            part.function.stages(robot), part.reference.stages(robot)
        self.schedule.tasks_on.feedback()
        first = self.schedule.sequence.next(self.schedule.moment, 0.0, robot.rest)
        self.current = self._controller(first.active, dt)

    @property
    def solver(self) -> StepSolver:  # type: ignore[override]  # another one where other tasks are active
        """What computes the inputs of the active tasks."""
        return self.current.solver

    @property
    def sequence(self) -> Sequence:
        """The conditions."""
        return self.schedule.sequence

    @property
    def moment(self) -> Moment:
        """What the last call decided."""
        return self.schedule.moment

    @property
    def events(self) -> list[Event]:
        """Tasks that began and ended since the last `reset`."""
        return self.schedule.events

    def __reduce__(self) -> tuple[object, ...]:
        arguments = self.given._replace(dt=self.dt)
        return type(self), (*arguments[:4], *arguments[5:])  # no added task

    def with_arguments(self, **arguments: Any) -> Self:
        """As for `Controller`."""
        values: tuple[Any, ...] = self.given._replace(**{"dt": self.dt, **arguments})
        return type(self)(*values[:4], *values[5:])

    def _controller(self, active: tuple[bool, ...], dt: float | None) -> Controller:
        """The controller of a set of active tasks."""
        if active not in self._controllers:
            arguments, resolver, retreat = self.given, self.given.resolver, self.given.retreat
            tasks = [task.always for task, on in zip(arguments.task, active, strict=True) if on]
            if not tasks:
                tasks, resolver, retreat = [Task(Constant([0.0]), [0.0], gain=None)], descent(resolver), None
            made = arguments._replace(task=Stack.of(tasks), resolver=resolver, retreat=retreat, dt=dt)
            self._controllers[active] = Controller(*made)
        controller = self._controllers[active]
        if dt is not None:
            controller.dt = dt
        return controller

    def switch(self) -> Controller:
        """Change to the controller of the scheduled tasks, and hand over the state."""
        old, moment = self.current, self.schedule.settle()
        try:
            new = self._controller(moment.active, old.dt)
        except InputError as error:
            names = [name for name, on in zip(self.sequence.names, moment.active, strict=True) if on]
            raise error.at(f"at t = {moment.t:g} s: with {listed(names)}", RunError) from None
        if new is not old:
            new.reset()  # their memories differ, so what is handed over is named here
            new.solver.before[:] = old.solver.before
            if old.solver.retreat_state is not None and new.solver.retreat_state is not None:
                new.solver.retreat_state.take_over(old.solver.retreat_state)
            self.current = new
        return new

    def __call__(self, t: float, q: ArrayLike, u: ArrayLike | None = None) -> Array:
        """As for `Controller`; decides which tasks are active."""
        q = self.robot.q(q)
        if self.schedule.changes(float(t), q):
            self.switch()
        return self.current(t, q, u)

    def step(
        self, t: float, q: ArrayLike, dt: float, method: str = "rk4", *, plant: Plant | None = None
    ) -> tuple[Array, Array]:
        """As for `Controller`; decides which tasks are active, for the whole step."""
        q = self.robot.q(q)
        if plant is not None:
            return plant.step(self, float(t), q, positive(dt, "dt"), method)
        if self.schedule.changes(float(t), q):
            self.switch()
        return self.current.step(t, q, dt, method)

    def velocity(self, t: float, q: ArrayLike) -> Array:
        """q_dot = S(q) u (n,) at (t, q), with the tasks that the last call decided."""
        return self.current.velocity(t, q)

    def stop(self, t: float, q: ArrayLike, u: ArrayLike | None = None) -> Array:
        """As for `Controller`; no task begins or ends meanwhile."""
        return self.current.stop(t, q, u)

    def reset(self) -> None:
        """Forget all decisions and the previous inputs."""
        self.schedule.reset()
        for controller in self._controllers.values():
            controller.solver.begin_run()


def descent(resolver: Resolver) -> Resolver:
    """u = -α h with the resolver's α; zero for a resolver without α."""
    alpha = float(getattr(resolver, "alpha", 0.0))

    def descend(problem: Problem) -> Array:
        return -alpha * np.asarray(problem.h)

    return CallableResolver(descend)
