"""The step size α of the objective's gradient, by Armijo's rule along the motion of one sample.

Sampled, the descent of H ends where α dt is beyond 2 / L, L the curvature of H: each sample then overshoots.
With u(α) the resolver's inputs and d = u(α) - u(0) what the gradient adds to them, α is shortened until

    H(q + dt S d) <= H(q) + c dt h·d,   h = Sᵀ ∂H/∂q, h·d <= 0,

as it was found at the sample; it holds through an integrator's stages. u(α) is the resolver's own answer with
that α: what the task gets of its rate is the resolver's business, and λ does not depend on α.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numba import types

from nmm.arrays import Array, Integers
from nmm.control.equations import ControlStep, resolve
from nmm.errors import InputError
from nmm.functions.function import Function
from nmm.functions.program import BESIDE, COMPILED, Buffers, LaidOut, Program, run
from nmm.kernels.compiled import caller, checked_by_caller, compiled, integer_scratch, kernel, scratch
from nmm.kernels.memory import Blocks, Cell, IntegerVector, Vector, views
from nmm.resolvers.answer import SINGULAR_J
from nmm.resolvers.base import Resolver
from nmm.robots.robot import Robot

#: c: a parabola's motion then ends no farther than 1.5 times as far as its least value.
DECREASE = 0.25
#: A trial's α is between these shares of the one before,
LEAST, MOST = 0.1, 0.5
#: and after so many trials the gradient is left out.
TRIALS = 25
#: Differences of H below this share of its terms are rounding: for a parabola the slope there says the same.
ROUNDING = 1e-13


@compiled
def descended(rows: Integers, weights: Array, b: Buffers, motion: Array) -> tuple[float, float, float]:
    """The value that is descended, the size of its terms, and its slope along a motion (n,)."""
    value = size = slope = 0.0
    for i in range(rows.shape[0]):
        term = weights[i] * b.value[rows[i]]
        value += term
        size += abs(term)
        for j in range(motion.shape[0]):
            slope += weights[i] * b.value_q[rows[i], j] * motion[j]
    return value, size, slope


@compiled
def apart(h: Array, u: Array, rest: Array, q_dot: Array, resting: Array, dt: float, motion: Array) -> float:
    """motion = dt S d; returns dt h·d, with d = u - rest."""
    slope = 0.0
    for j in range(u.shape[0]):
        slope += h[j] * (u[j] - rest[j])
    for i in range(q_dot.shape[0]):
        motion[i] = dt * (q_dot[i] - resting[i])
    return dt * slope


@compiled
def falls(change: float, slope: float, ahead: float, rounding: float) -> bool:
    """Whether what is descended has fallen enough, by `change`; slopes at the beginning and the end."""
    if change <= DECREASE * slope:
        return True
    return change <= rounding and (abs(slope) <= rounding or ahead <= (2.0 * DECREASE - 1.0) * slope)


@compiled
def shorter(change: float, slope: float) -> float:
    """The next α's share of this one: the least value of the parabola through what is known."""
    least = -0.5 * slope / (change - slope) if math.isfinite(change) else LEAST
    return min(max(least, LEAST), MOST)


class Descent(NamedTuple):
    """What α is chosen by, beside the program of what is descended; its place in memory is `BESIDE`.

    rows, weights (k,) : descended is the sum of weights[i] times the program's row rows[i]
    alpha_at : where α is among the resolver's numbers
    whole () : the resolver's own α
    """

    rows: IntegerVector
    weights: Vector
    alpha_at: int
    whole: Cell


@compiled
def set_aside(e: ControlStep, numbers: Array, integers: Integers) -> None:
    """Copy what solving again with another α changes."""
    m, n, levels = e.answer.u.shape[0], e.q_dot.shape[0], e.answer.scale.shape[0]
    active = e.problem.active.shape[0]
    for j in range(m):
        numbers[j], numbers[m + j] = e.answer.u[j], e.problem.before[j]
    for i in range(n):
        numbers[2 * m + i] = e.q_dot[i]
    for i in range(levels):
        numbers[2 * m + n + i] = e.answer.scale[i]
    rest = 2 * m + n + levels
    numbers[rest], numbers[rest + 1] = e.answer.status[()], e.answer.residual[()]
    numbers[rest + 2], numbers[rest + 3] = e.answer.measure[()], e.answer.excess[()]
    for i in range(active):
        integers[i] = e.problem.active[i]
    for i in range(e.state.shape[0]):
        integers[active + i] = e.state[i]


@compiled
def put_back(e: ControlStep, numbers: Array, integers: Integers) -> None:
    """What `set_aside` copied."""
    m, n, levels = e.answer.u.shape[0], e.q_dot.shape[0], e.answer.scale.shape[0]
    active = e.problem.active.shape[0]
    for j in range(m):
        e.answer.u[j], e.problem.before[j] = numbers[j], numbers[m + j]
    for i in range(n):
        e.q_dot[i] = numbers[2 * m + i]
    for i in range(levels):
        e.answer.scale[i] = numbers[2 * m + n + i]
    rest = 2 * m + n + levels
    e.answer.status[()], e.answer.residual[()] = numbers[rest], numbers[rest + 1]
    e.answer.measure[()], e.answer.excess[()] = numbers[rest + 2], numbers[rest + 3]
    for i in range(active):
        e.problem.active[i] = integers[i]
    for i in range(e.state.shape[0]):
        e.state[i] = integers[active + i]


#: t, q, the control step's blocks, those of what is descended.
SHORTEN = types.void(
    *(types.float64, types.float64[::1], types.int64[::1], types.float64[::1]),
    *(types.int64[::1], types.float64[::1]),
)

call_shorten = caller(SHORTEN)


@kernel(SHORTEN)
def shorten(
    t: float, q: Array, integers: Integers, floats: Array, own_integers: Integers, own_floats: Array
) -> None:
    """`StepSize.shorten` where no user's Python function is descended."""
    e = views(ControlStep, integers, floats, BESIDE)
    own = views(Descent, own_integers, own_floats, BESIDE)
    b = views(LaidOut, own_integers, own_floats, 0).buffers
    answer = e.answer
    if answer.status[()] >= SINGULAR_J:
        return
    m, n = answer.u.shape[0], q.shape[0]
    asked = scratch(2 * m + n + answer.scale.shape[0] + 4)
    asked_integers = integer_scratch(e.problem.active.shape[0] + e.state.shape[0])
    set_aside(e, asked, asked_integers)
    u, rest, q_dot, resting = scratch(m), scratch(m), scratch(n), scratch(n)
    motion, there_q = scratch(n), scratch(n)
    for j in range(m):
        u[j] = answer.u[j]
    for i in range(n):
        q_dot[i], motion[i] = e.q_dot[i], 0.0
    dt = e.problem.dt[()]
    e.numbers[own.alpha_at] = 0.0
    resolve(q, integers, floats)
    for j in range(m):
        rest[j] = answer.u[j]
    for i in range(n):
        resting[i] = e.q_dot[i]
    run(t, q, own_integers, own_floats)
    value, size, _ = descended(own.rows, own.weights, b, motion)
    share = 1.0
    for trial in range(TRIALS):
        slope = apart(e.problem.h, u, rest, q_dot, resting, dt, motion)
        for i in range(n):
            there_q[i] = q[i] + motion[i]
        run(t, there_q, own_integers, own_floats)
        there, size_there, ahead = descended(own.rows, own.weights, b, motion)
        if falls(there - value, slope, ahead, ROUNDING * (size + size_there)):
            if trial == 0:
                put_back(e, asked, asked_integers)
                e.numbers[own.alpha_at] = own.whole[()]
            return
        share *= shorter(there - value, slope)
        e.numbers[own.alpha_at] = share * own.whole[()]
        resolve(q, integers, floats)
        for j in range(m):
            u[j] = answer.u[j]
        for i in range(n):
            q_dot[i] = e.q_dot[i]
    e.numbers[own.alpha_at] = 0.0
    resolve(q, integers, floats)


class StepSize:
    """α of a controller's resolver, chosen anew at each sample.

    Parameters
    ----------
    robot, resolver : the controller's
    terms : what is descended is the sum of weight times the function's row: [(weight, function, row)]
    found, blocks : the control step in memory

    Attributes
    ----------
    share () : the α in use, as a share of the resolver's own

    Raises
    ------
    InputError : a resolver without α, or nothing to descend
    """

    def __init__(
        self,
        robot: Robot,
        resolver: Resolver,
        terms: Sequence[tuple[float, Function, int]],
        found: ControlStep,
        blocks: Blocks,
    ) -> None:
        if resolver.alpha_at is None:
            raise InputError(f"step: resolver {resolver.name} has no α to choose")
        if not terms:
            raise InputError("step: armijo chooses α by the objective, and there is none")
        # Compiled, so that α does not depend on who makes the samples.
        self._program = Program(robot, [function for _, function, _ in terms], COMPILED)
        rows = zip(self._program.first_rows, terms, strict=True)
        self._rows = np.array([first + row for first, (_, _, row) in rows])
        self._weights = np.array([weight for weight, _, _ in terms])
        self._found, self._blocks = found, blocks
        self._alpha = found.numbers[resolver.alpha_at : resolver.alpha_at + 1]
        self._whole = float(self._alpha[0])
        self._program.lay_out(Descent(self._rows, self._weights, resolver.alpha_at, np.array(self._whole)))
        #: What solving again with another α changes.
        self._kept = (*found.answer, found.q_dot, found.state, found.problem.active, found.problem.before)

    @property
    def compiled(self) -> bool:
        """Whether no user's Python function is descended."""
        return not self._program.calls_python

    @property
    def blocks(self) -> Blocks:
        """What `shorten` gets beside the control step's."""
        return self._program.blocks

    @property
    def share(self) -> float:
        """The α in use, as a share of the resolver's own."""
        return float(self._alpha[0]) / self._whole

    @share.setter
    def share(self, share: float) -> None:
        self._alpha[0] = share * self._whole if share < 1.0 else self._whole

    def shorten(self, t: float, q: Array) -> None:
        """Find α for the sample at (t, q), whose inputs with the whole α have just been found."""
        if self.compiled:
            checked_by_caller(shorten.compiled, SHORTEN)(t, q, *self._blocks, *self._program.blocks)
            return
        found = self._found
        answer, dt, h = found.answer, float(found.problem.dt), found.problem.h
        if answer.status[()] >= SINGULAR_J:
            return
        asked = [one.copy() for one in self._kept]
        u, q_dot = answer.u.copy(), found.q_dot.copy()
        self._solve(0.0, q)
        rest, resting = answer.u.copy(), found.q_dot.copy()
        motion = np.zeros_like(q)
        value, size, _ = self._descended(t, q, motion)
        share = 1.0
        for trial in range(TRIALS):
            slope = apart(h, u, rest, q_dot, resting, dt, motion)
            there, size_there, ahead = self._descended(t, q + motion, motion)
            if falls(there - value, slope, ahead, ROUNDING * (size + size_there)):
                if trial == 0:
                    for one, before in zip(self._kept, asked, strict=True):
                        one[...] = before
                    self.share = 1.0
                return
            share *= shorter(there - value, slope)
            self._solve(share, q)
            u[:], q_dot[:] = answer.u, found.q_dot
        self._solve(0.0, q)

    def _solve(self, share: float, q: Array) -> None:
        self.share = share
        resolve(q, *self._blocks)

    def _descended(self, t: float, q: Array, motion: Array) -> tuple[float, float, float]:
        program = self._program
        program.prepare(t, q)
        run(t, q, *program.blocks)
        found: tuple[float, float, float] = descended(self._rows, self._weights, program.buffers, motion)
        return found
