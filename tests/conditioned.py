"""Matrices of a condition that is known."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def with_condition(shape: tuple[int, int], condition: float, rng: np.random.Generator) -> Array:
    """A random matrix with singular values from 1 down to 1 / condition."""
    s, m = shape
    U = np.linalg.qr(rng.normal(size=(s, s)))[0]
    V = np.linalg.qr(rng.normal(size=(m, m)))[0]
    return np.ascontiguousarray(U @ np.diag(np.geomspace(1.0, 1.0 / condition, s)) @ V[:s])
