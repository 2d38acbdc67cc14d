"""The functions of a scenario that are of the robot alone: where its frames are, and its coordinates."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Literal

from pydantic import BeforeValidator, Field

from nmm.scenario.function_part import Combination, FunctionPart, check_combination
from nmm.scenario.keys import at
from nmm.scenario.numbers import nested

if TYPE_CHECKING:
    from nmm.functions.function import Function
    from nmm.robots.robot import Robot

#: A direction by its name or as three numbers.
Direction = Annotated[str | list[float], BeforeValidator(lambda v: v if isinstance(v, str) else nested(v))]
RELATIVE_TO = "a frame of the robot that sees it, instead of the world (two arms that hold one thing)"


def check_frames(part: FunctionPart, robot: Robot) -> None:
    """`InputError`, at its key, for a frame that the robot does not have."""
    for key in ("frame", "relative_to"):
        name = getattr(part, key, None)
        if name is not None:
            with at(key):
                robot.frame_id(name)


class PositionPart(FunctionPart):
    """Position of a frame's origin along world axes, or along another frame's, m."""

    kind: Literal["position"]
    frame: str = Field(description="a frame of the robot (`nmm info ROBOT` lists them)")
    axes: str = Field("xyz", description="some of x, y, z in the order wanted, as xy")
    relative_to: str | None = Field(None, description=RELATIVE_TO)

    def make(self, robot: Robot, unit: str) -> Function:
        from nmm.functions.tasks.position import Position

        check_frames(self, robot)
        return Position(self.frame, self.axes, self.relative_to)


class OrientationPart(FunctionPart):
    """Orientation of a frame as its rotation vector (axis times angle), three rows, rad. Its error is the
    rotation vector of the turn that is left, in the frame's own axes."""

    kind: Literal["orientation"]
    frame: str = Field(description="a frame of the robot")
    relative_to: str | None = Field(None, description=RELATIVE_TO)

    def make(self, robot: Robot, unit: str) -> Function:
        from nmm.functions.tasks.orientation import Orientation

        check_frames(self, robot)
        return Orientation(self.frame, self.relative_to)


class PosePart(FunctionPart):
    """Pose of a frame, six rows: position, m, over rotation vector, rad. Its error is the motion that is left
    (the logarithm of SE(3), in the frame's own axes), so that the frame moves along a screw."""

    kind: Literal["pose"]
    frame: str = Field(description="a frame of the robot")
    relative_to: str | None = Field(None, description=RELATIVE_TO)

    def make(self, robot: Robot, unit: str) -> Function:
        from nmm.functions.tasks.pose import Pose

        check_frames(self, robot)
        return Pose(self.frame, self.relative_to)


class HeadingPart(FunctionPart):
    """Absolute angle of a direction fixed in a frame, about a world axis, rad; differences wrap."""

    kind: Literal["heading"]
    frame: str = Field(description="a frame of the robot")
    direction: Direction = Field(
        "x", description="whose angle is taken: x, y, z or three numbers, in the frame's axes"
    )
    about: str = Field("z", description="world axis x, y or z about which the angle is measured")

    def make(self, robot: Robot, unit: str) -> Function:
        from nmm.functions.tasks.heading import Heading

        check_frames(self, robot)
        return Heading(self.frame, self.direction, self.about)


class CoordinatesPart(FunctionPart):
    """Linear combinations of coordinates, a row each (a joint coupling is one); angles are not wrapped."""

    kind: Literal["coordinates"]
    of: Annotated[list[Combination], BeforeValidator(lambda v: v if isinstance(v, list | tuple) else [v])] = (
        Field(
            description="a coordinate (q2), a combination ({theta: 1, q1: 1}), or a list of such",
            min_length=1,
        )
    )

    def make(self, robot: Robot, unit: str) -> Function:
        from nmm.functions.tasks.coordinates import Coordinates

        with at("of"):
            for item in self.of:
                check_combination(item, robot)
        return Coordinates(*self.of)


class PosturePart(FunctionPart):
    """Coordinates as they are, a row each; angles are not wrapped."""

    kind: Literal["posture"]
    of: list[str] | None = Field(
        None, description="names of coordinates; all of the manipulator's when not given", min_length=1
    )

    def make(self, robot: Robot, unit: str) -> Function:
        from nmm.functions.tasks.posture import Posture

        with at("of"):
            for name in self.of or ():
                robot.coordinate(name)
        return Posture(*(self.of or ()))


class CenterOfMassPart(FunctionPart):
    """Position of the whole robot's centre of mass along world axes, m."""

    kind: Literal["center_of_mass"]
    axes: str = Field("xyz", description="some of x, y, z in the order wanted, as xy")

    def make(self, robot: Robot, unit: str) -> Function:
        from nmm.functions.tasks.center_of_mass import CenterOfMass

        return CenterOfMass(self.axes)
