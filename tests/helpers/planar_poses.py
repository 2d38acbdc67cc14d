"""SE(2) by 3 x 3 matrices and scipy's expm and logm: an oracle that shares no code with nmm."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from scipy.linalg import expm, logm

Array = np.ndarray


def matrix_of(pose: Array) -> Array:
    x, y, theta = pose
    c, s = math.cos(theta), math.sin(theta)
    return np.array([[c, -s, x], [s, c, y], [0.0, 0.0, 1.0]])


def exp(twist: Array) -> Array:
    x, y, theta = twist
    return np.asarray(expm(np.array([[0.0, -theta, x], [theta, 0.0, y], [0.0, 0.0, 0.0]])))


def log(T: Array) -> Array:
    X = np.real(logm(T))
    return np.array([X[0, 2], X[1, 2], X[1, 0]])


def difference(f: Callable[[Array], Array], at: Array, h: float = 1e-5) -> Array:
    """The derivative of f at a point by central differences of fourth order."""
    columns = []
    for axis in np.eye(len(at)):
        near = (f(at + h * axis) - f(at - h * axis)) / (2 * h)
        far = (f(at + 2 * h * axis) - f(at - 2 * h * axis)) / (4 * h)
        columns.append((4 * near - far) / 3)
    return np.array(columns).T


def conditioned(prior: Array, residual: Array, H: Array, R: Array) -> tuple[Array, Array]:
    """Mean and covariance of v ~ N(0, prior) where residual = H v + N(0, R) was seen."""
    gain = prior @ H.T @ np.linalg.inv(H @ prior @ H.T + R)
    return gain @ residual, prior - gain @ H @ prior
