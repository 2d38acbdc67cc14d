"""A posture that the robot prefers, where its tasks leave it the choice."""

from __future__ import annotations

from collections.abc import Mapping

from nmm.arrays import positive
from nmm.errors import InputError, expect_known
from nmm.functions.function import Function, Stage
from nmm.functions.objectives.base import Objective
from nmm.functions.objectives.differences import Term, checked, difference_stages
from nmm.robots.robot import Robot


class PreferredPosture(Objective):
    """Distance from a posture, H(q) = Σ weight ½ (q_i - q_i*)², and for angles without limits, whose turns do
    not count, weight (1 - cos(q_i - q_i*)), which is the same nearby.

    Parameters
    ----------
    posture : values of coordinates by name, rad or m, each a number or a function of one row; coordinates not
        named are free
    weights : numbers above 0 by name, 1 for the rest

    Examples
    --------
    >>> robot = nmm.load("unicycle_2r")
    >>> H = nmm.PreferredPosture({"q1": 0.5, "q2": -0.5})
    >>> H.gradient(nmm.Configuration(robot, robot.rest)).round(3)
    array([ 0.   ,  0.   ,  0.   , -0.479,  0.479])
    """

    def __init__(
        self, posture: Mapping[str, Function | float], weights: Mapping[str, float] | None = None
    ) -> None:
        if not isinstance(posture, Mapping) or not posture:
            raise InputError(
                f'posture: expected values of coordinates by name, as in {{"q1": 0.5}}, got {posture!r}'
            )
        self.posture = dict(posture)
        self.weights = {
            name: positive(weight, f"weights: {name}") for name, weight in (weights or {}).items()
        }
        for name in self.weights:
            expect_known("coordinate", name, self.posture, "weights")
        for name, value in self.posture.items():
            checked(Term(name, value, 1.0), f"posture: {name}")

    def stages(self, robot: Robot) -> tuple[Stage, ...]:
        terms = []
        for name, value in self.posture.items():
            i = robot.coordinate(name)
            wraps = robot.q_units[i] == "rad" and not robot.limited[i].any()
            terms.append(Term(name, value, self.weights.get(name, 1.0), wraps))
        return difference_stages(terms, robot)
