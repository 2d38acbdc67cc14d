"""A task: a function f(q) that shall follow a reference g(t, q), with a gain on its error."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from nmm.base.arrays import Array, Integers, array, counted
from nmm.base.errors import InputError, expect, expect_kind, expect_known, one_or_several
from nmm.control.functions.function import Function, Row, Stage
from nmm.control.functions.references.polynomial import Constant
from nmm.control.functions.tasks.conditions import After, Between, Condition, While, by_unit
from nmm.model.robots.robot import Robot


class Task:
    """f(q) follows g(t, q): J_bar u = ∂g/∂t + K e, J_bar = (∂f/∂q - ∂g/∂q) S, e = g - f (paper, eq. 13).

    Parameters
    ----------
    function : f, with s rows
    reference : g, with as many rows: a function of time, of the configuration, or of both;
        numbers stand for a constant
    gain : K in 1/s: a number, s numbers, or an (s, s) matrix with a positive definite symmetric
        part; None for planning mode, without feedback
    priority : 1, 2, ...: where limits bind, lower numbers keep their rate; tasks of one number are scaled
        together
    speed : bound of ‖K e‖ over rows of one unit: a number, or numbers by unit ({"m": 1.0, "rad": 2.0}), 1/s
        of these
    braking : deceleration b to the target, ‖K e‖ <= √(2 b ‖e‖), in the same way, 1/s²
    name : for messages and other tasks' conditions; by default its rows' names
    when : a `Between`, `While` or `After`, or several, which all have to hold, for a task that comes and goes
        (`SequencedController`); none for one that is always there

    Raises
    ------
    InputError : what is no function, a priority that is none, a speed that is not above 0

    Examples
    --------
    >>> robot = nmm.load("unicycle_2r")
    >>> task = nmm.Task(nmm.Position("ee", "xy"), nmm.Circle([2, 2], 3, rate=0.25), gain=2.0)
    >>> controller = nmm.Controller(robot, task, nmm.ProjectedGradient())
    >>> controller.evaluate(0.0, robot.rest).error.round(3)
    array([3.9, 2. ])
    """

    def __init__(
        self,
        function: Function,
        reference: Function | ArrayLike,
        gain: ArrayLike | None = 1.0,
        priority: int = 1,
        speed: float | Mapping[str, float] | None = None,
        braking: float | Mapping[str, float] | None = None,
        name: str = "",
        when: Condition | Sequence[Condition] = (),
    ) -> None:
        expect_kind(function, Function, "task", "a function of the robot, as Position('ee')")
        self.function = function
        self.reference = reference if isinstance(reference, Function) else Constant(np.atleast_1d(reference))
        self.gain = gain
        self.priority = counted(priority, "priority")
        self.speed = by_unit(speed, "speed")
        self.braking = by_unit(braking, "braking")
        self.name = name
        expected = "Between, While or After, or several of these"
        self.when: tuple[Condition, ...] = one_or_several(when, Between | While | After, "when", expected)

    @property
    def always(self) -> Task:
        """The same task without conditions."""
        task = copy(self)
        task.when = ()
        return task

    def called(self, robot: Robot) -> str:
        """Its name, or those of its rows."""
        return self.name or ", ".join(row.name for row in self.rows(robot))

    def approach(self, robot: Robot, rows: Sequence[Row] = ()) -> tuple[Array, Array]:
        """Speed and braking for the unit of each row, (s,) each; infinite for none. `rows`: where known."""
        units = [row.unit for row in rows or self.rows(robot)]
        for name, values in (("speed", self.speed), ("braking", self.braking)):
            for unit in filter(None, values):
                expect_known("unit", unit, sorted(set(units)), name)
        speed, braking = (
            np.array([values.get(unit, values.get("", np.inf)) for unit in units])
            for values in (self.speed, self.braking)
        )
        return speed, braking

    def rows(self, robot: Robot) -> tuple[Row, ...]:
        """The rows of f; `InputError` when g has another number of them."""
        rows = self.function.rows(robot)
        targets = self.reference.rows(robot)
        if len(targets) != len(rows):
            what = f"{type(self.reference).__name__} has {len(targets)}"
            where = f"task {', '.join(row.name for row in rows)}"
            expected = f"a reference with {len(rows)} components"
            raise InputError(what, where=where, expected=expected, got=len(targets))
        return rows

    def gain_matrix(self, robot: Robot, rows: Sequence[Row] = ()) -> Array:
        """K as an (s, s) matrix; zero in planning mode. `rows`: where they are known."""
        rows = rows or self.rows(robot)
        name = f"gain of task {', '.join(row.name for row in rows)}"
        s = len(rows)
        if self.gain is None:
            return np.zeros((s, s))
        value = gain = array(self.gain, name)
        if gain.ndim == 0:
            gain = gain * np.eye(s)
        elif gain.shape == (s,):
            gain = np.diag(gain)
        elif gain.shape != (s, s):
            raise InputError(where=name, expected=f"a number, {s} numbers or a {s} x {s} matrix", got=gain)
        positive_definite = np.linalg.eigvalsh(gain + gain.T).min() > 0.0
        expect(positive_definite, name, "positive definite (above 0; None for planning mode)", value)
        return gain


class Comparison(Function):
    """The error e(t, q) of a task by its function's `comparison`; without one it has no rows. Its stage reads
    the 2 s rows before its own, so it comes right after the task's function and reference."""

    def __init__(self, task: Task) -> None:
        self.task = task

    def rows(self, robot: Robot) -> tuple[Row, ...]:
        return () if self.task.function.comparison is None else self.task.function.rows(robot)

    def stages(self, robot: Robot) -> tuple[Stage, ...]:
        if (kernel := self.task.function.comparison) is None:
            return ()
        s = len(self.task.rows(robot))
        for part in (self.task.function, self.task.reference):
            rows = max(stage.rows for stage in part.stages(robot))
            expect(rows == s, type(part).__name__, f"stages of {s} rows, as many as its components", rows)
        return (Stage(kernel, s, before=2 * s),)


@dataclass(frozen=True, eq=False)
class Stack:
    """Tasks executed together, one above the other by priority, each with its own reference and gain.

    Examples
    --------
    >>> reach = nmm.Task(nmm.Position("ee", "xy"), [2.0, 1.0])
    >>> turn = nmm.Task(nmm.Heading("base_footprint"), [0.0], priority=2)
    >>> nmm.Stack((reach, turn)).levels(nmm.load("unicycle_2r"))
    (2, 1)
    """

    tasks: tuple[Task, ...] = field(default=())

    @classmethod
    def of(cls, tasks: Task | Stack | Sequence[Task]) -> Stack:
        """A stack from a task, a stack or a sequence of tasks."""
        if isinstance(tasks, Stack):
            return tasks
        stacked = one_or_several(tasks, Task, "task", "a Task or a list of Tasks")
        return cls(tuple(sorted(stacked, key=lambda task: task.priority)))

    def __iter__(self) -> Iterator[Task]:
        return iter(self.tasks)

    def __len__(self) -> int:
        return len(self.tasks)

    def levels(self, robot: Robot) -> tuple[int, ...]:
        """How many rows each level of priority has, the first level first."""
        return self.on(robot).levels

    def separate(self, robot: Robot) -> tuple[bool, ...]:
        """For each level of priority, whether limits cut its rows one by one: all its functions say so."""
        separate: dict[int, bool] = {}
        for task in self.tasks:
            separate[task.priority] = separate.get(task.priority, True) and task.function.separate
        return tuple(separate.values())

    def nearer(self) -> dict[tuple[str, str], float]:
        """Pairs, by name, that a task leads nearer to each other than what is kept, and how near, m."""
        pairs: dict[tuple[str, str], float] = {}
        for task in self.tasks:
            for names, least in task.function.nearer.items():
                pairs[names] = min(least, pairs.get(names, least))
        return pairs

    def place(self, priority: int | None) -> int:
        """The number, from 1 on, of the first level that is not above a priority; 0 for None, above all."""
        if priority is None:
            return 0
        return 1 + len({task.priority for task in self.tasks if task.priority < priority})

    def rows(self, robot: Robot) -> tuple[Row, ...]:
        """The rows of all tasks, in order."""
        return self.on(robot).rows

    def on(self, robot: Robot) -> TasksOn:
        """These tasks on one robot, with their rows."""
        return TasksOn(self, robot, tuple(task.rows(robot) for task in self.tasks))


class TasksOn(NamedTuple):
    """Tasks on one robot, and the rows of `each`: what a controller is laid out from, and its runs read."""

    stack: Stack
    robot: Robot
    each: tuple[tuple[Row, ...], ...]

    @property
    def rows(self) -> tuple[Row, ...]:
        """The rows of all tasks, in order."""
        return tuple(row for rows in self.each for row in rows)

    @property
    def levels(self) -> tuple[int, ...]:
        """How many rows each level of priority has, the first level first."""
        counts: dict[int, int] = {}
        for task, rows in zip(self.stack, self.each, strict=True):
            counts[task.priority] = counts.get(task.priority, 0) + len(rows)
        return tuple(counts.values())

    def feedback(self) -> tuple[Array, Array, Array, Integers]:
        """K (s, s), block by block; speed, braking and group (s,), see `TaskRows`."""
        K, first = np.zeros((len(self.rows),) * 2), 0
        bounds = [np.zeros((2, 0))]
        for task, rows in zip(self.stack, self.each, strict=True):
            own = slice(first, first := first + len(rows))
            K[own, own] = task.gain_matrix(self.robot, rows)  # SciPy's block_diag loads its linear algebra
            bounds.append(np.array(task.approach(self.robot, rows)))
        units = [(k, row.unit) for k, rows in enumerate(self.each) for row in rows]
        return K, *np.hstack(bounds), np.array([units.index(unit) for unit in units], dtype=np.int64)
