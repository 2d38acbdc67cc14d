"""Damped least squares: inputs that stay small beside a singular configuration, at the task's cost."""

from typing import ClassVar

import numpy as np

from nmm.extending import (
    NO_OPTIONS,
    RELAXED,
    RESOLVER,
    AnswerArrays,
    Array,
    Dimensions,
    Integers,
    Kernel,
    ProblemArrays,
    Resolver,
    Setup,
    certify,
    eliminate,
    kernel,
    positive,
    scratch,
)

DAMPING = 0


@kernel(RESOLVER)
def damped_least_squares(
    problem: ProblemArrays, numbers: Array, options: Integers, state: Integers, answer: AnswerArrays
) -> None:
    """u = Jᵀ y with (J Jᵀ + λ²) y = rate: the least of |J u - rate|² + λ² |u|²."""
    J, rate, u = problem.J, problem.rate, answer.u
    s, m = J.shape
    M, scales = scratch((s, s + 1)), scratch(s)
    for i in range(s):
        scales[i] = 1.0
        for j in range(s):
            M[i, j] = numbers[DAMPING] ** 2 if i == j else 0.0
            for k in range(m):
                M[i, j] += J[i, k] * J[j, k]
        M[i, s] = rate[i]
    _, answer.measure[()] = eliminate(M, scales)
    asked = 0.0
    given = 0.0
    for j in range(m):
        u[j] = 0.0
        for i in range(s):
            u[j] += J[i, j] * M[i, s]
    for i in range(s):
        asked += rate[i] * rate[i]
        for j in range(m):
            given += rate[i] * J[i, j] * u[j]
    certify(problem, answer)
    if asked > 0.0 and given < asked:  # on purpose, and said: the share of the rate that is left
        answer.status[()] = RELAXED
        answer.nu[0] = given / asked


class DampedLeastSquares(Resolver):
    """u = Jᵀ (J Jᵀ + λ²)⁻¹ rate (Nakamura and Hanafusa 1986). The objective is not looked at.

    Parameters
    ----------
    damping : λ > 0, in the units of J
    """

    name: ClassVar[str] = "damped"
    exact: ClassVar[bool] = False

    def __init__(self, damping: float = 0.05) -> None:
        self.damping = positive(damping, "damping")

    @property
    def kernel(self) -> Kernel:
        return damped_least_squares

    def setup(self, dimensions: Dimensions) -> Setup:
        self.check(dimensions)
        return Setup(np.array([self.damping]), NO_OPTIONS)
