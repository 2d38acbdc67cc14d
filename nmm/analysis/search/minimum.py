"""Where σ is smallest without being zero: what the starts that found no singularity ended at."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import Bounds, minimize

from nmm.analysis.search.search import Search
from nmm.arrays import Array

#: So many of the lowest ends are followed to the bottom.
FOLLOWED = 3
#: Below this beside the largest, σ_min may well be meant to be zero.
NEARLY = 1e-4


@dataclass(frozen=True, eq=False)
class LocalMinimum:
    """A configuration beside which σ_min does not get smaller, and is not zero.

    Attributes
    ----------
    q (n,) : m and rad
    sigma_min : smallest singular value, in the sizes of the search
    ratio : beside the largest of the whole J

    Examples
    --------
    >>> robot = nmm.load("unicycle_2r")
    >>> search = nmm.analysis.find_singularities((robot, nmm.Position("ee", "xy")), starts=40)
    >>> round(search.smallest.sigma_min, 3)
    0.212
    """

    q: Array
    sigma_min: float
    ratio: float

    @property
    def text(self) -> str:
        """One line."""
        text = (
            f"smallest σ_min at a local minimum that is not singular: {self.sigma_min:.4g} "
            f"({self.ratio:.2g} of the largest)"
        )
        if self.ratio < NEARLY:
            text += (
                "; nearly singular, as where a file writes pi/2 as 1.5708, or beside a target: a larger "
                "tolerance counts it as singular"
            )
        return text


def followed(search: Search, z: Array) -> Array:
    """The lowest of the ends z (N, a), each brought to its minimum of σ, (FOLLOWED or fewer, a)."""
    if not len(z) or not len(search.space.axes):
        return z[:FOLLOWED]
    sigma, _ = search.sigma(z)
    order = np.argsort(sigma, kind="stable")
    order = order[np.isfinite(sigma[order])][:FOLLOWED]
    return np.array([_bottom(search, z[i]) for i in order]).reshape(-1, z.shape[1])


def _bottom(search: Search, z: Array) -> Array:
    def sigma(point: Array) -> tuple[float, Array]:
        _, C, values = search.equations(point[np.newaxis], corank=1)
        return float(values[0, -1]), C[0, 0]

    found = minimize(
        sigma, z, jac=True, method="L-BFGS-B", bounds=Bounds(*search.space.bounds),
        options={"gtol": 1e-9, "ftol": 1e-14},
    ).x  # fmt: skip
    both = np.array([z, found])
    return np.asarray(both[np.argmin(search.sigma(both)[0])])


def lowest(search: Search, z: Array) -> LocalMinimum | None:
    """Of points z (N, a) that with the smallest σ; None without points."""
    if not len(z):
        return None
    sigma, ratio = search.sigma(z)
    best = int(np.argmin(sigma))
    if not np.isfinite(sigma[best]):
        return None
    return LocalMinimum(search.space.fold(search.space.q(z)[best]), float(sigma[best]), float(ratio[best]))
