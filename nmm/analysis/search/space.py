"""Where to search: the coordinates that may move, their ranges, which matter, and which are circular."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from nmm.analysis.search.measure import Measure
from nmm.arrays import Array, Flags, Integers, vector
from nmm.errors import InputError, SingularError
from nmm.robots.robot import Robot

TURN = 2.0 * np.pi
#: Limits that are short of a turn by less than this are a turn, rad: files write pi in some digits.
DIGITS = 1e-6
#: Singular values that differ by less than this, beside the largest, are the same.
SAME = 1e-9
#: Configurations that tell whether a coordinate matters.
PROBES = 24
#: Longest step, in units.
LONGEST = 0.6


@dataclass(frozen=True, eq=False)
class Space:
    """What is searched.

    Attributes
    ----------
    robot : whose coordinates
    at (n,) : where the other coordinates stay
    moving : indices of the coordinates that may move
    axes (a,) : those of them on which J's singular values depend; the others are free from the start
    lower, upper (n,) : ranges; those of `moving` count
    circular (n,) : angles that make the whole turn and come back to the same J
    units (n,) : what counts as 1 of a coordinate: 1 rad, or the characteristic length in m
    """

    robot: Robot
    at: Array
    moving: tuple[int, ...]
    axes: Integers
    lower: Array
    upper: Array
    circular: Flags
    units: Array

    @property
    def indifferent(self) -> tuple[int, ...]:
        """Coordinates that may move and on which J's singular values do not depend."""
        return tuple(j for j in self.moving if j not in self.axes)

    def q(self, z: Array) -> Array:
        """Configurations (N, n) of the values (N, a) of `axes`, in their units."""
        q = np.tile(self.at, (len(z), 1))
        q[:, self.axes] = z * self.units[self.axes]
        return self.robot.following.placed(q)

    def z(self, q: Array) -> Array:
        """Values (..., a) of `axes` in their units."""
        return np.asarray(q[..., self.axes] / self.units[self.axes])

    @property
    def bounds(self) -> tuple[Array, Array]:
        """Lower and upper (a,) of z; infinite for circular ones, which need none."""
        units, turn = self.units[self.axes], self.circular[self.axes]
        lower, upper = self.lower[self.axes] / units, self.upper[self.axes] / units
        return np.where(turn, -np.inf, lower), np.where(turn, np.inf, upper)

    def clip(self, z: Array) -> Array:
        """z (..., a) within the bounds."""
        return np.asarray(np.clip(z, *self.bounds))

    def step(self, z: Array, of: Callable[[Flags], Array]) -> Array:
        """The step (N, a) from z of the coordinates that may move, without those that would leave the bounds.

        Parameters
        ----------
        of : which coordinates may move (N, a) -> the step of these
        """
        lower, upper = self.bounds
        usable = np.ones(z.shape, dtype=bool)
        for _ in range(z.shape[1] + 1):
            step = of(usable)
            outward = ((z <= lower) & (step < 0.0)) | ((z >= upper) & (step > 0.0))
            if not np.any(outward & usable):
                break
            usable &= ~outward
        size = np.max(np.abs(step), axis=1, initial=0.0)
        return np.asarray(step * np.minimum(1.0, LONGEST / np.maximum(size, 1e-300))[:, np.newaxis])

    def draw(self, rng: np.random.Generator, count: int) -> Array:
        """z (count, a), uniform over the ranges."""
        units = self.units[self.axes]
        lower, upper = self.lower[self.axes] / units, self.upper[self.axes] / units
        return rng.uniform(lower, upper, (count, len(self.axes)))

    def fold(self, q: Array) -> Array:
        """q (..., n) with circular coordinates brought into their ranges; the upper end for the lower."""
        low = self.lower + DIGITS
        turned = low + np.mod(q - low, TURN)
        turned = np.where((turned > self.upper) & (turned - TURN >= self.lower), turned - TURN, turned)
        # Where neither is inside, the range is short of a turn by the digits in which files write pi.
        return self.robot.following.placed(
            np.where(self.circular, np.clip(turned, self.lower, self.upper), q)
        )


def reach(robot: Robot) -> float:
    """An upper bound of how far the arm gets from the platform's reference point, m; at least 0.1."""
    model = robot.model
    total = sum(float(np.linalg.norm(placement.translation)) for placement in model.jointPlacements)
    travel = [
        float(np.max(np.abs(limits)))
        for unit, limits, limited in zip(robot.q_units, robot.q_limits, robot.limited, strict=True)
        if unit == "m" and limited.all()
    ]
    tip = max((float(np.linalg.norm(frame.placement.translation)) for frame in model.frames), default=0.0)
    return max(total + sum(travel) + tip, 0.1)


def search_space(
    measure: Measure,
    at: Array,
    among: Sequence[str] | None,
    ranges: Mapping[str, tuple[float, float]] | None,
    length: float | None,
    rng: np.random.Generator,
    *,
    around: bool = False,
) -> Space:
    """The space to search.

    Parameters
    ----------
    at (n,) : where the coordinates stay that do not move
    among : coordinates that may move; None for all that follow no other
    ranges : (lower, upper) by coordinate
    length : so many m count as 1 rad; 1 m where it is None
    around : ranges lie around `at`; and what is limited keeps its limits, whole turns too

    Raises
    ------
    InputError : an unknown coordinate, an empty range, a range of a coordinate that may not move
    SingularError : there is no J anywhere in these ranges
    """
    robot = measure.robot
    moving = _moving(robot, among)
    given = _ranges(robot, moving, ranges)
    own = robot.limited
    lower = np.where(own[:, 0], robot.q_limits[:, 0], -np.inf)
    upper = np.where(own[:, 1], robot.q_limits[:, 1], np.inf)
    angle = np.array([unit == "rad" for unit in robot.q_units])
    units = np.where(angle, 1.0, 1.0 if length is None else float(length))
    span = reach(robot)
    for j in range(robot.n):
        half, center = (np.pi, 0.0) if angle[j] and not around else (np.pi if angle[j] else span, at[j])
        window = _default(lower[j], upper[j], center, half, cut=bool(angle[j]) and not around)
        lower[j], upper[j] = given.get(j) or window
    space = Space(robot, at, moving, np.array(moving, dtype=np.int64), lower, upper, ~angle & angle, units)
    q = _probes(measure, space, rng)
    measure.settle(q)
    wide = angle & (upper - lower >= TURN - DIGITS)
    if around:
        wide &= ~own.any(axis=1)
    matter, circular = [], np.zeros(robot.n, dtype=bool)
    for j in moving:
        drawn = q.copy()
        drawn[:, j] = rng.uniform(lower[j], upper[j], len(q))
        if not _same(measure, q, drawn):
            matter.append(j)
        if wide[j]:
            drawn[:, j] = q[:, j] + TURN
            circular[j] = _same(measure, q, drawn)
    return Space(robot, at, moving, np.array(matter, dtype=np.int64), lower, upper, circular, units)


def _moving(robot: Robot, among: Sequence[str] | None) -> tuple[int, ...]:
    if among is None:
        return tuple(int(j) for j in robot.following.independent)
    names = [among] if isinstance(among, str) else list(among)
    found = tuple(sorted({robot.independent(name) for name in names}))
    if not found:
        raise InputError(f"among: expected coordinates of {', '.join(robot.q_names)}, got none")
    return found


def _ranges(
    robot: Robot, moving: Sequence[int], ranges: Mapping[str, tuple[float, float]] | None
) -> dict[int, tuple[float, float]]:
    found = {}
    for name, value in (ranges or {}).items():
        j = robot.independent(name)
        if j not in moving:
            raise InputError(f"ranges: {name} may not move; among are {', '.join(_names(robot, moving))}")
        lower, upper = vector(value, 2, f"range of {name}")
        if lower >= upper:
            raise InputError(f"range of {name}: expected (lower, upper), got ({lower:g}, {upper:g})")
        found[j] = (float(lower), float(upper))
    return found


def _names(robot: Robot, indices: Sequence[int]) -> list[str]:
    return [robot.q_names[j] for j in indices]


def _default(lower: float, upper: float, center: float, half: float, cut: bool) -> tuple[float, float]:
    """The limits; what is unlimited, and with `cut` what is longer, only within `half` of `center`."""
    if np.isfinite(lower) and np.isfinite(upper):
        if not cut or upper - lower <= 2.0 * half:
            return lower, upper
        inside = lower <= center - half and center + half <= upper
        return (center - half, center + half) if inside else (lower, lower + 2.0 * half)
    if np.isfinite(lower):
        return lower, max(lower, center) + 2.0 * half
    if np.isfinite(upper):
        return min(upper, center) - 2.0 * half, upper
    return center - half, center + half


def _probes(measure: Measure, space: Space, rng: np.random.Generator) -> Array:
    """Configurations (PROBES or fewer, n) that have a J."""
    q = space.q(space.draw(rng, 20 * PROBES))
    found = q[np.isfinite(measure.sigma(q)[0])][:PROBES]
    if not len(found):
        raise SingularError("the wheels cannot roll, or the task is undefined, everywhere in these ranges")
    return found


def _same(measure: Measure, q: Array, other: Array) -> bool:
    """Whether J's singular values are the same at both, row by row; and J exists at both."""
    (a, largest), (b, _) = measure.values(q), measure.values(other)
    with np.errstate(invalid="ignore"):
        return bool(np.all(np.abs(a - b) <= SAME * largest[:, np.newaxis]))
