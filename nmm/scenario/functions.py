"""The functions of a scenario that are made of others, and the choice of a reference."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, Literal

from pydantic import BeforeValidator, Field

from nmm.scenario.function_part import Combination as Combination
from nmm.scenario.function_part import FunctionPart
from nmm.scenario.function_part import check_combination as check_combination
from nmm.scenario.keys import Part, at, kind_of
from nmm.scenario.motions import (
    CirclePart,
    ConstantPart,
    LinePart,
    PolynomialPart,
    RotationPart,
    SlerpPart,
    SplinePart,
    TurnPart,
    checked_orientation,
    is_orientation,
)
from nmm.scenario.numbers import NumberList
from nmm.scenario.robot_functions import (
    CenterOfMassPart,
    CoordinatesPart,
    Direction,
    HeadingPart,
    OrientationPart,
    PositionPart,
    check_frames,
)

if TYPE_CHECKING:
    from nmm.functions.function import Function
    from nmm.robots.robot import Robot

POINT = (
    "three numbers, m, or a mapping with a kind: of time (circle, spline...), or a point of the robot "
    "(position, center_of_mass)"
)


class BearingPart(FunctionPart):
    """Angle at which a fixed point is seen from a moving one, rad."""

    kind: Literal["bearing"]
    of: Reference = Field(
        description="the moving point: a reference of time (circle, spline...), or a point of the robot, "
        "{kind: position, frame: ...}, which makes it a function of the configuration"
    )
    towards: NumberList = Field(description="the fixed point, 2 numbers, m (a third, z, is only drawn)")

    def make(self, robot: Robot, unit: str) -> Function:
        from nmm.functions.references.bearing import Bearing

        with at("of"):
            of = self.of.build(robot, "m")
        return Bearing(of, self.towards)


class PointingPart(FunctionPart):
    """How far an axis of a frame points past a point: two rows, rad, both 0 when it points at it. The turn
    about the axis is free."""

    kind: Literal["pointing"]
    frame: str = Field(description="a frame of the robot")
    at: Reference = Field(description=f"the point: {POINT}")
    axis: Direction = Field("z", description="x, y, z or three numbers, in the frame's axes")

    def make(self, robot: Robot, unit: str) -> Function:
        from nmm.functions.tasks.pointing import Pointing

        check_frames(self, robot)
        with at("at"):
            point = self.at.build(robot, "m")
        return Pointing(self.frame, point, self.axis)


class DistancePart(FunctionPart):
    """Distance of a frame's origin from a point, m."""

    kind: Literal["distance"]
    frame: str = Field(description="a frame of the robot")
    to: Reference = Field(description=f"the point: {POINT}")

    def make(self, robot: Robot, unit: str) -> Function:
        from nmm.functions.tasks.distance import Distance

        check_frames(self, robot)
        with at("to"):
            point = self.to.build(robot, "m")
        return Distance(self.frame, point)


class PoseReferencePart(FunctionPart):
    """A position over an orientation: the target of a pose."""

    kind: Literal["pose"]
    position: Reference = Field(description="three numbers, m, or a mapping with a kind of reference")
    orientation: Reference = Field(
        description="a rotation vector, rad; {rpy: [...]}; {quaternion: [x, y, z, w]}; or a mapping with a "
        "kind of reference, read as a rotation vector (slerp, turn, orientation of another frame...)"
    )

    def make(self, robot: Robot, unit: str) -> Function:
        from nmm.functions.references.pose import PoseReference

        with at("position"):
            position = self.position.build(robot, "m")
        with at("orientation"):
            orientation = self.orientation.build(robot, "rad")
        return PoseReference(position, orientation)


def _short(value: object) -> object:
    """A bare number or list stands for a constant, {rpy: ...} and {quaternion: ...} for an orientation."""
    if is_orientation(value):
        return checked_orientation(value)
    return value if isinstance(value, Mapping | Part) else {"kind": "constant", "value": value}


REFERENCES: tuple[type[FunctionPart], ...] = (
    CirclePart,
    LinePart,
    ConstantPart,
    PolynomialPart,
    SplinePart,
    BearingPart,
    RotationPart,
    SlerpPart,
    TurnPart,
    PoseReferencePart,
    PositionPart,
    OrientationPart,
    HeadingPart,
    DistancePart,
    CenterOfMassPart,
    CoordinatesPart,
)
Reference = Annotated[
    Annotated[
        CirclePart
        | LinePart
        | ConstantPart
        | PolynomialPart
        | SplinePart
        | BearingPart
        | RotationPart
        | SlerpPart
        | TurnPart
        | PoseReferencePart
        | PositionPart
        | OrientationPart
        | HeadingPart
        | DistancePart
        | CenterOfMassPart
        | CoordinatesPart,
        Field(discriminator="kind"),
    ],
    kind_of(*REFERENCES),
    BeforeValidator(_short),
]
for recursive in (BearingPart, PointingPart, DistancePart, PoseReferencePart):
    recursive.model_rebuild()
