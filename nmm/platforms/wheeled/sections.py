"""Lists of numbers as one vector, which is all that a platform's kernel is given.

The vector begins with the offsets of its sections, so that compiled code finds them by number.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from nmm.arrays import Array
from nmm.kernels.compiled import inlined


def pack(sections: Sequence[Array]) -> Array:
    """[offsets of the sections and of the end, section after section], all flattened."""
    flat = [section.ravel() for section in sections]
    ends = len(flat) + 1 + np.cumsum([0, *(len(section) for section in flat)])
    return np.concatenate([ends.astype(np.float64), *flat])


@inlined
def section(packed: Array, number: int) -> tuple[int, tuple[int]]:
    """Where one section begins, and its extents, for `view`."""
    first = int(packed[number])
    return first, (int(packed[number + 1]) - first,)
