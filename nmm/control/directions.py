"""Directions that people can read: bases close to the axes, and "0.71 ee.x - 0.71 ee.y"."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from nmm.arrays import Array
from nmm.words import signed_sum

#: A component this small beside a unit vector is not written.
SMALL = 1e-6


def readable_basis(basis: Array) -> Array:
    """Another orthonormal basis (k, s) of the span of orthonormal rows (k, s), each row close to an axis.

    The axis with the largest part in the space is projected on it; then what is left, the same way. So a
    space that is spanned by axes gets these axes, and each row's largest component is positive.
    """
    projector = basis.T @ basis
    found = np.zeros_like(basis)
    for row in range(len(basis)):
        axis = int(np.argmax(np.round(np.diag(projector), 12)))  # of equals the first, whatever the rounding
        direction = projector[axis] / np.linalg.norm(projector[axis])
        direction /= np.linalg.norm(direction)
        found[row] = direction
        projector = projector - np.outer(direction, direction)
    return found


def direction_text(direction: Array, names: Sequence[str]) -> str:
    """A vector as a combination of names: "0.71 ee.x - 0.71 ee.y"; "ee.x" for an axis, "0" for none."""
    terms = [
        (value, f"{abs(value):.2g} {name}" if abs(abs(value) - 1.0) > SMALL else name)
        for value, name in zip(direction, names, strict=True)
        if abs(value) > SMALL
    ]
    return signed_sum(terms) or "0"


def direction_texts(directions: Array, names: Sequence[str]) -> tuple[str, ...]:
    """`direction_text` of each row."""
    return tuple(direction_text(direction, names) for direction in directions)
