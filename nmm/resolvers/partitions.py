"""Partitions J T = [Ja Jb] of the reduced gradient: candidates, which is best, and when it changes."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from types import TracebackType
from typing import Self

import numpy as np

from nmm.arrays import Array, Integers
from nmm.errors import InputError, unknown
from nmm.kernels.compiled import compiled, integer_scratch, scratch
from nmm.kernels.linear_algebra import eliminate, orthonormal_rows
from nmm.resolvers.problem import Dimensions
from nmm.resolvers.state import State

#: A partition: the inputs whose columns form Ja, by name or by index.
Partition = Sequence[str | int]

MOST_CANDIDATES = 20_000
#: Automatic candidates beyond this number are searched, not tried.
MOST_TRIED = 2_000
#: An exchange of columns has to make |det Ja| larger by more than this share.
_GAIN = 1e-9
_MOST_EXCHANGES = 1_000
#: A block as irregular as this has lost rank.
_LOST = 1e-13

#: The integers of the state: FREE, HELD or OVERDUE; the sign of det Ja; the columns of Ja, NONE before
#: the first call and where there is no such block.
MODE, SIGN, COLUMNS = 0, 1, 2
NONE = -1
#: The partition may change; it is kept; it was kept although it fell below its threshold.
FREE, HELD, OVERDUE = 0, 1, 2


class PartitionState(State):
    """The partition in use, kept through an integration step, which then sees one smooth right-hand side.

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

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._overdue = bool(self.memory[MODE] == OVERDUE)
        self.memory[MODE] = FREE

    def may_stand(self, before: Integers) -> bool:
        """Not where the partition fell below its threshold at a stage, nor where det Ja changed its sign:
        in between Ja was singular."""
        return not (self._overdue or self._passed_zero(before))

    def _passed_zero(self, before: Integers) -> bool:
        same = np.array_equal(before[COLUMNS:], self.memory[COLUMNS:])
        return bool(same and before[SIGN] * self.memory[SIGN] < 0)

    def reservation(self, before: Integers, inputs: Sequence[str]) -> str:
        if not self._passed_zero(before):
            return ""
        names = ", ".join(inputs[column] for column in before[COLUMNS:])
        advice = "J itself is close to losing rank" if self.automatic else "give more partitions"
        return f"the block Ja of [{names}] became singular and no other candidate was better: {advice}"

    def partition(self, s: int) -> Integers:
        return self.memory[COLUMNS:].copy()


def candidate_columns(partitions: Sequence[Partition], dimensions: Dimensions) -> Integers:
    """Columns of all candidates, one after the other; every choice of s inputs when `partitions` is empty.

    Raises
    ------
    InputError : too many candidates, a name or an index that is no input's, a wrong number of them
    """
    if not partitions:
        count = math.comb(dimensions.m, dimensions.s)
        if count > MOST_CANDIDATES:
            raise InputError(f"partitions: {count} candidates are too many to try; give a list of some")
        every = itertools.combinations(range(dimensions.m), dimensions.s)
        return np.fromiter(itertools.chain.from_iterable(every), dtype=np.int64)
    given = (_columns(partition, dimensions) for partition in partitions)
    return np.fromiter(itertools.chain.from_iterable(given), dtype=np.int64)


def _columns(partition: Partition, dimensions: Dimensions) -> tuple[int, ...]:
    columns = []
    for item in partition:
        if isinstance(item, str) and item not in dimensions.inputs:
            raise InputError(unknown("input", item, dimensions.inputs, "partitions"))
        if not isinstance(item, (str, int, np.integer)):
            raise InputError(f"partitions: expected names or indices of inputs, got {item!r}")
        column = dimensions.inputs.index(item) if isinstance(item, str) else int(item)
        if not 0 <= column < dimensions.m:
            raise InputError(f"partitions: expected an index from 0 to {dimensions.m - 1}, got {column}")
        columns.append(column)
    if len(columns) != dimensions.s or len(set(columns)) != len(columns):
        raise InputError(
            f"partitions: expected {dimensions.s} different inputs, as many as the task has rows, "
            f"got {list(partition)}"
        )
    return tuple(columns)


@compiled
def solve_partition(
    J: Array, rate: Array, row_scales: Array, columns: Integers, M: Array
) -> tuple[float, float]:
    """M = [*, Ja⁻¹ J, Ja⁻¹ rate], shape (s, s + m + 1). Returns det Ja and how regular Ja is."""
    s, m = J.shape
    scales = scratch(s)
    for i in range(s):
        scales[i] = row_scales[i]
        for j in range(s):
            M[i, j] = J[i, columns[j]]
        for j in range(m):
            M[i, s + j] = J[i, j]
        M[i, s + m] = rate[i]
    return eliminate(M, scales)


def are_searched(dimensions: Dimensions) -> bool:
    """Whether there are too many automatic candidates to try them all."""
    return math.comb(dimensions.m, dimensions.s) > MOST_TRIED


def searched_threshold(threshold: float, dimensions: Dimensions) -> float:
    """Θ for as many candidates: half of what the best one's measure is at least, if that is less.

    The measures' squares add up to 1, so the best one's is at least 1 / sqrt(count).
    """
    return min(threshold, 0.5 / math.sqrt(math.comb(dimensions.m, dimensions.s)))


@compiled
def search_partition(J: Array, columns: Integers) -> None:
    """Write into `columns` a partition whose |det Ja| no exchange of one column makes larger.

    A rank-revealing QR: columns by pivoted orthogonalisation, then exchanged while an entry of Ja⁻¹ Jb, by
    which |det Ja| grows, is above 1. Where J has lost rank the columns are the pivots.

    Source: M. Gu, S. Eisenstat, "Efficient algorithms for computing a strong rank-revealing QR
    factorization", SIAM J. Scientific Computing 17(4), 1996, with f = 1.
    """
    s, m = J.shape
    rest = scratch((s, m))
    for i in range(s):
        for j in range(m):
            rest[i, j] = J[i, j]
    for k in range(s):
        largest = -1.0
        for j in range(m):
            square = 0.0
            for i in range(s):
                square += rest[i, j] * rest[i, j]
            taken = False
            for i in range(k):
                taken = taken or columns[i] == j
            if square > largest and not taken:
                largest = square
                columns[k] = j
        if largest <= 0.0:
            continue
        for j in range(m):
            along = 0.0
            if j != columns[k]:
                for i in range(s):
                    along += rest[i, columns[k]] * rest[i, j]
                for i in range(s):
                    rest[i, j] -= along / largest * rest[i, columns[k]]
        for i in range(s):
            rest[i, columns[k]] = 0.0
    M, scales = scratch((s, s + m)), scratch(s)
    for _ in range(_MOST_EXCHANGES):
        for i in range(s):
            scales[i] = 1.0
            for j in range(s):
                M[i, j] = J[i, columns[j]]
            for j in range(m):
                M[i, s + j] = J[i, j]
        if eliminate(M, scales)[1] <= _LOST:
            return
        out, into, gain = -1, -1, 1.0 + _GAIN
        for i in range(s):
            for j in range(m):  # of a column of Ja itself, 0 or 1 up to rounding
                if abs(M[i, s + j]) > gain:
                    out, into, gain = i, j, abs(M[i, s + j])
        if out < 0:
            return
        columns[out] = into


@compiled
def choose_partition(J: Array, candidates: Integers, columns: Integers) -> None:
    """Write into `columns` the candidate with the largest |det Ja|, the first of equals; without candidates,
    `search_partition`."""
    s = J.shape[0]
    if candidates.shape[0] == 0:
        search_partition(J, columns)
        return
    Ja = scratch((s, s))
    scales = scratch(s)
    largest = -1.0
    for c in range(0, candidates.shape[0], s):
        for i in range(s):
            scales[i] = 1.0
            for j in range(s):
                Ja[i, j] = J[i, candidates[c + j]]
        size = abs(eliminate(Ja, scales)[0])
        if size > largest * (1.0 + 1e-12):  # rounding must not reverse the order of equals
            largest = size
            for j in range(s):
                columns[j] = candidates[c + j]


@compiled
def volume(J: Array, row_scales: Array, tolerance: float) -> float:
    """sqrt(det J Jᵀ), by Cauchy-Binet the norm of all det Ja; 0 when J lost rank."""
    s, m = J.shape
    order = integer_scratch(s)
    L = scratch((s, s))
    if orthonormal_rows(J, row_scales, order, L, scratch((s, m))) <= tolerance:
        return 0.0
    product = 1.0
    for i in range(s):
        product *= L[i, i]
    return product
