"""Reduced Gradient: optimisation in the inputs that the task leaves free (paper, III-C)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar, Literal

import numpy as np

from nmm.arrays import Array, Integers, positive
from nmm.errors import InputError
from nmm.kernels.compiled import Kernel, clear, compiled, kernel, scratch, view
from nmm.resolvers.answer import SINGULAR_J, SINGULAR_JA, AnswerArrays, certify
from nmm.resolvers.base import RESOLVER, Resolver, Setup
from nmm.resolvers.limited import limit, within
from nmm.resolvers.partitions import (
    COLUMNS,
    FREE,
    MODE,
    OVERDUE,
    SIGN,
    Partition,
    PartitionState,
    candidate_columns,
    choose_partition,
    solve_partition,
    volume,
)
from nmm.resolvers.problem import Dimensions, ProblemArrays
from nmm.resolvers.weights import Weights, weight_diagonal

#: Numbers: α, Θ, the tolerance and, with weights, c = W^(-1/2).
ALPHA, THRESHOLD, TOLERANCE, C = 0, 1, 2, 3
#: Options: whether measures are divided by sqrt(det J Jᵀ), then the candidates' columns.
NORMALISED, CANDIDATES = 0, 1


@kernel(RESOLVER)
def reduced_gradient(
    problem: ProblemArrays, numbers: Array, options: Integers, state: Integers, answer: AnswerArrays
) -> None:
    """ub = -α (hb - (Ja⁻¹ Jb)ᵀ ha), ua = Ja⁻¹ (rate - Jb ub) (paper, eqs. 8 to 10).

    With weights, in the inputs ũ = u / c in which the weighted norm is the Euclidean one.
    """
    J, h = problem.J, problem.h
    s, m = J.shape
    weighted = numbers.shape[0] > C
    if weighted:
        weighted_J, weighted_h = scratch((s, m)), scratch(m)
        scale_columns(J, h, view(numbers, C, (m,)), weighted_J, weighted_h)
        J, h = weighted_J, weighted_h
    columns = view(state, COLUMNS, (s,))
    M = scratch((s, s + m + 1))
    unit = 1.0
    if options[NORMALISED] == 1:
        unit = volume(J, problem.row_scales, numbers[TOLERANCE])
        if unit == 0.0:
            answer.status[()] = SINGULAR_J
            return
    determinant, regular = partitioned(problem, J, unit, numbers, options, state, columns, M)
    answer.measure[()] = abs(determinant) / unit
    state[SIGN] = int(determinant > 0.0) - int(determinant < 0.0)
    if regular <= numbers[TOLERANCE]:
        lost = volume(J, problem.row_scales, numbers[TOLERANCE]) == 0.0
        answer.status[()] = SINGULAR_J if lost else SINGULAR_JA
        return
    u = answer.u
    for j in range(m):  # the reduced gradient; it is zero on Ja's own columns up to rounding
        reduced = h[j]
        for i in range(s):
            reduced -= M[i, s + j] * h[columns[i]]
        u[j] = -numbers[ALPHA] * reduced
    for i in range(s):
        u[columns[i]] = 0.0
    for i in range(s):
        ua = M[i, s + m]
        for j in range(m):
            ua -= M[i, s + j] * u[j]
        M[i, 0] = ua
    for i in range(s):
        u[columns[i]] = M[i, 0]
    if weighted:
        for j in range(m):
            u[j] *= numbers[C + j]
    certify(problem, answer)
    if not within(problem, u):
        T = scratch((m, m))
        reduced_metric(M, columns, T)
        if weighted:
            for i in range(m):
                for j in range(m):
                    T[i, j] *= numbers[C + i]
        limit(problem, T, answer)


@compiled
def reduced_metric(M: Array, columns: Integers, T: Array) -> None:
    """u = T [ua'; ub] with ua = ua' - Ja⁻¹ Jb ub: limits keep the free inputs near, and the partition."""
    s, m = columns.shape[0], T.shape[0]
    clear(T)
    free = s
    for j in range(m):
        basic = False
        for i in range(s):
            if columns[i] == j:
                basic = True
                T[j, i] = 1.0
        if not basic:
            T[j, free] = 1.0
            for i in range(s):
                T[columns[i], free] = -M[i, s + j]
            free += 1


@compiled
def partitioned(
    problem: ProblemArrays,
    J: Array,
    unit: float,
    numbers: Array,
    options: Integers,
    state: Integers,
    columns: Integers,
    M: Array,
) -> tuple[float, float]:
    """`solve_partition` with the partition kept, or with another where it fell below Θ and may change."""
    candidates = options[CANDIDATES:]
    if columns[0] < 0:
        choose_partition(J, candidates, columns)
    determinant, regular = solve_partition(J, problem.rate, problem.row_scales, columns, M)
    if abs(determinant) < numbers[THRESHOLD] * unit:
        if state[MODE] == FREE:
            choose_partition(J, candidates, columns)
            determinant, regular = solve_partition(J, problem.rate, problem.row_scales, columns, M)
        else:
            state[MODE] = OVERDUE
    return determinant, regular


@compiled
def scale_columns(J: Array, h: Array, c: Array, scaled_J: Array, scaled_h: Array) -> None:
    """J diag(c) and diag(c) h."""
    s, m = J.shape
    for j in range(m):
        scaled_h[j] = c[j] * h[j]
        for i in range(s):
            scaled_J[i, j] = J[i, j] * c[j]


def _as_tuple(partition: Partition) -> tuple[str | int, ...]:
    if isinstance(partition, str | int):
        raise InputError(f"partitions: expected lists of inputs, as in [['v', 'q1']], got {partition!r}")
    return tuple(partition)


class ReducedGradient(Resolver):
    """J T = [Ja Jb]: ub descends the reduced gradient of H, ua does the task (paper, eqs. 9 and 10).

    Which columns form Ja is the *partition*. It is chosen at the start as the candidate with the
    largest |det Ja|, kept while its measure stays at or above `threshold`, then chosen again.

    Parameters
    ----------
    alpha : step size α > 0, 1/s times the unit of H's curvature
    partitions : "automatic": all candidates, measured by |det Ja| / sqrt(det J Jᵀ), a number in
        [0, 1] (Cauchy-Binet); or a list of candidates, measured by |det Ja| (the paper's rule:
        [("v", "q1"), ("v", "omega")] in case 1; the arm's joints when n_m = s)
    threshold : Θ; 0.01 for given candidates (the paper's), 0.05 for automatic ones
    tolerance : Ja or J counts as singular where its last pivot, rows in their natural scales, is below
        this, times the largest pivot if that is above 1
    weights : None; m positive numbers; or a mapping from names of inputs or of their groups
        ("platform", "arm"), 1 for the rest. The counterpart of the weighted pseudoinverse: the method
        in the inputs sqrt(w) u. A heavy input is less often among those that do the task (its column
        counts for less in |det Ja|, weighted from here on), and descends H more slowly (α / w)
    """

    name: ClassVar[str] = "rg"

    def __init__(
        self,
        alpha: float = 10.0,
        partitions: Literal["automatic"] | Sequence[Partition] = "automatic",
        threshold: float | None = None,
        tolerance: float = 1e-10,
        weights: Weights | None = None,
    ) -> None:
        self.alpha = positive(alpha, "alpha")
        self.weights = weights
        self.automatic = isinstance(partitions, str)
        if self.automatic and partitions != "automatic":
            raise InputError(f"partitions: expected 'automatic' or lists of inputs, got {partitions!r}")
        self.partitions: tuple[tuple[str | int, ...], ...] = (
            () if self.automatic else tuple(_as_tuple(p) for p in partitions)
        )
        if not self.automatic and not self.partitions:
            raise InputError("partitions: expected at least one list of inputs, or 'automatic'")
        self.threshold = positive(
            (0.05 if self.automatic else 0.01) if threshold is None else threshold, "threshold"
        )
        if self.automatic and self.threshold >= 1.0:
            raise InputError(f"threshold: expected below 1 with automatic partitions, got {self.threshold:g}")
        self.tolerance = positive(tolerance, "tolerance")

    @property
    def kernel(self) -> Kernel:
        return reduced_gradient

    def setup(self, dimensions: Dimensions) -> Setup:
        self.check(dimensions)
        candidates = candidate_columns(self.partitions, dimensions)
        c = np.zeros(0) if self.weights is None else weight_diagonal(self.weights, dimensions) ** -0.5
        numbers = np.array([self.alpha, self.threshold, self.tolerance, *c])
        return Setup(numbers, np.array([int(self.automatic), *candidates], dtype=np.int64))

    def start(self, dimensions: Dimensions) -> PartitionState:
        return PartitionState(dimensions.s, self.automatic)
