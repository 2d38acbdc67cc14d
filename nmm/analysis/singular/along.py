"""The same along a motion: σ_min, condition and minors as arrays, and the instants that matter."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from nmm.analysis.singular.algorithmic import volume
from nmm.analysis.singular.instants import Crossing, Dip, crossings, dips
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
from nmm.arrays import Array, Integers, interpolated, positive
from nmm.errors import InputError
from nmm.runs.trajectory import Trajectory

#: How many numbers the minors of a motion may be.
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
    dips : local minima of σ_min below `threshold`
    extended_dips : local minima of J_e's σ_min below it; no entries without an added task

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

    Between samples q is taken as linear in t, so that instants are as good as that: of second order in the
    samples' distance. A singularity that lies between two samples is found as a dip between them.

    Parameters
    ----------
    subject : a controller, or (robot, task)
    motion : a trajectory of the same robot, or times (N,), s
    q : (N, n), m and rad, with times
    threshold : σ_min below which a local minimum is reported; 0.05 of the largest singular value on the
        motion when not given
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
        if q is not None:
            raise InputError("analysis: expected a trajectory alone, or times and configurations")
        times: ArrayLike = motion.t
        points: ArrayLike = motion.q
    elif q is None:
        raise InputError("analysis: expected a trajectory, or times and configurations; got no q")
    else:
        times, points = motion, q
    jacobians = Jacobians(subject, added_task)
    t, q = jacobians.samples(times, points)
    tolerance = positive(tolerance, "tolerance")
    robot, s = jacobians.robot, len(jacobians.rows)
    columns = chosen_columns(minors, robot.u_names, s, most_minors)
    if len(columns) * len(t) > MOST_NUMBERS:
        raise InputError(
            f"minors: {len(columns)} at {len(t)} samples are more than {MOST_NUMBERS} numbers; "
            "list those wanted, or ask for none (minors=False)"
        )
    row_sizes, added_sizes, input_sizes = jacobians.sizes(length, sizes)
    J, added_J = jacobians.history(t, q)
    scale = input_sizes / row_sizes[:, np.newaxis]
    values = singular_values(J * scale)
    rank = ranks(values, values[:, 0], tolerance, jacobians.natural(row_sizes))
    sigma = {name: singular_values((J * scale)[..., own])[:, -1] for name, own in groups(robot).items()}
    low = LOW * float(values.max()) if threshold is None else positive(threshold, "threshold")
    found = determinants(J, columns)
    whole = volume(J)[:, np.newaxis]

    def sigma_at(time: float) -> float:
        return float(singular_values(jacobians.J(time, interpolated(time, t, q)) * scale)[-1])

    extended_scale = input_sizes / np.concatenate([row_sizes, added_sizes])[:, np.newaxis]

    def extended_at(time: float) -> float:
        here = interpolated(time, t, q)
        rows = np.vstack([jacobians.J(time, here), jacobians.added_J(time, here)])
        return float(singular_values(rows * extended_scale)[-1])

    extended = (
        singular_values(np.concatenate([J, added_J], axis=1) * extended_scale)[:, -1]
        if added_J.size
        else None
    )
    significant = np.abs(found) > ROUNDING * hadamard_bounds(J, columns)
    names = Minors(columns, found, robot.u_names).names
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
        minors=Minors(columns, found, robot.u_names),
        ratios=np.divide(np.abs(found), whole, out=np.zeros_like(found), where=whole > 0.0),
        extended_sigma_min=extended,
        crossings=crossings(t, np.where(significant, found, 0.0), names),
        dips=dips(t, values[:, -1], low, sigma_at),
        extended_dips=() if extended is None else dips(t, extended, low, extended_at),
        threshold=low,
    )
