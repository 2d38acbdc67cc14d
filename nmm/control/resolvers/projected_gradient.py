"""Projected gradient: the minimum-norm solution, and the gradient's part in J's null space (paper, III-B)."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from nmm.base.arrays import Array, Integers, positive
from nmm.base.kernels.compiled import Kernel, integer_scratch, kernel, scratch, view
from nmm.base.kernels.damping import USUAL
from nmm.base.kernels.linear_algebra import closest_solution, orthonormal_rows
from nmm.control.resolvers.answer import SINGULAR_J, AnswerArrays, certify
from nmm.control.resolvers.base import RESOLVER, Resolver, Setup, StepRule, Weights, metric_root, step_rule
from nmm.control.resolvers.damped import damp, unweigh, weigh
from nmm.control.resolvers.limit_check import bring_within
from nmm.control.resolvers.problem import Dimensions
from nmm.control.resolvers.problem_arrays import ProblemArrays

#: Numbers: α, the tolerance and, with weights, C row by row.
ALPHA, TOLERANCE, C = 0, 1, 2


@kernel(RESOLVER)
def projected_gradient(
    problem: ProblemArrays, numbers: Array, options: Integers, state: Integers, answer: AnswerArrays
) -> None:
    """u = J⁺ rate - α (I - J⁺ J) h, with J⁺ J = Qᵀ Q from J's orthonormal rows; with weights, in ũ = C⁻¹ u,
    whose Euclidean norm is the weighted one, limits included. Contradictory directions of levels are
    damped."""
    s, m = problem.J.shape
    plain, alpha = numbers.shape[0] == C, numbers[ALPHA]
    W = view(numbers, 0 if plain else C, (0, 0) if plain else (m, m))
    if problem.ends.shape[0] > 1:
        damp(problem, alpha, USUAL, W, problem.dt[()], answer)
        bring_within(problem, W, answer)
        return
    order, L, Q = integer_scratch(s), scratch((s, s)), scratch((s, m))
    J, u0, solution = problem.J, scratch(m), answer.u
    if plain:  # as `weigh`, without copies
        for j in range(m):
            u0[j] = -alpha * problem.h[j]
    else:
        J, solution = scratch((s, m)), scratch(m)
        weigh(problem, alpha, W, J, u0)
    answer.measure[()] = orthonormal_rows(J, problem.row_scales, order, L, Q)
    if answer.measure[()] <= numbers[TOLERANCE]:
        answer.status[()] = SINGULAR_J
        return
    closest_solution(problem.rate, u0, order, L, Q, solution)
    if not plain:
        unweigh(W, solution, answer.u)
    certify(problem, answer)
    bring_within(problem, W, answer)


class ProjectedGradient(Resolver):
    """u = J⁺ rate - α (I - J⁺ J) h (paper, eqs. 5 and 7).

    With weights W, u minimises ½ (u - u0)ᵀ W (u - u0) under J u = rate with u0 = -α W⁻¹ h: the
    steepest descent of H in the metric W. (u0 = -α h with a weighted pseudoinverse, the literal
    reading of eq. 5, can increase H.)

    Parameters
    ----------
    alpha : step size α > 0, 1/s times the unit of H's curvature
    weights : numbers above 0, one an input, or by input or group ("platform", "arm"), 1 for the rest: a heavy
        input moves less; or a symmetric positive definite (m, m) matrix
    tolerance : singular where the last pivot, rows in their natural scales, is below this (times the largest
        one above 1)
    step : "constant": α; "armijo": at each sample α is shortened until the objective falls along the sample's
        motion

    Examples
    --------
    >>> robot = nmm.load("unicycle_2r")
    >>> task = nmm.Task(nmm.Position("ee", "xy"), [2.0, 1.0])
    >>> resolver = nmm.ProjectedGradient(alpha=10, weights={"platform": 4.0})
    >>> controller = nmm.Controller(robot, task, resolver, nmm.Quadratic(nmm.QuadraticTerm("q1")))
    >>> q = robot.q({"q2": 0.5})
    >>> u, step = controller(0.0, q), controller.evaluate(0.0, q)
    >>> np.allclose(step.J @ u, step.rate)
    True
    """

    name: ClassVar[str] = "pg"
    exact: ClassVar[bool] = True
    kernel: ClassVar[Kernel] = projected_gradient
    alpha_at: ClassVar[int | None] = ALPHA

    def __init__(
        self,
        alpha: float = 10.0,
        weights: Weights | None = None,
        tolerance: float = 1e-10,
        step: StepRule = "constant",
    ) -> None:
        self.alpha = positive(alpha, "alpha")
        self.step = step_rule(step)
        self.weights = weights
        self.tolerance = positive(tolerance, "tolerance")

    def setup(self, dimensions: Dimensions) -> Setup:
        self.check(dimensions)
        C = metric_root(self.weights, dimensions)
        return Setup(np.array([self.alpha, self.tolerance, *C]))
