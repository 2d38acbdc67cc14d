"""Tasks that come and go: a controller for each set of tasks, and what goes from one to the next."""

from __future__ import annotations

import math
from collections.abc import Sequence as Several
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from nmm.arrays import Array
from nmm.control.collisions import Collisions
from nmm.control.controller import Controller
from nmm.control.limits import Limits
from nmm.control.retreat import Retreat
from nmm.control.sequence import Event, Moment, Sequence
from nmm.control.steering import Steering
from nmm.errors import InputError, RunError
from nmm.functions.objectives.base import Objective
from nmm.functions.program import PINOCCHIO
from nmm.functions.references import Constant
from nmm.functions.tasks.task import Stack, Task
from nmm.resolvers.base import Resolver
from nmm.resolvers.callable_resolver import CallableResolver
from nmm.resolvers.problem import Problem
from nmm.robots.robot import Robot
from nmm.words import listed


class SequencedController(Controller):
    """u = controller(t, q), like a `Controller`, of tasks that come and go (`Task(..., when=)`).

    At each call the conditions decide which tasks are active; that holds until the next one. Everything else
    that a `Controller` has is that of `current`, the controller for the tasks now active: there is one for
    each set of tasks, built when it is first needed. From one to the next go the inputs before, from which
    accelerations count: with limits of acceleration u never changes by more than they allow, without them it
    may jump when a task begins or ends. A retreat under way goes on. Where no task is active the robot
    descends the objective alone, u = -α h with the resolver's α, and stands still where there is none.

    Parameters
    ----------
    robot, task, resolver, objective, limits, dt, retreat, steering, collisions, kinematics : see `Controller`

    Attributes
    ----------
    sequence : the conditions
    current : the controller of the tasks now active
    moment : what the last call decided
    events : those since the last `reset`

    Raises
    ------
    RunError : when called, where the tasks that are then active do not fit together
    InputError : what `Controller` and `Sequence` raise; a resolver with an added task, whose rows are as many
        as the task leaves

    Examples
    --------
    >>> robot = nmm.load("unicycle_2r")
    >>> hand = nmm.Task(nmm.Position("ee", "xy"), [2.0, 1.0], name="hand")
    >>> aim = nmm.Task(nmm.Posture("q1"), [0.5], name="aim", priority=2, when=nmm.Between(1.0, 2.0))
    >>> controller = nmm.SequencedController(robot, [hand, aim], nmm.ProjectedGradient())
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
    ) -> None:
        self.all_tasks = Stack.of(task)
        if not self.all_tasks.tasks:
            raise InputError("task: expected at least one")
        if resolver.takes_added_task:
            raise InputError(
                f"resolver {resolver.name}: its added task has as many rows as the tasks leave, which "
                "changes where tasks come and go; expected pg, rg or dls"
            )
        self.sequence = Sequence(self.all_tasks, robot)
        self._given = (
            robot,
            self.all_tasks,
            resolver,
            objective,
            limits,
            dt,
            retreat,
            steering,
            collisions,
            kinematics,
        )
        self._controllers: dict[tuple[bool, ...], Controller] = {}
        for one in self.all_tasks:  # what is wrong with a task is said now, not when it begins
            one.function.stages(robot), one.reference.stages(robot)
            one.gain_matrix(robot), one.approach(robot)
        self.moment = self._pending = self.sequence.start
        self.events: list[Event] = []
        self.current = self._controller(self.sequence.next(self.moment, 0.0, robot.rest).active, dt)

    def __getattr__(self, name: str) -> Any:
        if "current" not in self.__dict__:  # while it is built
            raise AttributeError(name)
        return getattr(self.current, name)

    def __reduce__(self) -> tuple[object, ...]:
        return type(self), (*self._given[:5], self.dt, *self._given[6:])

    def _controller(self, active: tuple[bool, ...], dt: float | None) -> Controller:
        """The one for a set of active tasks."""
        if active not in self._controllers:
            robot, stack, resolver, objective, limits, _, retreat, steering, keep, kinematics = self._given
            tasks = [task.always for task, on in zip(stack, active, strict=True) if on]
            if not tasks:
                tasks, resolver, retreat = [Task(Constant([0.0]), [0.0], gain=None)], descent(resolver), None
            self._controllers[active] = Controller(
                robot, tasks, resolver, objective, None, limits, dt, retreat, steering, keep, kinematics
            )
        found = self._controllers[active]
        if dt is not None:
            found.dt = dt
        return found

    @property
    def resolver_name(self) -> str:
        """The resolver's name, of the one that was given."""
        return self._given[2].name

    @property
    def dt(self) -> float | None:
        """Time between two calls, s; None where it was not said."""
        return self.current.dt

    @dt.setter
    def dt(self, dt: float | None) -> None:
        self.current.dt = dt

    def changes(self, t: float, q: Array) -> bool:
        """Whether a sample at t, s, and q (n,) has other tasks than the one before: then `switch`.

        Asked again at the same time, the last answer counts.
        """
        if t > self._pending.t:
            self._commit()
        self._pending = self.sequence.next(self.moment, t, q)
        return self._pending.active != self.moment.active

    def stays(self, times: Array, q: Array) -> int:
        """How many samples at times (N,), s, and q (N, n) have the same tasks as the one before them: what
        `changes` says of one after the other, up to the first that has others."""
        if len(times) and times[0] > self._pending.t:
            self._commit()
        count, known = self.sequence.pass_over(self.moment, times, q)
        if count:
            self.moment, self._pending = known
        while count < len(times) and not self.changes(float(times[count]), q[count]):
            count += 1
        return count

    def _commit(self) -> None:
        self.moment = self._pending
        self.events += self.moment.events
        self._pending = self.moment._replace(events=())

    def settle(self) -> Moment:
        """What was decided at the last sample counts."""
        if self._pending.t > self.moment.t:
            self._commit()
        return self.moment

    def switch(self) -> Controller:
        """Go over to the controller of the tasks that `changes` found; what goes along is handed over."""
        old = self.current
        self.settle()
        try:
            new = self._controller(self.moment.active, old.dt)
        except InputError as error:
            names = [name for name, on in zip(self.sequence.names, self.moment.active, strict=True) if on]
            raise RunError(f"at t = {self.moment.t:g} s: with {listed(names)}: {error}") from None
        if new is not old:
            before, backing = old.before.copy(), old.backing
            new.reset()
            new.before[:] = before
            if backing is not None and new.backing is not None:
                count, now, left, *_ = backing.snapshot()
                new.backing.restore((count, now, left, math.inf, 0.0))
            self.current = new
        return new

    def __call__(self, t: float, q: ArrayLike) -> Array:
        """Inputs u (m,) at time t (s) and configuration q (n,); decides which tasks are active."""
        q = self.robot.q(q)
        if self.changes(float(t), q):
            self.switch()
        return self.current(t, q)

    def step(self, t: float, q: ArrayLike, dt: float, method: str = "rk4") -> tuple[Array, Array]:
        """As a `Controller`'s; decides which tasks are active, for the whole step."""
        q = self.robot.q(q)
        if self.changes(float(t), q):
            self.switch()
        return self.current.step(t, q, dt, method)

    def velocity(self, t: float, q: ArrayLike) -> Array:
        """q_dot = S(q) u (n,) at (t, q), with the tasks that the last call decided."""
        return self.current.velocity(t, q)

    def reset(self) -> None:
        """Forget what was decided, and the inputs before."""
        self.moment = self._pending = self.sequence.start
        self.events = []
        for one in self._controllers.values():
            one.reset()


def descent(resolver: Resolver) -> Resolver:
    """u = -α h, with a resolver's α; rest where it has none."""
    alpha = float(getattr(resolver, "alpha", 0.0))

    def descend(problem: Problem) -> Array:
        return -alpha * np.asarray(problem.h)

    return CallableResolver(descend)
