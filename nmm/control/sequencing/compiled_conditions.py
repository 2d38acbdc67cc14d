"""Evaluation of the tasks' conditions over many samples in one compiled call, up to the first change."""

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from nmm.base.arrays import Array, Flags, Integers
from nmm.base.kernels.compiled import compiled, compiled_without_gil, scratch, view
from nmm.base.kernels.record_layout import IntegerMatrix, IntegerVector, Matrix, record_type, views
from nmm.base.kernels.signatures import boolean, float64, int64, void
from nmm.control.functions.program import LaidOut, run_program
from nmm.control.functions.tasks.conditions import After, Between, Condition
from nmm.control.functions.tasks.task import Task
from nmm.control.step.equations import WRAPPED
from nmm.control.step.task_rows import error_row
from nmm.model.robots.robot import Robot

#: Times that differ by less are equal, s.
SAME = 1e-9

BETWEEN, WHILE, AFTER = range(3)


class Conditions(NamedTuple):
    """Conditions and the rows that they evaluate.

    kinds, tasks (c,) : BETWEEN, WHILE or AFTER, and the task that has the condition
    watched (c,) : the task that an AFTER waits for
    first (c + 1,) : where the rows of each begin
    numbers (c, 2) : [start, end], s; [margin, 0]; [required duration, s, 0]
    rows (r, 4) : the program's rows of f, g and e (or PLAIN or WRAPPED, see `TaskRows`) and the first row of
        the same unit; for a WHILE its function's row alone
    bounds (r, 2) : for a WHILE the lowest and highest value; for an AFTER 0 and the tolerance
    """

    kinds: IntegerVector
    tasks: IntegerVector
    watched: IntegerVector
    first: IntegerVector
    numbers: Matrix
    rows: IntegerMatrix
    bounds: Matrix


_FLAT, _CONDITIONS = float64[::1], record_type(Conditions)

#: t, q (n,), the program's blocks, the conditions, active tasks, the memory, and the memory to write.
EVALUATE = void(float64, _FLAT, int64[::1], _FLAT, _CONDITIONS, boolean[::1], _FLAT, _FLAT)

#: times (N,), q (N, n), the program's blocks, the conditions, tasks that are active and over, the memory,
#: and the previous memory to write.
WATCH = int64(
    *(_FLAT, float64[:, ::1], int64[::1], _FLAT),
    *(_CONDITIONS, boolean[::1], boolean[::1], _FLAT, _FLAT),
)


@compiled
def square_error(value: Array, table: Conditions, i: int, last: int) -> float:
    """‖e‖² over the rows up to `last` of the unit whose first row is i."""
    square = 0.0
    for j in range(i, last):
        if table.rows[j, 3] == i:
            error = value[table.rows[j, 1]] - value[table.rows[j, 0]]
            if table.rows[j, 2] >= 0:
                error = value[table.rows[j, 2]]
            elif table.rows[j, 2] == WRAPPED:
                error = math.pi - (math.pi - error) % (2.0 * math.pi)
            square += error * error
    return square


@compiled
def evaluate_conditions(
    t: float,
    q: Array,
    integers: Integers,
    floats: Array,
    table: Conditions,
    active: Flags,
    memory: Array,
    now: Array,
) -> None:
    """Write now (c,), the memory (see `Moment`) after a sample at (t, q), from that before it. The results of
    Pinocchio and of users' Python functions are in the program's blocks already."""
    run_program(t, q, integers, floats)
    value = views(LaidOut, integers, floats, 0).buffers.value
    for c in range(table.kinds.shape[0]):
        was, within = memory[c], True
        start, last = table.first[c], table.first[c + 1]
        if table.kinds[c] == BETWEEN:
            within = table.numbers[c, 0] - SAME <= t < table.numbers[c, 1] - SAME
        elif table.kinds[c] == WHILE:
            wider = table.numbers[c, 0] if was == 1.0 else 0.0
            for i in range(start, last):
                x = value[table.rows[i, 0]]
                within = within and table.bounds[i, 0] - wider <= x and x <= table.bounds[i, 1] + wider
        else:
            for i in range(start, last):
                if table.rows[i, 3] == i:
                    within = within and math.sqrt(square_error(value, table, i, last)) <= table.bounds[i, 1]
            if was == -math.inf:
                now[c] = was
            elif not (active[table.watched[c]] and within):
                now[c] = math.nan
            else:
                since = t if math.isnan(was) else was
                now[c] = -math.inf if t - since >= table.numbers[c, 0] - SAME else since
            continue
        now[c] = 1.0 if within else 0.0


@compiled_without_gil
def watch(
    times: Array,
    q: Array,
    integers: Integers,
    floats: Array,
    table: Conditions,
    active: Flags,
    over: Flags,
    memory: Array,
    before: Array,
) -> int:
    """The number of samples before the active tasks change; memory and before (c,) become those after the
    last of these samples and after the one before it."""
    n, count = q.shape[1], table.kinds.shape[0]
    now = scratch(count)
    for k in range(times.shape[0]):
        evaluate_conditions(times[k], view(q, k * n, (n,)), integers, floats, table, active, memory, now)
        for task in range(active.shape[0]):
            wanted = not over[task]
            for c in range(count):
                held = now[c] == (-math.inf if table.kinds[c] == AFTER else 1.0)
                wanted = wanted and (table.tasks[c] != task or held)
            if wanted != active[task]:
                return k
        for c in range(count):
            before[c], memory[c] = memory[c], now[c]
    return int(times.shape[0])


def conditions(
    numbered: Sequence[tuple[int, Condition]],
    watched: Mapping[str, tuple[int, Task]],
    robot: Robot,
    first_rows: Sequence[int],
) -> Conditions:
    """The table of conditions, each with its task's number.

    watched : number and task by name, of those that an AFTER waits for
    first_rows : where f, g and e of each of these begin, then the function of each WHILE
    """
    kinds = [
        BETWEEN if isinstance(condition, Between) else AFTER if isinstance(condition, After) else WHILE
        for _, condition in numbered
    ]
    table = Conditions(
        kinds=np.array(kinds, dtype=np.int64),
        tasks=np.array([i for i, _ in numbered], dtype=np.int64),
        watched=np.zeros(len(numbered), dtype=np.int64),
        first=np.zeros(len(numbered) + 1, dtype=np.int64),
        numbers=np.zeros((len(numbered), 2)),
        rows=np.zeros((0, 4), dtype=np.int64),
        bounds=np.zeros((0, 2)),
    )
    rows: list[tuple[int, int, int, int]] = []
    bounds: list[tuple[float, float]] = []
    begins = {name: first_rows[3 * k : 3 * k + 3] for k, name in enumerate(watched)}
    whiles = iter(first_rows[3 * len(watched) :])
    for c, (_, condition) in enumerate(numbered):
        first = len(rows)
        if isinstance(condition, Between):
            table.numbers[c] = condition.start, condition.end
        elif isinstance(condition, After):
            (table.watched[c], task), (f, g, e) = watched[condition.task], begins[condition.task]
            table.numbers[c, 0] = condition.hold
            own = task.rows(robot)
            units = [row.unit for row in own]
            for j, row in enumerate(own):
                rows.append((f + j, g + j, error_row(task, e + j, row), first + units.index(row.unit)))
                bounds.append((0.0, condition.within.get(row.unit, condition.within.get("", math.inf))))
        else:
            begin, count = next(whiles), len(condition.function.rows(robot))
            table.numbers[c, 0] = condition.margin
            rows += [(begin + j, 0, 0, 0) for j in range(count)]
            lower, upper = (np.broadcast_to(bound, count) for bound in (condition.lower, condition.upper))
            bounds += zip(lower.tolist(), upper.tolist(), strict=True)
        table.first[c + 1] = len(rows)
    return table._replace(
        rows=np.array(rows, dtype=np.int64).reshape(-1, 4), bounds=np.array(bounds).reshape(-1, 2)
    )
