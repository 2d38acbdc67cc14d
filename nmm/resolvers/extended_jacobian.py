"""Extended Jacobian: as many added rows as there is redundancy, then one inverse (paper, III-A)."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from nmm.arrays import Array, Integers, positive
from nmm.errors import InputError
from nmm.kernels.compiled import Kernel, clear, compiled, integer_scratch, kernel, scratch
from nmm.kernels.linear_algebra import eliminate, orthonormal_rows
from nmm.resolvers.answer import SINGULAR_J, SINGULAR_JE, AnswerArrays, certify
from nmm.resolvers.base import NO_OPTIONS, RESOLVER, Resolver, Setup
from nmm.resolvers.limited import limit, within
from nmm.resolvers.problem import Dimensions, ProblemArrays

TOLERANCE = 0


@kernel(RESOLVER)
def extended_jacobian(
    problem: ProblemArrays, numbers: Array, options: Integers, state: Integers, answer: AnswerArrays
) -> None:
    """[J; J_added] u = [rate; rate_added]."""
    J = problem.J
    s, m = J.shape
    M = scratch((m, m + 1))
    scales = scratch(m)
    for i in range(m):
        for j in range(m):
            M[i, j] = J[i, j] if i < s else problem.added_J[i - s, j]
        M[i, m] = problem.rate[i] if i < s else problem.added_rate[i - s]
        scales[i] = problem.row_scales[i] if i < s else problem.added_row_scales[i - s]
    _, answer.measure[()] = eliminate(M, scales)
    if answer.measure[()] <= numbers[TOLERANCE]:
        order = integer_scratch(s)
        L = scratch((s, s))
        Q = scratch((s, m))
        regular = orthonormal_rows(J, problem.row_scales, order, L, Q) > numbers[TOLERANCE]
        answer.status[()] = SINGULAR_JE if regular else SINGULAR_J
        return
    for j in range(m):
        answer.u[j] = M[j, m]
    certify(problem, answer)
    if not within(problem, answer.u):
        T = scratch((m, m))
        inverse(problem, T)
        limit(problem, T, answer)


@compiled
def inverse(problem: ProblemArrays, T: Array) -> None:
    """T = [J; J_added]⁻¹, rows in their scales: the metric in which limits keep both tasks near."""
    s, m = problem.J.shape
    M, scales = scratch((m, 2 * m)), scratch(m)
    clear(M)
    for i in range(m):
        scales[i] = problem.row_scales[i] if i < s else problem.added_row_scales[i - s]
        for j in range(m):
            M[i, j] = problem.J[i, j] if i < s else problem.added_J[i - s, j]
        M[i, m + i] = scales[i]
    eliminate(M, scales)
    for i in range(m):
        for j in range(m):
            T[i, j] = M[i, m + j]


class ExtendedJacobian(Resolver):
    """u = J_e⁻¹ [rate; y_dot + K_y (y_d - y)] with the added task y = h(q) (paper, section III-A).

    The added task has as many rows as the first leaves free, k = p + n_m - s; the controller takes it
    (`Controller(..., added_task=...)`).

    Parameters
    ----------
    tolerance : J_e counts as singular where its last pivot, rows in their natural scales, is below this,
        times the largest pivot if that is above 1
    """

    name: ClassVar[str] = "ej"
    takes_added_task: ClassVar[bool] = True

    def __init__(self, tolerance: float = 1e-10) -> None:
        self.tolerance = positive(tolerance, "tolerance")

    @property
    def kernel(self) -> Kernel:
        return extended_jacobian

    def setup(self, dimensions: Dimensions) -> Setup:
        self.check(dimensions)
        free = dimensions.m - dimensions.s
        if dimensions.k != free:
            raise InputError(
                f"added_task: expected {free} rows ({dimensions.m} inputs less {dimensions.s} rows of the "
                f"task), got {dimensions.k}"
            )
        return Setup(np.array([self.tolerance]), NO_OPTIONS)
