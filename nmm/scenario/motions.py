"""The references of a scenario that are functions of time alone."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import BeforeValidator, Field, model_validator

from nmm.errors import unknown
from nmm.scenario.function_part import FunctionPart, Unit
from nmm.scenario.keys import KeyedError, Part, at, at_key
from nmm.scenario.numbers import Number, NumberList, Numbers, Positive, Whole, numbers, shown

if TYPE_CHECKING:
    from nmm.arrays import Array
    from nmm.functions.function import Function
    from nmm.robots.robot import Robot


class CirclePart(FunctionPart):
    """A circle driven at constant speed: center + radius (cos φ, sin φ), φ = phase + rate t."""

    kind: Literal["circle"]
    center: NumberList = Field(description="2 numbers in the plane or 3 in space, m")
    radius: Positive = Field(description="m, above 0")
    rate: Number = Field(description="angular speed, rad/s; negative runs clockwise")
    phase: Number = Field(0.0, description="φ at t = 0, rad")
    plane: Literal["xy", "yz", "zx"] = Field("xy", description="for a center in space: xy, yz or zx")

    def make(self, robot: Robot, unit: str) -> Function:
        from nmm.functions.references.circle import Circle

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
        from nmm.functions.references.polynomial import Line

        return Line(self.start, self.end, self.duration, self.profile, self.unit or unit)


class ConstantPart(_WithUnit):
    """A target that does not move. A bare number or list in place of a reference is one too."""

    kind: Literal["constant"]
    value: Numbers = Field(description="a number a row of the task")

    def make(self, robot: Robot, unit: str) -> Function:
        from nmm.functions.references.polynomial import Constant

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
        from nmm.functions.references.polynomial import Polynomial

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
        from nmm.functions.references.polynomial import Spline

        return Spline(self.times, self.points, self.degree, self.ends, self.unit or unit)


def is_orientation(value: object) -> bool:
    """Whether it is written {rpy: ...} or {quaternion: ...}, without a kind."""
    return isinstance(value, Mapping) and "kind" not in value and ("rpy" in value or "quaternion" in value)


def checked_orientation(value: Any) -> Any:
    """The mapping with its kind and its numbers read; errors know their key."""
    sizes = {"rpy": 3, "quaternion": 4}
    for key, item in value.items():
        if key not in sizes:
            raise at_key(str(key), unknown("key", key, sizes))
        try:
            given = numbers(item)
        except ValueError as error:
            raise at_key(key, str(error)) from None
        if len(given) != sizes[key]:
            raise at_key(key, f"expected {sizes[key]} numbers, got {shown(item)}")
    return {"kind": "rotation", **value}


class RotationPart(FunctionPart):
    """An orientation that does not move, as a rotation vector, rad. {rpy: ...} or {quaternion: ...} in place
    of a reference is one too."""

    kind: Literal["rotation"]
    rpy: NumberList | None = Field(
        None, description="roll, pitch, yaw, rad, as in URDF: turned about the fixed x, then y, then z"
    )
    quaternion: NumberList | None = Field(None, description="x, y, z, w, of length 1; in place of rpy")
    vector: NumberList | None = Field(None, description="the rotation vector, rad; in place of rpy")

    @model_validator(mode="after")
    def _one_form(self) -> RotationPart:
        names = ("rpy", "quaternion", "vector")
        given = [name for name in names if getattr(self, name) is not None]
        if len(given) != 1:
            raise ValueError(f"expected one of {', '.join(names)}; got {' and '.join(given) or 'none'}")
        return self

    def make(self, robot: Robot, unit: str) -> Function:
        from nmm.functions.references.polynomial import Constant

        return Constant(self.rotation_vector(), "rad")

    def rotation_vector(self) -> Array:
        """The rotation vector (3,), rad."""
        from nmm.arrays import vector
        from nmm.functions.references.orientation import rotation_vector

        with self.own_keys():
            if self.vector is not None:
                return vector(self.vector, 3, "vector")
            return rotation_vector(rpy=self.rpy, quaternion=self.quaternion)


def _fixed(value: object) -> object:
    """A rotation vector, or one of its other notations."""
    if is_orientation(value):
        return checked_orientation(value)
    if isinstance(value, Part) or (isinstance(value, Mapping) and value.get("kind") == "rotation"):
        return value
    if isinstance(value, Mapping):
        raise ValueError(
            f"expected a rotation vector, {{rpy: ...}} or {{quaternion: ...}}, got {shown(value)}"
        )
    return {"kind": "rotation", "vector": numbers(value)}


#: An orientation: a rotation vector, {rpy: ...} or {quaternion: ...}.
FixedOrientation = Annotated[RotationPart, BeforeValidator(_fixed)]


class SlerpPart(FunctionPart):
    """From one orientation to another by the shortest turn, then at rest; a rotation vector, rad."""

    kind: Literal["slerp"]
    start: FixedOrientation = Field(
        description="where it begins: a rotation vector, {rpy: [...]} or {quaternion: [x, y, z, w]}"
    )
    end: FixedOrientation = Field(description="where it ends")
    duration: Positive = Field(description="s, above 0")
    profile: Literal["constant", "smooth"] = Field(
        "constant", description="constant rate, or smooth: starts and stops at rest (fifth degree)"
    )

    def make(self, robot: Robot, unit: str) -> Function:
        from nmm.functions.references.orientation import Slerp

        with at("start"):
            start = self.start.rotation_vector()
        with at("end"):
            end = self.end.rotation_vector()
        return Slerp(start, end, self.duration, self.profile)


class TurnPart(FunctionPart):
    """An orientation that turns at constant rate about an axis fixed in it; a rotation vector, rad."""

    kind: Literal["turn"]
    axis: NumberList = Field(description="three numbers, in the axes of the orientation itself")
    rate: Number = Field(description="rad/s")
    start: FixedOrientation | None = Field(
        None,
        description="at t = 0: a rotation vector, {rpy: [...]} or {quaternion: [x, y, z, w]}; the world's "
        "axes when not given",
    )

    def make(self, robot: Robot, unit: str) -> Function:
        from nmm.functions.references.orientation import Turn

        if self.start is None:
            return Turn(self.axis, self.rate)
        with at("start"):
            start = self.start.rotation_vector()
        return Turn(self.axis, self.rate, start)
