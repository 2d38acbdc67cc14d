"""The problem of one control step, which a resolver solves."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from nmm.base.arrays import Array, Integers, array, scalar, vector
from nmm.base.errors import InputError, expect
from nmm.base.text_format import apart
from nmm.control.resolvers.problem_arrays import ProblemArrays
from nmm.control.resolvers.saturation import enforce_limits

#: Fields of `ProblemArrays` besides the problem's own numbers.
MEMORY = ("ends", "stops", "active", "limiter")


class Dimensions(NamedTuple):
    """What is constant from step to step: rows of the task and of the added task, names of the inputs.

    Attributes
    ----------
    s, k : rows of the task and of the added task
    inputs : their names
    groups : names of inputs by group ("platform", "arm")
    levels : the rows of each level of priority; one level when empty

    Examples
    --------
    >>> dimensions = nmm.extending.Dimensions(s=2, k=0, inputs=("v", "omega", "q1", "q2"))
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
    """Find u with J u = rate that serves the objective: all that a resolver gets.

    Parameters
    ----------
    J : (s, m) task Jacobian; rate : (s,) task velocity, in the rows' units per second
    h : (m,) gradient of the objective by the inputs, Sᵀ ∂H/∂q
    inputs : names of the inputs, for partitions and weights given by name; u0, u1, ... when not given
    groups : inputs by the name of their group
    row_scales : (s,) natural size of each row in its unit (the robot's reach for metres, 1 for radians),
        against which pivots are judged; 1 when not given
    levels : rows of each level of priority, from the highest on; one level when not given
    separate : for each level, whether limits cut its rows one by one, so that one which they hold does not
        hold the others; by one share λ when not given
    added_J, added_rate, added_row_scales : (k, m), (k,) and (k,), the added task of the extended Jacobian
    u_lower, u_upper : (m,) u_lower <= u <= u_upper; infinite for none
    limit_rows, lower, upper : (l, m), (l,) and (l,): lower <= limit_rows u <= upper
    limit_levels : (l,) 0 for rows that are always kept (default); k for those kept before the k-th level of
        priority, as far as the levels above it allow
    before : (m,) the previous inputs, 0 when not given
    falling, rising : (m,) how fast inputs may fall and rise, above 0, per second; infinite when not given
    dt : how long u will be applied, s; NaN where unknown

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
    separate: Sequence[bool] | None = None
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
    falling: ArrayLike | None = None
    rising: ArrayLike | None = None
    dt: float = float("nan")

    def __post_init__(self) -> None:
        J = array(self.J, "J")
        expect(J.ndim == 2, "J", "a matrix", J)
        s, m = J.shape
        names = tuple(f"u{i}" for i in range(m)) if self.inputs is None else tuple(self.inputs)
        expect(len(names) == m, "inputs", f"{m} names, as J has columns", len(names))
        levels = (s,) if self.levels is None else tuple(int(rows) for rows in self.levels)
        if sum(levels) != s or min(levels, default=0) < 0:
            raise InputError(where="levels", expected=f"numbers of rows that add up to {s}", got=list(levels))
        added_J = np.zeros((0, m)) if self.added_J is None else _rows(self.added_J, m, "added_J")
        limit_rows = np.zeros((0, m)) if self.limit_rows is None else _rows(self.limit_rows, m, "limit_rows")
        k, count = len(added_J), len(limit_rows)
        fields = {
            "J": J,
            "rate": vector(self.rate, s, "rate"),
            "h": vector(self.h, m, "h"),
            "inputs": names,
            "groups": dict(self.groups or {}),
            "row_scales": _scales(self.row_scales, s, "row_scales"),
            "levels": levels,
            "separate": _separate(self.separate, len(levels)),
            "added_J": added_J,
            "added_rate": vector(() if self.added_rate is None else self.added_rate, k, "added_rate"),
            "added_row_scales": _scales(self.added_row_scales, k, "added_row_scales"),
            **_bounds(self.u_lower, self.u_upper, m, "u_lower", "u_upper"),
            "limit_rows": limit_rows,
            **_bounds(self.lower, self.upper, count, "lower", "upper"),
            "limit_levels": _limit_levels(self.limit_levels, count, len(levels)),
            "before": np.zeros(m) if self.before is None else vector(self.before, m, "before"),
            "falling": _rates(self.falling, m, "falling"),
            "rising": _rates(self.rising, m, "rising"),
            "dt": float("nan") if np.isnan(self.dt) else scalar(self.dt, "dt"),
        }
        vars(self).update(fields)

    @classmethod
    def of(cls, arrays: ProblemArrays, dimensions: Dimensions) -> Problem:
        """The problem of a control step, copied; unchecked, as checking takes ten times as long."""
        problem = object.__new__(cls)
        vars(problem).update(
            {name: value.copy() for name, value in arrays._asdict().items() if name not in MEMORY},
            **{name: getattr(dimensions, name) for name in ("inputs", "groups", "levels")},
            dt=float(arrays.dt),
        )
        return problem

    @property
    def dimensions(self) -> Dimensions:
        """What is constant from step to step."""
        arrays, inputs, groups = self.arrays, tuple(self.inputs or ()), dict(self.groups or {})
        return Dimensions(len(arrays.J), len(arrays.added_J), inputs, groups, tuple(self.levels or ()))

    @property
    def arrays(self) -> ProblemArrays:
        """The problem as kernels read it."""
        ends = np.cumsum(self.levels or (), dtype=np.int64)
        own = {name: np.asarray(getattr(self, name)) for name in ProblemArrays._fields if name not in MEMORY}
        count = len(own["h"]) + len(own["lower"])
        stops = np.zeros(count, dtype=np.int64)
        active = np.zeros((len(ends) + 1) * (2 + count), dtype=np.int64)
        limited = len(own["lower"]) > 0 or np.isfinite([own["u_lower"], own["u_upper"]]).any()
        limiter = enforce_limits.address if limited else 0
        return ProblemArrays(ends=ends, stops=stops, active=active, limiter=limiter, **own)


def _rows(value: ArrayLike, m: int, name: str) -> Array:
    rows = array(value, name)
    expect(rows.ndim == 2 and rows.shape[1] == m, name, f"{m} columns", rows)
    return rows


def _separate(value: Sequence[bool] | None, levels: int) -> Integers:
    separate = np.zeros(levels, dtype=np.int64) if value is None else np.array(value, dtype=np.int64)
    expect(separate.shape == (levels,), "separate", f"{levels} of true and false, one a level", value)
    return separate


def _scales(value: ArrayLike | None, count: int, name: str) -> Array:
    scales = np.ones(count) if value is None else vector(value, count, name)
    expect(np.all(scales > 0.0), name, "numbers above 0", scales.min(initial=1.0))
    return scales


def _rates(value: ArrayLike | None, count: int, name: str) -> Array:
    rates = np.full(count, np.inf) if value is None else np.array(value, dtype=np.float64)
    expect(rates.shape == (count,) and np.all(rates > 0.0), name, f"{count} numbers above 0", rates)
    return rates


def _limit_levels(value: ArrayLike | None, count: int, levels: int) -> Integers:
    numbers = np.zeros(count) if value is None else vector(value, count, "limit_levels")
    if np.any((numbers < 0) | (numbers > levels + 1) | (numbers != np.floor(numbers))):
        raise InputError(where="limit_levels", expected=f"whole numbers from 0 to {levels + 1}", got=numbers)
    return numbers.astype(np.int64)


def _bounds(lower: ArrayLike | None, upper: ArrayLike | None, count: int, *names: str) -> dict[str, Array]:
    by_name = {}
    for name, value, none in zip(names, (lower, upper), (-np.inf, np.inf), strict=True):
        bounds = np.full(count, none) if value is None else np.array(value, dtype=np.float64)
        valid = bounds.shape == (count,) and not np.any(np.isnan(bounds))
        expect(valid, name, f"{count} numbers (infinite for none)", bounds)
        by_name[name] = bounds
    low, high = by_name.values()
    for i in np.flatnonzero(low > high):
        above, below = apart(float(low[i]), float(high[i]), digits=6)
        raise InputError(f"{above} of number {i} is above its {names[1]}, {below}", where=names[0])
    return by_name
