"""Resolvers as a stranger writes them after docs/architecture.md: one that is not exact, one that is."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from nmm.base.arrays import Array, Integers, positive
from nmm.base.kernels.compiled import Kernel, clear, integer_scratch, kernel, scratch
from nmm.base.kernels.linear_algebra import closest_solution, orthonormal_rows
from nmm.control.resolvers.answer import SINGULAR_J, AnswerArrays, certify
from nmm.control.resolvers.base import NO_OPTIONS, RESOLVER, Resolver, Setup
from nmm.control.resolvers.problem import Dimensions
from nmm.control.resolvers.problem_arrays import ProblemArrays


@kernel(RESOLVER)
def transposed(
    problem: ProblemArrays, numbers: Array, options: Integers, state: Integers, answer: AnswerArrays
) -> None:
    """u = c Jᵀ rate."""
    for j in range(problem.J.shape[1]):
        answer.u[j] = 0.0
        for i in range(problem.J.shape[0]):
            answer.u[j] += numbers[0] * problem.J[i, j] * problem.rate[i]
    certify(problem, answer)


class JacobianTranspose(Resolver):
    """u = c Jᵀ rate (Wolovich and Elliott 1984): no inverse, and no answer to J u = rate.

    Parameters
    ----------
    factor : c > 0
    """

    name: ClassVar[str] = "transpose"
    exact: ClassVar[bool] = False

    def __init__(self, factor: float = 1.0) -> None:
        self.factor = positive(factor, "factor")

    @property
    def kernel(self) -> Kernel:
        return transposed

    def setup(self, dimensions: Dimensions) -> Setup:
        self.check(dimensions)
        return Setup(np.array([self.factor]), NO_OPTIONS)


@kernel(RESOLVER)
def least_norm(
    problem: ProblemArrays, numbers: Array, options: Integers, state: Integers, answer: AnswerArrays
) -> None:
    """u = J⁺ rate."""
    s, m = problem.J.shape
    order, L, Q, rest = integer_scratch(s), scratch((s, s)), scratch((s, m)), scratch(m)
    answer.measure[()] = orthonormal_rows(problem.J, problem.row_scales, order, L, Q)
    if answer.measure[()] <= 1e-10:
        answer.status[()] = SINGULAR_J
        return
    clear(rest)
    closest_solution(problem.rate, rest, order, L, Q, answer.u)
    certify(problem, answer)


class LeastNorm(Resolver):
    """u = J⁺ rate, without an objective."""

    name: ClassVar[str] = "least"
    exact: ClassVar[bool] = True

    @property
    def kernel(self) -> Kernel:
        return least_norm

    def setup(self, dimensions: Dimensions) -> Setup:
        self.check(dimensions, all_levels=True)
        return Setup(np.zeros(0), NO_OPTIONS)
