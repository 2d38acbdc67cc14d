"""Extended Jacobian: as many added constraints as there is redundancy, then one inverse (paper, III-A)."""

from __future__ import annotations

import math
from typing import ClassVar

import numpy as np

from nmm.arrays import Array, positive
from nmm.errors import InputError
from nmm.kernels.compiled import RESOLVER, Kernel, kernel
from nmm.kernels.linear_algebra import eliminate, orthonormal_rows, residual_norm
from nmm.resolvers.base import Resolver, Setup, Shape


@kernel(RESOLVER)
def extended_jacobian(
    J: Array, rate: Array, Jc: Array, rate_c: Array, h: Array,
    parameters: Array, options: Array, state: Array, u: Array, report: Array,
) -> None:  # fmt: skip
    """[J; Jc] u = [rate; rate_c]; parameters = [tolerance]."""
    s, m = J.shape
    M = np.empty((m, m + 1))
    for i in range(m):
        for j in range(m):
            M[i, j] = J[i, j] if i < s else Jc[i - s, j]
        M[i, m] = rate[i] if i < s else rate_c[i - s]
    _, ratio = eliminate(M)
    report[2] = ratio
    if ratio <= parameters[0]:
        order = np.empty(s, dtype=np.int64)
        L = np.empty((s, s))
        Q = np.empty((s, m))
        report[0] = 1.0 if orthonormal_rows(J, order, L, Q) <= parameters[0] else 3.0
        return
    for j in range(m):
        u[j] = M[j, m]
    report[1] = residual_norm(J, u, rate)
    report[0] = 0.0 if math.isfinite(report[1]) else 4.0


class ExtendedJacobian(Resolver):
    """u = J_e⁻¹ [rate; y_dot + K_y (y_d - y)] with the constraint y = h(q) (paper, section III-A).

    The constraint is a second task with as many rows as the first leaves free, k = p + n_m - s;
    the controller takes it (`Controller(..., constraint=...)`).

    Parameters
    ----------
    tolerance : J_e counts as singular below this ratio of smallest to largest pivot
    """

    name: ClassVar[str] = "ej"
    uses_constraint: ClassVar[bool] = True

    def __init__(self, tolerance: float = 1e-10) -> None:
        self.tolerance = positive(tolerance, "tolerance")

    @property
    def kernel(self) -> Kernel:
        return extended_jacobian

    def setup(self, shape: Shape) -> Setup:
        self.check(shape)
        if shape.s + shape.k != shape.m:
            raise InputError(
                f"constraint: expected {shape.m - shape.s} rows ({shape.m} inputs less {shape.s} rows of "
                f"the task), got {shape.k}"
            )
        state = np.full(1 + shape.s, -1, dtype=np.int64)
        return Setup(np.array([self.tolerance]), np.zeros(0, dtype=np.int64), state)
