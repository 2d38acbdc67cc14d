"""Derivatives held against central differences, over any function and any controller."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from function_grid import evaluated
from numpy.typing import NDArray

from nmm.control.controller import Controller
from nmm.control.functions.function import Function
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
    """A function's values at (t, q); laid out once, which takes longer than many evaluations."""
    if isinstance(function, Objective):
        return lambda t, q: np.array([function.value(Configuration(robot, q), t)])
    program = Program(robot, (function,))
    program.lay_out()
    return lambda t, q: program.evaluate(t, q)[0].value


def check_function(function: Function, robot: Robot, t: float, q: Array) -> None:
    found = evaluated(function, t, Configuration(robot, q))
    angular = [row.angular for row in function.rows(robot)]

    near = values(function, robot)

    def value(t: float, q: Array) -> Array:
        return continuous(near(t, q), found.value, angular)

    assert_close(found.value_t, derivative(lambda h: value(t + h, q)))
    assert_close(found.value_q, partials(lambda q: value(t, q), q))


def check_equation(controller: Controller, t: float, q: Array) -> None:
    here = controller.evaluate(t, q)
    angular = [row.angular for row in controller.rows]
    S = controller.robot.S(q)

    def of_inputs(u: Array) -> Array:
        """f - g, and H, where a short motion with the inputs u leads."""
        there = controller.evaluate(t, q + S @ u)
        return np.append(-continuous(there.error, here.error, angular), there.objective)

    assert_close(np.vstack([here.J, here.h]), partials(of_inputs, np.zeros(len(here.u))))
