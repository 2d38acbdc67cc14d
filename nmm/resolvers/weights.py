"""What each input costs: weights given by input, by group of inputs, as numbers or as a matrix."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from nmm.arrays import Array, array
from nmm.errors import InputError
from nmm.resolvers.problem import Dimensions
from nmm.robots.input_weights import Weights, by_name

__all__ = ["Weights", "metric_root", "weight_diagonal", "weight_matrix"]


def weight_matrix(weights: Weights, dimensions: Dimensions) -> Array:
    """W (m, m), symmetric positive definite, of the norm sqrt(uᵀ W u).

    Raises
    ------
    InputError : an unknown name, a wrong number of weights, weights that are not positive (definite)
    """
    if isinstance(weights, Mapping):
        W = np.diag(by_name(weights, dimensions.inputs, dimensions.groups))
    else:
        given = array(weights, "weights")
        W = np.diag(given) if given.ndim == 1 else given
    m = dimensions.m
    if W.shape != (m, m):
        raise InputError(f"weights: expected {m} numbers or a {m} x {m} matrix, got {W.shape}")
    if not np.array_equal(W, W.T) or np.linalg.eigvalsh(W).min() <= 0.0:
        raise InputError("weights: expected numbers above 0, or a symmetric positive definite matrix")
    return W


def metric_root(weights: Weights | None, dimensions: Dimensions) -> Array:
    """C (m m,), row after row, with C Cᵀ = W⁻¹: ũ = C⁻¹ u has the norm sqrt(uᵀ W u); (0,) without weights."""
    if weights is None:
        return np.zeros(0)
    return np.asarray(np.linalg.inv(np.linalg.cholesky(weight_matrix(weights, dimensions))).T).ravel()


def weight_diagonal(weights: Weights, dimensions: Dimensions) -> Array:
    """The diagonal of W, (m,); `InputError` also for a W that is not diagonal, which couples the inputs."""
    W = weight_matrix(weights, dimensions)
    diagonal = np.diag(W).copy()
    if np.any(np.diag(diagonal) != W):
        raise InputError("weights: expected a number for each input (a matrix that couples inputs is for pg)")
    return diagonal
