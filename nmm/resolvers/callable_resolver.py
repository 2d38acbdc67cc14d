"""A user's own resolver, written in Python."""

from __future__ import annotations

from collections.abc import Callable
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from nmm.arrays import Array
from nmm.errors import InputError
from nmm.kernels.compiled import RESOLVER, Kernel, kernel
from nmm.kernels.linear_algebra import residual_norm
from nmm.resolvers.base import Resolver, Setup, Shape, Status


@kernel(RESOLVER)
def left_to_python(
    J: Array, rate: Array, Jc: Array, rate_c: Array, h: Array,
    parameters: Array, options: Array, state: Array, u: Array, report: Array,
) -> None:  # fmt: skip
    """Nothing: the compiled step stops short of the inputs, and `CallableResolver.finish` finds them."""
    u[:] = 0.0
    report[0] = 0.0


class CallableResolver(Resolver):
    """u from a Python function of (J, rate, h): arrays of shapes (s, m), (s,), (m,), to one of (m,).

    Parameters
    ----------
    function : (J, rate, h) -> u; it may raise `numpy.linalg.LinAlgError` when J is singular
    """

    name: ClassVar[str] = "callable"

    def __init__(self, function: Callable[[Array, Array, Array], ArrayLike]) -> None:
        self.function = function

    @property
    def kernel(self) -> Kernel:
        return left_to_python

    def setup(self, shape: Shape) -> Setup:
        self.check(shape)
        return Setup(np.zeros(0), np.zeros(0, dtype=np.int64), np.full(1 + shape.s, -1, dtype=np.int64))

    def finish(self, J: Array, rate: Array, h: Array, u: Array, report: Array) -> None:
        report[:] = (0.0, np.nan, np.nan)
        try:
            found = np.asarray(self.function(J.copy(), rate.copy(), h.copy()), dtype=np.float64)
        except np.linalg.LinAlgError:
            report[0] = Status.SINGULAR_J
            return
        if found.shape != u.shape:
            raise InputError(f"callable resolver: expected u of shape {u.shape}, got {found.shape}")
        u[:] = found
        report[1] = residual_norm(J, u, rate)
        if not np.isfinite(report[1]):
            report[0] = Status.NOT_FINITE
