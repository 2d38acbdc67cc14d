"""What a resolver's kernel gets: the problem of one control step, as one record."""

from __future__ import annotations

from typing import NamedTuple

from nmm.kernels.memory import Cell, IntegerVector, Matrix, Vector

#: What `stops` says of a bound.
UPPER, LOWER = 1, 2


class ProblemArrays(NamedTuple):
    """A `Problem` as kernels read it: s rows in levels, k added rows, l rows of limits, m inputs.

    Attributes
    ----------
    J (s, m), rate (s,) : J u = rate, one level of priority below the other
    row_scales (s,) : the natural size of each row, in its unit
    ends (levels,) : the row after the last of each level
    added_J (k, m), added_rate (k,), added_row_scales (k,) : the added task of the extended Jacobian
    h (m,) : the objective's gradient, seen by the inputs
    u_lower, u_upper (m,) : u_lower <= u <= u_upper, infinite for none
    limit_rows (l, m), lower (l,), upper (l,) : lower <= limit_rows u <= upper
    limit_levels (l,) : 0 for rows that are always kept, k for those that are kept before the k-th level
    stops (m + l,) : which bounds of inputs, then of rows, end a way and are no speeds: UPPER, LOWER or both
    active (1 + m + l,) : which of them held back the step before (see `nearest_within`); changed
    before (m,) : the inputs of the step before
    dt () : the time that u will stand, s; not a number where it is not known
    limiter : where the code of `limit` begins; 0 where there are no limits

    Examples
    --------
    >>> arrays = nmm.Problem(J=[[1.0, 0.5]], rate=[2.0], h=[0.0, 1.0]).arrays
    >>> isinstance(arrays, nmm.ProblemArrays), arrays.J.shape, arrays.ends.tolist()
    (True, (1, 2), [1])
    """

    J: Matrix
    rate: Vector
    row_scales: Vector
    ends: IntegerVector
    added_J: Matrix
    added_rate: Vector
    added_row_scales: Vector
    h: Vector
    u_lower: Vector
    u_upper: Vector
    limit_rows: Matrix
    lower: Vector
    upper: Vector
    limit_levels: IntegerVector
    stops: IntegerVector
    active: IntegerVector
    before: Vector
    dt: Cell
    limiter: int
