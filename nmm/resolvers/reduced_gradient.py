"""Reduced Gradient: optimisation in the inputs that the task leaves free (paper, III-C)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import ClassVar, Literal

import numpy as np

from nmm.arrays import Array, Integers, positive
from nmm.errors import InputError, expect_known
from nmm.kernels.compiled import Kernel, clear, compiled, kernel, scratch, view
from nmm.kernels.damping import BELOW, DIRECTIONS, LARGEST, step_threshold
from nmm.resolvers.answer import INEXACT, RELAXED, SINGULAR_J, SINGULAR_JA, AnswerArrays, certify
from nmm.resolvers.base import RESOLVER, Resolver, Setup, StepRule, step_rule
from nmm.resolvers.damped import damp
from nmm.resolvers.partitions import (
    COLUMNS,
    FREE,
    MODE,
    NONE,
    OVERDUE,
    SIGN,
    Partition,
    PartitionState,
    are_searched,
    candidate_columns,
    choose_partition,
    searched_threshold,
    solve_partition,
    volume,
)
from nmm.resolvers.problem import Dimensions
from nmm.resolvers.problem_arrays import ProblemArrays
from nmm.resolvers.weights import Weights, weight_diagonal
from nmm.resolvers.within import beyond, bring_within, call_limit

#: Numbers: α, Θ, the tolerance and, with weights, c = W^(-1/2).
ALPHA, THRESHOLD, TOLERANCE, C = 0, 1, 2, 3
#: Options: whether measures are divided by sqrt(det J Jᵀ), whether it is damped where no partition is well
#: conditioned, then the candidates' columns.
NORMALISED, DAMPED, CANDIDATES = 0, 1, 2


@kernel(RESOLVER)
def reduced_gradient(
    problem: ProblemArrays, numbers: Array, options: Integers, state: Integers, answer: AnswerArrays
) -> None:
    """ub = -α (hb - (Ja⁻¹ Jb)ᵀ ha), ua = Ja⁻¹ (rate - Jb ub) (paper, eqs. 8 to 10).

    With weights, in the inputs ũ = u / c in which the weighted norm is the Euclidean one.
    """
    J, h = problem.J, problem.h
    s, m = J.shape
    weighted, damped = numbers.shape[0] > C, options[DAMPED] == 1
    if weighted:
        weighted_J, weighted_h = scratch((s, m)), scratch(m)
        scale_columns(J, h, view(numbers, C, (m,)), weighted_J, weighted_h)
        J, h = weighted_J, weighted_h
    columns = view(state, COLUMNS, (s,))
    M = scratch((s, s + m + 1))
    unit = 1.0
    if options[NORMALISED] == 1:
        unit = volume(J, problem.row_scales, numbers[TOLERANCE])
        if unit == 0.0 and not damped:
            answer.status[()] = SINGULAR_J
            return
    determinant, regular = partitioned(problem, J, unit, numbers, options, state, columns, M)
    answer.measure[()] = abs(determinant) / unit if unit > 0.0 else 0.0
    state[SIGN] = int(determinant > 0.0) - int(determinant < 0.0)
    share = damped_share(problem, regular) if damped else 0.0
    if share == 1.0:
        state[SIGN] = 0
        for i in range(s):
            columns[i] = NONE
        damp_alone(problem, numbers, weighted, answer)
        return
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
    if share > 0.0:
        blend(problem, numbers, weighted, share, answer)
    if beyond(problem, answer):
        T = scratch((m, m))
        reduced_metric(M, columns, 1.0 - share, T)
        if weighted:
            for i in range(m):
                for j in range(m):
                    T[i, j] *= numbers[C + i]
        call_limit(problem.limiter, problem, T, answer)


@compiled
def damped_share(problem: ProblemArrays, regular: float) -> float:
    """How much of the answer is the damped one: none of it for a Ja as regular as ε, all for half of that."""
    square = 0.0
    for i in range(problem.rate.shape[0]):
        square += (problem.rate[i] / problem.row_scales[i]) ** 2
    threshold = step_threshold(math.sqrt(square), problem.dt[()], BELOW)
    return min(max(2.0 * (1.0 - regular / threshold), 0.0), 1.0)


@compiled
def damp_alone(problem: ProblemArrays, numbers: Array, weighted: bool, answer: AnswerArrays) -> None:
    """The answer of damped least squares with its own λ and ε, in the metric of the weights."""
    m = problem.J.shape[1]
    W = scratch((m, m))
    metric(numbers, weighted, W)
    damp(problem, numbers[ALPHA], DIRECTIONS, LARGEST, BELOW, W, answer)
    bring_within(problem, W, answer)


@compiled
def blend(problem: ProblemArrays, numbers: Array, weighted: bool, share: float, answer: AnswerArrays) -> None:
    """(1 - share) of the reduced gradient's u, and as much as share of the damped one."""
    m = problem.J.shape[1]
    reduced, W = scratch(m), scratch((m, m))
    metric(numbers, weighted, W)
    for j in range(m):
        reduced[j] = answer.u[j]
    measure = answer.measure[()]
    damp(problem, numbers[ALPHA], DIRECTIONS, LARGEST, BELOW, W, answer)
    answer.measure[()] = measure
    for j in range(m):
        answer.u[j] = (1.0 - share) * reduced[j] + share * answer.u[j]
    relaxed, scale = answer.status[()] == RELAXED, answer.scale[0]
    certify(problem, answer)
    if relaxed and answer.status[()] == INEXACT:
        answer.status[()] = RELAXED
        scale = 1.0 - share * (1.0 - scale)
    else:
        scale = 1.0
    for level in range(answer.scale.shape[0]):
        answer.scale[level] = scale


@compiled
def metric(numbers: Array, weighted: bool, W: Array) -> None:
    """diag(c), c = 1 without weights."""
    clear(W)
    for j in range(W.shape[0]):
        W[j, j] = numbers[C + j] if weighted else 1.0


@compiled
def reduced_metric(M: Array, columns: Integers, share: float, T: Array) -> None:
    """u = T [ua'; ub] with ua = ua' - Ja⁻¹ Jb ub: limits keep the free inputs near, and the partition.

    With a share of the coupling alone, between this metric and the inputs' own.
    """
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
                T[columns[i], free] = -share * M[i, s + j]
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
    damped = options[DAMPED] == 1
    if columns[0] == NONE:
        choose_partition(J, candidates, columns)
    determinant, regular = solve_partition(J, problem.rate, problem.row_scales, columns, M)
    if abs(determinant) < numbers[THRESHOLD] * unit:
        if state[MODE] == FREE:
            choose_partition(J, candidates, columns)
            determinant, regular = solve_partition(J, problem.rate, problem.row_scales, columns, M)
        elif not damped or damped_share(problem, regular) < 1.0:
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
        [0, 1] (Cauchy-Binet); above 2,000 of them they are searched by a rank-revealing QR, with Θ at
        most 1 / (2 sqrt(their number)); or a list of candidates, measured by |det Ja| (the paper's rule:
        [("v", "q1"), ("v", "omega")] in case 1; the arm's joints when n_m = s)
    threshold : Θ; 0.01 for given candidates (the paper's), 0.05 for automatic ones
    tolerance : Ja or J counts as singular where its last pivot, rows in their natural scales, is below
        this, times the largest pivot if that is above 1
    weights : None; m positive numbers; or a mapping from names of inputs or of their groups
        ("platform", "arm"), 1 for the rest. The counterpart of the weighted pseudoinverse: the method
        in the inputs sqrt(w) u. A heavy input is less often among those that do the task (its column
        counts for less in |det Ja|, weighted from here on), and descends H more slowly (α / w)
    singular : what happens where no candidate is well conditioned: "stop", the run ends there; "damped", the
        answer goes over, step by step, to that of damped least squares with its usual numbers, and back
    step : "constant", α as it is; "armijo", α at most, at each sample shortened until the objective falls
        along the sample's motion, so that no α dt is too large

    Examples
    --------
    >>> robot = nmm.load("unicycle_2r")
    >>> task = nmm.Task(nmm.Position("ee", "xy"), [2.0, 1.0])
    >>> resolver = nmm.ReducedGradient(alpha=10, partitions=[["v", "omega"], ["v", "q1"]], threshold=0.01)
    >>> controller = nmm.Controller(robot, task, resolver, nmm.Quadratic(nmm.Square("q1")))
    >>> controller.evaluate(0.0, robot.q({"q2": 0.5})).partition
    array([0, 1])
    """

    name: ClassVar[str] = "rg"
    alpha_at: ClassVar[int | None] = ALPHA

    def __init__(
        self,
        alpha: float = 10.0,
        partitions: Literal["automatic"] | Sequence[Partition] = "automatic",
        threshold: float | None = None,
        tolerance: float = 1e-10,
        weights: Weights | None = None,
        singular: Literal["stop", "damped"] = "stop",
        step: StepRule = "constant",
    ) -> None:
        self.alpha = positive(alpha, "alpha")
        self.step = step_rule(step)
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
        expect_known("singular", singular, ("stop", "damped"))
        self.singular = singular

    @property
    def kernel(self) -> Kernel:
        return reduced_gradient

    def setup(self, dimensions: Dimensions) -> Setup:
        self.check(dimensions, all_levels=True)
        searched = self.automatic and are_searched(dimensions)
        candidates = () if searched else candidate_columns(self.partitions, dimensions)
        threshold = searched_threshold(self.threshold, dimensions) if searched else self.threshold
        c = np.zeros(0) if self.weights is None else weight_diagonal(self.weights, dimensions) ** -0.5
        damped = self.singular == "damped" or len(dimensions.levels) > 1  # levels may contradict each other
        options = [self.automatic, damped, *candidates]
        numbers = np.array([self.alpha, threshold, self.tolerance, *c])
        return Setup(numbers, np.array(options, dtype=np.int64))

    def start(self, dimensions: Dimensions) -> PartitionState:
        return PartitionState(dimensions.s, self.automatic)
