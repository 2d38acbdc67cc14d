"""What a resolver gets: the problem of one control step."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from nmm.arrays import Array, Integers, array, one_line, scalar, vector
from nmm.errors import InputError
from nmm.resolvers.limited import limit
from nmm.resolvers.problem_arrays import ProblemArrays

#: What kernels have beside the problem's own numbers.
MEMORY = ("ends", "stops", "active", "limiter")


class Dimensions(NamedTuple):
    """What stays the same from step to step: rows of the task and of the added task, names of the inputs.

    Attributes
    ----------
    s, k : rows of the task and of the added task
    inputs : their names
    groups : inputs that are spoken of together, by the group's name ("platform", "arm")
    levels : the rows of each level of priority; one level when empty

    Examples
    --------
    >>> dimensions = nmm.Dimensions(s=2, k=0, inputs=("v", "omega", "q1", "q2"))
    >>> dimensions.m, nmm.ProjectedGradient().setup(dimensions).numbers.shape
    (4, (2,))
    """

    s: int
    k: int
    inputs: tuple[str, ...]
    groups: Mapping[str, tuple[str, ...]] = {}
    levels: tuple[int, ...] = ()

    @property
    def m(self) -> int:
        """Number of inputs."""
        return len(self.inputs)


@dataclass(frozen=True, eq=False)
class Problem:
    """Find u with J u = rate that is good for the objective: everything that a resolver is told.

    Parameters
    ----------
    J : (s, m) task Jacobian; rate : (s,) task velocity, in the rows' units per second
    h : (m,) gradient of the objective seen by the inputs, Sᵀ ∂H/∂q
    inputs : names of the inputs, for partitions and weights given by name; u0, u1, ... when not given
    groups : inputs by the name of their group
    row_scales : (s,) natural size of each row in its unit (the robot's reach for metres, 1 for radians),
        against which pivots are judged; 1 when not given
    levels : rows of each level of priority, from the highest on; one level when not given
    added_J, added_rate, added_row_scales : (k, m), (k,) and (k,), the added task of the extended Jacobian
    u_lower, u_upper : (m,) u_lower <= u <= u_upper; infinite where there is none
    limit_rows, lower, upper : (l, m), (l,) and (l,): lower <= limit_rows u <= upper
    limit_levels : (l,) 0 for rows that are always kept, as all are when not given; k for those that are kept
        before the k-th level of priority, as far as the levels above it leave it
    before : (m,) the inputs of the step before, 0 when not given
    dt : the time that u will stand, s; not a number where it is not known

    Raises
    ------
    InputError : shapes that do not fit, numbers that are not finite

    Examples
    --------
    >>> problem = nmm.Problem(J=[[1.0, 0.5]], rate=[2.0], h=[0.0, 1.0], u_upper=[1.0, np.inf])
    >>> problem.dimensions.inputs, nmm.ProjectedGradient().resolve(problem).u.round(3)
    (('u0', 'u1'), array([1., 2.]))
    """

    J: ArrayLike
    rate: ArrayLike
    h: ArrayLike
    inputs: Sequence[str] | None = None
    groups: Mapping[str, tuple[str, ...]] | None = None
    row_scales: ArrayLike | None = None
    levels: Sequence[int] | None = None
    added_J: ArrayLike | None = None
    added_rate: ArrayLike | None = None
    added_row_scales: ArrayLike | None = None
    u_lower: ArrayLike | None = None
    u_upper: ArrayLike | None = None
    limit_rows: ArrayLike | None = None
    lower: ArrayLike | None = None
    upper: ArrayLike | None = None
    limit_levels: ArrayLike | None = None
    before: ArrayLike | None = None
    dt: float = float("nan")

    def __post_init__(self) -> None:
        J = array(self.J, "J")
        if J.ndim != 2:
            raise InputError(f"J: expected a matrix, got shape {J.shape}")
        s, m = J.shape
        names = tuple(f"u{i}" for i in range(m)) if self.inputs is None else tuple(self.inputs)
        if len(names) != m:
            raise InputError(f"inputs: expected {m} names, as J has columns, got {len(names)}")
        levels = (s,) if self.levels is None else tuple(int(rows) for rows in self.levels)
        if sum(levels) != s or min(levels, default=0) < 0:
            raise InputError(f"levels: expected numbers of rows that add up to {s}, got {list(levels)}")
        added_J = np.zeros((0, m)) if self.added_J is None else _rows(self.added_J, m, "added_J")
        limit_rows = np.zeros((0, m)) if self.limit_rows is None else _rows(self.limit_rows, m, "limit_rows")
        k, count = len(added_J), len(limit_rows)
        given = {
            "J": J,
            "rate": vector(self.rate, s, "rate"),
            "h": vector(self.h, m, "h"),
            "inputs": names,
            "groups": dict(self.groups or {}),
            "row_scales": _scales(self.row_scales, s, "row_scales"),
            "levels": levels,
            "added_J": added_J,
            "added_rate": vector(() if self.added_rate is None else self.added_rate, k, "added_rate"),
            "added_row_scales": _scales(self.added_row_scales, k, "added_row_scales"),
            **_bounds(self.u_lower, self.u_upper, m, "u_lower", "u_upper"),
            "limit_rows": limit_rows,
            **_bounds(self.lower, self.upper, count, "lower", "upper"),
            "limit_levels": _limit_levels(self.limit_levels, count, len(levels)),
            "before": np.zeros(m) if self.before is None else vector(self.before, m, "before"),
            "dt": float("nan") if np.isnan(self.dt) else scalar(self.dt, "dt"),
        }
        for name, value in given.items():
            object.__setattr__(self, name, value)

    @classmethod
    def of(cls, arrays: ProblemArrays, dimensions: Dimensions) -> Problem:
        """The problem of a control step, copied; unchecked, as checking takes ten times as long."""
        problem = object.__new__(cls)
        vars(problem).update(
            {name: value.copy() for name, value in arrays._asdict().items() if name not in MEMORY},
            dt=float(arrays.dt),
            inputs=dimensions.inputs,
            groups=dimensions.groups,
            levels=dimensions.levels,
        )
        return problem

    @property
    def dimensions(self) -> Dimensions:
        """What of the problem stays the same from step to step."""
        arrays, inputs = self.arrays, tuple(self.inputs or ())
        return Dimensions(
            *(len(arrays.J), len(arrays.added_J), inputs), dict(self.groups or {}), tuple(self.levels or ())
        )

    @property
    def arrays(self) -> ProblemArrays:
        """The numbers, as kernels read them."""
        ends = np.cumsum(self.levels or (), dtype=np.int64)
        own = {name: np.asarray(getattr(self, name)) for name in ProblemArrays._fields if name not in MEMORY}
        stops, active = (
            np.zeros(more + len(own["h"]) + len(own["lower"]), dtype=np.int64) for more in (0, 1)
        )
        limited = len(own["lower"]) > 0 or np.isfinite([own["u_lower"], own["u_upper"]]).any()
        limiter = limit.address if limited else 0
        return ProblemArrays(ends=ends, stops=stops, active=active, limiter=limiter, **own)


def _rows(value: ArrayLike, m: int, name: str) -> Array:
    rows = array(value, name)
    if rows.ndim != 2 or rows.shape[1] != m:
        raise InputError(f"{name}: expected {m} columns, got shape {rows.shape}")
    return rows


def _scales(value: ArrayLike | None, count: int, name: str) -> Array:
    scales = np.ones(count) if value is None else vector(value, count, name)
    if np.any(scales <= 0.0):
        raise InputError(f"{name}: expected numbers above 0, got {scales.min():g}")
    return scales


def _limit_levels(value: ArrayLike | None, count: int, levels: int) -> Integers:
    given = np.zeros(count) if value is None else vector(value, count, "limit_levels")
    if np.any((given < 0) | (given > levels + 1) | (given != np.floor(given))):
        raise InputError(
            f"limit_levels: expected whole numbers from 0 to {levels + 1}, got {one_line(given)}"
        )
    return given.astype(np.int64)


def _bounds(lower: ArrayLike | None, upper: ArrayLike | None, count: int, *names: str) -> dict[str, Array]:
    found = {}
    for name, value, none in zip(names, (lower, upper), (-np.inf, np.inf), strict=True):
        bounds = np.full(count, none) if value is None else np.array(value, dtype=np.float64)
        if bounds.shape != (count,) or np.any(np.isnan(bounds)):
            raise InputError(f"{name}: expected {count} numbers (infinite for none), got {bounds}")
        found[name] = bounds
    low, high = found.values()
    for i in np.flatnonzero(low > high):
        raise InputError(f"{names[0]}: {low[i]:g} of number {i} is above its {names[1]}, {high[i]:g}")
    return found
