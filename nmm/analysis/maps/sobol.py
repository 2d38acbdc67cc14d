"""Sobol's points, scrambled: those of `scipy.stats.qmc.Sobol` to the last bit.

SciPy takes longer to import than all of a map's points to compute: it is asked where there are many joints.

S. Joe and F. Y. Kuo, "Constructing Sobol sequences with better two-dimensional projections", SIAM J. Sci.
Comput. 30(5), 2008; scrambled by random triangular matrices and a shift: J. Matoušek, J. Complexity 14, 1998.
"""

from __future__ import annotations

import numpy as np

from nmm.arrays import Array, Integers

BITS = 30
#: Of each dimension a primitive polynomial over GF(2), its coefficients as bits, and the first direction
#: numbers (Joe and Kuo, new-joe-kuo-6.21201).
DIRECTIONS = (
    (1, (1,)),
    (3, (1,)),
    (7, (1, 3)),
    (11, (1, 3, 1)),
    (13, (1, 1, 1)),
    (19, (1, 1, 3, 3)),
    (25, (1, 3, 5, 13)),
    (37, (1, 1, 5, 5, 17)),
    (41, (1, 1, 5, 5, 5)),
    (47, (1, 1, 7, 11, 19)),
    (55, (1, 1, 5, 1, 1)),
    (59, (1, 1, 1, 3, 11)),
    (61, (1, 3, 5, 5, 31)),
    (67, (1, 3, 3, 9, 7, 49)),
    (91, (1, 1, 1, 15, 21, 21)),
    (97, (1, 3, 1, 13, 27, 49)),
    (103, (1, 1, 1, 15, 7, 5)),
    (109, (1, 3, 1, 15, 13, 25)),
)


def sobol(count: int, dimensions: int, seed: int) -> Array:
    """The first `count` (a power of 2) scrambled points (count, dimensions), each number in [0, 1)."""
    if dimensions > len(DIRECTIONS):
        from scipy.stats import qmc

        return np.asarray(qmc.Sobol(dimensions, rng=seed).random(count))
    rng = np.random.default_rng(seed).spawn(1)[0]
    places = np.arange(BITS)
    drawn = rng.integers(2, size=(dimensions, BITS), dtype=np.uint32).astype(np.int64)
    lower = np.tril(rng.integers(2, size=(dimensions, BITS, BITS), dtype=np.uint32)).astype(np.int64)
    lower[:, places, places] = 1
    numbers = np.array([_directions(*DIRECTIONS[k]) for k in range(dimensions)])
    # Bits from the highest on, (dimensions, bits, numbers).
    bits = numbers[:, np.newaxis] >> places[::-1, np.newaxis] & 1
    numbers = np.sum((lower @ bits & 1) << places[::-1, np.newaxis], axis=1)
    index = np.arange(count)
    gray = index ^ index >> 1
    found = np.tile(np.sum(drawn << places, axis=1), (count, 1))
    for place in range((count - 1).bit_length()):
        found ^= np.where(gray[:, np.newaxis] >> place & 1, numbers[:, place], 0)
    return found * 2.0**-BITS


def _directions(polynomial: int, first: tuple[int, ...]) -> Integers:
    """A dimension's direction numbers (BITS,), as multiples of 2^-BITS."""
    degree = polynomial.bit_length() - 1
    v = list(first)
    while len(v) < BITS:
        new = v[-degree] if degree else 1
        for k in range(1, degree + 1):
            if polynomial >> degree - k & 1:
                new ^= v[-k] << k
        v.append(new)
    return np.array([number << BITS - 1 - j for j, number in enumerate(v)], dtype=np.int64)
