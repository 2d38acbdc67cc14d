"""A search: what is measured, where, what counts as singular, and the random numbers that it draws."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from nmm.analysis.search.measure import Measure
from nmm.analysis.search.space import Space
from nmm.arrays import Array, Integers

#: Singular values this small beside the largest are zero.
TOLERANCE = 1e-8


@dataclass(frozen=True, eq=False)
class Search:
    """A measure on a space, whose points are z (N, a): what `Measure` says of configurations, said of these.

    Attributes
    ----------
    tolerance : singular values this small beside the largest of the whole J are zero
    rng : what all that is random is drawn from
    """

    measure: Measure
    space: Space
    tolerance: float
    rng: np.random.Generator

    def sigma(self, z: Array) -> tuple[Array, Array]:
        """The smallest singular value (N,), and that beside the largest."""
        return self.measure.sigma(self.space.q(z))

    def ranks(self, z: Array) -> Integers:
        """Rank of the part's J (N,)."""
        return self.measure.ranks(self.space.q(z), self.tolerance)

    def equations(self, z: Array, corank: int) -> tuple[Array, Array, Array]:
        """Wᵀ J V, its slopes along z, and the singular values."""
        space = self.space
        return self.measure.equations(space.q(z), space.axes, space.units[space.axes], corank)

    def looser(self, factor: float) -> Search:
        """The same with another tolerance."""
        return replace(self, tolerance=factor * self.tolerance)
