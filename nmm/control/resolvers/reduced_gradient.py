"""Reduced gradient: optimisation in the inputs that the task leaves free (paper, III-C)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import ClassVar, Literal

import numpy as np

from nmm.base.arrays import Array, Integers, positive
from nmm.base.errors import InputError, expect, expect_known
from nmm.base.kernels.compiled import Kernel, clear, compiled, kernel, scratch, view
from nmm.base.kernels.damping import BELOW, USUAL, step_threshold
from nmm.base.kernels.linear_algebra import copied
from nmm.control.resolvers.answer import INEXACT, RELAXED, SINGULAR_J, SINGULAR_JA, AnswerArrays, certify
from nmm.control.resolvers.base import (
    RESOLVER,
    Resolver,
    Setup,
    StepRule,
    Weights,
    step_rule,
    weight_diagonal,
)
from nmm.control.resolvers.damped import damp
from nmm.control.resolvers.limit_check import beyond, bring_within, call_limit
from nmm.control.resolvers.partitions import (
    COLUMNS,
    FREE,
    MODE,
    MOST_TRIED,
    NONE,
    OVERDUE,
    SIGN,
    Partition,
    PartitionState,
    candidate_columns,
    choose_partition,
    solve_partition,
    volume,
)
from nmm.control.resolvers.problem import Dimensions
from nmm.control.resolvers.problem_arrays import ProblemArrays

#: Numbers: α, Θ, the tolerance and, with weights, c = W^(-1/2).
ALPHA, THRESHOLD, TOLERANCE, C = 0, 1, 2, 3
#: Options: whether to divide measures by sqrt(det J Jᵀ), whether to damp where no partition is well
#: conditioned, then the candidates' columns.
NORMALISED, DAMPED, CANDIDATES = 0, 1, 2


@kernel(RESOLVER)
def reduced_gradient(
    problem: ProblemArrays, numbers: Array, options: Integers, state: Integers, answer: AnswerArrays
) -> None:
    """ub = -α (hb - (Ja⁻¹ Jb)ᵀ ha), ua = Ja⁻¹ (rate - Jb ub) (paper, eqs. 8 to 10); with weights, in ũ = u /
    c, whose Euclidean norm is the weighted one."""
    J, h = problem.J, problem.h
    s, m = J.shape
    weighted, damped = numbers.shape[0] > C, options[DAMPED] == 1
    if weighted:
        J, h = scratch((s, m)), scratch(m)
        for j in range(m):
            h[j] = numbers[C + j] * problem.h[j]
            for i in range(s):
                J[i, j] = problem.J[i, j] * numbers[C + j]
    columns = view(state, COLUMNS, (s,))
    M, T = scratch((s, s + m + 1)), scratch((m, m))
    unit = 1.0
    if options[NORMALISED] == 1:
        unit = volume(J, problem.row_scales, numbers[TOLERANCE])
        if unit == 0.0 and not damped:
            answer.status[()] = SINGULAR_J
            return
    determinant, regular = partitioned(problem, J, unit, numbers, options, state, M)
    answer.measure[()] = abs(determinant) / unit if unit > 0.0 else 0.0
    state[SIGN] = int(determinant > 0.0) - int(determinant < 0.0)
    share = damped_share(problem, regular) if damped else 0.0
    if share == 1.0:
        state[SIGN] = 0
        for i in range(s):
            columns[i] = NONE
        damp_weighted(problem, numbers, T, answer)
        bring_within(problem, T, answer)
        return
    if regular <= numbers[TOLERANCE]:
        lost = volume(J, problem.row_scales, numbers[TOLERANCE]) == 0.0
        answer.status[()] = SINGULAR_J if lost else SINGULAR_JA
        return
    u = answer.u
    for j in range(m):  # the reduced gradient, on Ja's own columns 0 up to rounding
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
        blend(problem, numbers, share, T, answer)
    if beyond(problem, answer):
        reduced_metric(M, columns, 1.0 - share, T)
        if weighted:
            for i in range(m):
                for j in range(m):
                    T[i, j] *= numbers[C + i]
        call_limit(problem.limiter, problem, T, answer)


@compiled
def damped_share(problem: ProblemArrays, regular: float) -> float:
    """The damped answer's share: 0 where Ja is at least as regular as ε, 1 where at most half as regular."""
    square = 0.0
    for i in range(problem.rate.shape[0]):
        square += (problem.rate[i] / problem.row_scales[i]) ** 2
    threshold = step_threshold(math.sqrt(square), problem.dt[()], BELOW)
    return min(max(2.0 * (1.0 - regular / threshold), 0.0), 1.0)


@compiled
def damp_weighted(problem: ProblemArrays, numbers: Array, W: Array, answer: AnswerArrays) -> None:
    """Damped least squares with its default λ and ε, in the metric of the weights; W = diag(c)."""
    clear(W)
    for j in range(W.shape[0]):
        W[j, j] = numbers[C + j] if numbers.shape[0] > C else 1.0
    damp(problem, numbers[ALPHA], USUAL, W, problem.dt[()], answer)


@compiled
def blend(problem: ProblemArrays, numbers: Array, share: float, W: Array, answer: AnswerArrays) -> None:
    """u = (1 - share) times the reduced gradient's u plus share times the damped one; W is overwritten."""
    reduced, measure = scratch(W.shape[0]), answer.measure[()]
    copied(answer.u, reduced)
    damp_weighted(problem, numbers, W, answer)
    answer.measure[()] = measure
    for j in range(reduced.shape[0]):
        answer.u[j] = (1.0 - share) * reduced[j] + share * answer.u[j]
    relaxed, scale = answer.status[()] == RELAXED, answer.nu[0]
    certify(problem, answer)
    if relaxed and answer.status[()] == INEXACT:
        answer.status[()] = RELAXED
        scale = 1.0 - share * (1.0 - scale)
    else:
        scale = 1.0
    for level in range(answer.nu.shape[0]):
        answer.nu[level] = scale


@compiled
def reduced_metric(M: Array, columns: Integers, share: float, T: Array) -> None:
    """u = T [ua'; ub], ua = ua' - share Ja⁻¹ Jb ub: with share 1 limits change the free inputs the least."""
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
    M: Array,
) -> tuple[float, float]:
    """`solve_partition`; below Θ, or before damping takes over, with a new partition if it may change."""
    candidates, columns = options[CANDIDATES:], view(state, COLUMNS, (J.shape[0],))
    damped = options[DAMPED] == 1
    if columns[0] == NONE:
        choose_partition(J, candidates, columns)
    determinant, regular = solve_partition(J, problem.rate, problem.row_scales, columns, M)
    below = abs(determinant) < numbers[THRESHOLD] * unit
    alone = damped and damped_share(problem, regular) == 1.0
    if state[MODE] == FREE:
        if below or alone:
            choose_partition(J, candidates, columns)
            determinant, regular = solve_partition(J, problem.rate, problem.row_scales, columns, M)
    elif below and not alone:
        state[MODE] = OVERDUE
    return determinant, regular


def _as_tuple(partition: Partition) -> tuple[str | int, ...]:
    if isinstance(partition, str | int):
        raise InputError(where="partitions", expected="lists of inputs, as in [['v', 'q1']]", got=partition)
    return tuple(partition)


class ReducedGradient(Resolver):
    """J T = [Ja Jb]: ub descends the reduced gradient of H, ua does the task (paper, eqs. 9 and 10).

    The columns of Ja are the *partition*, at the start the candidate with the largest |det Ja|. It is chosen
    again when its measure falls below `threshold`, with `singular="damped"` also before the damped answer
    takes over.

    Parameters
    ----------
    alpha : step size α > 0, 1/s times the unit of H's curvature
    partitions : "automatic": all candidates, measured by |det Ja| / sqrt(det J Jᵀ), a number in
        [0, 1] (Cauchy-Binet); more than 2,000 are searched by a rank-revealing QR, with Θ at
        most 1 / (2 sqrt(their number)); or a list of candidates, measured by |det Ja| (the paper's rule:
        [("v", "q1"), ("v", "omega")] in case 1; the arm's joints when n_m = s)
    threshold : Θ; 0.01 for given candidates (the paper's), 0.05 for automatic ones
    tolerance : singular where the last pivot, rows in their natural scales, is below this (times the largest
        one above 1)
    weights : numbers above 0, one an input, or by input or group ("platform", "arm"), 1 for the rest: the
        method in the inputs sqrt(w) u. A heavy input is less often in Ja, and descends H more slowly (α / w)
    singular : where no candidate is well conditioned: "stop" ends the run, "damped" changes gradually to
        damped least squares, and back
    step : "constant": α; "armijo": at each sample α is shortened until the objective falls along the sample's
        motion

    Examples
    --------
    >>> robot = nmm.load("unicycle_2r")
    >>> task = nmm.Task(nmm.Position("ee", "xy"), [2.0, 1.0])
    >>> resolver = nmm.ReducedGradient(alpha=10, partitions=[["v", "omega"], ["v", "q1"]], threshold=0.01)
    >>> controller = nmm.Controller(robot, task, resolver, nmm.Quadratic(nmm.QuadraticTerm("q1")))
    >>> controller.evaluate(0.0, robot.q({"q2": 0.5})).partition
    array([0, 1])
    """

    name: ClassVar[str] = "rg"
    exact: ClassVar[bool] = True
    kernel: ClassVar[Kernel] = reduced_gradient
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
        self.partitions = () if self.automatic else tuple(_as_tuple(p) for p in partitions)
        if self.automatic:
            expect(partitions == "automatic", "partitions", "'automatic' or lists of inputs", partitions)
        else:
            expect(self.partitions, "partitions", "at least one list of inputs, or 'automatic'")
        usual = 0.05 if self.automatic else 0.01
        self.threshold = positive(usual if threshold is None else threshold, "threshold")
        below_one = self.threshold < 1.0 or not self.automatic
        expect(below_one, "threshold", "below 1 (automatic)", self.threshold)
        self.tolerance = positive(tolerance, "tolerance")
        expect_known("singular", singular, ("stop", "damped"))
        self.singular = singular

    def setup(self, dimensions: Dimensions) -> Setup:
        self.check(dimensions, all_levels=True)
        threshold, count = self.threshold, math.comb(dimensions.m, dimensions.s)
        searched = self.automatic and count > MOST_TRIED
        if searched:  # the squares of all measures add up to 1, so the best is at least 1 / sqrt(count)
            threshold = min(threshold, 0.5 / math.sqrt(count))
        candidates = () if searched else candidate_columns(self.partitions, dimensions)
        c = np.zeros(0) if self.weights is None else weight_diagonal(self.weights, dimensions) ** -0.5
        damped = self.singular == "damped" or len(dimensions.levels) > 1  # levels may contradict each other
        options = [self.automatic, damped, *candidates]
        numbers = np.array([self.alpha, threshold, self.tolerance, *c])
        return Setup(numbers, np.array(options, dtype=np.int64))

    def start(self, dimensions: Dimensions) -> PartitionState:
        return PartitionState(dimensions.s, self.automatic)
