"""Damped least squares: the projected gradient, bounded where J loses rank."""

from __future__ import annotations

from typing import ClassVar, Literal, get_args

import numpy as np

from nmm.base.arrays import Array, Integers, positive
from nmm.base.errors import expect_known
from nmm.base.kernels.compiled import Kernel, compiled, kernel, view
from nmm.base.kernels.damping import BELOW, LARGEST, Law
from nmm.control.resolvers.answer import AnswerArrays
from nmm.control.resolvers.base import RESOLVER, Resolver, Setup, StepRule, Weights, metric_root, step_rule
from nmm.control.resolvers.damped import any_passed, damp, damp_between_stops
from nmm.control.resolvers.limit_check import bring_within
from nmm.control.resolvers.problem import Dimensions
from nmm.control.resolvers.problem_arrays import ProblemArrays

#: Numbers: α, λ, ε, the time that `adapted` remembers and, with weights, C row by row. Options: the law, in
#: the order of `Damping`.
ALPHA, DAMPING, THRESHOLD, LASTING, C = 0, 1, 2, 3, 4
LAW = 0

#: The time for which λ is raised grows by this share of how long the robot runs on, and falls as fast.
GROWS = 0.05

Damping = Literal["constant", "variable", "directions"]


@compiled
def adapted(lasting: float, dt: float, against: float, needed: float) -> float:
    """The time in which λ lets inputs change to what is asked of damped directions, s; 0 for a sample's.

    Inputs whose accelerations are limited run on for `against` s where they are asked to turn back. An arm
    that is stretched towards a target out of reach then swings through, and with a λ for single samples for
    ever. So the time grows meanwhile, and later falls, but not below what the inputs `needed` then.
    """
    if against > 0.0 and dt > 0.0:
        return max(lasting, min(against + dt, max(lasting, dt) + GROWS * dt))
    if lasting > 0.0 and needed >= 0.0:
        return min(lasting, max(lasting - GROWS * dt, needed))
    return lasting


@kernel(RESOLVER)
def damped_least_squares(
    problem: ProblemArrays, numbers: Array, options: Integers, state: Integers, answer: AnswerArrays
) -> None:
    """`damped_solution`, between stops, for a time that is `adapted`; limits keep u near it in the metric of
    the weights."""
    m = problem.J.shape[1]
    plain = numbers.shape[0] == C
    W = view(numbers, 0 if plain else C, (0, 0) if plain else (m, m))
    law, dt = Law(options[LAW], numbers[DAMPING], numbers[THRESHOLD]), problem.dt[()]
    lasting = max(dt, numbers[LASTING]) if numbers[LASTING] > 0.0 else dt
    against, needed = damp(problem, numbers[ALPHA], law, W, lasting, answer)
    numbers[LASTING] = adapted(numbers[LASTING], dt, against, needed)
    if problem.ends.shape[0] == 1 and any_passed(problem, answer.u):
        damp_between_stops(problem, numbers[ALPHA], law, W, lasting, answer)
    bring_within(problem, W, answer)


class DampedLeastSquares(Resolver):
    """The least of ‖J u - rate‖² + λ² ‖u‖², and -α h in J's null space: the projected gradient where λ = 0.

    Rows are taken in their natural scales, weights as for the projected gradient. A run continues at singular
    configurations: the inputs stay bounded, and the answer's ν is the share of its rate that the task gets.
    A task may have more rows than there are inputs: u is then the best in the least-squares sense, damped and
    limited likewise, and the residual is what of the rate is left undone. Under limits of acceleration λ
    grows where the robot runs on against what is asked, and falls again.

    The objective affects the task only in directions with σ below the threshold, which become part of the
    null space as σ falls to 0: so u is continuous where the rank changes.

    Parameters
    ----------
    alpha : step size α > 0, 1/s times the unit of H's curvature
    law : λ by the singular values σ of J, rows in their natural scales: "directions", each by its own σ, λ_i²
        = λ² (1 - (σ_i / ε)²) below ε, else 0 (Maciejewski and Klein 1988, Chiaverini 1997); "variable", all
        by the least σ (Chiaverini, Egeland and Kanestrøm 1991); "constant", λ everywhere (Wampler 1986)
    damping : the largest λ > 0
    threshold : ε > 0; where no σ is smaller, the answer is the projected gradient's ("constant" damps
        everywhere)
    weights : numbers above 0, one an input, or by input or group ("platform", "arm"), 1 for the rest: a heavy
        input moves less; or a symmetric positive definite (m, m) matrix
    step : "constant": α; "armijo": at each sample α is shortened until the objective falls along the sample's
        motion

    Examples
    --------
    >>> arm = nmm.load("unicycle_3r", platform="fixed")
    >>> task = nmm.Task(nmm.Position("ee"), [2.0, 0.0, 0.5])
    >>> controller = nmm.Controller(arm, task, nmm.DampedLeastSquares())
    >>> run = nmm.simulate(controller, arm.q({"q2": 0.8, "q3": 0.5}), 10)
    >>> str(run.outcome), bool(np.abs(run.u[-1]).max() < 0.01)
    ('missed', True)
    """

    name: ClassVar[str] = "dls"
    exact: ClassVar[bool] = False
    more_rows: ClassVar[bool] = True
    #: Where the root of the weights begins in the numbers of its kernel.
    root_at: ClassVar[int] = C
    kernel: ClassVar[Kernel] = damped_least_squares
    alpha_at: ClassVar[int | None] = ALPHA

    def __init__(
        self,
        alpha: float = 10.0,
        law: Damping = "directions",
        damping: float = LARGEST,
        threshold: float = BELOW,
        weights: Weights | None = None,
        step: StepRule = "constant",
    ) -> None:
        self.alpha = positive(alpha, "alpha")
        self.step = step_rule(step)
        expect_known("law", law, get_args(Damping))
        self.law = law
        self.damping = positive(damping, "damping")
        self.threshold = positive(threshold, "threshold")
        self.weights = weights

    def setup(self, dimensions: Dimensions) -> Setup:
        self.check(dimensions)
        C = metric_root(self.weights, dimensions)
        numbers = np.array([self.alpha, self.damping, self.threshold, 0.0, *C])
        return Setup(numbers, np.array([get_args(Damping).index(self.law)], dtype=np.int64))
