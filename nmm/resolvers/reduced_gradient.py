"""Reduced Gradient: optimisation in the inputs that the task leaves free (paper, III-C)."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from typing import ClassVar, Literal

import numpy as np

from nmm.arrays import Array, positive
from nmm.errors import InputError, unknown
from nmm.kernels.compiled import RESOLVER, Kernel, compiled, kernel
from nmm.kernels.linear_algebra import eliminate, orthonormal_rows, residual_norm
from nmm.resolvers.base import FREE, OVERDUE, Resolver, Setup, Shape
from nmm.resolvers.weights import Weights, weight_diagonal

#: A partition: the inputs whose columns form Ja, by name or by index.
Partition = Sequence[str | int]

MOST_CANDIDATES = 20_000


@compiled
def solve_partition(J: Array, rate: Array, columns: Array, M: Array) -> tuple[float, float]:
    """M = [*, Ja⁻¹ J, Ja⁻¹ rate], shape (s, s + m + 1). Returns det Ja and the ratio of its pivots."""
    s, m = J.shape
    for i in range(s):
        for j in range(s):
            M[i, j] = J[i, columns[j]]
        for j in range(m):
            M[i, s + j] = J[i, j]
        M[i, s + m] = rate[i]
    return eliminate(M)


@compiled
def best_partition(J: Array, candidates: Array, columns: Array) -> None:
    """Write into `columns` the candidate with the largest |det Ja|, the first of equals."""
    s = J.shape[0]
    Ja = np.empty((s, s))
    largest = -1.0
    for c in range(0, candidates.shape[0], s):
        for j in range(s):
            for i in range(s):
                Ja[i, j] = J[i, candidates[c + j]]
        size = abs(eliminate(Ja)[0])
        if size > largest * (1.0 + 1e-12):  # rounding must not reverse the order of equals
            largest = size
            for j in range(s):
                columns[j] = candidates[c + j]


@compiled
def volume(J: Array, tolerance: float) -> float:
    """sqrt(det J Jᵀ), by Cauchy-Binet the norm of all det Ja; 0 when J lost rank."""
    s, m = J.shape
    order = np.empty(s, dtype=np.int64)
    L = np.empty((s, s))
    if orthonormal_rows(J, order, L, np.empty((s, m))) <= tolerance:
        return 0.0
    product = 1.0
    for i in range(s):
        product *= L[i, i]
    return product


@compiled
def scaled(J: Array, h: Array, c: Array) -> tuple[Array, Array]:
    """J diag(c) and diag(c) h."""
    s, m = J.shape
    scaled_J = np.empty((s, m))
    scaled_h = np.empty(m)
    for j in range(m):
        scaled_h[j] = c[j] * h[j]
        for i in range(s):
            scaled_J[i, j] = J[i, j] * c[j]
    return scaled_J, scaled_h


@kernel(RESOLVER)
def reduced_gradient(
    J: Array, rate: Array, Jc: Array, rate_c: Array, h: Array,
    parameters: Array, options: Array, state: Array, u: Array, report: Array,
) -> None:  # fmt: skip
    """ub = -α (hb - (Ja⁻¹ Jb)ᵀ ha), ua = Ja⁻¹ (rate - Jb ub).

    With weights, in the inputs ũ = u / c in which the weighted norm is the Euclidean one, c = W^(-1/2).
    parameters = [α, threshold, tolerance, c...], options = [normalised, weighted, candidates...],
    state = [FREE, HELD or OVERDUE, the s basic columns (-1 before the first call)].
    """
    given_J = J
    if options[1] == 1:
        J, h = scaled(J, h, parameters[3:])
    s, m = J.shape
    alpha = parameters[0]
    tolerance = parameters[2]
    candidates = options[2:]
    columns = state[1:]
    scale = 1.0
    if options[0] == 1:
        scale = volume(J, tolerance)
        if scale == 0.0:
            report[0] = 1.0
            return
    if columns[0] < 0:
        best_partition(J, candidates, columns)
    M = np.empty((s, s + m + 1))
    determinant, ratio = solve_partition(J, rate, columns, M)
    if abs(determinant) < parameters[1] * scale:
        if state[0] == FREE:
            best_partition(J, candidates, columns)
            determinant, ratio = solve_partition(J, rate, columns, M)
        else:
            state[0] = OVERDUE
    report[2] = determinant / scale
    if ratio <= tolerance:
        report[0] = 1.0 if volume(J, tolerance) == 0.0 else 2.0
        return

    for j in range(m):  # the reduced gradient; it is zero on Ja's own columns up to rounding
        reduced = h[j]
        for i in range(s):
            reduced -= M[i, s + j] * h[columns[i]]
        u[j] = -alpha * reduced
    for i in range(s):
        u[columns[i]] = 0.0
    for i in range(s):
        ua = M[i, s + m]
        for j in range(m):
            ua -= M[i, s + j] * u[j]
        M[i, 0] = ua
    for i in range(s):
        u[columns[i]] = M[i, 0]
    if options[1] == 1:
        for j in range(m):
            u[j] *= parameters[3 + j]
    report[1] = residual_norm(given_J, u, rate)
    report[0] = 0.0 if math.isfinite(report[1]) else 4.0


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
    tolerance : Ja or J counts as singular below this ratio of smallest to largest pivot
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

    def setup(self, shape: Shape) -> Setup:
        self.check(shape)
        if self.automatic:
            count = math.comb(shape.m, shape.s)
            if count > MOST_CANDIDATES:
                raise InputError(f"partitions: {count} candidates are too many to try; give a list of some")
            candidates = list(itertools.combinations(range(shape.m), shape.s))
        else:
            candidates = [self._columns(partition, shape) for partition in self.partitions]
        flags = [int(self.automatic), int(self.weights is not None)]
        options = np.array([*flags, *itertools.chain.from_iterable(candidates)], dtype=np.int64)
        state = np.full(1 + shape.s, -1, dtype=np.int64)
        state[0] = 0
        c = np.zeros(0) if self.weights is None else weight_diagonal(self.weights, shape) ** -0.5
        return Setup(np.array([self.alpha, self.threshold, self.tolerance, *c]), options, state)

    @staticmethod
    def _columns(partition: Sequence[str | int], shape: Shape) -> tuple[int, ...]:
        columns = []
        for item in partition:
            if isinstance(item, str) and item not in shape.inputs:
                raise InputError(unknown("input", item, shape.inputs, "partitions"))
            if not isinstance(item, (str, int, np.integer)):
                raise InputError(f"partitions: expected names or indices of inputs, got {item!r}")
            column = shape.inputs.index(item) if isinstance(item, str) else int(item)
            if not 0 <= column < shape.m:
                raise InputError(f"partitions: expected an index from 0 to {shape.m - 1}, got {column}")
            columns.append(column)
        if len(columns) != shape.s or len(set(columns)) != len(columns):
            raise InputError(
                f"partitions: expected {shape.s} different inputs, as many as the task has rows, "
                f"got {list(partition)}"
            )
        return tuple(columns)
