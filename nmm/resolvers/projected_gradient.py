"""Projected Gradient: the minimum-norm solution and the gradient's part in J's null space (paper, III-B)."""

from __future__ import annotations

import math
from typing import ClassVar

import numpy as np

from nmm.arrays import Array, positive
from nmm.kernels.compiled import RESOLVER, Kernel, kernel
from nmm.kernels.linear_algebra import closest_solution, orthonormal_rows, residual_norm
from nmm.resolvers.base import Resolver, Setup, Shape
from nmm.resolvers.weights import Weights, weight_matrix


@kernel(RESOLVER)
def projected_gradient(
    J: Array, rate: Array, Jc: Array, rate_c: Array, h: Array,
    parameters: Array, options: Array, state: Array, u: Array, report: Array,
) -> None:  # fmt: skip
    """u = J⁺ rate - α (I - J⁺ J) h, with J⁺ J = Qᵀ Q from J's orthonormal rows.

    With weights, in the coordinates ũ = C⁻¹ u in which the weighted norm is the Euclidean one.
    parameters = [α, tolerance, C row after row], options = [weighted].
    """
    s, m = J.shape
    order = np.empty(s, dtype=np.int64)
    L = np.empty((s, s))
    Q = np.empty((s, m))
    u0 = np.empty(m)
    if options[0] == 0:
        for j in range(m):
            u0[j] = -parameters[0] * h[j]
        report[2] = orthonormal_rows(J, order, L, Q)
        if report[2] > parameters[1]:
            closest_solution(rate, u0, order, L, Q, u)
    else:
        C = parameters[2:].reshape((m, m))
        weighted_J = np.zeros((s, m))
        solution = np.empty(m)
        for j in range(m):
            u0[j] = 0.0
            for k in range(m):
                u0[j] -= parameters[0] * C[k, j] * h[k]
                for i in range(s):
                    weighted_J[i, j] += J[i, k] * C[k, j]
        report[2] = orthonormal_rows(weighted_J, order, L, Q)
        if report[2] > parameters[1]:
            closest_solution(rate, u0, order, L, Q, solution)
            for j in range(m):
                u[j] = 0.0
                for k in range(m):
                    u[j] += C[j, k] * solution[k]
    if report[2] <= parameters[1]:
        report[0] = 1.0
        return
    report[1] = residual_norm(J, u, rate)
    report[0] = 0.0 if math.isfinite(report[1]) else 4.0


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
    tolerance : J counts as singular below this ratio of smallest to largest pivot, whatever the
        rows' units: rows of very different size want to be scaled first
    """

    name: ClassVar[str] = "pg"

    def __init__(
        self,
        alpha: float = 10.0,
        weights: Weights | None = None,
        tolerance: float = 1e-10,
    ) -> None:
        self.alpha = positive(alpha, "alpha")
        self.weights = weights
        self.tolerance = positive(tolerance, "tolerance")

    @property
    def kernel(self) -> Kernel:
        return projected_gradient

    def setup(self, shape: Shape) -> Setup:
        self.check(shape)
        state = np.full(1 + shape.s, -1, dtype=np.int64)
        head = np.array([self.alpha, self.tolerance])
        if self.weights is None:
            return Setup(head, np.zeros(1, dtype=np.int64), state)
        C = np.linalg.inv(np.linalg.cholesky(weight_matrix(self.weights, shape))).T
        return Setup(np.concatenate([head, C.ravel()]), np.ones(1, dtype=np.int64), state)
