"""Shapes of problems, and matrices of a condition or of singular values that are known."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Rows and inputs: without redundancy, with little, with much.
SHAPES = [(1, 1), (1, 4), (2, 2), (2, 4), (3, 3), (3, 4), (3, 5), (5, 6), (6, 6), (6, 9)]
each_shape = pytest.mark.parametrize("shape", SHAPES, ids=str)


def with_condition(shape: tuple[int, int], condition: float, rng: np.random.Generator) -> Array:
    """A random matrix with singular values from 1 down to 1 / condition."""
    s, m = shape
    U = np.linalg.qr(rng.normal(size=(s, s)))[0]
    V = np.linalg.qr(rng.normal(size=(m, m)))[0]
    return np.ascontiguousarray(U @ np.diag(np.geomspace(1.0, 1.0 / condition, s)) @ V[:s])


def with_singular_values(values: Array, m: int, rng: np.random.Generator) -> Array:
    """A random matrix (s, m) of these singular values."""
    U = np.linalg.qr(rng.normal(size=(len(values), len(values))))[0]
    V = np.linalg.qr(rng.normal(size=(m, len(values))))[0]
    return np.ascontiguousarray(U * values @ V.T)
