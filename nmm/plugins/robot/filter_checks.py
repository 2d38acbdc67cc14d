"""What a filter is told of its noise and fixes, as numbers that its kernels take."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from nmm.base.arrays import Array, matrix
from nmm.base.errors import expect


def gates_of(share: float) -> tuple[float, float]:
    """Below which this share of squares of 2 and of 3 normal numbers lies (SciPy is no part of a robot's
    install)."""
    low, high = 0.0, 1e3
    for _ in range(100):
        middle = 0.5 * (low + high)
        beyond = math.erfc(math.sqrt(0.5 * middle)) + math.sqrt(2 * middle / math.pi) * math.exp(
            -0.5 * middle
        )
        low, high = (middle, high) if beyond > 1.0 - share else (low, middle)
    return -2.0 * math.log1p(-share), middle


def float_array(value: ArrayLike) -> Array:
    """A contiguous float64 array, empty for what is no array of numbers."""
    try:
        return np.ascontiguousarray(value, dtype=np.float64)
    except (TypeError, ValueError):
        return np.zeros(0)


def turned_axes(theta: float) -> Array:
    """diag(R, 1) from the platform's axes to the map's."""
    c, s = math.cos(theta), math.sin(theta)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def covariance_of(value: ArrayLike, where: str) -> Array:
    """(3, 3), symmetric and of no negative variance; `InputError` else."""
    P = matrix(value, (3, 3), where)
    size = float(np.abs(P).max())
    definite = np.allclose(P, P.T, rtol=0.0, atol=1e-9 * size)
    definite &= bool(np.linalg.eigvalsh(P).min() >= -1e-9 * size)
    expect(definite, where, "a covariance: symmetric, no negative variance", P)
    return P
