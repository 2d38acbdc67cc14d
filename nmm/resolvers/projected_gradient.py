"""Projected Gradient: the minimum-norm solution and the gradient's part in J's null space (paper, III-B)."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from nmm.arrays import Array, Integers, positive
from nmm.kernels.compiled import Kernel, integer_scratch, kernel, scratch, view
from nmm.kernels.damping import BELOW, DIRECTIONS, LARGEST
from nmm.kernels.linear_algebra import closest_solution, orthonormal_rows
from nmm.resolvers.answer import SINGULAR_J, AnswerArrays, certify
from nmm.resolvers.base import NO_OPTIONS, RESOLVER, Resolver, Setup, StepRule, step_rule
from nmm.resolvers.damped import damp, unweigh, weigh
from nmm.resolvers.problem import Dimensions
from nmm.resolvers.problem_arrays import ProblemArrays
from nmm.resolvers.weights import Weights, metric_root
from nmm.resolvers.within import bring_within

#: Numbers: α, the tolerance and, with weights, C row after row.
ALPHA, TOLERANCE, C = 0, 1, 2


@kernel(RESOLVER)
def projected_gradient(
    problem: ProblemArrays, numbers: Array, options: Integers, state: Integers, answer: AnswerArrays
) -> None:
    """u = J⁺ rate - α (I - J⁺ J) h, with J⁺ J = Qᵀ Q from J's orthonormal rows.

    With weights, in the coordinates ũ = C⁻¹ u in which the weighted norm is the Euclidean one; that is
    the metric, too, in which limits keep u near to it. With levels of priority J may lose rank, as the levels
    may contradict each other: directions that do are damped.
    """
    J, h, u = problem.J, problem.h, answer.u
    s, m = J.shape
    alpha = numbers[ALPHA]
    if problem.ends.shape[0] > 1:
        plain = numbers.shape[0] == C
        metric = view(numbers, 0 if plain else C, (0, 0) if plain else (m, m))
        damp(problem, alpha, DIRECTIONS, LARGEST, BELOW, metric, answer)
        bring_within(problem, metric, answer)
        return
    order = integer_scratch(s)
    L = scratch((s, s))
    Q = scratch((s, m))
    u0 = scratch(m)
    if numbers.shape[0] == C:
        for j in range(m):
            u0[j] = -alpha * h[j]
        answer.measure[()] = orthonormal_rows(J, problem.row_scales, order, L, Q)
        if answer.measure[()] <= numbers[TOLERANCE]:
            answer.status[()] = SINGULAR_J
            return
        closest_solution(problem.rate, u0, order, L, Q, u)
    else:
        W = view(numbers, C, (m, m))
        weighted_J = scratch((s, m))
        weigh(problem, alpha, W, weighted_J, u0)
        answer.measure[()] = orthonormal_rows(weighted_J, problem.row_scales, order, L, Q)
        if answer.measure[()] <= numbers[TOLERANCE]:
            answer.status[()] = SINGULAR_J
            return
        solution = scratch(m)
        closest_solution(problem.rate, u0, order, L, Q, solution)
        unweigh(W, solution, u)
    certify(problem, answer)
    plain = numbers.shape[0] == C
    bring_within(problem, view(numbers, 0 if plain else C, (0, 0) if plain else (m, m)), answer)


class ProjectedGradient(Resolver):
    """u = J⁺ rate - α (I - J⁺ J) h (paper, eqs. 5 and 7).

    With weights W, u minimises ½ (u - u0)ᵀ W (u - u0) under J u = rate with u0 = -α W⁻¹ h: the
    steepest descent of H in the metric W. (u0 = -α h with a weighted pseudoinverse, the literal
    reading of eq. 5, can increase H.)

    Parameters
    ----------
    alpha : step size α > 0, 1/s times the unit of H's curvature
    weights : None; m positive numbers; a mapping from names of inputs or of their groups ("platform",
        "arm"), 1 for the rest: a large weight spares the input; or a symmetric positive definite
        (m, m) matrix
    tolerance : J counts as singular where its last pivot, rows in their natural scales, is below this,
        times the first pivot if that is above 1
    step : "constant", α as it is; "armijo", α at most, at each sample shortened until the objective falls
        along the sample's motion, so that no α dt is too large

    Examples
    --------
    >>> robot = nmm.load("unicycle_2r")
    >>> task = nmm.Task(nmm.Position("ee", "xy"), [2.0, 1.0])
    >>> resolver = nmm.ProjectedGradient(alpha=10, weights={"platform": 4.0})
    >>> controller = nmm.Controller(robot, task, resolver, nmm.Quadratic(nmm.Square("q1")))
    >>> q = robot.q({"q2": 0.5})
    >>> u, step = controller(0.0, q), controller.evaluate(0.0, q)
    >>> np.allclose(step.J @ u, step.rate)
    True
    """

    name: ClassVar[str] = "pg"
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

    @property
    def kernel(self) -> Kernel:
        return projected_gradient

    def setup(self, dimensions: Dimensions) -> Setup:
        self.check(dimensions)
        C = metric_root(self.weights, dimensions)
        return Setup(np.array([self.alpha, self.tolerance, *C]), NO_OPTIONS)
