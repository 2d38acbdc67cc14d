"""Extended Jacobian: as many added rows as there is redundancy, then one inverse (paper, III-A)."""

from __future__ import annotations

from typing import ClassVar, Literal, get_args

import numpy as np

from nmm.arrays import Array, Integers, positive
from nmm.errors import InputError, expect_known
from nmm.kernels.compiled import Kernel, clear, compiled, integer_scratch, kernel, scratch, view
from nmm.kernels.damping import BELOW, DIRECTIONS, LARGEST, damped_solution
from nmm.kernels.linear_algebra import closest_solution, eliminate, orthonormal_rows, project_out
from nmm.resolvers.answer import (
    INEXACT,
    RELAXED,
    SINGULAR_J,
    SINGULAR_JE,
    SOLVED,
    AnswerArrays,
    certify,
)
from nmm.resolvers.base import RESOLVER, Resolver, Setup
from nmm.resolvers.problem import Dimensions
from nmm.resolvers.problem_arrays import ProblemArrays
from nmm.resolvers.within import beyond, bring_within, call_limit

#: Numbers: the tolerance. Options: whether the added task is damped where it asks for what the task fixes.
TOLERANCE = 0
DAMPED = 0


Singular = Literal["stop", "damped"]


@kernel(RESOLVER)
def extended_jacobian(
    problem: ProblemArrays, numbers: Array, options: Integers, state: Integers, answer: AnswerArrays
) -> None:
    """[J; J_added] u = [rate; rate_added]."""
    J = problem.J
    s, m = J.shape
    if options[DAMPED] == 1 and damped_beside(problem, numbers[TOLERANCE], answer):
        bring_within(problem, view(numbers, 0, (0, 0)), answer)
        return
    M = scratch((m, m + 1))
    scales = scratch(m)
    for i in range(m):
        for j in range(m):
            M[i, j] = J[i, j] if i < s else problem.added_J[i - s, j]
        M[i, m] = problem.rate[i] if i < s else problem.added_rate[i - s]
        scales[i] = problem.row_scales[i] if i < s else problem.added_row_scales[i - s]
    determinant, answer.measure[()] = eliminate(M, scales)
    if answer.measure[()] <= numbers[TOLERANCE]:
        order = integer_scratch(s)
        L = scratch((s, s))
        Q = scratch((s, m))
        regular = orthonormal_rows(J, problem.row_scales, order, L, Q) > numbers[TOLERANCE]
        answer.status[()] = SINGULAR_JE if regular else SINGULAR_J
        return
    answer.side[()] = 1.0 if determinant > 0.0 else -1.0
    for j in range(m):
        answer.u[j] = M[j, m]
    certify(problem, answer)
    if beyond(problem, answer):
        T = scratch((m, m))
        inverse(problem, T)
        call_limit(problem.limiter, problem, T, answer)


@compiled
def damped_beside(problem: ProblemArrays, tolerance: float, answer: AnswerArrays) -> bool:
    """The task exactly, the added task by damped least squares in its null space; False where none is needed.

    J_e loses rank with J or with J_added (I - J⁺ J), rows in their scales: the second is damped. Where the
    task has levels the added task is one more below them, and all are damped as levels are.
    """
    if problem.ends.shape[0] > 1:
        return damped_levels(problem, answer)
    J, added_J, u = problem.J, problem.added_J, answer.u
    s, m = J.shape
    k = added_J.shape[0]
    order, L, Q = integer_scratch(s), scratch((s, s)), scratch((s, m))
    if orthonormal_rows(J, problem.row_scales, order, L, Q) <= tolerance:
        return False
    u0, free, b, A = scratch(m), scratch(m), scratch(k), scratch((k, m))
    clear(u0)
    closest_solution(problem.rate, u0, order, L, Q, u)
    for i in range(k):
        b[i] = problem.added_rate[i]
        for j in range(m):
            b[i] -= added_J[i, j] * u[j]
            A[i, j] = added_J[i, j]
        project_out(A, i, Q, s)
    scales, dt = problem.added_row_scales, problem.dt[()]
    ends, shares = integer_scratch(1), scratch(1)
    ends[0] = k
    least, damped = damped_solution(A, scales, b, ends, u0, DIRECTIONS, LARGEST, BELOW, dt, free, shares)
    if not damped:
        return False
    for j in range(m):
        u[j] += free[j]
    answer.measure[()] = least
    certify(problem, answer)
    if answer.status[()] == SOLVED:
        answer.status[()] = RELAXED
    return True


@compiled
def damped_levels(problem: ProblemArrays, answer: AnswerArrays) -> bool:
    """Level by level, the added task the last, each in what those above leave; False where none is damped."""
    s, m = problem.J.shape
    levels = problem.ends.shape[0]
    A, b, scales, u0, u = scratch((m, m)), scratch(m), scratch(m), scratch(m), scratch(m)
    ends, shares = integer_scratch(levels + 1), scratch(levels + 1)
    for i in range(m):
        for j in range(m):
            A[i, j] = problem.J[i, j] if i < s else problem.added_J[i - s, j]
        b[i] = problem.rate[i] if i < s else problem.added_rate[i - s]
        scales[i] = problem.row_scales[i] if i < s else problem.added_row_scales[i - s]
    for level in range(levels):
        ends[level] = problem.ends[level]
    ends[levels] = m
    clear(u0)
    dt = problem.dt[()]
    least, damped = damped_solution(A, scales, b, ends, u0, DIRECTIONS, LARGEST, BELOW, dt, u, shares)
    if not damped:
        return False
    for j in range(m):
        answer.u[j] = u[j]
    answer.measure[()] = least
    certify(problem, answer)
    if answer.status[()] == INEXACT:
        for level in range(levels):
            answer.scale[level] = shares[level]
    answer.status[()] = RELAXED
    return True


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
    singular : what happens where J_e loses rank though J does not (algorithmic singularities): "stop", the
        run ends there; "damped", the task is done and the added task damped, as by damped least squares with
        its usual numbers, in the directions in which the task leaves it hardly anything; levels of priority
        are damped, too, where those above leave them hardly anything

    Examples
    --------
    >>> robot = nmm.load("unicycle_2r")
    >>> hand = nmm.Task(nmm.Position("ee", "xy"), [2.0, 1.0])
    >>> arm = nmm.Task(nmm.Posture("q1", "q2"), [0.3, 0.6])
    >>> controller = nmm.Controller(robot, hand, nmm.ExtendedJacobian(), added_task=arm)
    >>> nmm.simulate(controller, robot.q({"q2": 0.5}), 10).q[-1, 3:].round(3)
    array([0.3, 0.6])
    """

    name: ClassVar[str] = "ej"
    takes_added_task: ClassVar[bool] = True

    def __init__(self, tolerance: float = 1e-10, singular: Singular = "stop") -> None:
        self.tolerance = positive(tolerance, "tolerance")
        expect_known("singular", singular, get_args(Singular))
        self.singular = singular

    @property
    def kernel(self) -> Kernel:
        return extended_jacobian

    def setup(self, dimensions: Dimensions) -> Setup:
        self.check(dimensions, all_levels=True)
        free = dimensions.m - dimensions.s
        if dimensions.k != free:
            raise InputError(
                f"added_task: expected {free} rows ({dimensions.m} inputs less {dimensions.s} rows of the "
                f"task), got {dimensions.k}"
            )
        return Setup(np.array([self.tolerance]), np.array([self.singular == "damped"], dtype=np.int64))
