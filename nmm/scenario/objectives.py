"""The objectives of a scenario: what the redundancy is used for."""

from __future__ import annotations

from abc import abstractmethod
from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import BeforeValidator, Field

from nmm.scenario.functions import Combination, check_combination
from nmm.scenario.keys import Part, at, kind_of
from nmm.scenario.numbers import Number, NumberList, Positive

if TYPE_CHECKING:
    from nmm.functions.objectives import Objective
    from nmm.robots.robot import Robot


class ObjectivePart(Part):
    """An objective H(q), minimised."""

    weight: Positive = Field(1.0, description="factor on this objective in the sum, above 0")
    maximise: bool = Field(False, description="whether to maximise it: its negative is minimised")

    @abstractmethod
    def make(self, robot: Robot) -> Objective:
        """The library's object, without weight and sign."""

    def build(self, robot: Robot) -> Objective:
        """The weighted objective; errors know their key."""
        with self.own_keys():
            objective = self.make(robot)
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

    kind: Literal["quadratic"]
    terms: list[TermPart] = Field(description="the squares that are added up", min_length=1)

    def make(self, robot: Robot) -> Objective:
        from nmm.functions.objectives import Quadratic, Square

        for i, term in enumerate(self.terms):
            with at("terms", i, "of"):
                check_combination(term.of, robot)
        return Quadratic(*(Square(term.of, term.target, term.weight) for term in self.terms))


class JointRangePart(ObjectivePart):
    """Distance of joints from the middle of their ranges, 1/(2N) Σ ((q - middle) / (upper - lower))²."""

    kind: Literal["joint_range"]
    joints: list[str] | None = Field(None, description="names; all the arm's when not given")
    lower: NumberList | None = Field(None, description="lower limits, rad or m; the robot's when not given")
    upper: NumberList | None = Field(None, description="upper limits")

    def make(self, robot: Robot) -> Objective:
        from nmm.functions.objectives import JointRange

        with at("joints"):
            for name in self.joints or ():
                robot.coordinate(name)
        return JointRange(self.joints, self.lower, self.upper)


class ManipulabilityPart(ObjectivePart):
    """Manipulability sqrt(det J Jᵀ) of a frame; maximised, unless maximise is false."""

    kind: Literal["manipulability"]
    frame: str = Field(description="a frame of the robot")
    rows: Annotated[list[str], BeforeValidator(lambda v: list(v) if isinstance(v, str) else v)] = Field(
        ["x", "y", "z"], description="rows of its Jacobian: xy, xyz, or a list of x, y, z, rx, ry, rz"
    )
    of: Literal["robot", "arm"] = Field(
        "robot", description="robot, with the platform's inputs, or arm alone"
    )
    maximise: bool = Field(True, description="whether to maximise it")

    def make(self, robot: Robot) -> Objective:
        from nmm.functions.objectives import Manipulability

        with at("frame"):
            robot.frame_id(self.frame)
        return Manipulability(self.frame, self.rows, self.of)


def _listed(value: object) -> object:
    if value is None:
        return []
    return value if isinstance(value, list | tuple) else [value]


OBJECTIVES: tuple[type[ObjectivePart], ...] = (QuadraticPart, JointRangePart, ManipulabilityPart)
#: One objective, a list that is added up, or nothing.
ObjectiveList = Annotated[
    list[
        Annotated[
            Annotated[QuadraticPart | JointRangePart | ManipulabilityPart, Field(discriminator="kind")],
            kind_of(*OBJECTIVES),
        ]
    ],
    BeforeValidator(_listed),
]


def build_objective(parts: list[Any], robot: Robot) -> Objective | None:
    """The sum of the parts, if there are any."""
    total: Objective | None = None
    for i, part in enumerate(parts):
        with at(i):
            objective = part.build(robot)
        total = objective if total is None else total + objective
    return total
