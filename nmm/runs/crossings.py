"""Singularities of J_e that a run passes between two samples: its determinant changes its sign there."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from nmm.arrays import Array, Integers

#: Inputs that change by more than this share of their size have jumped, over such a step,
JUMPED = 0.5
#: in it and in the steps beside it, where a sample is near the singularity.
NEAR = np.array([-1, 0, 1])
#: So many of them are told by their times.
TOLD = 3


def crossed(side: Integers) -> Integers:
    """1 at the samples before which J_e was singular on the way, else 0, (N,), by the sign of det J_e there.

    det J_e is continuous along a motion. Where it is 0 in `side` (N,) J_e was not inverted, and nothing is
    known; neither is an even number of singularities between two samples.
    """
    found = np.zeros(len(side), dtype=np.int64)
    found[1:] = side[1:] * side[:-1] < 0
    return found


class Crossings(NamedTuple):
    """Where J_e was singular between two samples.

    Attributes
    ----------
    jumped : whether inputs jumped over one: with other samples they would be others
    sentence : what is to be said
    """

    jumped: bool
    sentence: str


def crossings(
    t: Array, u: Array, side: Integers, names: Sequence[str], units: Sequence[str]
) -> Crossings | None:
    """What to say of inputs u (N, m) at times t (N,) and the sign of det J_e (N,); None for nothing."""
    (after,) = np.nonzero(crossed(side))
    if not after.size:
        return None
    near = np.unique(np.clip(after[:, np.newaxis] + NEAR, 1, len(u) - 1))
    change = np.abs(u[near] - u[near - 1])
    sizes = np.linalg.norm(u, axis=1)
    larger = np.maximum(sizes[near], sizes[near - 1])
    far = np.linalg.norm(change, axis=1) > JUMPED * larger
    when = ", ".join(f"{t[k - 1]:.4g} and {t[k]:.4g} s" for k in after[:TOLD])
    more = f" and in {len(after) - TOLD} more steps" if len(after) > TOLD else ""
    said = f"J_e was singular between t = {when}{more} (its determinant changes its sign)"
    if not far.any():
        return Crossings(False, f"{said}; the inputs go on without a jump")
    row, j = divmod(int(np.argmax(np.where(far[:, np.newaxis], change, -1.0))), u.shape[1])
    k = near[row]
    return Crossings(
        True,
        f"{said}: there {names[j]} jumps from {u[k - 1, j]:.3g} to {u[k, j]:.3g} {units[j]}, and the motion "
        "from there on depends on where the samples fall; singular: damped drives through",
    )
