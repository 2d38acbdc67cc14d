"""The closed loop over many samples in one compiled call, without the GIL.

It does what `closed_loop` does from sample to sample, to the last digit, as long as nothing out of the
ordinary happens; where something does, it stops before it, and `closed_loop` sees to that step.
"""

from __future__ import annotations

import math
import time
from typing import NamedTuple

import numpy as np
from numba import types

from nmm.arrays import Array, Integers
from nmm.control.controller import Controller
from nmm.control.equations import ControlStep, call_step
from nmm.control.goal import Goal
from nmm.control.integrators import Integrator
from nmm.control.step_size import Descent, call_shorten, shorten
from nmm.control.stepping import Tableau, go_on, tableau
from nmm.functions.program import BESIDE, LaidOut
from nmm.kernels.compiled import (
    checked_by_caller,
    compiled,
    compiled_without_gil,
    integer_scratch,
    scratch,
    view,
)
from nmm.kernels.memory import IntegerVector, Vector, record_type, views
from nmm.resolvers.answer import SINGULAR_J
from nmm.resolvers.partitions import COLUMNS, FREE, HELD, MODE, OVERDUE, SIGN, PartitionState
from nmm.resolvers.state import State
from nmm.runs.recorded import Recorded, note

#: Coordinates or inputs whose norm is beyond this have diverged, m, rad, m/s or rad/s.
BOUND = 1e6
#: How long a call lasts at most, about, s: nothing interrupts it.
A_CALL = 0.03
#: So many times the samples of the longest call before a call has at most, by the time that those took.
MOST_TIMES = 64


class Ends(NamedTuple):
    """Where a run ends before its time.

    units (s,) : of the task's rows: 0 m, 1 rad, -1 another
    tolerances (2,) : norms of the error over rows of metres and of radians that are an arrival; negative
        where there is no goal
    """

    units: IntegerVector
    tolerances: Vector


class Choice(NamedTuple):
    """How α is chosen at each sample: where the code of `shorten` begins, 0 where it is constant, and the
    blocks of what is descended."""

    code: int
    integers: IntegerVector
    floats: Vector


FLY = types.int64(
    *(types.int64[::1], types.float64[::1], record_type(Tableau), types.float64[::1], types.int64),
    *(types.int64, types.int64, record_type(Ends), record_type(Choice), record_type(Recorded)),
)


@compiled
def remember(e: ControlStep, floats: Array, integers: Integers) -> None:
    """Copy bounds, the inputs before, the active limits and the resolver's state."""
    p = e.problem
    m, rows, active, state = p.before.shape[0], p.lower.shape[0], p.active.shape[0], e.state.shape[0]
    for j in range(m):
        floats[j], floats[m + j], floats[2 * m + j] = p.u_lower[j], p.u_upper[j], p.before[j]
    for i in range(rows):
        floats[3 * m + i], floats[3 * m + rows + i] = p.lower[i], p.upper[i]
    for i in range(active):
        integers[i] = p.active[i]
    for i in range(state):
        integers[active + i] = e.state[i]
    for j in range(m):  # rows' never change
        integers[active + state + j] = p.stops[j]


@compiled
def recall(e: ControlStep, floats: Array, integers: Integers) -> None:
    """What `remember` copied."""
    p = e.problem
    m, rows, active, state = p.before.shape[0], p.lower.shape[0], p.active.shape[0], e.state.shape[0]
    for j in range(m):
        p.u_lower[j], p.u_upper[j], p.before[j] = floats[j], floats[m + j], floats[2 * m + j]
    for i in range(rows):
        p.lower[i], p.upper[i] = floats[3 * m + i], floats[3 * m + rows + i]
    for i in range(active):
        p.active[i] = integers[i]
    for i in range(state):
        e.state[i] = integers[active + i]
    for j in range(m):
        p.stops[j] = integers[active + state + j]


@compiled
def passed_zero(e: ControlStep, before: Integers) -> bool:
    """Whether det Ja has changed its sign with the same partition (`PartitionState.may_stand`)."""
    for i in range(COLUMNS, e.state.shape[0]):
        if before[i] != e.state[i]:
            return False
    return before[SIGN] * e.state[SIGN] < 0


@compiled
def small(numbers: Array) -> bool:
    """Whether the norm is within BOUND; not with a number that is none."""
    square = 0.0
    for i in range(numbers.shape[0]):
        square += numbers[i] * numbers[i]
    return square < BOUND * BOUND


@compiled
def sample(t: float, earlier: float, q: Array, integers: Integers, floats: Array) -> float:
    """The sample at (t, q); accelerations count from the one before it, at `earlier`."""
    e = views(ControlStep, integers, floats, BESIDE)
    usual = e.limits.elapsed[()]
    if t - earlier < e.problem.dt[()] * (1.0 - 1e-9):
        e.limits.elapsed[()] = t - earlier
    status = float(call_step(e.step, t, q, integers, floats))
    e.limits.elapsed[()] = usual
    return status


@compiled
def arrived(error: Array, ends: Ends) -> bool:
    """`Goal.reached`."""
    square_m, square_rad = 0.0, 0.0
    for i in range(error.shape[0]):
        if ends.units[i] == 0:
            square_m += error[i] * error[i]
        if ends.units[i] == 1:
            square_rad += error[i] * error[i]
    return math.sqrt(square_m) <= ends.tolerances[0] and math.sqrt(square_rad) <= ends.tolerances[1]


@compiled
def alpha(e: ControlStep, choice: Choice) -> tuple[float, float]:
    """The α in use and the resolver's own; 1 and 1 where it is constant."""
    if choice.code == 0:
        return 1.0, 1.0
    own = views(Descent, choice.integers, choice.floats, BESIDE)
    return float(e.numbers[own.alpha_at]), float(own.whole[()])


@compiled
def set_alpha(e: ControlStep, choice: Choice, value: float) -> None:
    """Use that α, where it is not constant."""
    if choice.code != 0:
        own = views(Descent, choice.integers, choice.floats, BESIDE)
        e.numbers[own.alpha_at] = value


@compiled_without_gil
def fly(
    integers: Integers,
    floats: Array,
    method: Tableau,
    times: Array,
    first: int,
    last: int,
    partitioned: int,
    ends: Ends,
    choice: Choice,
    found: Recorded,
) -> int:
    """From the sample `first`, which was just made, to the sample `last`. Returns the last one recorded.

    There it stops: before a step that may not stand or fails, at a sample whose limits were widened or that
    has arrived. What is remembered is then as before that sample, which is to be made again; with no sample
    recorded, as after `first`.
    """
    e = views(ControlStep, integers, floats, BESIDE)
    b = views(LaidOut, integers, floats, 0).buffers
    p = e.problem
    n, m = found.q.shape[1], p.before.shape[0]
    size, count = 3 * m + 2 * p.lower.shape[0], p.active.shape[0] + e.state.shape[0] + m
    was, now, decided = scratch(size), scratch(size), integer_scratch(e.state.shape[0] + 1)
    was_integers, now_integers = integer_scratch(count + 1), integer_scratch(count + 1)
    ahead = scratch(n)
    remember(e, was, was_integers)
    earlier, whole = alpha(e, choice)
    reached = first
    for k in range(first + 1, last + 1):
        for i in range(e.state.shape[0]):
            decided[i] = e.state[i]
        if partitioned == 1:
            e.state[MODE] = HELD
        q = view(found.q, (k - 1) * n, (n,))
        status = go_on(times[k - 1], times[k] - times[k - 1], q, integers, floats, method, ahead)
        fine = status < SINGULAR_J and small(ahead)
        if partitioned == 1:
            fine = fine and e.state[MODE] != OVERDUE and not passed_zero(e, decided)
            e.state[MODE] = FREE
        if not fine:
            break
        remember(e, now, now_integers)
        set_alpha(e, choice, whole)
        status = sample(times[k], times[k - 1], ahead, integers, floats)
        if choice.code != 0:
            call_shorten(choice.code, times[k], ahead, integers, floats, choice.integers, choice.floats)
            status = e.answer.status[()]
        if status >= SINGULAR_J or not small(e.answer.u):
            break
        if partitioned == 1 and passed_zero(e, decided):
            break
        note(e, b, ahead, partitioned, k, found)
        found.step_size[k] = alpha(e, choice)[0] / whole
        reached = k
        for i in range(size):
            was[i] = now[i]
        for i in range(count):
            was_integers[i] = now_integers[i]
        if e.answer.excess[()] > 0.0 or arrived(e.task.error, ends):
            break
    recall(e, was, was_integers)
    if reached == first:
        set_alpha(e, choice, earlier)
    return reached


class CompiledLoop:
    """`fly` for a controller and an integrator.

    Parameters
    ----------
    until : where the run ends before its time
    """

    def __init__(self, controller: Controller, method: Tableau, until: Goal | None) -> None:
        self._controller, self._method = controller, method
        self._partitioned = int(isinstance(controller.state, PartitionState))
        codes = {"m": 0, "rad": 1}
        self._ends = Ends(
            np.array([codes.get(row.unit, -1) for row in controller.rows], dtype=np.int64),
            np.array([-1.0, -1.0] if until is None else [until.m, until.rad]),
        )
        chosen = controller.step_size
        self._choice = (
            Choice(0, np.zeros(0, dtype=np.int64), np.zeros(0))
            if chosen is None
            else Choice(shorten.address, *chosen.blocks)
        )
        self._fly = checked_by_caller(fly, FLY)
        self._at_once = 16

    def __call__(self, times: Array, first: int, last: int, found: Recorded) -> tuple[int, bool]:
        """`fly`, to `last` or as far as a short call goes: the sample reached, and whether it went so far."""
        last = min(last, first + self._at_once)
        began = time.perf_counter()
        with self._controller.compiled() as blocks:
            reached = self._fly(
                *blocks,
                self._method,
                times,
                first,
                last,
                self._partitioned,
                self._ends,
                self._choice,
                found,
            )
        if reached == last:
            fitting = 0.8 * A_CALL * (last - first) / max(time.perf_counter() - began, 1e-9)
            self._at_once = max(self._at_once, min(int(fitting), MOST_TIMES * self._at_once))
        return reached, reached == last


def compiled_loop(controller: Controller, advance: Integrator, until: Goal | None) -> CompiledLoop | None:
    """The loop of a controller that is compiled as a whole; None for another one."""
    method = tableau(advance)
    plain = type(controller.state) in (State, PartitionState) and (until is None or type(until) is Goal)
    if method is None or not (plain and controller.flies):
        return None
    return CompiledLoop(controller, method, until)
