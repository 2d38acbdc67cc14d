"""The closed loop over many samples in one compiled call, without the GIL.

It equals `closed_loop` to the last digit, and stops before anything that needs `closed_loop`.
"""

from __future__ import annotations

import math
import time
from typing import NamedTuple

import numpy as np

from nmm.base.arrays import Array, Integers
from nmm.base.kernels.compiled import (
    checked_by_caller,
    compiled,
    compiled_without_gil,
    integer_scratch,
    scratch,
    view,
)
from nmm.base.kernels.record_layout import IntegerVector, Vector, keep, kept, put_back, record_type, views
from nmm.base.kernels.signatures import float64, int64
from nmm.control.controller import Controller
from nmm.control.functions.program import BESIDE
from nmm.control.goal import Goal, norms, unit_codes
from nmm.control.plant import Disturbed, Plant, act, observe
from nmm.control.resolvers.answer import SINGULAR_J, SOLVED
from nmm.control.resolvers.base import State
from nmm.control.resolvers.partitions import COLUMNS, FREE, HELD, MODE, OVERDUE, SIGN, PartitionState
from nmm.control.step.equations import ControlStep, call_step, watch_error
from nmm.control.step.recorded import Recorded, note_held, note_sample
from nmm.control.step.step_size import Descent, call_shorten, shorten
from nmm.control.step.stepping import Tableau, end_stages, integrate_step, tableau

#: Coordinates or inputs whose norm is beyond this have diverged, m, rad, m/s or rad/s.
DIVERGED_BEYOND = 1e6
#: Longest call, about, s: it cannot be interrupted.
A_CALL = 0.03
#: A call has at most this many times the samples of the longest one before.
MOST_TIMES = 64


class Ends(NamedTuple):
    """A goal: the units of the task's rows (`unit_codes`) and tolerances, m and rad; negative: no goal."""

    units: IntegerVector
    tolerances: Vector


class StepSizeChoice(NamedTuple):
    """How α is chosen: where the code of `shorten` begins, 0 for a constant α, and the objective's blocks."""

    code: int
    integers: IntegerVector
    floats: Vector


ADVANCE_SAMPLES = int64(
    *(int64[::1], float64[::1], record_type(Tableau), float64[::1], int64),
    *(int64, int64, record_type(Ends), record_type(StepSizeChoice), record_type(Disturbed)),
    record_type(Recorded),
)


@compiled
def passed_zero(e: ControlStep, before: Integers) -> bool:
    """Whether det Ja changed sign with the same partition (`PartitionState.may_stand`)."""
    for i in range(COLUMNS, e.state.shape[0]):
        if before[i] != e.state[i]:
            return False
    return before[SIGN] * e.state[SIGN] < 0


@compiled
def within_bound(numbers: Array) -> bool:
    """Whether the norm is within BOUND; false for NaN."""
    square = 0.0
    for i in range(numbers.shape[0]):
        square += numbers[i] * numbers[i]
    return square < DIVERGED_BEYOND * DIVERGED_BEYOND


@compiled
def compiled_sample(t: float, earlier: float, q: Array, integers: Integers, floats: Array) -> float:
    """The sample at (t, q); accelerations count from the one at `earlier`."""
    e = views(ControlStep, integers, floats, BESIDE)
    if t - earlier < e.problem.dt[()] * (1.0 - 1e-9):
        e.limits.elapsed[()] = t - earlier
    status = float(call_step(e.step, t, q, integers, floats))
    e.limits.elapsed[()] = math.nan
    return status


@compiled
def arrived(error: Array, ends: Ends) -> bool:
    metres, radians = norms(error, ends.units)
    return metres <= ends.tolerances[0] and radians <= ends.tolerances[1]


@compiled
def whole_alpha(e: ControlStep, choice: StepSizeChoice) -> float:
    """Restore the resolver's own α; 1 where α is constant."""
    if choice.code == 0:
        return 1.0
    own = views(Descent, choice.integers, choice.floats, BESIDE)
    e.numbers[own.alpha_at] = own.whole[()]
    return float(own.whole[()])


@compiled
def alpha(e: ControlStep, choice: StepSizeChoice) -> float:
    """The α in use; 1 where it is constant."""
    if choice.code == 0:
        return 1.0
    return float(e.numbers[views(Descent, choice.integers, choice.floats, BESIDE).alpha_at])


@compiled_without_gil
def advance_samples(
    integers: Integers,
    floats: Array,
    method: Tableau,
    times: Array,
    first: int,
    last: int,
    partitioned: int,
    ends: Ends,
    choice: StepSizeChoice,
    disturbed: Disturbed,
    found: Recorded,
) -> int:
    """From the sample `first`, just made, towards `last`; returns the last one recorded. Stops before a step
    that fails, is rejected or leads to a retreat, and at samples that widened limits or arrived; the state is
    then as before that sample, which is to be made again (as after `first` if none was recorded). Steps of a
    disturbed robot are not rejected; q, r and errors are the robot's, not those that the controller sees."""
    e = views(ControlStep, integers, floats, BESIDE)
    n = found.q.shape[1]
    count, size = kept(integers, floats)
    both, both_integers = scratch((2, size)), integer_scratch(2 * count)
    was, was_integers = view(both, 0, (size,)), view(both_integers, 0, (count,))
    now, now_integers = view(both, size, (size,)), view(both_integers, count, (count,))
    ahead, decided = scratch(n), integer_scratch(e.state.shape[0] + 1)
    held, seen = scratch(e.answer.u.shape[0]), scratch(n)
    disturbs, noisy = disturbed.slip.shape[0] > 0, disturbed.noise.shape[0] > 0
    believes = disturbed.believed.shape[0] > 0
    keep(integers, floats, was_integers, was)
    reached = first
    for k in range(first + 1, last + 1):
        for i in range(e.state.shape[0]):
            decided[i] = e.state[i]
        keep(integers, floats, now_integers, now)
        if partitioned == 1:
            e.state[MODE] = HELD
        q = view(found.q, (k - 1) * n, (n,))
        dt = times[k] - times[k - 1]
        if disturbs:
            act(k - 1, dt, q, integers, floats, disturbed, ahead)
            status = float(SOLVED)
        else:
            status = integrate_step(times[k - 1], dt, q, integers, floats, method, ahead)
        fine = status < SINGULAR_J and within_bound(ahead)
        if partitioned == 1:
            fine = fine and e.state[MODE] != OVERDUE and not passed_zero(e, decided)
            e.state[MODE] = FREE
        if not fine:
            break
        if method.weights.shape[0] > 1 or e.second.u_dot.shape[0] > 0:
            end_stages(integers, floats, now_integers, now, method, held)
            if method.holds == 1:
                note_held(integers, floats, q, held, k - 1, found)
            keep(integers, floats, now_integers, now)
        for i in range(n):
            seen[i] = disturbed.believed[k, i] if believes else ahead[i]
            if noisy:
                seen[i] += disturbed.noise[k, i]
        whole = whole_alpha(e, choice)
        status = compiled_sample(times[k], times[k - 1], seen, integers, floats)
        if choice.code != 0:
            call_shorten(choice.code, times[k], seen, integers, floats, choice.integers, choice.floats)
            status = float(e.answer.status[()])
        if watch_error(integers, floats) or status >= SINGULAR_J or not within_bound(e.answer.u):
            break
        if partitioned == 1 and not disturbs and passed_zero(e, decided):
            break
        if noisy or believes:
            observe(times[k], ahead, integers, floats)
        note_sample(integers, floats, ahead, partitioned, alpha(e, choice) / whole, k, found)
        reached = k
        side = (reached - first) % 2
        was, was_integers = view(both, side * size, (size,)), view(both_integers, side * count, (count,))
        now = view(both, (1 - side) * size, (size,))
        now_integers = view(both_integers, (1 - side) * count, (count,))
        if e.answer.excess[()] > 0.0 or arrived(e.task.error, ends):
            break
    put_back(integers, floats, was_integers, was)
    return reached


class CompiledLoop:
    def __init__(
        self, controller: Controller, method: Tableau, disturbed: Disturbed, until: Goal | None
    ) -> None:
        self._controller, self._method, self._disturbed = controller, method, disturbed
        self._partitioned = int(isinstance(controller.solver.state, PartitionState))
        self._ends = Ends(
            unit_codes(controller.rows),
            np.array([-1.0, -1.0] if until is None else [until.m, until.rad]),
        )
        self._choice = StepSizeChoice(0, np.zeros(0, dtype=np.int64), np.zeros(0))
        if controller.solver.step_size is not None:
            self._choice = StepSizeChoice(shorten.address, *controller.solver.step_size.blocks)
        self._fly = checked_by_caller(advance_samples, ADVANCE_SAMPLES)
        self._at_once = 16

    def __call__(self, times: Array, first: int, last: int, found: Recorded) -> tuple[int, bool]:
        """One short call of `advance_samples`: the sample reached, and whether that is `last`."""
        last = min(last, first + self._at_once)
        began = time.perf_counter()
        with self._controller.solver.compiled() as blocks:
            arguments = self._method, times, first, last, self._partitioned, self._ends, self._choice
            reached = self._fly(*blocks, *arguments, self._disturbed, found)
        if reached == last:
            fitting = 0.8 * A_CALL * (last - first) / max(time.perf_counter() - began, 1e-9)
            self._at_once = max(self._at_once, min(int(fitting), MOST_TIMES * self._at_once))
        return reached, reached == last


def compiled_loop(controller: Controller, plant: Plant, until: Goal | None) -> CompiledLoop | None:
    """The loop of a controller that compiles as a whole, else None."""
    method = tableau(plant.integrator)
    plain = type(controller.solver.state) in (State, PartitionState) and type(until) in (Goal, type(None))
    if method is None or plant.believing is not None or not (plain and controller.solver.compiles_runs):
        return None
    return CompiledLoop(controller, method, plant.disturbed, until)
