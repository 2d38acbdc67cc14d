"""The objectives of a scenario: what the redundancy is used for."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Literal

from pydantic import BeforeValidator, Field

from nmm.functions.objectives.base import Objective
from nmm.functions.objectives.quadratic import Quadratic, Square
from nmm.kinds import OBJECTIVES
from nmm.robots.robot import Robot
from nmm.scenario.function_part import check_coordinates, check_names
from nmm.scenario.keys import Part, at, one_of
from nmm.scenario.made_part import MadePart, part_of
from nmm.scenario.numbers import Number, Positive
from nmm.scenario.spelling import Combination


class ObjectivePart(MadePart):
    """An objective H(q), minimised."""

    weight: Positive = Field(1.0, description="factor on this objective in the sum, above 0")
    maximise: bool = Field(False, description="whether to maximise it: its negative is minimised")

    def build(self, robot: Robot) -> Objective:
        """The weighted objective; errors know their key."""
        check_names(self, robot)
        objective: Objective = self.make()
        with self.own_keys():
            objective.rows(robot)
            objective.stages(robot)
        factor = -self.weight if self.maximise else self.weight
        return objective if factor == 1.0 else factor * objective


class TermPart(Part):
    """½ weight (of - target)²."""

    of: Combination = Field(description="a coordinate (q1) or a combination ({theta: 1, q1: 1, q2: 1})")
    target: Number = Field(0.0, description="rad or m")
    weight: Positive = Field(1.0, description="above 0")


class QuadraticPart(ObjectivePart):
    """½ Σ weight (combination - target)²; angles are read as they are, never wrapped."""

    makes = Quadratic
    kind: Literal["quadratic"]
    terms: list[TermPart] = Field(description="the squares that are added up", min_length=1)

    def make(self, unit: str = "m") -> Objective:
        return Quadratic(*(Square(term.of, term.target, term.weight) for term in self.terms))

    def build(self, robot: Robot) -> Objective:
        for i, term in enumerate(self.terms):
            with at("terms", i, "of"):
                check_coordinates([term.of], robot)
        return super().build(robot)


class MaximisedPart(ObjectivePart):
    """An objective that is better when it is larger."""

    maximise: bool = Field(True, description="whether to maximise it: its negative is minimised")


SPECIAL: dict[str, type[ObjectivePart]] = {"quadratic": QuadraticPart}
BASES = {"manipulability": MaximisedPart}
OBJECTIVE_PARTS: dict[str, type[ObjectivePart]] = {
    kind: SPECIAL.get(kind) or part_of(kind, made, BASES.get(kind, ObjectivePart))
    for kind, made in OBJECTIVES.items()
}


def _listed(value: object) -> object:
    if value is None:
        return []
    return value if isinstance(value, list | tuple) else [value]


if TYPE_CHECKING:
    ObjectiveList = list[ObjectivePart]
else:
    #: One objective, a list that is added up, or nothing.
    ObjectiveList = Annotated[list[one_of(OBJECTIVE_PARTS)], BeforeValidator(_listed)]


def build_objective(parts: list[ObjectivePart], robot: Robot) -> Objective | None:
    """The sum of the parts, if there are any."""
    total: Objective | None = None
    for i, part in enumerate(parts):
        with at(i):
            objective = part.build(robot)
        total = objective if total is None else total + objective
    return total
