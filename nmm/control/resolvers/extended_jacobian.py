"""Extended Jacobian: as many added rows as there is redundancy, then a single inverse (paper, III-A)."""

from __future__ import annotations

from typing import ClassVar, Literal, get_args

import numpy as np

from nmm.base.arrays import Array, Integers, positive
from nmm.base.errors import expect, expect_known
from nmm.base.kernels.compiled import Kernel, clear, compiled, integer_scratch, kernel, scratch, view
from nmm.base.kernels.damping import USUAL, damped_solution
from nmm.base.kernels.linear_algebra import (
    add,
    closest_solution,
    copied,
    eliminate,
    less,
    orthonormal_rows,
    project_out,
)
from nmm.control.resolvers.answer import (
    INEXACT,
    RELAXED,
    SINGULAR_J,
    SINGULAR_JE,
    SOLVED,
    AnswerArrays,
    certify,
)
from nmm.control.resolvers.base import RESOLVER, Resolver, Setup
from nmm.control.resolvers.limit_check import beyond, bring_within, call_limit
from nmm.control.resolvers.problem import Dimensions
from nmm.control.resolvers.problem_arrays import ProblemArrays

#: Numbers: the tolerance. Options: whether to damp the added task where it conflicts with the task.
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
    M, b, scales = scratch((m, m + 1)), scratch(m), scratch(m)
    both_tasks(problem, M, b, scales)
    for i in range(m):
        M[i, m] = b[i]
    determinant, answer.measure[()] = eliminate(M, scales)
    if answer.measure[()] <= numbers[TOLERANCE]:
        order, L, Q = integer_scratch(s), scratch((s, s)), scratch((s, m))
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
def both_tasks(problem: ProblemArrays, M: Array, b: Array, scales: Array) -> None:
    """The first columns of M (m, ...) become [J; J_added], b their rates (m,), scales their rows' scales
    (m,).
    """
    s, m = problem.J.shape
    for i in range(m):
        for j in range(m):
            M[i, j] = problem.J[i, j] if i < s else problem.added_J[i - s, j]
        b[i] = problem.rate[i] if i < s else problem.added_rate[i - s]
        scales[i] = problem.row_scales[i] if i < s else problem.added_row_scales[i - s]


@compiled
def damped_beside(problem: ProblemArrays, tolerance: float, answer: AnswerArrays) -> bool:
    """The task exactly, the added task damped in its null space; False where no damping is needed.

    J_e loses rank with J or with J_added (I - J⁺ J), rows in their scales; the second is damped. For a task
    with levels the added task is one more level below them, and all levels are damped.
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
        b[i] = less(problem.added_rate[i], added_J[i], u)
        copied(added_J[i], A[i])
        project_out(A[i], Q, s)
    ends, shares = integer_scratch(1), scratch(1)
    ends[0] = k
    scales, dt = problem.added_row_scales, problem.dt[()]
    least, damped = damped_solution(A, scales, b, ends, u0, USUAL, dt, free, shares, scratch(m))
    if not damped:
        return False
    add(u, 1.0, free)
    answer.measure[()] = least
    certify(problem, answer)
    if answer.status[()] == SOLVED:
        answer.status[()] = RELAXED
    return True


@compiled
def damped_levels(problem: ProblemArrays, answer: AnswerArrays) -> bool:
    """Each level, the added task last, in the null space of those above; False where none is damped."""
    m, levels = problem.J.shape[1], problem.ends.shape[0]
    A, b, scales, u0, u = scratch((m, m)), scratch(m), scratch(m), scratch(m), scratch(m)
    ends, shares = integer_scratch(levels + 1), scratch(levels + 1)
    both_tasks(problem, A, b, scales)
    for level in range(levels):
        ends[level] = problem.ends[level]
    ends[levels] = m
    clear(u0)
    least, damped = damped_solution(A, scales, b, ends, u0, USUAL, problem.dt[()], u, shares, scratch(m))
    if not damped:
        return False
    copied(u, answer.u)
    answer.measure[()] = least
    certify(problem, answer)
    if answer.status[()] == INEXACT:
        copied(shares, answer.nu)
    answer.status[()] = RELAXED
    return True


@compiled
def inverse(problem: ProblemArrays, T: Array) -> None:
    """T = [J; J_added]⁻¹, rows in their scales: limits keep u near in the metric of both tasks."""
    m = problem.J.shape[1]
    M, b, scales = scratch((m, 2 * m)), scratch(m), scratch(m)
    clear(M)
    both_tasks(problem, M, b, scales)
    for i in range(m):
        M[i, m + i] = scales[i]
    eliminate(M, scales)
    for i in range(m):
        for j in range(m):
            T[i, j] = M[i, m + j]


class ExtendedJacobian(Resolver):
    """u = J_e⁻¹ [rate; y_dot + K_y (y_d - y)] with the added task y = h(q) (paper, section III-A).

    The added task has as many rows as the first leaves free, k = p + n_m - s; it is an argument of the
    controller (`Controller(..., added_task=...)`).

    Parameters
    ----------
    tolerance : singular where the last pivot, rows in their natural scales, is below this (times the largest
        one above 1)
    singular : where J_e loses rank and J does not (algorithmic singularities): "stop" ends the run; "damped"
        keeps the task exact and damps the added task, or lower levels, where the task hardly leaves it free

    Examples
    --------
    >>> robot = nmm.load("unicycle_2r")
    >>> reach = nmm.Task(nmm.Position("ee", "xy"), [2.0, 1.0])
    >>> arm = nmm.Task(nmm.Posture("q1", "q2"), [0.3, 0.6])
    >>> controller = nmm.Controller(robot, reach, nmm.ExtendedJacobian(), added_task=arm)
    >>> nmm.simulate(controller, robot.q({"q2": 0.5}), 10).q[-1, 3:].round(3)
    array([0.3, 0.6])
    """

    name: ClassVar[str] = "ej"
    exact: ClassVar[bool] = True
    kernel: ClassVar[Kernel] = extended_jacobian
    takes_added_task: ClassVar[bool] = True

    def __init__(self, tolerance: float = 1e-10, singular: Singular = "stop") -> None:
        self.tolerance = positive(tolerance, "tolerance")
        expect_known("singular", singular, get_args(Singular))
        self.singular = singular

    def setup(self, dimensions: Dimensions) -> Setup:
        self.check(dimensions, all_levels=True)
        free = dimensions.m - dimensions.s
        expected = f"{free} rows ({dimensions.m} inputs less {dimensions.s} rows of the task)"
        expect(dimensions.k == free, "added_task", expected, dimensions.k)
        return Setup(np.array([self.tolerance]), np.array([self.singular == "damped"], dtype=np.int64))
