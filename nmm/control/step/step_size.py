"""The step size α of the objective's gradient, by Armijo's rule along the motion of one sample.

In a sampled loop H no longer falls where α dt is beyond 2 / L, L the curvature of H: each sample overshoots.
With u(α) the resolver's inputs and d = u(α) - u(0) the gradient's part, α is shortened until

    H(q + dt S d) <= H(q) + c dt h·d,   h = Sᵀ ∂H/∂q, h·d <= 0,

and then holds through the sample's stages. u(α) is the resolver's own answer for that α: the task's share λ
remains the resolver's decision and does not depend on α. At order 2 u(α) is the answer that u follows.
"""

import math
from collections.abc import Callable, Sequence
from functools import cached_property
from typing import NamedTuple

import numpy as np

from nmm.base.arrays import Array, Integers
from nmm.base.errors import InputError
from nmm.base.kernels.compiled import caller, checked_by_caller, clear, compiled, kernel
from nmm.base.kernels.linear_algebra import add, copied
from nmm.base.kernels.record_layout import (
    Blocks,
    Cell,
    IntegerCell,
    IntegerVector,
    Vector,
    keep,
    put_back,
    sampled,
    views,
)
from nmm.base.kernels.signatures import boolean, float64, int64, void
from nmm.control.functions.function import Function
from nmm.control.functions.program import BESIDE, COMPILED, Buffers, LaidOut, Program, run_program
from nmm.control.resolvers.answer import SINGULAR_J
from nmm.control.resolvers.base import Resolver
from nmm.control.step.acceleration import follow_answer
from nmm.control.step.equations import ControlStep, drive, resolve
from nmm.model.robots.robot import Robot

#: c: on a parabola the step is then at most 1.5 times that to the minimum.
DECREASE = 0.25
#: Each trial's α is between these shares of the previous one's,
LEAST, MOST = 0.1, 0.5
#: and after this many trials the gradient is left out.
TRIALS = 25
#: Differences of H below this share of its terms are rounding; then the slope at the end decides.
ROUNDING = 1e-13


@compiled
def descended(rows: Integers, weights: Array, b: Buffers, motion: Array) -> tuple[float, float, float]:
    """The value of H, the size of its terms, and its slope along a motion (n,)."""
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
    """Whether `change` lowers H enough; slope and ahead are its slopes at the beginning and the end."""
    if change <= DECREASE * slope:
        return True
    return change <= rounding and (abs(slope) <= rounding or ahead <= (2.0 * DECREASE - 1.0) * slope)


@compiled
def shorter(change: float, slope: float) -> float:
    """The next trial's share of this α: the minimum of the parabola through the known values and slope."""
    least = -0.5 * slope / (change - slope) if math.isfinite(change) else LEAST
    return min(max(least, LEAST), MOST)


class Descent(NamedTuple):
    """The search for α, in its own memory at `BESIDE`, beside the program of H.

    rows, weights (k,) : H is the sum of weights[i] times the program's row rows[i]
    alpha_at, whole () : where α is among the resolver's numbers, and its full value
    turn () : of the search; value (), size () : of H at q, and the size of its terms
    share () : of α, in the trial; slope () : along its motion (n,), which leads to `q_trial` (n,)
    u, rest (m,), q_dot, resting (n,) : inputs of the trial and without the gradient, and their motions
    asked_integers, asked : the sampled numbers for the full α
    """

    rows: IntegerVector
    weights: Vector
    alpha_at: int
    whole: Cell
    turn: IntegerCell
    value: Cell
    size: Cell
    share: Cell
    slope: Cell
    motion: Vector
    q_trial: Vector
    u: Vector
    rest: Vector
    q_dot: Vector
    resting: Vector
    asked_integers: IntegerVector
    asked: Vector


@compiled
def answered(e: ControlStep, u: Array, q_dot: Array) -> None:
    copied(e.answer.u, u)
    copied(e.q_dot, q_dot)


#: q, the control step's blocks, those of H.
SEARCH = boolean(
    *(float64[::1], int64[::1], float64[::1]),
    *(int64[::1], float64[::1]),
)


@compiled
def search(q: Array, integers: Integers, floats: Array, own_integers: Integers, own_floats: Array) -> bool:
    """One turn of the search for α; True where H is to be evaluated at `q_trial` for the next turn.

    The first turn, after the step with the full α, finds the answer without the gradient; the second knows H
    at q; each later one knows H at the end of a trial's motion, and accepts α or shortens it.
    """
    e = views(ControlStep, integers, floats, BESIDE)
    own = views(Descent, own_integers, own_floats, BESIDE)
    turn = own.turn[()]
    own.turn[()] += 1
    if turn == 0:
        if e.answer.status[()] >= SINGULAR_J:
            return False
        keep(integers, floats, own.asked_integers, own.asked)
        copied(e.answer.u, own.u)
        drive(own.u, views(LaidOut, integers, floats, 0).buffers.G, e.arm, own.q_dot)
        e.numbers[own.alpha_at] = 0.0
        resolve(q, integers, floats)
        answered(e, own.rest, own.resting)
        own.share[()] = 1.0
        copied(q, own.q_trial)
        clear(own.motion)
        return True
    b = views(LaidOut, own_integers, own_floats, 0).buffers
    value, size, ahead = descended(own.rows, own.weights, b, own.motion)
    if turn == 1:
        own.value[()], own.size[()] = value, size
    else:
        change = value - own.value[()]
        if falls(change, own.slope[()], ahead, ROUNDING * (own.size[()] + size)):
            if turn == 2:
                put_back(integers, floats, own.asked_integers, own.asked)
            elif e.second.u_dot.shape[0] > 0:
                follow_answer(integers, floats)
            return False
        own.share[()] *= shorter(change, own.slope[()])
        e.numbers[own.alpha_at] = own.share[()] * own.whole[()]
        resolve(q, integers, floats)
        if turn == TRIALS + 1:
            e.numbers[own.alpha_at] = 0.0
            resolve(q, integers, floats)
            if e.second.u_dot.shape[0] > 0:
                follow_answer(integers, floats)
            return False
        answered(e, own.u, own.q_dot)
    dt = e.problem.dt[()]
    own.slope[()] = apart(e.problem.h, own.u, own.rest, own.q_dot, own.resting, dt, own.motion)
    copied(q, own.q_trial)
    add(own.q_trial, 1.0, own.motion)
    return True


#: t, q, the control step's blocks, those of H.
SHORTEN = void(float64, *SEARCH.args)

call_shorten = caller(SHORTEN)


@kernel(SHORTEN)
def shorten(
    t: float, q: Array, integers: Integers, floats: Array, own_integers: Integers, own_floats: Array
) -> None:
    """`StepSize.shorten` where H contains no user's Python function."""
    own = views(Descent, own_integers, own_floats, BESIDE)
    own.turn[()] = 0
    while search(q, integers, floats, own_integers, own_floats):
        run_program(t, own.q_trial, own_integers, own_floats)


class StepSize:
    """α of a controller's resolver, chosen anew at each sample; `InputError` without α or terms.

    terms : [(weight, function, row)] of H, the sum of weight times the function's row
    step, blocks : the control step in memory
    """

    def __init__(
        self,
        robot: Robot,
        resolver: Resolver,
        terms: Sequence[tuple[float, Function, int]],
        step: ControlStep,
        blocks: Blocks,
    ) -> None:
        if resolver.alpha_at is None:
            raise InputError(f"resolver {resolver.name} has no α to choose", where="step")
        if not terms:
            raise InputError("armijo chooses α by the objective, and there is none", where="step")
        # Compiled, so that α is the same in Python and in compiled loops.
        self._program = Program(robot, [function for _, function, _ in terms], COMPILED)
        rows = zip(self._program.first_rows, terms, strict=True)
        self._blocks, n, m = blocks, robot.n, robot.n_u
        self._alpha = step.numbers[resolver.alpha_at : resolver.alpha_at + 1]
        self._whole = float(self._alpha[0])
        asked_integers, asked = sampled(*blocks)
        own = Descent(
            rows=np.array([first + row for first, (_, _, row) in rows]),
            weights=np.array([weight for weight, _, _ in terms]),
            alpha_at=resolver.alpha_at,
            whole=np.array(self._whole),
            turn=np.array(0),
            value=np.array(0.0),
            size=np.array(0.0),
            share=np.array(0.0),
            slope=np.array(0.0),
            motion=np.zeros(n),
            q_trial=np.zeros(n),
            u=np.zeros(m),
            rest=np.zeros(m),
            q_dot=np.zeros(n),
            resting=np.zeros(n),
            asked_integers=asked_integers,
            asked=asked,
        )
        self._program.lay_out(own)
        self._own = views(Descent, *self._program.blocks, BESIDE)

    @property
    def compiled(self) -> bool:
        """Whether H contains no user's Python function."""
        return not self._program.calls_python

    @property
    def blocks(self) -> Blocks:
        return self._program.blocks

    @property
    def share(self) -> float:
        return float(self._alpha[0]) / self._whole

    @share.setter
    def share(self, share: float) -> None:
        self._alpha[0] = share * self._whole if share < 1.0 else self._whole

    def shorten(self, t: float, q: Array) -> None:
        """Find α for the sample at (t, q), whose inputs for the full α were just computed."""
        blocks, program = (*self._blocks, *self._program.blocks), self._program
        if self.compiled:
            self._whole_search(t, q, *blocks)
            return
        turn, q_trial = self._turn, self._own.q_trial
        self._own.turn[()] = 0
        while turn(q, *blocks):
            program.prepare(t, q_trial)
            run_program(t, q_trial, *program.blocks)

    @cached_property
    def _whole_search(self) -> Callable[..., None]:
        return checked_by_caller(shorten.compiled, SHORTEN)

    @cached_property
    def _turn(self) -> Callable[..., bool]:
        return checked_by_caller(search, SEARCH)
