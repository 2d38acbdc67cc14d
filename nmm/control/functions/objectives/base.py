"""Objectives H(t, q), minimised: one row each, added and scaled like numbers; and a user's own, in Python."""

from __future__ import annotations

from collections.abc import Callable

from numpy.typing import ArrayLike

from nmm.base.arrays import Array, scalar
from nmm.base.errors import InputError, expect, expect_kind
from nmm.base.kernels.compiled import kernel
from nmm.base.kernels.records import FUNCTION, At, Frames, Rows
from nmm.control.functions.callbacks import of_configuration
from nmm.control.functions.function import Evaluation, Function, Row, Stage, only_row, stacked
from nmm.control.functions.program import evaluate
from nmm.model.robots.configuration import Configuration
from nmm.model.robots.robot import Robot


@kernel(FUNCTION)
def product(at: At, frames: Frames, numbers: Array, rows: Rows) -> None:
    """The first row times the second, in place."""
    a, b = rows.value[0], rows.value[1]
    rows.value[0] = a * b
    rows.value_t[0] = rows.value_t[0] * b + a * rows.value_t[1]
    for k in range(at.q.shape[0]):
        rows.value_q[0, k] = rows.value_q[0, k] * b + a * rows.value_q[1, k]


class WeightedFunction(Function):
    """The product of two functions of one row: a term whose weight changes, usually with time; unitless."""

    def __init__(self, function: Function, weight: Function) -> None:
        self.function = function
        self.weight = weight

    def rows(self, robot: Robot) -> tuple[Row, ...]:
        row = only_row(self.function, robot, "function", "a function of one row")
        only_row(self.weight, robot, "weight", "a function of one row")
        return (Row(row.name, "1"),)

    def stages(self, robot: Robot) -> tuple[Stage, ...]:
        self.rows(robot)
        return (*stacked((self.function, self.weight), robot), Stage(product, 2))


class Objective(Function):
    """H(q), a function with one row. It is minimised: to maximise w, minimise `-w`.

    `a + b`, `2.0 * a` and `-a` make sums and multiples; `ramp * a` with a function of one row (a line, a
    spline, a signal, ...) is a term whose weight changes.

    Examples
    --------
    >>> robot = nmm.load("unicycle_2r")
    >>> H = nmm.Quadratic(nmm.QuadraticTerm("q1")) + 0.5 * nmm.Quadratic(nmm.QuadraticTerm("q2", 1.0))
    >>> here = nmm.Configuration(robot, robot.q({"q1": 1.0}))
    >>> isinstance(H, nmm.extending.Objective), H.value(here), H.gradient(here)
    (True, 0.75, array([ 0. ,  0. ,  0. ,  1. , -0.5]))
    """

    def rows(self, robot: Robot) -> tuple[Row, ...]:
        return (Row("H", "1"),)

    def terms(self) -> tuple[tuple[float, Function], ...]:
        """The weighted functions, of one row each, that add up to H."""
        return ((1.0, self),)

    def terms_on(self, robot: Robot) -> tuple[tuple[float, Function], ...]:
        """The terms, checked against a robot; `InputError` for one that has more rows than one."""
        for _, function in self.terms():
            only_row(function, robot, "objective", "terms of one row")
        return self.terms()

    def value(self, configuration: Configuration, t: float = 0.0) -> float:
        """H(t, q), t in s."""
        return float(self._evaluated(configuration, t).value[0])

    def gradient(self, configuration: Configuration, t: float = 0.0) -> Array:
        """∂H/∂q, shape (n,): ordinary partial derivatives in the coordinates."""
        gradient: Array = self._evaluated(configuration, t).value_q[0]
        return gradient

    def rate(self, configuration: Configuration, t: float = 0.0) -> float:
        """∂H/∂t, 1/s, at fixed q: 0 unless weights, targets or directions move; resolvers ignore it."""
        return float(self._evaluated(configuration, t).value_t[0])

    def _evaluated(self, configuration: Configuration, t: float) -> Evaluation:
        terms = self.terms_on(configuration.robot)
        evaluations = [(weight, evaluate(function, t, configuration)) for weight, function in terms]
        parts = ([weight * evaluation[i] for weight, evaluation in evaluations] for i in range(3))
        return Evaluation(*(sum(part[1:], part[0]) for part in parts))

    def __add__(self, other: Objective) -> Objective:
        return WeightedSum((1.0, self), (1.0, other))

    def __radd__(self, other: object) -> Objective:
        """So that Python's `sum` of objectives, which begins with 0, is their sum."""
        if other == 0:
            return self
        raise InputError(where="objective", expected="an objective to add", got=other)

    def __mul__(self, factor: float | Function) -> Objective:
        return WeightedSum((factor, self))

    __rmul__ = __mul__

    def __neg__(self) -> Objective:
        return -1.0 * self

    def __sub__(self, other: Objective) -> Objective:
        return self + -other


class WeightedSum(Objective):
    """A weighted sum of objectives, or of other functions of one row: `WeightedSum((2.0, a), (ramp, b))`.
    Weights are numbers or functions of one row, usually of time."""

    def __init__(self, *terms: tuple[float | Function, Function]) -> None:
        expect(terms, "sum of objectives", "at least one")
        for _, function in terms:
            expect_kind(function, Function, "objective", "an objective to add")
        self._terms = tuple(
            (inner, WeightedFunction(part, weight))
            if isinstance(weight, Function)
            else (scalar(weight, "weight") * inner, part)
            for weight, function in terms
            for inner, part in (function.terms() if isinstance(function, Objective) else ((1.0, function),))
        )

    def terms(self) -> tuple[tuple[float, Function], ...]:
        return self._terms

    def stages(self, robot: Robot) -> tuple[Stage, ...]:
        raise InputError(where="sum of objectives", expected="as an objective, it is no task of its own")


class CallableObjective(Objective):
    """H from a Python function of a `Configuration`.

    Parameters
    ----------
    function : configuration -> H
    gradient : configuration -> ∂H/∂q, shape (n,); central differences when not given

    Examples
    --------
    >>> robot = nmm.load("unicycle_2r")
    >>> q2 = robot.coordinate("q2")
    >>> H = nmm.CallableObjective(lambda here: 0.5 * (here.q[q2] - 1) ** 2)
    >>> H.gradient(nmm.Configuration(robot, robot.rest)).round(3)
    array([ 0.,  0.,  0.,  0., -1.])
    """

    def __init__(
        self,
        function: Callable[[Configuration], float],
        gradient: Callable[[Configuration], ArrayLike] | None = None,
    ) -> None:
        self.function = function
        self._gradient = gradient

    def stages(self, robot: Robot) -> tuple[Stage, ...]:
        return of_configuration(self.function, self._gradient, 1, "callable objective", robot, "gradient")
