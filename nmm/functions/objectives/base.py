"""Objectives H(t, q), minimised: one row each, added and scaled like numbers."""

from __future__ import annotations

from nmm.arrays import Array, scalar
from nmm.errors import InputError
from nmm.functions.function import Evaluation, Function, Row, Stage
from nmm.functions.product import Product
from nmm.functions.program import evaluate
from nmm.robots.configuration import Configuration
from nmm.robots.robot import Robot


class Objective(Function):
    """H(q), a function with one row. It is minimised: to maximise w, minimise `-w`.

    `a + b`, `2.0 * a` and `-a` make sums and multiples; `ramp * a` with a function of one row (a line, a
    spline, a signal, ...) is a term whose weight changes.

    Examples
    --------
    >>> robot = nmm.load("unicycle_2r")
    >>> H = nmm.Quadratic(nmm.Square("q1")) + 0.5 * nmm.Quadratic(nmm.Square("q2", 1.0))
    >>> here = nmm.Configuration(robot, robot.q({"q1": 1.0}))
    >>> isinstance(H, nmm.Objective), H.value(here), H.gradient(here)
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
            rows = function.rows(robot)
            if len(rows) != 1:
                names = ", ".join(row.name for row in rows)
                raise InputError(f"objective: expected terms of one row, got one with {len(rows)} ({names})")
        return self.terms()

    def value(self, configuration: Configuration, t: float = 0.0) -> float:
        """H(t, q), t in s."""
        return float(self._evaluated(configuration, t).value[0])

    def gradient(self, configuration: Configuration, t: float = 0.0) -> Array:
        """∂H/∂q, shape (n,): ordinary partial derivatives in the coordinates."""
        gradient: Array = self._evaluated(configuration, t).value_q[0]
        return gradient

    def rate(self, configuration: Configuration, t: float = 0.0) -> float:
        """∂H/∂t, 1/s, at a standing configuration: 0 but for weights, targets and directions that move.

        No resolver reads it: they descend H as it is now.
        """
        return float(self._evaluated(configuration, t).value_t[0])

    def _evaluated(self, configuration: Configuration, t: float) -> Evaluation:
        terms = self.terms_on(configuration.robot)
        found = [(weight, evaluate(function, t, configuration)) for weight, function in terms]
        parts = ([weight * one[i] for weight, one in found] for i in range(3))
        return Evaluation(*(sum(part[1:], part[0]) for part in parts))

    def __add__(self, other: Objective) -> Objective:
        return Sum((1.0, self), (1.0, other))

    def __radd__(self, other: object) -> Objective:
        """So that Python's `sum` of objectives, which begins with 0, is their sum."""
        if other == 0:
            return self
        raise InputError(f"objective: expected an objective to add, got {other!r}")

    def __mul__(self, factor: float | Function) -> Objective:
        return Sum((factor, self))

    __rmul__ = __mul__

    def __neg__(self) -> Objective:
        return -1.0 * self

    def __sub__(self, other: Objective) -> Objective:
        return self + -other


class Sum(Objective):
    """A weighted sum of objectives, or of other functions of one row: `Sum((2.0, a), (-1.0, b))`.

    Parameters
    ----------
    terms : (weight, function); a weight is a number, or a function of one row itself, of time as a rule
    """

    def __init__(self, *terms: tuple[float | Function, Function]) -> None:
        if not terms:
            raise InputError("sum of objectives: expected at least one")
        for _, function in terms:
            if not isinstance(function, Function):
                raise InputError(f"objective: expected an objective to add, got {function!r}")
        self._terms = tuple(
            (inner, Product(part, weight))
            if isinstance(weight, Function)
            else (scalar(weight, "weight") * inner, part)
            for weight, function in terms
            for inner, part in (function.terms() if isinstance(function, Objective) else ((1.0, function),))
        )

    def terms(self) -> tuple[tuple[float, Function], ...]:
        return self._terms

    def stages(self, robot: Robot) -> tuple[Stage, ...]:
        raise InputError("sum of objectives: expected as an objective, it is no task of its own")
