"""A user's own resolver, written in Python."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from nmm.base.arrays import Array, Integers
from nmm.base.errors import InputError
from nmm.base.kernels.compiled import Kernel, clear, kernel
from nmm.base.kernels.linear_algebra import residual_norm
from nmm.control.resolvers.answer import SOLVED, Answer, AnswerArrays, Status, certified
from nmm.control.resolvers.base import RESOLVER, Resolver, Setup
from nmm.control.resolvers.limit_check import bring_within
from nmm.control.resolvers.problem import Dimensions, Problem
from nmm.control.resolvers.problem_arrays import ProblemArrays


@kernel(RESOLVER)
def left_to_python(
    problem: ProblemArrays, numbers: Array, options: Integers, state: Integers, answer: AnswerArrays
) -> None:
    """Write zeros; `CallableResolver.finish` computes the inputs after the compiled step, and limits them."""
    clear(answer.u)
    answer.status[()], answer.excess[()] = SOLVED, 0.0


#: Limited inputs are the nearest to the function's in the Euclidean norm.
NO_METRIC: Array = np.zeros((0, 0))


class CallableResolver(Resolver):
    """u from a Python function of a `Problem` (problem.J, .rate, .h, ...): (m,) inputs, or an `Answer`.

    J u is compared with the rate: an answer that differs is INEXACT, which a run reports. A function that
    scales or damps the rate on purpose returns an `Answer` with status RELAXED and its nu.

    Parameters
    ----------
    function : problem -> u; it may raise `numpy.linalg.LinAlgError` when J is singular

    Examples
    --------
    >>> robot = nmm.load("unicycle_2r")
    >>> least_norm = nmm.CallableResolver(lambda problem: np.linalg.pinv(problem.J) @ problem.rate)
    >>> controller = nmm.Controller(robot, nmm.Task(nmm.Position("ee", "xy"), [2.0, 1.0]), least_norm)
    >>> nmm.simulate(controller, robot.q({"q2": 0.5}), 10).complete
    True
    """

    name: ClassVar[str] = "callable"
    exact: ClassVar[bool] = False
    kernel: ClassVar[Kernel] = left_to_python

    def __init__(self, function: Callable[[Problem], ArrayLike | Answer]) -> None:
        self.function = function

    def setup(self, dimensions: Dimensions) -> Setup:
        self.check(dimensions)
        return Setup(np.zeros(0))

    def finish(self, problem: ProblemArrays, dimensions: Dimensions, answer: AnswerArrays) -> None:
        answer.measure[()] = np.nan
        answer.nu[:] = 1.0
        answer.excess[()] = np.nan
        if not all(np.isfinite(array).all() for array in (problem.J, problem.rate, problem.h)):
            answer.status[()] = Status.NOT_FINITE
            return
        try:
            result = self.function(Problem.of(problem, dimensions))
        except np.linalg.LinAlgError:
            answer.status[()] = Status.SINGULAR_J
            return
        u = np.asarray(result.u if isinstance(result, Answer) else result, dtype=np.float64)
        if u.shape != answer.u.shape:
            raise InputError(where="callable resolver", expected=f"u of shape {answer.u.shape}", got=u)
        answer.u[:] = u
        residual, rounding = residual_norm(problem.J, answer.u, problem.rate)
        answer.residual[()] = residual
        answer.status[()] = certified(residual, rounding, math.hypot(*problem.rate))
        if isinstance(result, Answer):
            answer.measure[()] = result.measure
            if result.status is not Status.SOLVED and answer.status[()] < Status.SINGULAR_J:
                answer.status[()] = result.status
                answer.nu[:] = result.nu
        bring_within(problem, NO_METRIC, answer)
