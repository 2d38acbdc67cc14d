"""Where J loses rank: singular configurations found from many starts, told as families."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from nmm.analysis.singular.jacobians import Jacobians, Subject
from nmm.analysis.singular.parts import WHOLE
from nmm.base.arrays import Array, counted, scalar
from nmm.base.errors import SingularError
from nmm.base.progress import Progress, between
from nmm.base.text_format import counted as counted_text
from nmm.base.text_format import listed, value_text
from nmm.plugins.symbolic.search.descent import LocalMinimum, descend, followed, lowest
from nmm.plugins.symbolic.search.family import SingularFamily
from nmm.plugins.symbolic.search.sorting import everywhere, families_of
from nmm.plugins.symbolic.search.space import TOLERANCE, RankMeasure, SearchSpace, search_space

#: Cheap samples for each start of the better half.
SAMPLES = 20


@dataclass(frozen=True, eq=False)
class SingularitySearch:
    """What a search found.

    That nothing was found is no proof: `starts` local minimisations ended elsewhere, `smallest` says where.

    Attributes
    ----------
    robot, part, rows : names; of the part whose columns of J were searched, and of the task's rows
    full_rank : of the part's J, where it is not singular
    families : the thickest first
    starts, seed, converged : local minimisations, what drew them, and how many ended where J is singular
    smallest : the lowest of the local minima of σ_min that are not singular; None without one
    ranges : (lower, upper) of the coordinates that were searched, m or rad
    indifferent : coordinates that may move and on which J's singular values do not depend: always free
    fixed, units : coordinates that did not move, and where they stood; the units of all, rad or m
    tolerance : singular values this small beside the largest are zero

    Examples
    --------
    >>> robot = nmm.load("unicycle_2r")
    >>> search = nmm.analysis.find_singularities((robot, nmm.Position("ee", "xy")), part="arm", starts=40)
    >>> search.full_rank, search.converged
    (2, 40)
    """

    robot: str
    part: str
    rows: tuple[str, ...]
    full_rank: int
    families: tuple[SingularFamily, ...]
    starts: int
    seed: int
    converged: int
    smallest: LocalMinimum | None
    ranges: Mapping[str, tuple[float, float]]
    units: Mapping[str, str]
    indifferent: tuple[str, ...]
    fixed: Mapping[str, float]
    tolerance: float

    @property
    def found(self) -> bool:
        """Whether there is a singular configuration."""
        return self.converged > 0

    @property
    def everywhere(self) -> bool:
        """Whether J is singular wherever one looks."""
        return any(not family.codimension for family in self.families)

    @property
    def unsorted(self) -> int:
        """Starts that ended at singular configurations where families meet, so that none could be told."""
        return self.converged - sum(family.starts for family in self.families)

    @property
    def summary(self) -> str:
        """One line: how many families, or that none was found, and from how many starts."""
        whose = "J" if self.part == WHOLE else f"J's columns of the {self.part}"
        if self.everywhere:
            rank, full = self.families[0].rank, self.full_rank
            if self.part == WHOLE:
                return f"J is singular everywhere: rank {rank}, not {full}"
            return f"{whose} lose rank everywhere: {rank}, where rows and inputs allow {full}"
        if not self.converged:
            return f"no singular configuration of {whose} found from {self.starts} starts"
        count = len(self.families)
        return (
            f"{count} famil{'y' if count == 1 else 'ies'} of singular configurations of {whose} "
            f"(rank below {self.full_rank}), found by {self.converged} of {self.starts} starts"
        )

    def configuration_text(self, q: Array) -> str:
        """ "q1 = 0, q2 = π/2": q (n,) without the indifferent coordinates."""
        return ", ".join(
            f"{name} = {value_text(float(value), unit)}"
            for (name, unit), value in zip(self.units.items(), q, strict=True)
            if name not in self.indifferent
        )

    @property
    def remarks(self) -> list[str]:
        """Lines beside the families: the smallest σ_min that is not zero, and what was searched."""
        lines = [f"{counted_text(self.unsorted, 'start')} ended where families meet"] if self.unsorted else []
        if self.smallest is not None:
            lines.append(f"{self.smallest.text}, at {self.configuration_text(self.smallest.q)}")
        ranges = [
            f"{name} from {value_text(lower, self.units[name])} to {value_text(upper, self.units[name])}"
            for name, (lower, upper) in self.ranges.items()
        ]
        lines.append(f"searched: {'; '.join(ranges) or 'nothing that matters may move'}")
        if self.indifferent:
            lines.append(f"J's singular values do not depend on {', '.join(self.indifferent)}")
        if self.fixed:
            stood = [f"{name} = {value_text(value, self.units[name])}" for name, value in self.fixed.items()]
            lines.append(f"not moved: {listed(stood)}")
        return lines

    def text(self) -> str:
        """Everything, in lines."""
        return "\n".join([self.summary, *(f"  {family.text}" for family in self.families), *self.remarks])


def find_singularities(
    subject: Subject,
    *,
    starts: int = 200,
    seed: int = 0,
    ranges: Mapping[str, tuple[float, float]] | None = None,
    among: Sequence[str] | None = None,
    at: ArrayLike | Mapping[str, float] | None = None,
    part: str = WHOLE,
    length: float | None = None,
    sizes: Mapping[str, float] | None = None,
    tolerance: float = TOLERANCE,
    t: float = 0.0,
    progress: Progress | None = None,
) -> SingularitySearch:
    """Search the singular configurations of the task's J_bar (paper, eq. 13) inside the limits.

    From each start σ_min is minimised; what ends at zero is sorted into families, and random members of each
    family are tried. Half the starts are drawn uniformly, half are each the best of 20 samples. The same
    seed gives the same result.

    Parameters
    ----------
    subject : a controller, or (robot, task); functions without targets are enough
    starts, seed : local minimisations, and what draws them
    ranges : (lower, upper) by coordinate, m or rad, whatever the limits. Else the limits; where there are
        none, or they make more than a turn, angles from -π to π, and lengths about the robot's reach either
        way from `at`
    among : coordinates that may move; None for all
    at : where the others stay, and examples have what is free; None for the configuration nearest to zero
    part : "robot", "arm", "platform" or an arm's name: whose columns of J. An arm's families that are none
        of the robot's are those that the platform removes
    length, sizes : as in `analyse`; they hardly matter for what is singular, but for σ_min
    tolerance : singular values this small beside the largest of the whole J are zero
    t : s
    progress : called with the fraction done

    Raises
    ------
    InputError : a number of starts below 1; an unknown coordinate or part; an empty range; a task of more
        rows than the robot has inputs
    SingularError : there is no J anywhere in the ranges

    Examples
    --------
    >>> robot = nmm.load("unicycle_2r")
    >>> search = nmm.analysis.find_singularities((robot, nmm.Position("ee", "xy")), part="arm", starts=40)
    >>> [family.text for family in search.families]
    ['q2 = 0 or ±π; x, y, theta and q1 free; loses ee.x (rank 1); 40 starts']
    """
    jacobians = Jacobians(subject)
    measure, robot = RankMeasure(jacobians, part, length, sizes, scalar(t, "t")), jacobians.robot
    starts, seed = counted(starts, "starts"), counted(seed, "seed", 0)
    rng = np.random.default_rng(seed)
    stand = robot.rest if at is None else robot.q(at)
    robot.check_followers(stand)
    search = search_space(measure, stand, among, ranges, length, tolerance, rng)
    first, singular = _starts(search, starts)
    families: tuple[SingularFamily, ...]
    if singular:
        families = (everywhere(search, first[0], starts),)
        converged, bottom = starts, None
    else:
        z, ratio = descend(search, first, progress=between(progress, 0.0, 0.6))
        ends = followed(search, z[ratio > search.tolerance])
        singular_ends = search.sigma(ends)[1] <= search.tolerance
        found = np.concatenate([z[ratio <= search.tolerance], ends[singular_ends]])
        converged, bottom = len(found), lowest(search, ends[~singular_ends])
        families = families_of(search, found)
    if progress is not None:
        progress(1.0)
    names = robot.q_names
    return SingularitySearch(
        robot=robot.name,
        part=part,
        rows=jacobians.row_names,
        full_rank=measure.full_rank,
        families=families,
        starts=starts,
        seed=seed,
        converged=converged,
        smallest=bottom,
        ranges={names[j]: (float(search.lower[j]), float(search.upper[j])) for j in search.axes},
        units=dict(zip(names, robot.q_units, strict=True)),
        indifferent=tuple(names[j] for j in search.indifferent),
        fixed={names[j]: float(stand[j]) for j in robot.following.independent if j not in search.moving},
        tolerance=search.tolerance,
    )


def _starts(search: SearchSpace, starts: int) -> tuple[Array, bool]:
    """Starts (starts, a) that have a J, and whether all samples are singular."""
    pool = search.draw(max(SAMPLES * ((starts + 1) // 2), 2 * SAMPLES))
    sigma, ratio = search.sigma(pool)
    exists = np.isfinite(sigma)
    if not exists.any():
        raise SingularError("the wheels cannot roll, or the task is undefined, everywhere in these ranges")
    best = sigma.reshape(-1, SAMPLES).argmin(axis=1) + SAMPLES * np.arange(len(pool) // SAMPLES)
    good = [int(i) for i in best if exists[i]][: (starts + 1) // 2]
    plain = np.flatnonzero(exists)
    rest = plain[search.rng.permutation(len(plain))[: starts - len(good)]]
    chosen = np.concatenate([np.array(good, dtype=np.int64), rest])
    chosen = np.resize(chosen, starts)  # again from the first, where hardly any have a J
    return pool[chosen], bool(np.all(ratio[exists] <= search.tolerance))
