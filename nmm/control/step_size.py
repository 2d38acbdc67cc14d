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

import numpy as np

from nmm.arrays import Array, Integers
from nmm.control.equations import ControlStep, resolve
from nmm.errors import InputError
from nmm.functions.function import Function
from nmm.functions.program import Buffers, Program, run
from nmm.kernels.compiled import compiled
from nmm.kernels.memory import Blocks
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
        kinematics: str,
    ) -> None:
        if resolver.alpha_at is None:
            raise InputError(f"step: resolver {resolver.name} has no α to choose")
        if not terms:
            raise InputError("step: armijo chooses α by the objective, and there is none")
        self._program = Program(robot, [function for _, function, _ in terms], kinematics)
        self._program.lay_out()
        rows = zip(self._program.first_rows, terms, strict=True)
        self._rows = np.array([first + row for first, (_, _, row) in rows])
        self._weights = np.array([weight for weight, _, _ in terms])
        self._found, self._blocks = found, blocks
        self._alpha = found.numbers[resolver.alpha_at : resolver.alpha_at + 1]
        self._whole = float(self._alpha[0])
        #: What solving again with another α changes.
        self._kept = (*found.answer, found.q_dot, found.state, found.problem.active, found.problem.before)

    @property
    def share(self) -> float:
        """The α in use, as a share of the resolver's own."""
        return float(self._alpha[0]) / self._whole

    @share.setter
    def share(self, share: float) -> None:
        self._alpha[0] = share * self._whole if share < 1.0 else self._whole

    def shorten(self, t: float, q: Array) -> None:
        """Find α for the sample at (t, q), whose inputs with the whole α have just been found."""
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
            change, rounding = there - value, ROUNDING * (size + size_there)
            if change <= DECREASE * slope or (
                change <= rounding and (abs(slope) <= rounding or ahead <= (2.0 * DECREASE - 1.0) * slope)
            ):
                if trial == 0:
                    for one, before in zip(self._kept, asked, strict=True):
                        one[...] = before
                    self.share = 1.0
                return
            # The least value of the parabola through what is known.
            least = -0.5 * slope / (change - slope) if math.isfinite(change) else LEAST
            share *= min(max(least, LEAST), MOST)
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
