"""The singular configuration nearest to a given one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from nmm.analysis.search.descent import descend
from nmm.analysis.search.family import SingularFamily
from nmm.analysis.search.measure import Measure
from nmm.analysis.search.search import TOLERANCE, Search
from nmm.analysis.search.slide import slide
from nmm.analysis.search.sorting import family_at
from nmm.analysis.search.space import search_space
from nmm.analysis.singular.jacobians import Jacobians, Subject, checked
from nmm.analysis.singular.parts import WHOLE
from nmm.arrays import Array, counted, positive
from nmm.progress import Progress
from nmm.words import listed, value_text

#: Nearest candidates that are followed to the end.
KEPT = 8
#: Changes below this are none, m or rad.
UNCHANGED = 1e-6


@dataclass(frozen=True, eq=False)
class SingularPoint:
    """A singular configuration near a given one: the nearest that `starts` local searches found.

    Each search ends where no singular configuration beside it is nearer; that none is nearer at all is not
    proved.

    Attributes
    ----------
    q (n,) : m and rad; `given` (n,) : the configuration it is near to
    distance : root of the sum of squares of the changes, in rad, lengths in units of `length`
    length : m that count as 1 rad
    names, units : of the coordinates
    family : what is free, pinned and tied there; None where several families meet and none could be told
    rank, full_rank : of J at q, and elsewhere
    lost : the task's directions that are lost at q
    sigma_min, ratio : smallest singular value at q, and beside the largest of the whole J
    starts, converged : local searches, and how many of them found a singular configuration

    Examples
    --------
    >>> arm = nmm.load("unicycle_2r", platform="fixed")
    >>> point = nmm.analysis.nearest_singularity((arm, nmm.Position("ee", "xy")), {"q2": 0.4}, starts=20)
    >>> point.rank, point.full_rank, point.free
    (1, 2, ('q1',))
    """

    q: Array
    given: Array
    distance: float
    length: float
    names: tuple[str, ...]
    units: tuple[str, ...]
    family: SingularFamily | None
    rank: int
    full_rank: int
    lost: tuple[str, ...]
    sigma_min: float
    ratio: float
    starts: int
    converged: int

    @property
    def changes(self) -> dict[str, float]:
        """How far each coordinate that moves has to go, m or rad."""
        moves = zip(self.names, self.q - self.given, strict=True)
        return {name: float(change) for name, change in moves if abs(change) > UNCHANGED}

    @property
    def free(self) -> tuple[str, ...]:
        """Coordinates that may take any value there."""
        return self.family.free if self.family else ()

    @property
    def pinned(self) -> dict[str, float]:
        """Values at q of the coordinates that are pinned there."""
        values = dict(zip(self.names, self.q, strict=True))
        return {name: float(values[name]) for name in (self.family.pinned if self.family else ())}

    @property
    def summary(self) -> str:
        """One line: how far, and where."""
        if not self.changes:
            return f"singular already: loses {listed(self.lost)} (rank {self.rank} of {self.full_rank})"
        metric = "" if "m" not in self.units else f" (rad; {self.length:g} m count as 1 rad)"
        units = dict(zip(self.names, self.units, strict=True))
        values = dict(zip(self.names, self.q, strict=True))
        where = [f"{name} = {value_text(values[name], units[name])}" for name in self.changes]
        return f"nearest singular configuration: distance {self.distance:.4g}{metric}, at {listed(where)}"

    @property
    def family_text(self) -> str:
        """One line: the family that it lies in."""
        if self.family is None:
            return "several families of singular configurations meet there"
        return f"it lies in the family: {self.family.conditions}; {self.family.free_text}"

    @property
    def proof_text(self) -> str:
        """One line: that this is what local searches found, and how many."""
        return (
            f"the nearest that {self.starts} local searches found ({self.converged} of them found one); "
            "no proof that there is none nearer"
        )

    def text(self) -> str:
        """Everything, in lines."""
        lines = [self.summary]
        if self.changes:
            lines.append(f"  loses {listed(self.lost)} (rank {self.rank} of {self.full_rank})")
        lines.append(f"  {self.family_text}")
        if self.changes:
            lines.append(f"  {self.proof_text}")
        return "\n".join(lines)


def nearest_singularity(
    subject: Subject,
    q: ArrayLike | Mapping[str, float],
    *,
    starts: int = 60,
    seed: int = 0,
    ranges: Mapping[str, tuple[float, float]] | None = None,
    among: Sequence[str] | None = None,
    part: str = WHOLE,
    length: float | None = None,
    sizes: Mapping[str, float] | None = None,
    tolerance: float = TOLERANCE,
    t: float = 0.0,
    progress: Progress | None = None,
) -> SingularPoint | None:
    """The singular configuration nearest to q, inside the limits; None when none was found.

    Local searches start at q, at random around it, and all over the ranges; what they find slides along the
    singular set towards q. Distance is the root of the sum of squared changes of the coordinates in rad;
    `length` m count as 1 rad. Angles are not wrapped: 3.1 rad is far from -3.1 rad for a joint.

    Parameters
    ----------
    subject, part, sizes, tolerance, t, progress : as in `find_singularities`
    q : (n,) m and rad, or by name
    starts, seed : local searches, and what draws them
    ranges : (lower, upper) by coordinate; else the limits, or where there are none half a turn or about the
        robot's reach either way from q
    among : coordinates that may move; None for all
    length : characteristic length, m; 1 m where it is None

    Raises
    ------
    InputError, SingularError : as `find_singularities`

    Examples
    --------
    >>> arm = nmm.load("unicycle_2r", platform="fixed")
    >>> hand = nmm.Position("ee", "xy")
    >>> point = nmm.analysis.nearest_singularity((arm, hand), {"q1": 0.3, "q2": 0.4}, starts=20)
    >>> round(point.distance, 3), point.q.round(3) + 0.0
    (0.4, array([0.3, 0. ]))
    """
    jacobians = Jacobians(subject)
    t, given = checked(jacobians, t, q)
    measure, robot = Measure(jacobians, part, length, sizes, t), jacobians.robot
    starts, rng = counted(starts, "starts"), np.random.default_rng(counted(seed, "seed", 0))
    space = search_space(measure, given, among, ranges, length, rng, around=True)
    search = Search(measure, space, positive(tolerance, "tolerance"), rng)
    goal = space.z(given)
    z, ratio = descend(search, _starts(search, goal, starts))
    found = z[ratio <= search.tolerance]
    if not len(found):
        return None
    best = _nearest(search, found, goal, progress)
    at = best[np.newaxis]
    where, (sigma, ratio), rank = space.q(at)[0], search.sigma(at), int(search.ranks(at)[0])
    return SingularPoint(
        q=where,
        given=given,
        distance=float(np.linalg.norm(best - goal)),
        length=1.0 if length is None else float(length),
        names=robot.q_names,
        units=robot.q_units,
        family=family_at(search, best),
        rank=rank,
        full_rank=measure.full_rank,
        lost=measure.lost_text(where, rank),
        sigma_min=float(sigma[0]),
        ratio=float(ratio[0]),
        starts=starts,
        converged=len(found),
    )


def _starts(search: Search, goal: Array, starts: int) -> Array:
    """(starts, a): the goal, half the others around it near and far, the rest all over the ranges."""
    near, rng = starts // 2, search.rng
    directions = rng.standard_normal((near, len(goal)))
    directions /= np.maximum(np.linalg.norm(directions, axis=1), 1e-300)[:, np.newaxis]
    around = goal + directions * np.exp(rng.uniform(np.log(0.02), np.log(3.0), near))[:, np.newaxis]
    drawn = np.concatenate([goal[np.newaxis], around, search.space.draw(rng, 4 * starts)])
    drawn = search.space.clip(drawn)
    return drawn[np.isfinite(search.sigma(drawn)[0])][:starts]


def _nearest(search: Search, z: Array, goal: Array, progress: Progress | None) -> Array:
    """The nearest to the goal of singular points z (N, a), each slid towards it; (a,)."""
    for turn, (rounds, kept) in enumerate([(3, 4 * KEPT), (8, KEPT), (150, 1)]):
        if progress is not None:
            progress(0.25 * (turn + 1))
        z = slide(search, z, goal, rounds)
        order = np.argsort(np.round(np.linalg.norm(z - goal, axis=1), 12), kind="stable")
        z = z[order[:kept]]
    if progress is not None:
        progress(1.0)
    return z[0]
