"""The singular configuration nearest to a given one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from nmm.analysis.singular.jacobians import Jacobians, Subject, checked
from nmm.analysis.singular.parts import WHOLE
from nmm.base.arrays import Array, Flags, counted
from nmm.base.progress import Progress
from nmm.base.text_format import listed, value_text
from nmm.plugins.symbolic.search.descent import FLAT, descend
from nmm.plugins.symbolic.search.family import SingularFamily
from nmm.plugins.symbolic.search.sorting import family_at
from nmm.plugins.symbolic.search.space import TOLERANCE, RankMeasure, SearchSpace, search_space

#: Lengths of a tangent step that are tried.
FACTORS = np.array([2.0, 1.0, 0.5, 0.1])
#: A tangent step shorter than this, in units, has arrived.
ARRIVED = 1e-10
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
    rank, full_rank, lost : of J at q, and elsewhere; the task's directions that are lost at q
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
        at = zip(self.names, self.q, self.units, strict=True)
        where = [f"{name} = {value_text(value, unit)}" for name, value, unit in at if name in self.changes]
        return f"nearest singular configuration: distance {self.distance:.4g}{metric}, at {listed(where)}"

    @property
    def remarks(self) -> list[str]:
        """Lines below the summary: what is lost, the family, and that local searches prove nothing."""
        family = "several families of singular configurations meet there"
        if self.family is not None:
            family = f"it lies in the family: {self.family.conditions}; {self.family.free_text}"
        if not self.changes:
            return [family]
        return [
            f"loses {listed(self.lost)} (rank {self.rank} of {self.full_rank})",
            family,
            f"the nearest that {self.starts} local searches found ({self.converged} of them found one); "
            "no proof that there is none nearer",
        ]

    def text(self) -> str:
        """Everything, in lines."""
        return "\n  ".join([self.summary, *self.remarks])


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
    >>> tip = nmm.Position("ee", "xy")
    >>> point = nmm.analysis.nearest_singularity((arm, tip), {"q1": 0.3, "q2": 0.4}, starts=20)
    >>> round(point.distance, 3), point.q.round(3) + 0.0
    (0.4, array([0.3, 0. ]))
    """
    jacobians = Jacobians(subject)
    t, given = checked(jacobians, t, q)
    measure, robot = RankMeasure(jacobians, part, length, sizes, t), jacobians.robot
    starts, rng = counted(starts, "starts"), np.random.default_rng(counted(seed, "seed", 0))
    search = search_space(measure, given, among, ranges, length, tolerance, rng, around=True)
    goal = search.z(given)
    z, ratio = descend(search, _starts(search, goal, starts))
    found = z[ratio <= search.tolerance]
    if not len(found):
        return None
    best = _nearest(search, found, goal, progress)
    at = best[np.newaxis]
    where, (sigma, ratio), rank = search.q(at)[0], search.sigma(at), int(search.ranks(at)[0])
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


def _starts(search: SearchSpace, goal: Array, starts: int) -> Array:
    """(starts, a): the goal, half the others around it near and far, the rest all over the ranges."""
    near, rng = starts // 2, search.rng
    directions = rng.standard_normal((near, len(goal)))
    directions /= np.maximum(np.linalg.norm(directions, axis=1), 1e-300)[:, np.newaxis]
    around = goal + directions * np.exp(rng.uniform(np.log(0.02), np.log(3.0), near))[:, np.newaxis]
    drawn = np.concatenate([goal[np.newaxis], around, search.draw(4 * starts)])
    drawn = search.clip(drawn)
    return drawn[np.isfinite(search.sigma(drawn)[0])][:starts]


def _nearest(search: SearchSpace, z: Array, goal: Array, progress: Progress | None) -> Array:
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


def slide(search: SearchSpace, z: Array, goal: Array, rounds: int) -> Array:
    """Singular points (N, a) that are no farther from the goal (a,) than z (N, a) are, point by point."""
    z = z.copy()
    distance = np.linalg.norm(z - goal, axis=1)
    live = np.ones(len(z), dtype=bool)
    for _ in range(rounds):
        at = np.flatnonzero(live)
        if not len(at) or not z.shape[1]:
            break
        step = _towards(search, z[at], goal)
        tries = z[at][:, np.newaxis] + step[:, np.newaxis] * FACTORS[:, np.newaxis]
        landed, ratio = descend(search, tries.reshape(-1, z.shape[1]), iterations=12)
        landed = landed.reshape(tries.shape)
        far = np.linalg.norm(landed - goal, axis=2)
        far[ratio.reshape(far.shape) > search.tolerance] = np.inf
        best = np.argmin(far, axis=1)
        row = np.arange(len(at))
        better = far[row, best] < distance[at] - 1e-14
        z[at[better]] = landed[row, best][better]
        distance[at[better]] = far[row, best][better]
        live[at] = better & (np.linalg.norm(step, axis=1) > ARRIVED)
    return z


def _towards(search: SearchSpace, z: Array, goal: Array) -> Array:
    """The part (N, a) of goal - z that is tangent to the singular set and stays inside the bounds."""
    _, C, values = search.equations(z, 1)
    floor = FLAT * np.maximum(values[:, :1], 1e-300)

    def step(usable: Flags) -> Array:
        _, sizes, rows = np.linalg.svd(C * usable[:, np.newaxis], full_matrices=False)
        normals = np.where((sizes > floor)[..., np.newaxis], rows, 0.0)
        own = (goal - z) * usable
        return np.asarray(own - (np.swapaxes(normals, 1, 2) @ (normals @ own[..., np.newaxis]))[..., 0])

    return search.step(z, step)
