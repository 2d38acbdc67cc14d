"""Which numbers measurements show, by singular values in units of the noise."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from nmm.base.arrays import Array

#: A direction of numbers is shown if it is known to this share of what is plausible.
SHOWN = 0.5


def hidden(W: Array, scales: Array, order: Callable[[int], float]) -> dict[int, list[int]]:
    """Columns of W that measurements do not show, one after another, each with the others that would make up
    for it: of what is plausible, the direction that is least known; the last in it by order of what is held
    first.

    W (N, f) : slopes of measurements over their standard deviations; scales (f,) : what is plausible
    order : of a column, greater where it is held rather than others
    """
    left, lost = [*range(len(scales))], {}
    scaled = W * scales
    if len(scaled) > len(scales):
        scaled = np.linalg.qr(scaled)[1]  # its singular values are those of W, and it has fewer rows
    while left:
        _, sizes, directions = np.linalg.svd(scaled[:, left], full_matrices=False)
        if len(sizes) == len(left) and sizes[-1] * SHOWN > 1.0:
            break
        weak = np.abs(directions[-1])
        weak = np.where(weak > 0.3 * weak.max(), weak, 0.0)
        worst = max(range(len(left)), key=lambda j: (weak[j] > 0.0, order(left[j]), weak[j]))
        others = [left[j] for j in range(len(left)) if weak[j] > 0.0 and j != worst]
        lost[left.pop(worst)] = others
    return lost


def independent(W: Array, order: Sequence[int]) -> list[int]:
    """The columns of W (N, f) that none before them in an order makes up for."""
    kept: list[int] = []
    basis = np.zeros((len(W), 0))
    for j in order:
        size = float(np.linalg.norm(W[:, j]))
        if size == 0.0:
            continue
        rest = W[:, j] / size
        for _ in range(2):  # once more: what rounding left
            rest = rest - basis @ (basis.T @ rest)
        norm = float(np.linalg.norm(rest))
        if norm > 1e-6:
            kept.append(j)
            basis = np.column_stack([basis, rest / norm])
    return kept
