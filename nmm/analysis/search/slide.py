"""Along the singular set towards a configuration: tangent steps, each brought back to the set."""

from __future__ import annotations

import numpy as np

from nmm.analysis.search.descent import LONGEST, descend
from nmm.analysis.search.local import FLAT
from nmm.analysis.search.measure import Measure
from nmm.analysis.search.space import Space
from nmm.arrays import Array

#: Lengths of a tangent step that are tried.
FACTORS = np.array([2.0, 1.0, 0.5, 0.1])
#: A tangent step shorter than this, in units, has arrived.
ARRIVED = 1e-10


def slide(measure: Measure, space: Space, z: Array, goal: Array, tolerance: float, rounds: int) -> Array:
    """Singular points (N, a) that are no farther from the goal (a,) than z (N, a) are, point by point."""
    z = z.copy()
    distance = np.linalg.norm(z - goal, axis=1)
    live = np.ones(len(z), dtype=bool)
    for _ in range(rounds):
        at = np.flatnonzero(live)
        if not len(at) or not z.shape[1]:
            break
        step = _towards(measure, space, z[at], goal)
        tries = z[at][:, np.newaxis] + step[:, np.newaxis] * FACTORS[:, np.newaxis]
        landed, ratio = descend(measure, space, tries.reshape(-1, z.shape[1]), iterations=12)
        landed = landed.reshape(tries.shape)
        far = np.linalg.norm(landed - goal, axis=2)
        far[ratio.reshape(far.shape) > tolerance] = np.inf
        best = np.argmin(far, axis=1)
        row = np.arange(len(at))
        better = far[row, best] < distance[at] - 1e-14
        z[at[better]] = landed[row, best][better]
        distance[at[better]] = far[row, best][better]
        live[at] = better & (np.linalg.norm(step, axis=1) > ARRIVED)
    return z


def _towards(measure: Measure, space: Space, z: Array, goal: Array) -> Array:
    """The part (N, a) of goal - z that is tangent to the singular set and stays inside the bounds."""
    lower, upper = space.bounds
    _, C, values = measure.equations(space.q(z), space.axes, space.units[space.axes], 1)
    floor = FLAT * np.maximum(values[:, :1], 1e-300)
    wish = goal - z
    usable = np.ones(z.shape, dtype=bool)
    for _ in range(z.shape[1] + 1):
        _, sizes, rows = np.linalg.svd(C * usable[:, np.newaxis], full_matrices=False)
        normals = np.where((sizes > floor)[..., np.newaxis], rows, 0.0)
        own = wish * usable
        step = own - (np.swapaxes(normals, 1, 2) @ (normals @ own[..., np.newaxis]))[..., 0]
        outward = ((z <= lower) & (step < 0.0)) | ((z >= upper) & (step > 0.0))
        if not np.any(outward & usable):
            break
        usable &= ~outward
    longest = np.max(np.abs(step), axis=1, initial=0.0)
    return np.asarray(step * np.minimum(1.0, LONGEST / np.maximum(longest, 1e-300))[:, np.newaxis])
