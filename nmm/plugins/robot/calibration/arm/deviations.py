"""How well an arm's numbers are known, where what is left of one sample goes together."""

from __future__ import annotations

import numpy as np

from nmm.base.arrays import Array, Integers

#: A sample that alone tells a number leaves nothing there: so much at least of what it left is taken to be
#: seen.
LEFT = 0.02


def covariance(W: Array, e: Array, sample: Integers, scales: Array) -> Array:
    """(f, f) : of least squares, the larger of two in each number. The one takes all rows as independent. The
    other takes those of a sample together (the corners of one picture, when the arm itself is off), by what
    they left.

    W (R, f), e (R,) : slopes and residuals over their noise; sample (R,) : whose they are; scales (f,) :
        plausible sizes of the numbers

    Of the other: C = B (Σ g gᵀ) B with B = (Wᵀ W)⁻¹ and, of a sample, g = Wᵀ (I - W B Wᵀ)^(-1/2) e, which is
    unbiased where the rows are independent. (R. M. Bell, D. F. McCaffrey, Bias reduction in standard errors
    for linear regression with multi-stage samples, Survey Methodology 28, 2002.)
    """
    if not W.shape[1]:
        return np.zeros((0, 0))
    _, sizes, axes = np.linalg.svd(W * scales, full_matrices=False)
    shown = sizes > 1e-12 * sizes[0]
    L = (scales[:, np.newaxis] * axes[shown].T) / sizes[shown]
    plain: Array = L @ L.T
    X = W @ L
    by_sample = []
    for k in np.unique(sample):
        own = sample == k
        shares, turned = np.linalg.eigh(X[own].T @ X[own])
        seen = turned.T @ (X[own].T @ e[own])
        by_sample.append(turned @ (seen / np.sqrt(np.maximum(1.0 - shares, LEFT))))
    grouped = L @ np.array(by_sample).T
    square = np.diag(plain)
    factor = np.sqrt(np.maximum(1.0, np.sum(grouped * grouped, axis=1) / np.where(square > 0.0, square, 1.0)))
    return plain * np.outer(factor, factor)
