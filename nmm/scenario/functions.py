"""The functions of a scenario: what tasks position, and the references that they follow."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, Literal

from pydantic import BeforeValidator, Field, model_validator

from nmm.scenario.keys import KeyedError, Part, at, kind_of
from nmm.scenario.numbers import (
    Number,
    NumberList,
    Numbers,
    Positive,
    Whole,
    nested,
    numbers_by_name,
    shown,
)

if TYPE_CHECKING:
    from nmm.function import Function
    from nmm.robot import Robot

Unit = Literal["m", "rad", "1"]


def combination(value: object) -> str | dict[str, float]:
    """A coordinate's name, or coefficients by name."""
    if isinstance(value, str):
        return value
    if isinstance(value, Mapping) and value:
        return numbers_by_name(value, "coefficient of ")
    raise ValueError(
        f"expected a coordinate's name, or coefficients by name ({{theta: 1, q1: 1}}), got {shown(value)}"
    )


Combination = Annotated[str | dict[str, float], BeforeValidator(combination)]


def check_combination(combination: str | dict[str, float], robot: Robot) -> None:
    """`InputError` for a coordinate that the robot does not have."""
    for name in [combination] if isinstance(combination, str) else combination:
        robot.coordinate(name)


class FunctionPart(Part):
    """A function phi(t, q) of the library."""

    @abstractmethod
    def make(self, robot: Robot, unit: str) -> Function:
        """The function; `unit` is that of values whose unit the file leaves open."""

    def build(self, robot: Robot, unit: str = "m") -> Function:
        """`make`, with the robot's word on it: errors know their key."""
        with self.own_keys():
            function = self.make(robot, unit)
            function.rows(robot)
            function.stages(robot)
        return function


class PositionPart(FunctionPart):
    """Position of a frame's origin along world axes, m."""

    kind: Literal["position"]
    frame: str = Field(description="a frame of the robot (`nmm info ROBOT` lists them)")
    axes: str = Field("xyz", description="some of x, y, z in the order wanted, as xy")

    def make(self, robot: Robot, unit: str) -> Function:
        from nmm.tasks.position import Position

        with at("frame"):
            robot.frame_id(self.frame)
        return Position(self.frame, self.axes)


class HeadingPart(FunctionPart):
    """Absolute angle of a direction fixed in a frame, about a world axis, rad; differences wrap."""

    kind: Literal["heading"]
    frame: str = Field(description="a frame of the robot")
    direction: Annotated[
        str | list[float], BeforeValidator(lambda v: v if isinstance(v, str) else nested(v))
    ] = Field("x", description="whose angle is taken: x, y, z or three numbers, in the frame's axes")
    about: str = Field("z", description="world axis x, y or z about which the angle is measured")

    def make(self, robot: Robot, unit: str) -> Function:
        from nmm.tasks.heading import Heading

        with at("frame"):
            robot.frame_id(self.frame)
        return Heading(self.frame, self.direction, self.about)


class CoordinatesPart(FunctionPart):
    """Linear combinations of coordinates, a row each; angles are not wrapped."""

    kind: Literal["coordinates"]
    of: Annotated[list[Combination], BeforeValidator(lambda v: v if isinstance(v, list | tuple) else [v])] = (
        Field(
            description="a coordinate (q2), a combination ({theta: 1, q1: 1}), or a list of such",
            min_length=1,
        )
    )

    def make(self, robot: Robot, unit: str) -> Function:
        from nmm.tasks.coordinates import Coordinates

        with at("of"):
            for item in self.of:
                check_combination(item, robot)
        return Coordinates(*self.of)


class CirclePart(FunctionPart):
    """A circle driven at constant speed: center + radius (cos φ, sin φ), φ = phase + rate t."""

    kind: Literal["circle"]
    center: NumberList = Field(description="2 numbers in the plane or 3 in space, m")
    radius: Positive = Field(description="m, above 0")
    rate: Number = Field(description="angular speed, rad/s; negative runs clockwise")
    phase: Number = Field(0.0, description="φ at t = 0, rad")
    plane: Literal["xy", "yz", "zx"] = Field("xy", description="for a center in space: xy, yz or zx")

    def make(self, robot: Robot, unit: str) -> Function:
        from nmm.references.circle import Circle

        return Circle(self.center, self.radius, self.rate, self.phase, self.plane)


class _WithUnit(FunctionPart):
    unit: Unit | None = Field(None, description="m, rad or 1; when not given, that of the task")


class LinePart(_WithUnit):
    """A straight line from start to end, then at rest."""

    kind: Literal["line"]
    start: NumberList = Field(description="where it begins, a number a row of the task")
    end: NumberList = Field(description="where it ends")
    duration: Positive = Field(description="s, above 0")
    profile: Literal["constant", "smooth"] = Field(
        "constant", description="constant speed, or smooth: starts and stops at rest (fifth degree)"
    )

    def make(self, robot: Robot, unit: str) -> Function:
        from nmm.references.polynomial import Line

        return Line(self.start, self.end, self.duration, self.profile, self.unit or unit)


class ConstantPart(_WithUnit):
    """A target that does not move. A bare number or list in place of a reference is one too."""

    kind: Literal["constant"]
    value: Numbers = Field(description="a number a row of the task")

    def make(self, robot: Robot, unit: str) -> Function:
        from nmm.references.polynomial import Constant

        return Constant(self.value, self.unit or unit)


class PolynomialPart(_WithUnit):
    """A polynomial of time, given by its coefficients or through waypoints; then at rest."""

    kind: Literal["polynomial"]
    coefficients: NumberList | None = Field(
        None, description="a list a power of t, lowest first: [[x0, y0], [vx, vy], ...]; with duration"
    )
    duration: Positive | None = Field(None, description="s, above 0; with coefficients")
    times: NumberList | None = Field(None, description="s, increasing, the first 0; with points")
    points: NumberList | None = Field(
        None, description="a point a time; the polynomial has the lowest degree that fits"
    )

    @model_validator(mode="after")
    def _one_form(self) -> PolynomialPart:
        given = {
            name
            for name in ("coefficients", "duration", "times", "points")
            if getattr(self, name) is not None
        }
        if given not in ({"coefficients", "duration"}, {"times", "points"}):
            came = ", ".join(sorted(given)) or "none of them"
            raise ValueError(f"expected coefficients and duration, or times and points; got {came}")
        return self

    def make(self, robot: Robot, unit: str) -> Function:
        from nmm.references.polynomial import Polynomial

        if self.times is not None and self.points is not None:
            return Polynomial.through(self.times, self.points, self.unit or unit)
        if self.coefficients is None or self.duration is None:
            raise KeyedError((), "expected coefficients and duration, or times and points")
        return Polynomial(self.coefficients, self.duration, self.unit or unit)


class SplinePart(_WithUnit):
    """A spline through waypoints; before the first and after the last it rests."""

    kind: Literal["spline"]
    times: NumberList = Field(description="s, increasing")
    points: NumberList = Field(description="a point a time")
    degree: Whole = Field(3, description="3, twice continuously differentiable, or 5, four times")
    ends: Literal["rest", "natural", "periodic"] = Field(
        "rest",
        description="rest (velocity zero), natural (free), or periodic (degree 3, last point = first)",
    )

    def make(self, robot: Robot, unit: str) -> Function:
        from nmm.references.polynomial import Spline

        return Spline(self.times, self.points, self.degree, self.ends, self.unit or unit)


class BearingPart(FunctionPart):
    """Angle at which a fixed point is seen from a moving one, rad."""

    kind: Literal["bearing"]
    of: Reference = Field(
        description="the moving point: a reference of time (circle, spline...), or a point of the robot, "
        "{kind: position, frame: ...}, which makes it a function of the configuration"
    )
    towards: NumberList = Field(description="the fixed point, 2 numbers, m (a third, z, is only drawn)")

    def make(self, robot: Robot, unit: str) -> Function:
        from nmm.references.bearing import Bearing

        with at("of"):
            of = self.of.build(robot, "m")
        return Bearing(of, self.towards)


def _constant(value: object) -> object:
    """A bare number or list stands for a constant."""
    return value if isinstance(value, Mapping | Part) else {"kind": "constant", "value": value}


REFERENCES: tuple[type[FunctionPart], ...] = (
    CirclePart,
    LinePart,
    ConstantPart,
    PolynomialPart,
    SplinePart,
    BearingPart,
    PositionPart,
    HeadingPart,
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
        | PositionPart
        | HeadingPart
        | CoordinatesPart,
        Field(discriminator="kind"),
    ],
    kind_of(*REFERENCES),
    BeforeValidator(_constant),
]
BearingPart.model_rebuild()
