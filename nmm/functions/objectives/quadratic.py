"""Quadratic objectives in linear combinations of coordinates (the paper's H1 to H4)."""

from __future__ import annotations

from dataclasses import dataclass

from nmm.errors import InputError
from nmm.functions.function import Function, Stage
from nmm.functions.objectives.base import Objective
from nmm.functions.objectives.differences import Term, checked, difference_stages
from nmm.functions.tasks.coordinates import Combination, label
from nmm.robots.robot import Robot


@dataclass(frozen=True)
class Square:
    """½ weight (combination - target)²: target in the combination's unit, rad or m, or a function of one row
    in it (a line, a spline, a signal, ...).

    Examples
    --------
    >>> robot = nmm.load("unicycle_2r")
    >>> H = nmm.Quadratic(nmm.Square("q2", target=1.0, weight=4.0))
    >>> H.value(nmm.Configuration(robot, robot.rest))
    2.0
    """

    combination: Combination
    target: float | Function = 0.0
    weight: float = 1.0


class Quadratic(Objective):
    """H(q) = ½ Σ weight (combination(q) - target)². Angles are read as they are, never wrapped.

    Parameters
    ----------
    squares : the terms; H1 of the paper is
        `Quadratic(Square({"theta": 1, "q1": 1, "q2": 1}, pi / 2), Square("q1", pi / 4))`

    Examples
    --------
    >>> robot = nmm.load("unicycle_2r")
    >>> H = nmm.Quadratic(nmm.Square({"theta": 1, "q1": 1, "q2": 1}, np.pi / 2), nmm.Square("q1", np.pi / 4))
    >>> round(H.value(nmm.Configuration(robot, robot.rest)), 3)
    1.542
    """

    def __init__(self, *squares: Square) -> None:
        if not squares:
            raise InputError("quadratic objective: expected at least one term")
        for square in squares:
            if not square.combination:
                raise InputError("quadratic objective: expected a coordinate in every term, got none")
        self.squares = squares
        self._terms = [Term(square.combination, square.target, square.weight) for square in squares]
        for term in self._terms:
            checked(term, f"term {label(term.combination)}")

    def stages(self, robot: Robot) -> tuple[Stage, ...]:
        return difference_stages(self._terms, robot)
