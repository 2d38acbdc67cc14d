"""Inputs that stay bounded where J loses rank, level by level: what resolvers go over to there."""

from __future__ import annotations

from nmm.arrays import Array
from nmm.kernels.compiled import compiled, scratch
from nmm.kernels.damping import damped_solution
from nmm.resolvers.answer import INEXACT, RELAXED, AnswerArrays, certify
from nmm.resolvers.problem_arrays import ProblemArrays


@compiled
def damp(
    problem: ProblemArrays,
    alpha: float,
    law: int,
    damping: float,
    threshold: float,
    W: Array,
    answer: AnswerArrays,
) -> None:
    """u, measure, residual, status and scale; W holds C (m, m), or (0, 0) where every weight is 1."""
    s, m = problem.J.shape
    J, u0, solution = scratch((s, m)), scratch(m), scratch(m)
    weigh(problem, alpha, W, J, u0)
    scales, dt = problem.row_scales, problem.dt[()]
    shares = scratch(problem.ends.shape[0])
    least, damped = damped_solution(
        J, scales, problem.rate, problem.ends, u0, law, damping, threshold, dt, solution, shares
    )
    give(problem, W, solution, least, damped, shares, answer)


@compiled
def give(
    problem: ProblemArrays,
    W: Array,
    solution: Array,
    least: float,
    damped: bool,
    shares: Array,
    answer: AnswerArrays,
) -> None:
    """Write the answer with u = C solution; least, damped and shares are `damped_solution`'s."""
    unweigh(W, solution, answer.u)
    answer.measure[()] = least
    certify(problem, answer)
    if answer.status[()] == INEXACT and damped:
        answer.status[()] = RELAXED
        for level in range(answer.scale.shape[0]):
            answer.scale[level] = shares[level]


@compiled
def weigh(problem: ProblemArrays, alpha: float, W: Array, weighted_J: Array, u0: Array) -> None:
    """J C and u0 = -α Cᵀ h, in ũ = C⁻¹ u, in which the weighted norm is the Euclidean one; W holds C."""
    s, m = problem.J.shape
    if W.shape[0] == 0:
        for j in range(m):
            u0[j] = -alpha * problem.h[j]
            for i in range(s):
                weighted_J[i, j] = problem.J[i, j]
        return
    for j in range(m):
        u0[j] = 0.0
        for i in range(s):
            weighted_J[i, j] = 0.0
        for k in range(m):
            u0[j] -= alpha * W[k, j] * problem.h[k]
            for i in range(s):
                weighted_J[i, j] += problem.J[i, k] * W[k, j]


@compiled
def unweigh(W: Array, solution: Array, u: Array) -> None:
    """u = C ũ."""
    for j in range(u.shape[0]):
        u[j] = solution[j] if W.shape[0] == 0 else 0.0
        for k in range(W.shape[0]):
            u[j] += W[j, k] * solution[k]
