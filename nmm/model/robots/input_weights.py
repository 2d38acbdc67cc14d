"""Weights of inputs, by their names or by those of their groups."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike

from nmm.base.arrays import Array, scalar
from nmm.base.errors import expect_known

#: Numbers above 0: by input or by group ("platform", "arm"), an input's own deciding; 1 for the rest.
Weights = ArrayLike | Mapping[str, float]


def by_name(
    weights: Mapping[str, float], inputs: Sequence[str], groups: Mapping[str, Sequence[str]]
) -> Array:
    """A weight for each input, (m,); `InputError` for an unknown name. The caller checks the signs."""
    values = np.ones(len(inputs))
    for name in weights:
        expect_known("input or group", name, [*inputs, *groups], "weights")
    # An input's own weight has the last word, a smaller group's the one before.
    order = sorted(weights, key=lambda name: name in inputs or -len(groups[name]))
    for name in order:
        for member in (name,) if name in inputs else groups[name]:
            values[inputs.index(member)] = scalar(weights[name], f"weight of {name}")
    return values
