"""The objectives of a scenario: what the redundancy is used for."""

import operator
from collections.abc import Mapping
from functools import reduce
from typing import Annotated, Literal

from pydantic import BeforeValidator, Discriminator, Field, Tag

from nmm.base.kinds import OBJECTIVES
from nmm.control.functions.function import Function
from nmm.control.functions.objectives.base import Objective
from nmm.control.functions.objectives.clearance import Clearance
from nmm.control.functions.objectives.coordinates import Quadratic, QuadraticTerm
from nmm.control.limits.collisions import Collisions
from nmm.model.robots.robot import Robot
from nmm.scenario.constructors import (
    Combination,
    FunctionPart,
    MadePart,
    check_coordinates,
    check_part,
    keys_of,
    listed,
    part_of,
)
from nmm.scenario.functions import Reference
from nmm.scenario.keys import FUNCTION, NUMBER, KeyedPart, OneOf, at, each, is_path
from nmm.scenario.numbers import Number, Positive


def _spelled(value: object) -> str:
    return FUNCTION if isinstance(value, Mapping | FunctionPart) or is_path(value) else NUMBER


_Function = Annotated[Reference, Tag(FUNCTION)]
Target = Annotated[Annotated[Number, Tag(NUMBER)] | _Function, Discriminator(_spelled)]
Weight = Annotated[Annotated[Positive, Tag(NUMBER)] | _Function, Discriminator(_spelled)]


class ObjectivePart(MadePart):
    """An objective H(q), minimised."""

    weight: Weight = Field(
        1.0,
        description="factor above 0: a number, or a reference of one row ({kind: line, start: 0, "
        "end: 1, duration: 5})",
    )
    maximise: bool = Field(False, description="whether it is maximised")

    def among(self, collisions: Collisions | None) -> Objective:
        objective: Objective = self.make()
        return objective

    def build(self, robot: Robot, collisions: Collisions | None = None) -> Objective:
        check_part(self, robot)
        objective = self.among(collisions)
        with self.own_keys():
            for _, term in objective.terms_on(robot):
                term.stages(robot)
        if isinstance(self.weight, FunctionPart):
            objective = self.weight.build(robot, "1") * objective
            with at("weight"):
                objective.terms_on(robot)
            return -objective if self.maximise else objective
        factor = -self.weight if self.maximise else self.weight
        return objective if factor == 1.0 else factor * objective


class TermPart(KeyedPart):
    """½ weight (of - target)²."""

    of: Combination = Field(description="a coordinate (q1) or a combination ({theta: 1, q1: 1, q2: 1})")
    target: Target = Field(0.0, description="rad or m: a number, or a reference of one row")
    weight: Positive = Field(1.0, description="above 0")

    def aim(self, i: int) -> float | Function:
        if isinstance(self.target, FunctionPart):
            with at("terms", i, "target"):
                target: Function = self.target.make("rad")
            return target
        return self.target


class QuadraticPart(ObjectivePart):
    """½ Σ weight (combination - target)²; angles are read as they are, never wrapped."""

    makes = Quadratic
    kind: Literal["quadratic"]
    terms: list[TermPart] = Field(description="the squares that are added up", min_length=1)

    def make(self, unit: str = "m") -> Objective:
        return Quadratic(
            *(QuadraticTerm(term.of, term.aim(i), term.weight) for i, term in enumerate(self.terms))
        )

    def build(self, robot: Robot, collisions: Collisions | None = None) -> Objective:
        for i, term in enumerate(self.terms):
            with at("terms", i, "of"):
                check_coordinates([term.of], robot)
            if isinstance(term.target, FunctionPart):
                with at("terms", i, "target"):
                    term.target.build(robot, "rad")
        return super().build(robot, collisions)


class ClearancePart(keys_of(Clearance, ObjectivePart, "collisions")):  # type: ignore[misc]  # made
    """Grows where the robot comes near to the obstacles of `collisions`, so that it turns away early."""

    makes = Clearance
    beside = ("collisions",)
    kind: Literal["clearance"]

    def among(self, collisions: Collisions | None) -> Objective:
        return self.make() if collisions is None else self.make().among(collisions)


class MaximisedPart(ObjectivePart):
    """An objective that is better when it is larger."""

    maximise: bool = Field(True, description="whether it is maximised")


SPECIAL: dict[str, type[ObjectivePart]] = {"quadratic": QuadraticPart, "clearance": ClearancePart}
BASES = dict.fromkeys(
    ("manipulability", "weighted_manipulability", "directional_manipulability", "inverse_condition"),
    MaximisedPart,
)
OBJECTIVE_PARTS: dict[str, type[ObjectivePart]] = OBJECTIVES.made(
    lambda kind, made: SPECIAL.get(kind) or part_of(kind, made, BASES.get(kind, ObjectivePart))
)

#: One objective, a list that is added up, or nothing.
ObjectiveList = Annotated[
    list[Annotated[ObjectivePart, OneOf(OBJECTIVE_PARTS)]],
    BeforeValidator(lambda value: [] if value is None else listed(value)),
]


def build_objective(
    parts: list[ObjectivePart], robot: Robot, collisions: Collisions | None = None
) -> Objective | None:
    built = each(parts, lambda part: part.build(robot, collisions))
    return reduce(operator.add, built) if built else None
