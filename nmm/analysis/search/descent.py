"""Down to a singular configuration: damped Gauss-Newton on Wᵀ J V = 0, many starts in step."""

from __future__ import annotations

import numpy as np

from nmm.analysis.search.measure import ROUNDING
from nmm.analysis.search.search import Search
from nmm.analysis.search.space import Space
from nmm.arrays import Array, Flags
from nmm.progress import Progress

#: Lengths of a step that are tried.
FACTORS = np.array([1.0, 0.5, 0.2, 0.04])
#: And where σ falls slowly: exact where it touches zero as a square does. Elsewhere it would lead to the
#: places where pieces of the singular set meet.
DOUBLE = 2.0
#: Relative decreases of σ below this are no progress; so many in a row end a start.
LITTLE, PATIENCE = 1e-3, 4
#: Slopes this small beside the largest are the differences' rounding.
NOISE = 1e-8
#: Two singular values within this factor may be on their way to zero together; where σ alone falls slower
#: than by this in a step, both are asked to.
TOGETHER, SLOW = 20.0, 0.3


def minimum_norm_step(space: Space, z: Array, F: Array, C: Array, damping: Array) -> Array:
    """-Cᵀ (C Cᵀ + damping)⁻¹ F, (N, a), without what would leave the bounds."""

    def step(usable: Flags) -> Array:
        left, sizes, right = np.linalg.svd(C * usable[:, np.newaxis], full_matrices=False)
        gain = sizes / np.maximum(sizes**2 + damping[:, np.newaxis], 1e-300)
        gain[sizes <= NOISE * np.max(sizes, axis=1, initial=0.0)[:, np.newaxis]] = 0.0
        along = gain * (np.swapaxes(left, 1, 2) @ F[..., np.newaxis])[..., 0]
        return -(np.swapaxes(right, 1, 2) @ along[..., np.newaxis])[..., 0]

    return space.step(z, step)


def descend(
    search: Search, z: Array, *, iterations: int = 60, progress: Progress | None = None
) -> tuple[Array, Array]:
    """Local minima of σ from the starts z (N, a): where each ended (N, a), and σ beside the largest (N,).

    σ never grows. A start ends where σ is rounding, or where it stops falling.
    """
    z = search.space.clip(z)
    sigma, ratio = search.sigma(z)
    damping = np.ones(len(z))
    waited = np.zeros(len(z), dtype=np.int64)
    slow = np.zeros(len(z), dtype=bool)
    for iteration in range(iterations):
        live = np.flatnonzero((ratio > ROUNDING) & (waited < PATIENCE) & np.isfinite(ratio))
        if not len(live) or not len(search.space.axes):
            break
        trials = _trials(search, z[live], damping[live], slow[live])
        count = trials.shape[1]
        tried, ratios = search.sigma(trials.reshape(-1, trials.shape[2]))
        tried, ratios = tried.reshape(-1, count), ratios.reshape(-1, count)
        best = np.argmin(tried, axis=1)
        row = np.arange(len(live))
        value = tried[row, best]
        better = value < sigma[live]
        slow[live] = value > SLOW * sigma[live]
        progressed = value < (1.0 - LITTLE) * sigma[live]
        waited[live] = np.where(progressed, 0, waited[live] + 1)
        damping[live] *= np.where(~better, 10.0, np.where(best == 0, 0.2, 1.0))
        chosen = live[better]
        z[chosen] = trials[row, best][better]
        sigma[chosen], ratio[chosen] = value[better], ratios[row, best][better]
        if progress is not None:
            progress((iteration + 1) / iterations)
    return z, ratio


def _trials(search: Search, z: Array, damping: Array, slow: Flags) -> Array:
    """Points (N, tries, a): towards one singular value at zero, and towards two where two fall slowly."""
    space = search.space
    F, C, values = search.equations(z, 1)
    step = minimum_norm_step(space, z, F, C, _damping(F, damping))
    steps = step[:, np.newaxis] * FACTORS[:, np.newaxis]
    longer = np.where(slow, DOUBLE, 0.7)[:, np.newaxis, np.newaxis] * step[:, np.newaxis]
    steps = np.concatenate([steps, longer], axis=1)
    if search.measure.full_rank > 1:
        twin = np.flatnonzero(slow & (values[:, -2] < TOGETHER * values[:, -1]))
        second = np.tile(step[:, np.newaxis] * 1.5, (1, 2, 1))
        if len(twin):
            F, C, _ = search.equations(z[twin], 2)
            both = minimum_norm_step(space, z[twin], F, C, _damping(F, damping[twin]))
            second[twin] = both[:, np.newaxis] * np.array([[1.0], [0.3]])
        steps = np.concatenate([steps, second], axis=1)
    return space.clip(z[:, np.newaxis] + steps)


def _damping(F: Array, damping: Array) -> Array:
    """Falls with the square of σ, so that convergence stays quadratic."""
    return np.asarray(damping * np.sum(F**2, axis=1))
