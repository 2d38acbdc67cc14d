"""The smallest and the largest value of a map's measure, also between its cells, where it is singular."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from nmm.analysis.maps.singular_set import SingularSet
from nmm.analysis.singular.parts import WHOLE
from nmm.arrays import Array

#: What a measure of the part is where the part's J loses rank.
WHERE_SINGULAR: Mapping[str, float] = {
    "sigma_min": 0.0,
    "inverse_condition": 0.0,
    "manipulability": 0.0,
    "eccentricity": 1.0,
}
#: Measures that are zero where the whole robot is singular: a part is there, too.
OF_PARTS = ("arm_manipulability", "platform_manipulability", "weighted")
#: Smallest and largest that differ by less than this, of the largest in size, differ by rounding.
SAME = 1e-9
EVERYWHERE = "everywhere"


class Extreme(NamedTuple):
    """A value, where on the map it is, and on what: a singular set, in words, "everywhere" where the map has
    no other value (no place then says more than the others), or "" for a cell's sample.

    Examples
    --------
    >>> robot = nmm.load("unicycle_2r")
    >>> found = nmm.analysis.singularity_map((robot, nmm.Position("ee", "xy")), samples=20)
    >>> smallest = found.extremes("sigma_min")["smallest"]
    >>> isinstance(smallest, nmm.analysis.Extreme), round(smallest.value, 4)
    (True, 0.2135)
    """

    value: float
    at: tuple[float, float]
    on: str = ""


class Known(NamedTuple):
    """What a measure is on a singular set: the set, whose it is ("" or "arm's "), the value."""

    those: SingularSet
    whose: str
    value: float


def extremes(
    values: Array, axes: tuple[Array, Array], known: Sequence[Known], between: Sequence[Known]
) -> dict[str, Extreme]:
    """ "smallest" and "largest" of a map's values; NaN where there is no number.

    Parameters
    ----------
    values : (rows, columns), NaN where there is none
    axes : the columns' (columns,) and the rows' (rows,) coordinates
    known : what the measure is on the singular sets that were found
    between : those of them that count, beside the cells, where they are no more than lines and points
    """
    found = {}
    for name, pick in (("smallest", np.nanargmin), ("largest", np.nanargmax)):
        if np.all(np.isnan(values)):
            found[name] = Extreme(np.nan, (np.nan, np.nan))
            continue
        row, column = np.unravel_index(pick(values), values.shape)
        where = float(axes[0][column]), float(axes[1][row])
        found[name] = Extreme(float(values[row, column]), where)
    constant = [value for those, _, value in known if those.everywhere]
    seen = [found["smallest"].value, found["largest"].value, *(value for *_, value in between)]
    if constant or max(seen) - min(seen) <= SAME * max(map(abs, seen)):
        return {
            end: Extreme(constant[0] if constant else one.value, one.at, EVERYWHERE)
            for end, one in found.items()
        }
    for those, whose, value in between[:1]:
        end = "largest" if value > 0.0 else "smallest"
        found[end] = Extreme(value, _first_of(those), _words(those, whose))
    return found


def known_on(measure: str, part: str, singular: SingularSet, arm_singular: SingularSet | None) -> list[Known]:
    """What is known of a measure on the singular sets that were found, of the part's J and the arm's."""
    found = []
    if measure in WHERE_SINGULAR:
        found.append(Known(singular, "", WHERE_SINGULAR[measure]))
    if measure in OF_PARTS and part == WHOLE:
        found.append(Known(singular, "", 0.0))
    if measure == "arm_manipulability":
        own = singular if part == "arm" else arm_singular
        if own is not None:
            found.insert(0, Known(own, "arm's ", 0.0))
    return [one for one in found if not one.those.empty]


def _first_of(those: SingularSet) -> tuple[float, float]:
    points = those.lines[0] if those.lines else those.points
    return float(points[0, 0]), float(points[0, 1])


def _words(those: SingularSet, whose: str) -> str:
    """ "the singular lines", "the arm's singular lines and point"."""
    n = len(those.points)
    kinds = ["lines"] * bool(those.lines) + [f"point{'s' * (n > 1)}"] * bool(n)
    return f"the {whose}singular {' and '.join(kinds)}"
