"""Singularities along a motion: σ_min, condition and minors as arrays, and the instants that matter."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from nmm.analysis.singular.algorithmic import volume
from nmm.analysis.singular.jacobians import Jacobians, Subject, Tasks
from nmm.analysis.singular.minors import (
    MOST_MINORS,
    ROUNDING,
    Choice,
    Minors,
    chosen_columns,
    determinants,
    hadamard_bounds,
)
from nmm.analysis.singular.parts import WHOLE, condition_numbers, groups, ranks, singular_values
from nmm.analysis.singular.singularity import TOLERANCE
from nmm.base.arrays import Array, Integers, interpolated, positive
from nmm.base.errors import InputError, expect
from nmm.motion.trajectory import Trajectory

#: Two minima count as one unless the value rises between them by this fraction of the threshold.
RISE = 1e-3
#: A refined minimum must be lower than its sample by this fraction of the threshold: else it is rounding.
LOWER = 1e-9


@dataclass(frozen=True)
class Crossing:
    """A minor changes its sign at time `t` (s), between the samples `before` and `after`.

    sign : of the minor afterwards, 1 or -1

    Examples
    --------
    >>> scenario = nmm.Scenario.load("unicycle_2r_switching")
    >>> history = nmm.analysis.analyse_along(scenario.controller(), scenario.run())
    >>> crossing = history.crossings[0]
    >>> crossing.columns, round(crossing.t, 2), crossing.sign
    (('v', 'q1'), 1.83, -1)
    """

    t: float
    columns: tuple[str, ...]
    sign: int
    before: int
    after: int


@dataclass(frozen=True)
class Dip:
    """A local minimum `value` at `t` (s), near sample `index`; `at_end` if that is the first or last.

    Examples
    --------
    >>> arm = nmm.load("unicycle_2r", platform="fixed")
    >>> q = np.array([[0.0, q2] for q2 in np.linspace(-1, 1, 21)])
    >>> history = nmm.analysis.analyse_along((arm, nmm.Position("ee", "xy")), np.linspace(0, 2, 21), q)
    >>> [(round(dip.t, 3), round(dip.value, 6)) for dip in history.dips]
    [(1.0, 0.0)]
    """

    t: float
    value: float
    index: int
    at_end: bool


def crossings(t: Array, values: Array, names: tuple[tuple[str, ...], ...]) -> tuple[Crossing, ...]:
    """Changes of sign in the columns of values (N, count), zeros skipped: interpolated linearly between
    neighbouring samples, or the middle of the zeros between two samples."""
    zero_crossings = []
    for column, name in zip(values.T, names, strict=True):
        signed = np.flatnonzero(column)
        changes = np.flatnonzero(np.sign(column[signed[1:]]) != np.sign(column[signed[:-1]]))
        for k in changes:
            before, after = int(signed[k]), int(signed[k + 1])
            if after == before + 1:
                share = column[before] / (column[before] - column[after])
                time = t[before] + share * (t[after] - t[before])
            else:
                time = (t[before + 1] + t[after - 1]) / 2.0
            zero_crossings.append(Crossing(float(time), name, int(np.sign(column[after])), before, after))
    return tuple(sorted(zero_crossings, key=lambda crossing: crossing.t))


def dips(t: Array, values: Array, threshold: float, value_at: Callable[[float], float]) -> tuple[Dip, ...]:
    """Local minima of values (N,) below the threshold, also at an end, each refined between its neighbours by
    `value_at(t)`. One whose sample is above is refined, too, if a neighbour's slope lets it reach below: a
    singularity passed between two samples."""
    from scipy.optimize import minimize_scalar  # a tenth of a second that other analyses need not spend

    lows = []
    for index in _minima(values, RISE * threshold):
        first, last = max(index - 1, 0), min(index + 1, len(t) - 1)
        time, value = float(t[index]), float(values[index])
        steepest = max(abs(values[index] - values[k]) for k in (first, last))
        if value - steepest > threshold:
            continue
        for a, b in ((first, index), (index, last)):
            # Each side by itself: the interpolated motion has a kink at the sample.
            if a < b:
                refined = minimize_scalar(
                    value_at, bounds=(t[a], t[b]), method="bounded", options={"xatol": 1e-9 * (t[b] - t[a])}
                )
                if refined.fun < value - LOWER * threshold:
                    time, value = float(refined.x), float(refined.fun)
        if value < threshold:
            lows.append(Dip(time, value, index, time in (t[0], t[-1])))
    return tuple(lows)


def _minima(values: Array, rise: float) -> list[int]:
    """Samples of local minima between which the values rise by `rise` or more, ends included."""
    minima: list[int] = []
    lowest, highest, falling = 0, 0, True
    for k in range(len(values)):
        if falling:
            if values[k] < values[lowest]:
                lowest = k
            elif values[k] >= values[lowest] + rise:
                minima.append(lowest)
                highest, falling = k, False
        elif values[k] > values[highest]:
            highest = k
        elif values[k] <= values[highest] - rise:
            lowest, falling = k, True
    if falling:
        minima.append(lowest)
    return minima


#: Most numbers that the minors of a motion may take.
MOST_NUMBERS = 20_000_000
#: σ_min is low below this fraction of the largest singular value on the motion, unless the caller says.
LOW = 0.05


@dataclass(frozen=True, eq=False)
class SingularityHistory:
    """J along N samples of a motion; singular values are those of the scaled J (see `analyse`).

    Attributes
    ----------
    t (N,) s, q (N, n) : the samples
    rows, inputs : names of J's rows and columns
    J (N, s, m) : J_bar as it is
    singular_values (N, s), rank (N,), condition (N,) : of the whole robot
    sigma_min : (N,) of each part: "platform", "arm", the arms by name, "robot"
    minors : of J as it is; an item is (N,)
    ratios (N, count) : |minor| / sqrt(det J Jᵀ), from 0 to 1 (Cauchy-Binet): RG's measure of that partition
    extended_sigma_min (N,) : of EJ's J_e; None without an added task
    crossings : where a minor changes its sign, in the order of time
    dips, extended_dips : local minima below `threshold` of σ_min, and of J_e's; empty without an added task

    Examples
    --------
    >>> scenario = nmm.Scenario.load("unicycle_2r_position")
    >>> history = nmm.analysis.analyse_along(scenario.controller(), scenario.run())
    >>> history.J.shape, sorted(history.sigma_min)
    ((5001, 2, 4), ['arm', 'platform', 'robot'])
    """

    t: Array
    q: Array
    rows: tuple[str, ...]
    inputs: tuple[str, ...]
    J: Array
    singular_values: Array
    rank: Integers
    condition: Array
    sigma_min: Mapping[str, Array]
    minors: Minors
    ratios: Array
    extended_sigma_min: Array | None
    crossings: tuple[Crossing, ...]
    dips: tuple[Dip, ...]
    extended_dips: tuple[Dip, ...]
    threshold: float


def analyse_along(
    subject: Subject,
    motion: Trajectory | ArrayLike,
    q: ArrayLike | None = None,
    *,
    length: float | None = None,
    sizes: Mapping[str, float] | None = None,
    minors: Choice = True,
    most_minors: int = MOST_MINORS,
    added_task: Tasks | None = None,
    threshold: float | None = None,
    tolerance: float = TOLERANCE,
) -> SingularityHistory:
    """Analyse J_bar along a motion.

    Between samples q is linear in t, so that instants are accurate to second order in the samples' distance.
    A singularity between two samples is found as a dip.

    Parameters
    ----------
    subject : a controller, or (robot, task)
    motion : a trajectory of the same robot, or times (N,), s
    q : (N, n), m and rad, with times
    threshold : σ_min below which a local minimum is reported; by default 0.05 of the largest singular value
        on the motion
    length, sizes, minors, most_minors, added_task, tolerance : as in `analyse`

    Raises
    ------
    InputError : as `analyse`; times and q that do not fit
    SingularError : there is no J at a sample

    Examples
    --------
    >>> scenario = nmm.Scenario.load("unicycle_2r_stretched")
    >>> history = nmm.analysis.analyse_along(scenario.controller(), scenario.run())
    >>> bool(history.sigma_min["arm"].max() < 1e-9), bool(history.sigma_min["robot"].min() > 0.9)
    (True, True)
    """
    if isinstance(motion, Trajectory):
        expect(q is None, "analysis", "a trajectory alone, or times and configurations")
        q, motion = motion.q, motion.t
    elif q is None:
        raise InputError(where="analysis", expected="a trajectory, or times and configurations; got no q")
    jacobians = Jacobians(subject, added_task)
    t, q = jacobians.samples(motion, q)
    tolerance = positive(tolerance, "tolerance")
    robot = jacobians.robot
    columns = chosen_columns(minors, robot.u_names, len(jacobians.rows), most_minors)
    if len(columns) * len(t) > MOST_NUMBERS:
        many = f"{len(columns)} at {len(t)} samples are more than {MOST_NUMBERS} numbers"
        raise InputError(f"{many}; list those wanted, or ask for none (minors=False)", where="minors")
    row_sizes, added_sizes, input_sizes = jacobians.sizes(length, sizes)
    J, added_J = jacobians.history(t, q)
    scale = input_sizes / row_sizes[:, np.newaxis]
    values = singular_values(J * scale)
    rank = ranks(values, values[:, 0], tolerance, jacobians.natural(row_sizes))
    sigma = {name: singular_values((J * scale)[..., own])[:, -1] for name, own in groups(robot).items()}
    low = LOW * float(values.max()) if threshold is None else positive(threshold, "threshold")
    all_minors = Minors(columns, determinants(J, columns), robot.u_names)
    whole = volume(J)[:, np.newaxis]

    def sigma_at(time: float) -> float:
        return float(singular_values(jacobians.J(time, interpolated(time, t, q)) * scale)[-1])

    extended_scale = input_sizes / np.concatenate([row_sizes, added_sizes])[:, np.newaxis]

    def extended_at(time: float) -> float:
        point = interpolated(time, t, q)
        rows = np.vstack([jacobians.J(time, point), jacobians.added_J(time, point)])
        return float(singular_values(rows * extended_scale)[-1])

    extended = None
    if added_J.size:
        extended = singular_values(np.concatenate([J, added_J], axis=1) * extended_scale)[:, -1]
    sizes_of_minors = np.abs(all_minors.array)
    significant = sizes_of_minors > ROUNDING * hadamard_bounds(J, columns)
    return SingularityHistory(
        t=t,
        q=q,
        rows=jacobians.row_names,
        inputs=robot.u_names,
        J=J,
        singular_values=values,
        rank=rank,
        condition=condition_numbers(values, rank),
        sigma_min={**sigma, WHOLE: values[:, -1]},
        minors=all_minors,
        ratios=np.divide(sizes_of_minors, whole, out=np.zeros_like(all_minors.array), where=whole > 0.0),
        extended_sigma_min=extended,
        crossings=crossings(t, np.where(significant, all_minors.array, 0.0), all_minors.names),
        dips=dips(t, values[:, -1], low, sigma_at),
        extended_dips=() if extended is None else dips(t, extended, low, extended_at),
        threshold=low,
    )
