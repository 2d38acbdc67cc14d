"""Several arrays as one: a compiled call costs about 0.1 µs an array, so a step's tables travel together.

A packed vector begins with the offsets of its sections, so that compiled code finds them by number.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from nmm.kernels.compiled import inlined, view


def pack(sections: Sequence[Any], dtype: type) -> NDArray[Any]:
    """[offsets of the sections and of the end, section after section], all flattened."""
    flat: list[NDArray[Any]] = [np.asarray(section, dtype=dtype).ravel() for section in sections]
    ends = len(flat) + 1 + np.cumsum([0, *(len(section) for section in flat)])
    return np.concatenate([ends.astype(dtype), *flat])


@inlined
def section(packed: NDArray[Any], number: int) -> NDArray[Any]:
    """The view of one section."""
    first = int(packed[number])
    return view(packed, first, (int(packed[number + 1]) - first,))
