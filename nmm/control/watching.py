"""The conditions of tasks over many samples in one compiled call, up to the first that changes something."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numba import types

from nmm.arrays import Array, Flags, Integers
from nmm.control.equations import PLAIN, WRAPPED
from nmm.functions.function import Row
from nmm.functions.program import LaidOut, run
from nmm.functions.tasks.conditions import After, Between, Condition
from nmm.functions.tasks.task import Task
from nmm.kernels.compiled import compiled_without_gil, integer_scratch, scratch, view
from nmm.kernels.memory import IntegerMatrix, IntegerVector, Matrix, record_type, views

#: Times that differ by less are one, s.
SAME = 1e-9

BETWEEN, WHILE, AFTER = range(3)


class Conditions(NamedTuple):
    """Conditions and the rows that they look at.

    kinds, tasks (c,) : of each BETWEEN, WHILE or AFTER, and whose it is
    watched (c,) : the task that an AFTER waits for
    first (c + 1,) : where the rows of each begin
    numbers (c, 2) : start and end, s; margin, 0; how long it holds, s, 0
    rows (r, 4) : in the program the row of f, of g and of e or PLAIN or WRAPPED, as in `TaskRows`, and the
        first row of the same unit; of a WHILE its function's row alone
    bounds (r, 2) : of a WHILE lowest and highest value; of an AFTER 0 and the tolerance
    """

    kinds: IntegerVector
    tasks: IntegerVector
    watched: IntegerVector
    first: IntegerVector
    numbers: Matrix
    rows: IntegerMatrix
    bounds: Matrix


#: times (N,), q (N, n), the program's blocks, the conditions, which tasks are active and which over, what is
#: remembered, and room for what was remembered before that.
WATCH = types.int64(
    *(types.float64[::1], types.Array(types.float64, 2, "C"), types.int64[::1], types.float64[::1]),
    *(
        record_type(Conditions),
        types.boolean[::1],
        types.boolean[::1],
        types.float64[::1],
        types.float64[::1],
    ),
)


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
    """How many samples have the active tasks.

    memory, before (c,) : what is remembered (see `Moment`); become that after the last of them, and after the
        one before it
    """
    b = views(LaidOut, integers, floats, 0).buffers
    n, count = q.shape[1], those.kinds.shape[0]
    now, holds = scratch(count), integer_scratch(count)
    for k in range(times.shape[0]):
        t = times[k]
        run(t, view(q, k * n, (n,)), integers, floats)
        for c in range(count):
            first, last, was = those.first[c], those.first[c + 1], memory[c]
            if those.kinds[c] == BETWEEN:
                now[c] = 0.0
                holds[c] = 1 if those.numbers[c, 0] - SAME <= t < those.numbers[c, 1] - SAME else 0
                continue
            within = True
            if those.kinds[c] == WHILE:
                wider = those.numbers[c, 0] if was == 1.0 else 0.0
                for i in range(first, last):
                    value = b.value[those.rows[i, 0]]
                    within = within and (
                        those.bounds[i, 0] - wider <= value and value <= those.bounds[i, 1] + wider
                    )
                now[c], holds[c] = 1.0 if within else 0.0, 1 if within else 0
                continue
            for i in range(first, last):
                if those.rows[i, 3] != i:
                    continue
                square = 0.0
                for j in range(i, last):
                    if those.rows[j, 3] == i:
                        error = b.value[those.rows[j, 1]] - b.value[those.rows[j, 0]]
                        if those.rows[j, 2] >= 0:
                            error = b.value[those.rows[j, 2]]
                        elif those.rows[j, 2] == WRAPPED:
                            error = math.pi - (math.pi - error) % (2.0 * math.pi)
                        square += error * error
                within = within and math.sqrt(square) <= those.bounds[i, 1]
            if was == -math.inf:
                now[c] = was
            elif not (active[those.watched[c]] and within):
                now[c] = math.nan
            else:
                since = t if math.isnan(was) else was
                now[c] = -math.inf if t - since >= those.numbers[c, 0] - SAME else since
            holds[c] = 1 if now[c] == -math.inf else 0
        for task in range(active.shape[0]):
            wanted = not over[task]
            for c in range(count):
                wanted = wanted and (those.tasks[c] != task or holds[c] == 1)
            if wanted != active[task]:
                return k
        for c in range(count):
            before[c], memory[c] = memory[c], now[c]
    return int(times.shape[0])


def conditions(
    given: Sequence[tuple[int, Condition]],
    watched: Sequence[tuple[int, Task, Sequence[Row], Sequence[int]]],
    looked_at: Sequence[tuple[int, int]],
) -> Conditions:
    """The table of conditions, each with the number of its task.

    Parameters
    ----------
    watched : for each AFTER, in turn, the task's number, the task, its rows, and where f, g and e begin
    looked_at : for each WHILE, in turn, where its function begins, and how many rows it has
    """
    table = Conditions(
        kinds=np.array([_kind(one) for _, one in given], dtype=np.int64),
        tasks=np.array([i for i, _ in given], dtype=np.int64),
        watched=np.zeros(len(given), dtype=np.int64),
        first=np.zeros(len(given) + 1, dtype=np.int64),
        numbers=np.zeros((len(given), 2)),
        rows=np.zeros((0, 4), dtype=np.int64),
        bounds=np.zeros((0, 2)),
    )
    rows: list[tuple[int, int, int, int]] = []
    bounds: list[tuple[float, float]] = []
    afters, whiles = iter(watched), iter(looked_at)
    for c, (_, one) in enumerate(given):
        first = len(rows)
        if isinstance(one, Between):
            table.numbers[c] = one.start, one.end
        elif isinstance(one, After):
            table.watched[c], task, own, (f, g, e) = next(afters)
            table.numbers[c, 0] = one.hold
            units = [row.unit for row in own]
            for j, row in enumerate(own):
                compared = (
                    e + j if task.function.comparison is not None else WRAPPED if row.angular else PLAIN
                )
                rows.append((f + j, g + j, compared, first + units.index(row.unit)))
                bounds.append((0.0, one.within.get(row.unit, one.within.get("", math.inf))))
        else:
            begins, count = next(whiles)
            table.numbers[c, 0] = one.margin
            rows += [(begins + j, 0, 0, 0) for j in range(count)]
            lower, upper = (np.broadcast_to(bound, count) for bound in (one.lower, one.upper))
            bounds += zip(lower.tolist(), upper.tolist(), strict=True)
        table.first[c + 1] = len(rows)
    return table._replace(
        rows=np.array(rows, dtype=np.int64).reshape(-1, 4), bounds=np.array(bounds).reshape(-1, 2)
    )


def _kind(one: Condition) -> int:
    return BETWEEN if isinstance(one, Between) else AFTER if isinstance(one, After) else WHILE
