"""What a filter is told of its noise and fixes, as numbers that its kernels take."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike

from nmm.base.arrays import Array, matrix, positive, scalar, vector
from nmm.base.errors import expect
from nmm.plugins.robot.filter_step import Noise
from nmm.plugins.robot.odometry import Odometry, by_counter

#: How the two numbers of what walks are called.
WALKING = ("deviation", "walk")


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
    """A contiguous float64 array; an empty matrix, which fits nothing, for what is no array of numbers."""
    try:
        return np.ascontiguousarray(value, dtype=np.float64)
    except (TypeError, ValueError):
        return np.zeros((0, 0))


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


def noise_of(
    odometry: Odometry,
    where: str,
    spread: float | Mapping[str, float],
    slip_noise: ArrayLike,
    gyro_noise: float | None,
    walking: Mapping[str, tuple[float, float]],
) -> tuple[Noise, Array]:
    """The noise of a filter, as `PoseFilter` has it, and the covariance (d, d) of its state at first, but for
    the pose's.

    walking : of the bias, the counters' scales and that of turns: standard deviation at first, and the walk
    """
    names = odometry.counters
    variances = by_counter(spread, names, np.zeros(len(names)), f"{where}: spread")
    expect(bool((variances >= 0.0).all()), f"{where}: spread", "numbers from 0", variances)
    slips = vector(slip_noise, 3, f"{where}: slip_noise")
    expect(bool((slips >= 0.0).all()), f"{where}: slip_noise", "numbers from 0", slips)
    gyro = 0.0 if gyro_noise is None else positive(gyro_noise, f"{where}: gyro_noise")
    known = {
        what: [scalar(x, f"{where}: {what}_{name}", least=0.0) for x, name in zip(both, WALKING, strict=True)]
        for what, both in walking.items()
    }
    turning = any(known["turn"])
    scaled = turning or any(known["scale"])
    at_first = [known["bias"][0], *[known["scale"][0]] * (len(names) * scaled), *[known["turn"][0]] * turning]
    P = np.diag([0.0, 0.0, 0.0, *at_first]) ** 2
    of_gyro, walks = np.array([gyro, known["bias"][1]]), np.array([known["scale"][1], known["turn"][1]])
    return Noise(odometry.shares, variances, slips**2, of_gyro**2, walks**2), P
