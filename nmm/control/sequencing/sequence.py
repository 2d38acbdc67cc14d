"""Which tasks are active: decided at samples by the tasks' conditions, constant in between."""

from __future__ import annotations

import math
from collections.abc import Sequence as Several
from typing import NamedTuple

import numpy as np

from nmm.base.arrays import Array
from nmm.base.errors import InputError, expect, expect_known
from nmm.base.findings import Finding
from nmm.base.kernels.compiled import checked_by_caller
from nmm.control.functions.program import COMPILED, Program
from nmm.control.functions.tasks.conditions import After, Between, Condition, While
from nmm.control.functions.tasks.task import Stack
from nmm.control.sequencing.compiled_conditions import EVALUATE, WATCH, conditions, evaluate_conditions, watch
from nmm.control.step.task_rows import task_functions
from nmm.model.robots.robot import Robot


class Event(NamedTuple):
    """A task began or ended: t, s; the task's name; "begins" or "ends"; the reason, in words.

    Examples
    --------
    >>> robot = nmm.load("unicycle_2r")
    >>> aim = nmm.Task(nmm.Posture("q1"), [0.5], name="aim", when=nmm.Between(0.5, 1.0))
    >>> controller = nmm.SequencedController(robot, aim, nmm.ProjectedGradient())
    >>> run = nmm.simulate(controller, robot.rest, 2.0, 0.01)
    >>> run.events[0]
    Event(t=0.5, task='aim', what='begins', why='its time is t = 0.5 to 1 s')
    """

    t: float
    task: str
    what: str
    why: str


class Moment(NamedTuple):
    """The state after a sample at t, s.

    active : whether each task is
    memory : one number per condition, in the tasks' order: 1 where it holds, else 0; for After, the time
        since which the error has been within its tolerance, NaN while it is not, -inf once the condition held
    begun, over : whether each task was ever active, and whether it has ended for good
    events : the changes at this sample
    """

    t: float
    active: tuple[bool, ...]
    memory: tuple[float, ...]
    begun: tuple[bool, ...]
    over: tuple[bool, ...]
    events: tuple[Event, ...] = ()


class Sequence:
    """The conditions of a stack's tasks on a robot.

    Attributes
    ----------
    tasks, names : all tasks, by priority
    start : the moment before the first sample

    Raises
    ------
    InputError : two tasks of one name, an `After` of a task that does not exist, or that waits for itself
    """

    def __init__(self, stack: Stack, robot: Robot) -> None:
        self.tasks = stack.tasks
        self.names = tuple(task.called(robot) for task in stack)
        named = [task.name for task in stack if task.name]
        for name in named:
            if named.count(name) > 1:
                raise InputError(where="name", expected="another name for each task", got=name)
        self._conditions = [(i, condition) for i, task in enumerate(stack) for condition in task.when]
        for i, condition in self._conditions:
            if isinstance(condition, After):
                expect_known("task name", condition.task, named, f"task {self.names[i]}: when: after")
            if isinstance(condition, While):
                _check_rows(condition, robot, f"task {self.names[i]}: when: while")
        self._refuse_circles()
        afters = [condition for _, condition in self._conditions if isinstance(condition, After)]
        self._after = {condition.task: self.names.index(condition.task) for condition in afters}
        for i, condition in self._conditions:
            if isinstance(condition, After):
                units = sorted({row.unit for row in self.tasks[self._after[condition.task]].rows(robot)})
                for unit in condition.within:
                    if unit:
                        expect_known("unit", unit, units, f"task {self.names[i]}: when: after: within")
        self._robot = robot
        watched = {name: (i, self.tasks[i]) for name, i in self._after.items()}
        waited_for = Stack(tuple(task for _, task in watched.values()))
        functions = [condition.function for _, condition in self._conditions if isinstance(condition, While)]
        # Compiled, so that `pass_over` and `next` agree to the last digit.
        self._program = Program(robot, [*task_functions(waited_for), *functions], COMPILED)
        self._program.lay_out()
        self._table = conditions(self._conditions, watched, robot, self._program.first_rows)
        none = (False,) * len(self.tasks)
        memory = tuple(math.nan if isinstance(condition, After) else 0.0 for _, condition in self._conditions)
        self.start = Moment(-math.inf, none, memory, none, none)

    def _refuse_circles(self) -> None:
        waits = {
            self.names[i]: [condition.task for condition in task.when if isinstance(condition, After)]
            for i, task in enumerate(self.tasks)
        }

        def follow(name: str, way: list[str]) -> None:
            if name in way:
                circle = [*way[way.index(name) :], name]
                raise InputError("they wait for each other", where=f"task {name}: when: after", got=circle)
            for other in waits[name]:
                follow(other, [*way, name])

        for name in waits:
            follow(name, [])

    def pass_over(self, before: Moment, times: Array, q: Array) -> tuple[int, list[Moment]]:
        """How many samples at times (N,), s, and q (N, n) have the same active tasks as the one before.

        Returns
        -------
        that number, 0 where conditions use users' Python functions; the moments after each of the last two of
        these samples, and before them
        """
        if self._program.calls_python:
            return 0, [before]
        active, over = np.array(before.active), np.array(before.over)
        memory = np.array(before.memory, dtype=np.float64)
        earlier = memory.copy()
        at = np.ascontiguousarray(times, dtype=np.float64), np.ascontiguousarray(q, dtype=np.float64)
        watching = checked_by_caller(watch, WATCH)
        count = watching(*at, *self._program.blocks, self._table, active, over, memory, earlier)
        known = [before]
        for k, remembered in ((count - 2, earlier), (count - 1, memory)):
            if k >= 0:
                known.append(before._replace(t=float(times[k]), memory=(*remembered.tolist(),), events=()))
        return count, known[-2:]

    def next(self, before: Moment, t: float, q: Array) -> Moment:
        """The moment after a sample at t, s, and q (n,), from the one before it."""
        q, room = np.array(q, dtype=np.float64), np.empty(len(self._conditions))
        self._program.prepare(t, q)
        known = self._table, np.array(before.active), np.array(before.memory)
        checked_by_caller(evaluate_conditions, EVALUATE)(t, q, *self._program.blocks, *known, room)
        memory = (*room.tolist(),)
        holds = self._held(memory)
        wanted = [
            not before.over[i]
            and all(held for (j, _), held in zip(self._conditions, holds, strict=True) if i == j)
            for i in range(len(self.tasks))
        ]
        over, replaced = list(before.over), {}
        for i, condition in self._conditions:
            if isinstance(condition, After) and condition.instead and wanted[i] and not before.begun[i]:
                replaced[self._after[condition.task]] = i
        for i in replaced:
            wanted[i], over[i] = False, True
        events = []
        for i, (was, now) in enumerate(zip(before.active, wanted, strict=True)):
            if was == now or not (self.tasks[i].when or i in replaced):
                continue
            if i in replaced:
                why = f"{self.names[replaced[i]]} begins instead of it"
            else:
                changed = [
                    self._words(condition, now)
                    for (j, condition), held, earlier in zip(
                        self._conditions, holds, self._held(before.memory), strict=True
                    )
                    if i == j and held == now and (held != earlier or math.isinf(before.t))
                ]
                why = ", ".join(changed)
            events.append(Event(t, self.names[i], "begins" if now else "ends", why))
        begun = tuple(a or b for a, b in zip(before.begun, wanted, strict=True))
        return Moment(t, tuple(wanted), memory, begun, tuple(over), tuple(events))

    def waiting(self, moment: Moment) -> list[str]:
        """The tasks that have not begun yet."""
        return [name for name, begun in zip(self.names, moment.begun, strict=True) if not begun]

    def never_began(self, moment: Moment) -> list[Finding]:
        """The tasks whose conditions never held together, with the conditions that do not hold now."""
        findings = []
        for i, name in enumerate(self.names):
            if not moment.begun[i]:
                missing = [
                    self._words(condition, now=False)
                    for (j, condition), held in zip(self._conditions, self._held(moment.memory), strict=True)
                    if i == j and not held
                ]
                findings.append(Finding("task_never_began", {"task": name, "missing": missing}))
        return findings

    def _held(self, memory: Several[float]) -> list[bool]:
        pairs = zip(self._conditions, memory, strict=True)
        return [now == (-math.inf if isinstance(condition, After) else 1.0) for (_, condition), now in pairs]

    def _words(self, condition: Condition, now: bool) -> str:
        if isinstance(condition, Between):
            time = (
                f"t = {condition.start:g} s"
                if math.isinf(condition.end)
                else f"t = {condition.start:g} to {condition.end:g} s"
            )
            return f"its time is {time}"
        if isinstance(condition, While):
            rows = ", ".join(row.name for row in condition.function.rows(self._robot))
            ends = [
                f"{word} {', '.join(f'{x:g}' for x in bound.tolist())}"
                for word, bound in (("at least", condition.lower), ("at most", condition.upper))
                if np.any(np.isfinite(bound))
            ]
            return f"{rows} is {'' if now else 'not '}{' and '.join(ends)}"
        sizes = ", ".join(f"{value:g} {unit}".strip() for unit, value in condition.within.items())
        if condition.hold == 0.0:
            return f"{condition.task} {'came' if now else 'did not come'} within {sizes}"
        return (
            f"{condition.task} {'stayed' if now else 'did not stay'} within {sizes} for {condition.hold:g} s"
        )


class Schedule:
    """What a `Sequence` decided up to the last sample.

    Attributes
    ----------
    tasks : all tasks, active or not; tasks_on : with their rows on the robot
    sequence : their conditions
    moment : the decision at the last sample
    events : those since the last `reset`
    """

    def __init__(self, tasks: Stack, robot: Robot) -> None:
        self.tasks, self.tasks_on = tasks, tasks.on(robot)
        self.sequence = Sequence(tasks, robot)
        self.reset()

    def reset(self) -> None:
        """Return to the state before the first sample."""
        self.moment = self._pending = self.sequence.start
        self.events: list[Event] = []

    def changes(self, t: float, q: Array) -> bool:
        """Whether a sample at t, s, and q (n,) changes the active tasks; the last answer at a time counts."""
        if t > self._pending.t:
            self._commit()
        self._pending = self.sequence.next(self.moment, t, q)
        return self._pending.active != self.moment.active

    def stays(self, times: Array, q: Array) -> int:
        """How many samples at times (N,), s, and q (N, n) have the same active tasks as the one before:
        `changes` for each in turn, up to the first change."""
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
        """Adopt the decision at the last sample."""
        if self._pending.t > self.moment.t:
            self._commit()
        return self.moment


def _check_rows(condition: While, robot: Robot, where: str) -> None:
    rows = len(condition.function.rows(robot))
    for name, bound in (("lower", condition.lower), ("upper", condition.upper)):
        expect(len(bound) in (1, rows), f"{where}: {name}", f"a number, or {rows}, one a row", len(bound))
