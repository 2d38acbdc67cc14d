"""Partitions J T = [Ja Jb] of the reduced gradient: candidates, the best one, and when it changes."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from typing import Self

import numpy as np

from nmm.base.arrays import Array, Integers
from nmm.base.errors import InputError, expect, expect_kind, expect_known
from nmm.base.findings import Finding
from nmm.base.kernels.compiled import clear, compiled, integer_scratch, scratch, view
from nmm.base.kernels.linear_algebra import add, copied, dot, eliminate, orthonormal_rows
from nmm.control.resolvers.base import State
from nmm.control.resolvers.problem import Dimensions

#: The inputs whose columns form Ja, by name or by index.
Partition = Sequence[str | int]

MOST_CANDIDATES = 20_000
#: More automatic candidates than this are searched rather than tried one by one.
MOST_TRIED = 2_000
#: An exchange of columns has to increase |det Ja| by more than this share.
_GAIN = 1e-9
_MOST_EXCHANGES = 1_000
#: A block at most as regular as this has lost rank.
_LOST = 1e-13

#: The integers of the state: FREE, HELD or OVERDUE; the sign of det Ja; the columns of Ja, NONE before
#: the first call and without such a block.
MODE, SIGN, COLUMNS = 0, 1, 2
NONE = -1
#: The partition may change; is kept; was kept although its measure fell below the threshold.
FREE, HELD, OVERDUE = 0, 1, 2


class PartitionState(State):
    """The partition in use, constant through an integration step, whose right-hand side is then smooth.

    Parameters
    ----------
    s : number of columns of Ja
    automatic : whether all candidates are tried
    """

    def __init__(self, s: int, automatic: bool = False) -> None:
        super().__init__([FREE, 0, *(-1 for _ in range(s))])
        self.automatic = automatic
        self._overdue = False

    def __enter__(self) -> Self:
        self.memory[MODE] = HELD
        return self

    def __exit__(self, *_: object) -> None:
        self._overdue = bool(self.memory[MODE] == OVERDUE)
        self.memory[MODE] = FREE

    def may_stand(self, before: Integers) -> bool:
        """False where a stage's measure fell below the threshold, or Ja was singular in between."""
        return not (self._overdue or self._passed_zero(before))

    def _passed_zero(self, before: Integers) -> bool:
        same = np.array_equal(before[COLUMNS:], self.memory[COLUMNS:])
        return bool(same and before[SIGN] * self.memory[SIGN] < 0)

    def reservation(self, before: Integers, inputs: Sequence[str], t: float) -> Finding | None:
        if not self._passed_zero(before):
            return None
        names = [inputs[column] for column in before[COLUMNS:]]
        return Finding("partition_singular", {"inputs": names, "automatic": bool(self.automatic)}, {"t": t})

    def partition(self, s: int) -> Integers:
        return self.memory[COLUMNS:].copy()


def candidate_columns(partitions: Sequence[Partition], dimensions: Dimensions) -> Integers:
    """Columns of all candidates, one after the other; every choice of s inputs when `partitions` is empty.

    Raises
    ------
    InputError : too many candidates, an unknown name or index of an input, a wrong number of inputs
    """
    count = math.comb(dimensions.m, dimensions.s)
    if not partitions and count > MOST_CANDIDATES:
        raise InputError(f"too many to try ({count}); give a list of some", where="partitions")
    chosen = (_columns(partition, dimensions) for partition in partitions)
    every = chosen if partitions else itertools.combinations(range(dimensions.m), dimensions.s)
    return np.fromiter(itertools.chain.from_iterable(every), dtype=np.int64)


def _columns(partition: Partition, dimensions: Dimensions) -> tuple[int, ...]:
    columns = []
    for item in partition:
        expect_kind(item, (str, int, np.integer), "partitions", "names or indices of inputs")
        if isinstance(item, str):
            expect_known("input", item, dimensions.inputs, "partitions")
        column = dimensions.inputs.index(item) if isinstance(item, str) else int(item)
        expect(0 <= column < dimensions.m, "partitions", f"an index from 0 to {dimensions.m - 1}", column)
        columns.append(column)
    distinct = len({*columns}) == len(columns) == dimensions.s
    expect(distinct, "partitions", f"{dimensions.s} different inputs, one a row of the task", list(partition))
    return tuple(columns)


@compiled
def solve_partition(
    J: Array, rate: Array, row_scales: Array, columns: Integers, M: Array
) -> tuple[float, float]:
    """M = [*, Ja⁻¹ J, Ja⁻¹ rate], shape (s, s + m + 1). Returns det Ja and how regular Ja is."""
    s, m = J.shape
    scales = scratch(s)
    copied(row_scales, scales)
    put_block(J, columns, M)
    for i in range(s):
        M[i, s + m] = rate[i]
    return eliminate(M, scales)


@compiled
def put_block(J: Array, columns: Integers, M: Array) -> None:
    s, m = J.shape
    for i in range(s):
        for j in range(s):
            M[i, j] = J[i, columns[j]]
        for j in range(m):
            M[i, s + j] = J[i, j]


@compiled
def search_partition(J: Array, columns: Integers) -> None:
    """Write into `columns` a partition whose |det Ja| no exchange of one column increases.

    Columns come from pivoted orthogonalisation, then are exchanged while an entry of Ja⁻¹ Jb, the factor of
    |det Ja|, is above 1; where J has lost rank, they stay. Source: M. Gu, S. Eisenstat, "Efficient algorithms
    for computing a strong rank-revealing QR factorization", SIAM J. Sci. Computing 17(4), 1996, with f = 1.
    """
    s, m = J.shape
    rest = scratch((m, s))
    for i in range(s):
        for j in range(m):
            rest[j, i] = J[i, j]
    for k in range(s):
        largest = -1.0
        for j in range(m):
            square, taken = dot(rest[j], rest[j]), False
            for i in range(k):
                taken = taken or columns[i] == j
            if square > largest and not taken:
                largest, columns[k] = square, j
        if largest > 0.0:
            pivot = rest[columns[k]]
            for j in range(m):
                if j != columns[k]:
                    add(rest[j], -(dot(pivot, rest[j]) / largest), pivot)
            clear(pivot)
    M, scales = scratch((s, s + m)), scratch(s)
    for _ in range(_MOST_EXCHANGES):
        put_block(J, columns, M)
        for i in range(s):
            scales[i] = 1.0
        if eliminate(M, scales)[1] <= _LOST:
            return
        out, into, gain = -1, -1, 1.0 + _GAIN
        for i in range(s):
            for j in range(m):  # for a column of Ja itself, 0 or 1 up to rounding
                if abs(M[i, s + j]) > gain:
                    out, into, gain = i, j, abs(M[i, s + j])
        if out < 0:
            return
        columns[out] = into


@compiled
def choose_partition(J: Array, candidates: Integers, columns: Integers) -> None:
    """Write the candidate with the largest |det Ja|, the first of equals, or that of `search_partition`."""
    s = J.shape[0]
    if candidates.shape[0] == 0:
        search_partition(J, columns)
        return
    Ja, scales, largest = scratch((s, s)), scratch(s), -1.0
    for c in range(0, candidates.shape[0], s):
        for i in range(s):
            scales[i] = 1.0
            for j in range(s):
                Ja[i, j] = J[i, candidates[c + j]]
        size = abs(eliminate(Ja, scales)[0])
        if size > largest * (1.0 + 1e-12):  # rounding must not reverse the order of equals
            largest = size
            copied(view(candidates, c, (s,)), columns)


@compiled
def volume(J: Array, row_scales: Array, tolerance: float) -> float:
    """sqrt(det J Jᵀ), by Cauchy-Binet the norm of all det Ja; 0 when J lost rank."""
    s, m = J.shape
    order, L = integer_scratch(s), scratch((s, s))
    if orthonormal_rows(J, row_scales, order, L, scratch((s, m))) <= tolerance:
        return 0.0
    product = 1.0
    for i in range(s):
        product *= L[i, i]
    return product
