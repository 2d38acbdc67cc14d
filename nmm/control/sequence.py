"""Which tasks are active: decided at samples by the tasks' conditions, held in between."""

from __future__ import annotations

import math
from collections.abc import Iterator
from collections.abc import Sequence as Several
from typing import NamedTuple

import numpy as np

from nmm.arrays import Array
from nmm.control.task_rows import task_functions
from nmm.control.watching import SAME, WATCH, conditions, watch
from nmm.errors import InputError, expect_known
from nmm.functions.function import Evaluation, Row
from nmm.functions.program import COMPILED, Program
from nmm.functions.tasks.conditions import After, Between, Condition, While
from nmm.functions.tasks.task import Stack, Task
from nmm.kernels.compiled import checked_by_caller
from nmm.robots.robot import Robot


class Event(NamedTuple):
    """A task began or ended: t, s; the task's name; "begins" or "ends"; why, in words.

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
    """What is known after a sample at t, s.

    active : whether each task is
    memory : a number a condition, in the tasks' order: of While, 1 where it holds; of After, the time since
        which the error has been within its tolerance, not a number where it is not, -inf once it held
    begun, over : whether each task was ever active, and whether it has ended for good
    events : what changed at this sample
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
    start : before the first sample

    Raises
    ------
    InputError : two tasks of one name, an `After` of a task that is not there, or that waits for itself
    """

    def __init__(self, stack: Stack, robot: Robot) -> None:
        self.tasks = stack.tasks
        self.names = tuple(task.called(robot) for task in stack)
        named = [task.name for task in stack if task.name]
        for name in named:
            if named.count(name) > 1:
                raise InputError(f"name: expected another name for each task, got {name} twice")
        self._conditions = [(i, one) for i, task in enumerate(stack) for one in task.when]
        for i, one in self._conditions:
            if isinstance(one, After):
                expect_known("task name", one.task, named, f"task {self.names[i]}: when: after")
            if isinstance(one, While):
                _check_rows(one, robot, f"task {self.names[i]}: when: while")
        self._refuse_circles()
        self._after = {
            one.task: self.names.index(one.task) for _, one in self._conditions if isinstance(one, After)
        }
        for i, one in self._conditions:
            if isinstance(one, After):
                units = sorted({row.unit for row in self.tasks[self._after[one.task]].rows(robot)})
                for unit in one.within:
                    if unit:
                        expect_known("unit", unit, units, f"task {self.names[i]}: when: after: within")
        self._robot = robot
        watched = [self.tasks[i] for i in self._after.values()]
        functions = [one.function for _, one in self._conditions if isinstance(one, While)]
        # Compiled, so that samples passed over and those looked at one by one are judged by the same digits.
        self._program = Program(robot, [*task_functions(Stack(tuple(watched))), *functions], COMPILED)
        self._program.lay_out()
        self._evaluates = bool(watched or functions)
        first = self._program.first_rows
        begins = {name: first[3 * k : 3 * k + 3] for k, name in enumerate(self._after)}
        self._rows = {name: self.tasks[i].rows(robot) for name, i in self._after.items()}
        self._table = conditions(
            self._conditions,
            [
                (i := self._after[one.task], self.tasks[i], self._rows[one.task], begins[one.task])
                for _, one in self._conditions
                if isinstance(one, After)
            ],
            [
                (begin, len(function.rows(robot)))
                for begin, function in zip(first[3 * len(watched) :], functions, strict=True)
            ],
        )
        none = (False,) * len(self.tasks)
        memory = tuple(math.nan if isinstance(one, After) else 0.0 for _, one in self._conditions)
        self.start = Moment(-math.inf, none, memory, none, none)

    def _refuse_circles(self) -> None:
        waits = {
            self.names[i]: [one.task for one in task.when if isinstance(one, After)]
            for i, task in enumerate(self.tasks)
        }

        def follow(name: str, way: list[str]) -> None:
            if name in way:
                circle = " after ".join([*way[way.index(name) :], name])
                raise InputError(f"task {name}: when: after: tasks wait for each other: {circle}")
            for other in waits[name]:
                follow(other, [*way, name])

        for name in waits:
            follow(name, [])

    def pass_over(self, before: Moment, times: Array, q: Array) -> tuple[int, list[Moment]]:
        """How many samples at times (N,), s, and q (N, n) have the same tasks active as the one before.

        Returns
        -------
        that number; what is known after each of the last two of them, and before them. Where users' Python
        functions are among the conditions, 0
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
        """What is known after a sample at t, s, and q (n,), given what was known before it."""
        found = self._program.evaluate(t, q) if self._evaluates else []
        errors = {
            name: _error(self.tasks[i], found[3 * k : 3 * k + 3], self._rows[name])
            for k, (name, i) in enumerate(self._after.items())
        }
        values = iter(found[3 * len(self._after) :])
        memory = tuple(
            self._remembered(one, was, before, t, errors, values)
            for (_, one), was in zip(self._conditions, before.memory, strict=True)
        )
        holds = [self._holds(one, now, t) for (_, one), now in zip(self._conditions, memory, strict=True)]
        wanted = [
            not before.over[i]
            and all(held for (j, _), held in zip(self._conditions, holds, strict=True) if i == j)
            for i in range(len(self.tasks))
        ]
        over, replaced = list(before.over), {}
        for i, one in self._conditions:
            if isinstance(one, After) and one.instead and wanted[i] and not before.begun[i]:
                replaced[self._after[one.task]] = i
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
                    self._words(one, now)
                    for (j, one), held, earlier in zip(
                        self._conditions, holds, self._held(before), strict=True
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

    def never_began(self, moment: Moment) -> list[str]:
        """A sentence for each task whose conditions never held together, with those that do not now."""
        sentences = []
        for i, name in enumerate(self.names):
            if not moment.begun[i]:
                missing = [
                    self._words(one, now=False)
                    for (j, one), held in zip(self._conditions, self._held(moment), strict=True)
                    if i == j and not held
                ]
                why = ", ".join(missing) or "its conditions did not hold at one time"
                sentences.append(f"task {name} never began: at the end of the run, {why}")
        return sentences

    def _held(self, moment: Moment) -> list[bool]:
        return [
            self._holds(one, now, moment.t)
            for (_, one), now in zip(self._conditions, moment.memory, strict=True)
        ]

    def _remembered(
        self,
        one: Condition,
        was: float,
        before: Moment,
        t: float,
        errors: dict[str, Array],
        values: Iterator[Evaluation],
    ) -> float:
        if isinstance(one, While):
            value = next(values).value
            wider = one.margin if was else 0.0
            return float(np.all((one.lower - wider <= value) & (value <= one.upper + wider)))
        if isinstance(one, After):
            if was == -math.inf:
                return was
            i = self._after[one.task]
            if not before.active[i] or not self._within(one, errors[one.task]):
                return math.nan
            since = t if math.isnan(was) else was
            return -math.inf if t - since >= one.hold - SAME else since
        return 0.0

    def _within(self, one: After, error: Array) -> bool:
        squares: dict[str, float] = {}
        for row, value in zip(self._rows[one.task], error.tolist(), strict=True):
            squares[row.unit] = squares.get(row.unit, 0.0) + value * value
        tolerances = {unit: one.within.get(unit, one.within.get("", math.inf)) for unit in squares}
        return all(math.sqrt(squares[unit]) <= tolerances[unit] for unit in squares)

    @staticmethod
    def _holds(one: Condition, memory: float, t: float) -> bool:
        if isinstance(one, Between):
            return one.start - SAME <= t < one.end - SAME
        return memory == 1.0 if isinstance(one, While) else memory == -math.inf

    def _words(self, one: Condition, now: bool) -> str:
        if isinstance(one, Between):
            time = f"t = {one.start:g} s" if math.isinf(one.end) else f"t = {one.start:g} to {one.end:g} s"
            return f"its time is {time}"
        if isinstance(one, While):
            rows = ", ".join(row.name for row in one.function.rows(self._robot))
            ends = [
                f"{word} {', '.join(f'{x:g}' for x in bound.tolist())}"
                for word, bound in (("at least", one.lower), ("at most", one.upper))
                if np.any(np.isfinite(bound))
            ]
            return f"{rows} is {'' if now else 'not '}{' and '.join(ends)}"
        sizes = ", ".join(f"{value:g} {unit}".strip() for unit, value in one.within.items())
        if one.hold == 0.0:
            return f"{one.task} {'came' if now else 'did not come'} within {sizes}"
        return f"{one.task} {'stayed' if now else 'did not stay'} within {sizes} for {one.hold:g} s"


def _check_rows(one: While, robot: Robot, where: str) -> None:
    rows = len(one.function.rows(robot))
    for name, bound in (("lower", one.lower), ("upper", one.upper)):
        if len(bound) not in (1, rows):
            raise InputError(f"{where}: {name}: expected a number, or {rows}, one a row, got {len(bound)}")


def _error(task: Task, found: Several[Evaluation], rows: Several[Row]) -> Array:
    """The error (s,) of a task: computed, or the difference, wrapped where a row is an angle."""
    value, target, compared = (one.value for one in found)
    if task.function.comparison is not None:
        return compared
    error = target - value
    angular = np.array([row.angular for row in rows], dtype=bool)
    return np.where(angular, np.pi - (np.pi - error) % (2.0 * np.pi), error)
