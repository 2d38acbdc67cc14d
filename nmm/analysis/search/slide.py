"""Along the singular set towards a configuration: tangent steps, each brought back to the set."""

from __future__ import annotations

import numpy as np

from nmm.analysis.search.descent import descend
from nmm.analysis.search.local import FLAT
from nmm.analysis.search.search import Search
from nmm.arrays import Array, Flags

#: Lengths of a tangent step that are tried.
FACTORS = np.array([2.0, 1.0, 0.5, 0.1])
#: A tangent step shorter than this, in units, has arrived.
ARRIVED = 1e-10


def slide(search: Search, z: Array, goal: Array, rounds: int) -> Array:
    """Singular points (N, a) that are no farther from the goal (a,) than z (N, a) are, point by point."""
    z = z.copy()
    distance = np.linalg.norm(z - goal, axis=1)
    live = np.ones(len(z), dtype=bool)
    for _ in range(rounds):
        at = np.flatnonzero(live)
        if not len(at) or not z.shape[1]:
            break
        step = _towards(search, z[at], goal)
        tries = z[at][:, np.newaxis] + step[:, np.newaxis] * FACTORS[:, np.newaxis]
        landed, ratio = descend(search, tries.reshape(-1, z.shape[1]), iterations=12)
        landed = landed.reshape(tries.shape)
        far = np.linalg.norm(landed - goal, axis=2)
        far[ratio.reshape(far.shape) > search.tolerance] = np.inf
        best = np.argmin(far, axis=1)
        row = np.arange(len(at))
        better = far[row, best] < distance[at] - 1e-14
        z[at[better]] = landed[row, best][better]
        distance[at[better]] = far[row, best][better]
        live[at] = better & (np.linalg.norm(step, axis=1) > ARRIVED)
    return z


def _towards(search: Search, z: Array, goal: Array) -> Array:
    """The part (N, a) of goal - z that is tangent to the singular set and stays inside the bounds."""
    _, C, values = search.equations(z, 1)
    floor = FLAT * np.maximum(values[:, :1], 1e-300)

    def step(usable: Flags) -> Array:
        _, sizes, rows = np.linalg.svd(C * usable[:, np.newaxis], full_matrices=False)
        normals = np.where((sizes > floor)[..., np.newaxis], rows, 0.0)
        own = (goal - z) * usable
        return np.asarray(own - (np.swapaxes(normals, 1, 2) @ (normals @ own[..., np.newaxis]))[..., 0])

    return search.space.step(z, step)
