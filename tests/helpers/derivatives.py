"""Derivatives held against central differences, over any function and any controller."""

from __future__ import annotations

from collections.abc import Callable, Iterable

import numpy as np
from function_grid import evaluated
from numpy.typing import NDArray

from nmm.control.controller import Controller
from nmm.control.functions.function import Evaluation, Function
from nmm.control.functions.objectives import Objective
from nmm.control.functions.program import Program
from nmm.model.robots.configuration import Configuration
from nmm.model.robots.robot import Robot

Array = NDArray[np.float64]

STEP = 1e-3
#: Of the largest entry, or of 1 where that is smaller. The stencil is good to 1e-10; what nmm itself takes by
#: differences (callables without derivatives) is good to 1e-9.
TOLERANCE = 1e-8


def derivative(function: Callable[[float], Array]) -> Array:
    """At 0, by the fourth-order stencil."""
    near = function(STEP) - function(-STEP)
    far = function(2 * STEP) - function(-2 * STEP)
    return (8 * near - far) / (12 * STEP)


def partials(function: Callable[[Array], Array], at: Array) -> Array:
    """The derivatives in every component of `at`, along a last axis."""
    if at.size == 0:
        return np.zeros((*function(at).shape, 0))
    return np.stack([derivative(lambda h, e=e: function(at + h * e)) for e in np.eye(at.size)], axis=-1)


def assert_close(found: Array, expected: Array) -> None:
    assert found.shape == expected.shape
    assert np.all(np.isfinite(found))
    scale = max(1.0, float(np.abs(expected).max(initial=0.0)))
    np.testing.assert_allclose(found, expected, rtol=0, atol=TOLERANCE * scale)


def continuous(values: Array, near: Array, angular: list[bool]) -> Array:
    """The values, with angles taken on the branch of `near`."""
    jump = 2 * np.pi * np.round((values - near) / (2 * np.pi))
    return values - np.where(angular, jump, 0.0)


def values(function: Function, robot: Robot) -> Callable[[float, Array], Array]:
    """A function's values at (t, q), an objective's by its terms; laid out once, which takes longer than many
    evaluations."""
    terms = function.terms() if isinstance(function, Objective) else ((1.0, function),)
    program = Program(robot, [term for _, term in terms])
    program.lay_out()

    def value(t: float, q: Array) -> Array:
        evaluations = zip(terms, program.evaluate(t, q), strict=True)
        first, *others = (weight * evaluation.value for (weight, _), evaluation in evaluations)
        return np.asarray(sum(others, first))

    return value


def check_function(function: Function, robot: Robot, t: float, q: Array) -> None:
    check_function_at(function, robot, [(t, q)])


def check_function_at(function: Function, robot: Robot, points: Iterable[tuple[float, Array]]) -> None:
    """At each t and q: both derivatives, and the value, which is that of the programs differentiated here."""
    angular = [row.angular for row in function.rows(robot)]
    near = values(function, robot)
    for t, q in points:
        found = evaluated(function, t, Configuration(robot, q))
        np.testing.assert_array_equal(near(t, q), found.value)

        def value(t: float, q: Array, found: Evaluation = found) -> Array:
            return continuous(near(t, q), found.value, angular)

        assert_close(found.value_t, derivative(lambda h, t=t, q=q, value=value: value(t + h, q)))
        assert_close(found.value_q, partials(lambda q, t=t, value=value: value(t, q), q))


def check_equation(controller: Controller, t: float, q: Array) -> None:
    here = controller.evaluate(t, q)
    angular = [row.angular for row in controller.rows]
    S = controller.robot.S(q)

    def of_inputs(u: Array) -> Array:
        """f - g, and H, where a short motion with the inputs u leads."""
        there = controller.evaluate(t, q + S @ u)
        return np.append(-continuous(there.error, here.error, angular), there.objective)

    assert_close(np.vstack([here.J, here.h]), partials(of_inputs, np.zeros(len(here.u))))
