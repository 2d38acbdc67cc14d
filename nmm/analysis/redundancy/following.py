"""The inputs of a self-motion at one configuration, compiled: a unit null vector of J, and the task held."""

from __future__ import annotations

import math
from typing import NamedTuple

from numba import types

from nmm.arrays import Array, Flags, Integers
from nmm.control.equations import ControlStep, drive
from nmm.functions.program import BESIDE, LaidOut
from nmm.kernels.compiled import compiled, integer_scratch, scratch
from nmm.kernels.linear_algebra import residual_norm
from nmm.kernels.memory import IntegerVector, Vector, record_type, views
from nmm.kernels.singular_values import singular_rows

#: The motion ends where a singular value that it needs is below this part of the largest.
NEARLY_SINGULAR = 1e-3
#: It ends where less than this part of the wished inputs leaves the task at rest.
LITTLE_LEFT = 0.05
#: What became of it: there is a direction; J is not a number; J, or the columns of the inputs that move, are
#: nearly singular; of the wish too little is left.
FOLLOWED, UNDEFINED, NEARLY, ALONE, LITTLE = range(5)


class Field(NamedTuple):
    """A unit null vector n of J that is continuous in q.

    columns (c,) : the inputs that move
    wish (c,) : what is asked of them: n is what of it leaves the task at rest, or, of inputs of which no
        fewer depend on each other, their null vector next to the last one, at first to the wish
    rank : J's
    fewest : 1 for such inputs; else 0, and `columns` are all
    """

    columns: IntegerVector
    wish: Vector
    rank: int
    fewest: int


#: J (s, m), the field, the n before (zeros at first), n (m,) to be written.
DIRECTION = types.int64(
    types.Array(types.float64, 2, "C"), record_type(Field), types.float64[::1], types.float64[::1]
)
#: Blocks, the field, e0 (s,), which rows are angles (s,), the n before, ṡ, K, n (m,) to be written.
FOLLOW = types.int64(
    *(types.int64[::1], types.float64[::1], record_type(Field), types.float64[::1], types.boolean[::1]),
    *(types.float64[::1], types.float64, types.float64, types.float64[::1]),
)


@compiled
def largest_rows(A: Array, count: int, squares: Array, which: Integers) -> None:
    """which (count,): the longest rows of A (s, m), the longest first; squares (s,): of their lengths."""
    for i in range(A.shape[0]):
        squares[i] = 0.0
        for j in range(A.shape[1]):
            squares[i] += A[i, j] * A[i, j]
    for k in range(count):
        which[k] = -1
        for i in range(A.shape[0]):
            taken = False
            for earlier in range(k):
                taken = taken or which[earlier] == i
            if not taken and (which[k] < 0 or squares[i] > squares[which[k]]):
                which[k] = i


@compiled
def write_direction(J: Array, field: Field, last: Array, along: Array) -> int:
    """along (m,): n at J (s, m), `last` (m,) being the one before, or zeros. Returns what became of it."""
    s, c = J.shape[0], field.columns.shape[0]
    A, R, squares, which = scratch((s, c)), scratch((s, s)), scratch(s), integer_scratch(s)
    for i in range(s):
        for j in range(c):
            A[i, j] = J[i, field.columns[j]]
    count = c - 1 if field.fewest == 1 else field.rank
    singular_rows(A, R)
    largest_rows(A, count, squares, which)
    if field.fewest == 1 and count > 0:
        whole = scratch(J.shape)
        for i in range(s):
            for j in range(J.shape[1]):
                whole[i, j] = J[i, j]
        _, largest = singular_rows(whole, R)
        if math.sqrt(squares[which[count - 1]]) < NEARLY_SINGULAR * largest:
            return ALONE
    goes_on, asked = False, 0.0
    for j in range(c):
        goes_on = goes_on or last[field.columns[j]] != 0.0
    left = scratch(c)
    for j in range(c):
        left[j] = last[field.columns[j]] if field.fewest == 1 and goes_on else field.wish[j]
        asked += left[j] * left[j]
    for _ in range(2):  # the second time for what rounding left
        for k in range(count):
            overlap = 0.0
            for j in range(c):
                overlap += A[which[k], j] * left[j]
            for j in range(c):
                left[j] -= overlap / squares[which[k]] * A[which[k], j]
    size = 0.0
    for j in range(c):
        size += left[j] * left[j]
    if field.fewest == 0 and math.sqrt(size) < LITTLE_LEFT * math.sqrt(asked):
        return LITTLE
    for j in range(along.shape[0]):
        along[j] = 0.0
    for j in range(c):
        along[field.columns[j]] = left[j] / math.sqrt(size)
    return FOLLOWED


@compiled
def follow(
    integers: Integers,
    floats: Array,
    field: Field,
    e0: Array,
    angular: Flags,
    last: Array,
    rate: float,
    gain: float,
    along: Array,
) -> int:
    """Of the step just made: u = ṡ n + J⁺ K (e - e0), with q_dot, error, rate and residual of that.

    along (m,) : n. Returns what became of it; nothing is written unless it is FOLLOWED
    """
    e = views(ControlStep, integers, floats, BESIDE)
    b = views(LaidOut, integers, floats, 0).buffers
    J = e.problem.J
    s, m = J.shape
    for i in range(s):
        for j in range(m):
            if not math.isfinite(J[i, j]):
                return UNDEFINED
    A, R, squares, which = scratch((s, m)), scratch((s, s)), scratch(s), integer_scratch(s)
    for i in range(s):
        for j in range(m):
            A[i, j] = J[i, j]
    singular_rows(A, R)
    largest_rows(A, field.rank, squares, which)
    if field.rank > 0:
        least = math.sqrt(squares[which[field.rank - 1]])
        if least < NEARLY_SINGULAR * math.sqrt(squares[which[0]]):
            return NEARLY
    found = write_direction(J, field, last, along)
    if found != FOLLOWED:
        return found
    error, u = e.task.error, e.answer.u
    for i in range(s):
        error[i] -= e0[i]
        if angular[i]:
            error[i] -= 2.0 * math.pi * math.floor(error[i] / (2.0 * math.pi) + 0.5)
        e.task.full[i] = gain * error[i]
    for j in range(m):
        u[j] = rate * along[j]
    for k in range(field.rank):
        wanted = 0.0
        for i in range(s):
            wanted += R[which[k], i] * e.task.full[i]
        for j in range(m):
            u[j] += wanted / squares[which[k]] * A[which[k], j]
    e.answer.residual[()], _ = residual_norm(J, u, e.task.full)
    drive(u, b.G, e.arm, e.q_dot)
    return FOLLOWED
