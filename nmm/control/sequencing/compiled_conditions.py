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
LOOK = void(float64, _FLAT, int64[::1], _FLAT, _CONDITIONS, boolean[::1], _FLAT, _FLAT)

#: times (N,), q (N, n), the program's blocks, the conditions, tasks that are active and over, the memory,
#: and the previous memory to write.
WATCH = int64(
    *(_FLAT, float64[:, ::1], int64[::1], _FLAT),
    *(_CONDITIONS, boolean[::1], boolean[::1], _FLAT, _FLAT),
)


@compiled
def square_error(value: Array, those: Conditions, i: int, last: int) -> float:
    """‖e‖² over the rows up to `last` of the unit whose first row is i."""
    square = 0.0
    for j in range(i, last):
        if those.rows[j, 3] == i:
            error = value[those.rows[j, 1]] - value[those.rows[j, 0]]
            if those.rows[j, 2] >= 0:
                error = value[those.rows[j, 2]]
            elif those.rows[j, 2] == WRAPPED:
                error = math.pi - (math.pi - error) % (2.0 * math.pi)
            square += error * error
    return square


@compiled
def look(
    t: float,
    q: Array,
    integers: Integers,
    floats: Array,
    those: Conditions,
    active: Flags,
    memory: Array,
    now: Array,
) -> None:
    """Write now (c,), the memory (see `Moment`) after a sample at (t, q), from that before it. The results of
    Pinocchio and of users' Python functions are in the program's blocks already."""
    run_program(t, q, integers, floats)
    value = views(LaidOut, integers, floats, 0).buffers.value
    for c in range(those.kinds.shape[0]):
        was, within = memory[c], True
        start, last = those.first[c], those.first[c + 1]
        if those.kinds[c] == BETWEEN:
            within = those.numbers[c, 0] - SAME <= t < those.numbers[c, 1] - SAME
        elif those.kinds[c] == WHILE:
            wider = those.numbers[c, 0] if was == 1.0 else 0.0
            for i in range(start, last):
                x = value[those.rows[i, 0]]
                within = within and those.bounds[i, 0] - wider <= x and x <= those.bounds[i, 1] + wider
        else:
            for i in range(start, last):
                if those.rows[i, 3] == i:
                    within = within and math.sqrt(square_error(value, those, i, last)) <= those.bounds[i, 1]
            if was == -math.inf:
                now[c] = was
            elif not (active[those.watched[c]] and within):
                now[c] = math.nan
            else:
                since = t if math.isnan(was) else was
                now[c] = -math.inf if t - since >= those.numbers[c, 0] - SAME else since
            continue
        now[c] = 1.0 if within else 0.0


@compiled_without_gil
def watch(
    times: Array,
    q: Array,
    integers: Integers,
    floats: Array,
    those: Conditions,
    active: Flags,
    over: Flags,
    memory: Array,
    before: Array,
) -> int:
    """The number of samples before the active tasks change; memory and before (c,) become those after the
    last of these samples and after the one before it."""
    n, count = q.shape[1], those.kinds.shape[0]
    now = scratch(count)
    for k in range(times.shape[0]):
        look(times[k], view(q, k * n, (n,)), integers, floats, those, active, memory, now)
        for task in range(active.shape[0]):
            wanted = not over[task]
            for c in range(count):
                held = now[c] == (-math.inf if those.kinds[c] == AFTER else 1.0)
                wanted = wanted and (those.tasks[c] != task or held)
            if wanted != active[task]:
                return k
        for c in range(count):
            before[c], memory[c] = memory[c], now[c]
    return int(times.shape[0])


def conditions(
    given: Sequence[tuple[int, Condition]],
    watched: Mapping[str, tuple[int, Task]],
    robot: Robot,
    first_rows: Sequence[int],
) -> Conditions:
    """The table of conditions, each with its task's number.

    watched : number and task by name, of those that an AFTER waits for
    first_rows : where f, g and e of each of these begin, then the function of each WHILE
    """
    kinds = [
        BETWEEN if isinstance(one, Between) else AFTER if isinstance(one, After) else WHILE
        for _, one in given
    ]
    table = Conditions(
        kinds=np.array(kinds, dtype=np.int64),
        tasks=np.array([i for i, _ in given], dtype=np.int64),
        watched=np.zeros(len(given), dtype=np.int64),
        first=np.zeros(len(given) + 1, dtype=np.int64),
        numbers=np.zeros((len(given), 2)),
        rows=np.zeros((0, 4), dtype=np.int64),
        bounds=np.zeros((0, 2)),
    )
    rows: list[tuple[int, int, int, int]] = []
    bounds: list[tuple[float, float]] = []
    begins = {name: first_rows[3 * k : 3 * k + 3] for k, name in enumerate(watched)}
    whiles = iter(first_rows[3 * len(watched) :])
    for c, (_, one) in enumerate(given):
        first = len(rows)
        if isinstance(one, Between):
            table.numbers[c] = one.start, one.end
        elif isinstance(one, After):
            (table.watched[c], task), (f, g, e) = watched[one.task], begins[one.task]
            table.numbers[c, 0] = one.hold
            own = task.rows(robot)
            units = [row.unit for row in own]
            for j, row in enumerate(own):
                rows.append((f + j, g + j, error_row(task, e + j, row), first + units.index(row.unit)))
                bounds.append((0.0, one.within.get(row.unit, one.within.get("", math.inf))))
        else:
            begin, count = next(whiles), len(one.function.rows(robot))
            table.numbers[c, 0] = one.margin
            rows += [(begin + j, 0, 0, 0) for j in range(count)]
            lower, upper = (np.broadcast_to(bound, count) for bound in (one.lower, one.upper))
            bounds += zip(lower.tolist(), upper.tolist(), strict=True)
        table.first[c + 1] = len(rows)
    return table._replace(
        rows=np.array(rows, dtype=np.int64).reshape(-1, 4), bounds=np.array(bounds).reshape(-1, 2)
    )
