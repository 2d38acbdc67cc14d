"""The problem of one control step as kernels read it."""

from __future__ import annotations

from typing import NamedTuple

from nmm.base.kernels.record_layout import (
    Cell,
    IntegerVector,
    Matrix,
    SampledIntegerVector,
    SampledMatrix,
    SampledVector,
    Vector,
)

#: Values of `stops`.
UPPER, LOWER = 1, 2


class ProblemArrays(NamedTuple):
    """A `Problem` as kernels read it: s rows in levels, k added rows, l rows of limits, m inputs.

    Attributes
    ----------
    J (s, m), rate (s,) : J u = rate, by level of priority
    row_scales (s,) : the natural size of each row, in its unit
    ends (levels,) : the row after the last of each level
    separate (levels,) : 1 where limits cut each row of a level by itself, 0 where all by one share λ
    added_J (k, m), added_rate (k,), added_row_scales (k,) : the added task of the extended Jacobian
    h (m,) : the objective's gradient by the inputs
    u_lower, u_upper (m,) : u_lower <= u <= u_upper, infinite for none
    limit_rows (l, m), lower (l,), upper (l,) : lower <= limit_rows u <= upper
    limit_levels (l,) : 0 for rows that are always kept, k for those that are kept before the k-th level
    stops (m + l,) : which bounds, of inputs, then of rows, limit a position, not a speed: UPPER, LOWER or
        both
    active ((levels + 1) (2 + m + l),) : those active at the previous step, level by level, then after all
        levels (see `nearest_within`); changed
    before (m,) : the previous inputs
    falling, rising (m,) : how fast inputs may fall and rise, per second; infinite for none
    dt () : how long u will be applied, s; NaN where unknown
    limiter : address of `enforce_limits`; 0 without limits

    Examples
    --------
    >>> arrays = nmm.Problem(J=[[1.0, 0.5]], rate=[2.0], h=[0.0, 1.0]).arrays
    >>> isinstance(arrays, nmm.extending.ProblemArrays), arrays.J.shape, arrays.ends.tolist()
    (True, (1, 2), [1])
    """

    J: Matrix
    rate: Vector
    row_scales: Vector
    ends: IntegerVector
    separate: IntegerVector
    added_J: Matrix
    added_rate: Vector
    added_row_scales: Vector
    h: Vector
    u_lower: SampledVector
    u_upper: SampledVector
    limit_rows: SampledMatrix
    lower: SampledVector
    upper: SampledVector
    limit_levels: IntegerVector
    stops: SampledIntegerVector
    active: SampledIntegerVector
    before: SampledVector
    falling: Vector
    rising: Vector
    dt: Cell
    limiter: int
