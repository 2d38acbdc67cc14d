"""Where to search: the coordinates that may move, their ranges, which matter, and which are circular; and how
far from singular J is there: the smallest singular value of a part's J, and its slopes."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from nmm.analysis.singular.jacobians import STEP, Jacobians
from nmm.analysis.singular.parts import expect_inputs, singular_values
from nmm.base.arrays import Array, Flags, Integers, positive, vector
from nmm.base.errors import InputError, SingularError, expect
from nmm.control.directions import direction_texts, readable_basis
from nmm.model.robots.robot import Robot

TURN = 2.0 * np.pi
#: Limits that are short of a turn by less than this are a turn, rad: files write pi in some digits.
DIGITS = 1e-6
#: Singular values that differ by less than this, beside the largest, are the same.
SAME = 1e-9
#: Configurations that tell whether a coordinate matters.
PROBES = 24
#: Longest step, in units.
LONGEST = 0.6
#: Singular values this small beside the largest are zero.
TOLERANCE = 1e-8


@dataclass(frozen=True, eq=False)
class SearchSpace:
    """What is searched: a measure over the points z (N, a) of the coordinates that matter.

    at (n,), moving : where the other coordinates stay; indices of those that may move
    axes (a,) : those of them on which J's singular values depend; the others are free from the start
    lower, upper (n,) : ranges; those of `moving` count
    circular (n,) : angles that make the whole turn and come back to the same J
    units (n,) : what counts as 1 of a coordinate: 1 rad, or the characteristic length in m
    tolerance : singular values this small beside the largest of the whole J are zero
    """

    measure: RankMeasure
    at: Array
    moving: tuple[int, ...]
    axes: Integers
    lower: Array
    upper: Array
    circular: Flags
    units: Array
    tolerance: float
    rng: np.random.Generator

    @property
    def robot(self) -> Robot:
        return self.measure.robot

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
        turn = self.circular[self.axes]
        return np.where(turn, -np.inf, self.z(self.lower)), np.where(turn, np.inf, self.z(self.upper))

    def clip(self, z: Array) -> Array:
        return np.asarray(np.clip(z, *self.bounds))

    def step(self, z: Array, of: Callable[[Flags], Array]) -> Array:
        """The step (N, a) that `of` gives for the coordinates (N, a) that stay within the bounds."""
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

    def draw(self, count: int) -> Array:
        """z (count, a), uniform over the ranges."""
        return self.rng.uniform(self.z(self.lower), self.z(self.upper), (count, len(self.axes)))

    def fold(self, q: Array) -> Array:
        """q (..., n) with circular coordinates brought into their ranges; the upper end for the lower."""
        low = self.lower + DIGITS
        turned = low + np.mod(q - low, TURN)
        turned = np.where((turned > self.upper) & (turned - TURN >= self.lower), turned - TURN, turned)
        # Where neither is inside, the range is short of a turn by the digits in which files write pi.
        return self.robot.following.placed(
            np.where(self.circular, np.clip(turned, self.lower, self.upper), q)
        )

    def sigma(self, z: Array) -> tuple[Array, Array]:
        """The smallest singular value (N,), and that beside the largest."""
        return self.measure.sigma(self.q(z))

    def ranks(self, z: Array) -> Integers:
        """Rank of the part's J (N,)."""
        return self.measure.ranks(self.q(z), self.tolerance)

    def equations(self, z: Array, corank: int) -> tuple[Array, Array, Array]:
        """Wᵀ J V, its slopes along z, and the singular values."""
        return self.measure.equations(self.q(z), self.axes, self.units[self.axes], corank)

    def looser(self, factor: float) -> SearchSpace:
        return replace(self, tolerance=factor * self.tolerance)


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
    measure: RankMeasure,
    at: Array,
    among: Sequence[str] | None,
    ranges: Mapping[str, tuple[float, float]] | None,
    length: float | None,
    tolerance: float,
    rng: np.random.Generator,
    *,
    around: bool = False,
) -> SearchSpace:
    """The search space of `find_singularities`; coordinates outside it stay `at` (n,).

    With `around`, ranges are centred on `at` within the limits. `SingularError` where J exists nowhere.
    """
    robot = measure.robot
    moving = _moving(robot, among)
    windows = _ranges(robot, moving, ranges)
    own = robot.limited
    lower = np.where(own[:, 0], robot.q_limits[:, 0], -np.inf)
    upper = np.where(own[:, 1], robot.q_limits[:, 1], np.inf)
    angle = np.array(robot.q_units) == "rad"
    units = np.where(angle, 1.0, 1.0 if length is None else float(length))
    span = reach(robot)
    for j in range(robot.n):
        turn = bool(angle[j]) and not around
        window = _default(lower[j], upper[j], 0.0 if turn else at[j], np.pi if angle[j] else span, cut=turn)
        lower[j], upper[j] = windows.get(j) or window
    tolerance, none = positive(tolerance, "tolerance"), np.zeros(robot.n, dtype=bool)
    search = SearchSpace(measure, at, moving, np.array(moving), lower, upper, none, units, tolerance, rng)
    q = search.q(search.draw(20 * PROBES))
    q = q[np.isfinite(measure.sigma(q)[0])][:PROBES]
    if not len(q):
        raise SingularError("the wheels cannot roll, or the task is undefined, everywhere in these ranges")
    measure.settle(q)
    wide = angle & (upper - lower >= TURN - DIGITS)
    if around:
        wide &= ~own.any(axis=1)
    matter, circular = [], none.copy()
    for j in moving:
        drawn = q.copy()
        drawn[:, j] = rng.uniform(lower[j], upper[j], len(q))
        if not _same(measure, q, drawn):
            matter.append(j)
        if wide[j]:
            drawn[:, j] = q[:, j] + TURN
            circular[j] = _same(measure, q, drawn)
    return replace(search, axes=np.array(matter, dtype=np.int64), circular=circular)


def _moving(robot: Robot, among: Sequence[str] | None) -> tuple[int, ...]:
    if among is None:
        return tuple(int(j) for j in robot.following.independent)
    names = [among] if isinstance(among, str) else list(among)
    indices = tuple(sorted({robot.independent(name) for name in names}))
    expect(indices, "among", f"coordinates of {', '.join(robot.q_names)}, got none")
    return indices


def _ranges(
    robot: Robot, moving: Sequence[int], ranges: Mapping[str, tuple[float, float]] | None
) -> dict[int, tuple[float, float]]:
    windows = {}
    for name, value in (ranges or {}).items():
        j = robot.independent(name)
        if j not in moving:
            among = ", ".join(robot.q_names[i] for i in moving)
            raise InputError(f"{name} may not move; among are {among}", where="ranges")
        lower, upper = vector(value, 2, f"range of {name}")
        expect(lower < upper, f"range of {name}", f"(lower, upper), got ({lower:g}, {upper:g})")
        windows[j] = (float(lower), float(upper))
    return windows


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


def _same(measure: RankMeasure, q: Array, other: Array) -> bool:
    """Whether J's singular values are the same at both, row by row; and J exists at both."""
    (a, largest), (b, _) = measure.values(q), measure.values(other)
    with np.errstate(invalid="ignore"):
        return bool(np.all(np.abs(a - b) <= SAME * largest[:, np.newaxis]))


#: Singular values beside the largest, at a point that has converged: what is above it is not zero.
ROUNDING = 1e-13
#: So many times the usual largest singular value there is no J to speak of.
BLOWN = 100.0
#: Components of a unit vector that are too small for a text.
UNWRITTEN = 1e-4


class RankMeasure:
    """Singular values of some columns of the scaled J, and the equations that make them vanish.

    J has full rank when its k-th singular value σ is not zero, k = min(rows, inputs of the part). Where c
    vanish, with singular vectors W (rows, rows - k + c) and V (inputs, inputs - k + c) of these and the null
    spaces, a motion along q_j keeps them at zero, to first order, exactly when Wᵀ (∂J/∂q_j) V = 0.
    `InputError` for an unknown part, one without inputs, or a wrong size.
    """

    def __init__(
        self,
        jacobians: Jacobians,
        part: str,
        length: float | None,
        sizes: Mapping[str, float] | None,
        t: float,
    ) -> None:
        self.columns = expect_inputs(jacobians.robot, part)
        self.jacobians, self.robot, self.t = jacobians, jacobians.robot, t
        row_sizes, _, input_sizes = jacobians.sizes(length, sizes)
        self._scale = input_sizes / row_sizes[:, np.newaxis]
        self.rows, self.inputs = len(row_sizes), len(self.columns)
        self.full_rank = min(self.rows, self.inputs)
        self.natural = jacobians.natural(row_sizes)
        self.typical = np.inf

    def settle(self, q: Array) -> None:
        """Let σ stand beside no more than ten times the usual largest singular value, that at q (N, n)."""
        values, largest = self.values(q)
        exists = np.isfinite(values).all(axis=1)
        self.typical = 10.0 * float(np.median(largest[exists])) if exists.any() else np.inf

    def J(self, q: Array) -> Array:
        """Scaled J (N, s, inputs) of the part."""
        return (self.jacobians.batch(q, self.t) * self._scale)[:, :, self.columns]

    def sigma(self, q: Array) -> tuple[Array, Array]:
        """The k-th singular value (N,), and that beside the largest of the whole J; infinite without a J."""
        values, largest = self.values(q)
        return values[:, -1], values[:, -1] / largest

    def values(self, q: Array) -> tuple[Array, Array]:
        """The part's k singular values (N, k), falling, and their reference (N,).

        That is the whole J's largest, at most ten times its median over the space and at least a row of
        natural size; where it is far above that, J counts as none.
        """
        whole = self.jacobians.batch(q, self.t) * self._scale
        exists = np.isfinite(whole).all(axis=(1, 2))
        whole[~exists] = 0.0
        values = singular_values(whole[:, :, self.columns])[:, : self.full_rank]
        largest = values[:, 0]
        if len(self.columns) < whole.shape[2]:
            largest = singular_values(whole)[:, 0]
        # Beside the target of a bearing J grows without bound: that takes no rank away.
        exists &= largest <= BLOWN * self.typical
        values[~exists] = np.inf
        beside = np.maximum(np.minimum(largest, self.typical), self.natural)
        return values, np.asarray(np.where(exists, beside, 1.0))

    def ranks(self, q: Array, tolerance: float) -> Integers:
        """Rank of the part's J (N,), beside the largest singular value of the whole J."""
        values, largest = self.values(q)
        return np.sum(values > tolerance * largest[:, np.newaxis], axis=1, dtype=np.int64)

    def lost_text(self, q: Array, rank: int) -> tuple[str, ...]:
        """The task's directions that the part does not move at q (n,), in the rows' names."""
        left = np.linalg.svd(self.J(q[np.newaxis])[0])[0]
        lost = readable_basis(left[:, rank:].T)
        return direction_texts(np.where(np.abs(lost) < UNWRITTEN, 0.0, lost), self.jacobians.row_names)

    def equations(self, q: Array, axes: Integers, units: Array, corank: int) -> tuple[Array, Array, Array]:
        """Wᵀ J V (N, e), derivatives (N, e, a) along `axes` in their `units`, and singular values (N, k).

        Derivatives are central differences; 0 where there is no J beside q.
        """
        count, a = len(q), len(axes)
        steps = np.zeros((2, a, q.shape[1]))
        steps[0, range(a), axes] = STEP * units
        steps[1] = -steps[0]
        around = self.J((q[:, np.newaxis] + steps.reshape(1, 2 * a, -1)).reshape(-1, q.shape[1]))
        around = around.reshape(count, 2, a, self.rows, self.inputs)
        slopes = np.nan_to_num((around[:, 0] - around[:, 1]) / (2.0 * STEP))
        U, values, Vt = np.linalg.svd(np.nan_to_num(self.J(q)))
        keep = self.full_rank - corank
        W, V = U[:, :, keep:], np.swapaxes(Vt[:, keep:], 1, 2)
        C = np.swapaxes(W, 1, 2)[:, np.newaxis] @ slopes @ V[:, np.newaxis]
        F = np.zeros((count, W.shape[2], V.shape[2]))
        F[:, range(corank), range(corank)] = values[:, keep:]
        return F.reshape(count, -1), np.swapaxes(C.reshape(count, a, -1), 1, 2), values
