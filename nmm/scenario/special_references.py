"""The references that a file spells in other ways than Python: polynomials of two forms, and orientations."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field

from nmm.arrays import Array, vector
from nmm.errors import unknown
from nmm.functions.function import Function
from nmm.functions.references.orientation import rotation_vector
from nmm.functions.references.polynomial import Constant, Polynomial
from nmm.scenario.function_part import FunctionPart
from nmm.scenario.keys import KeyedError, Part, at_key
from nmm.scenario.numbers import NumberList, Positive, numbers, shown
from nmm.scenario.spelling import Unit


class PolynomialPart(FunctionPart):
    """A polynomial of time, given by its coefficients or through waypoints; then at rest."""

    makes = Polynomial
    kind: Literal["polynomial"]
    unit: Unit | None = Field(None, description="m, rad or 1; when not given, that of the task")
    coefficients: NumberList | None = Field(
        None, description="a list a power of t, lowest first: [[x0, y0], [vx, vy], ...]; with duration"
    )
    duration: Positive | None = Field(None, description="s, above 0; with coefficients")
    times: NumberList | None = Field(None, description="s, increasing, the first 0; with points")
    points: NumberList | None = Field(
        None, description="a point a time; the polynomial has the lowest degree that fits"
    )

    def make(self, unit: str = "m") -> Function:
        forms = ("coefficients", "duration", "times", "points")
        given = {name for name in forms if getattr(self, name) is not None}
        if given not in ({"coefficients", "duration"}, {"times", "points"}):
            came = ", ".join(sorted(given)) or "none of them"
            raise KeyedError((), f"expected coefficients and duration, or times and points; got {came}")
        with self.own_keys():
            if self.times is not None and self.points is not None:
                return Polynomial.through(self.times, self.points, self.unit or unit)
            return Polynomial(self.coefficients or [], self.duration or 0.0, self.unit or unit)


class RotationPart(FunctionPart):
    """An orientation that does not move, as a rotation vector, rad. {rpy: ...} or {quaternion: ...} in place
    of a reference is one too."""

    makes = Constant
    kind: Literal["rotation"]
    rpy: NumberList | None = Field(
        None, description="roll, pitch, yaw, rad, as in URDF: turned about the fixed x, then y, then z"
    )
    quaternion: NumberList | None = Field(None, description="x, y, z, w, of length 1; in place of rpy")
    vector: NumberList | None = Field(None, description="the rotation vector, rad; in place of rpy")

    def make(self, unit: str = "m") -> Function:
        return Constant(self.rotation_vector(), "rad")

    def rotation_vector(self) -> Array:
        """The rotation vector (3,), rad."""
        names = ("rpy", "quaternion", "vector")
        given = [name for name in names if getattr(self, name) is not None]
        if len(given) != 1:
            came = " and ".join(given) or "none"
            raise KeyedError((), f"expected one of {', '.join(names)}; got {came}")
        with self.own_keys():
            if self.vector is not None:
                return vector(self.vector, 3, "vector")
            return rotation_vector(rpy=self.rpy, quaternion=self.quaternion)


class FixedPart(RotationPart):
    """An orientation where only one that does not move will do."""

    def argument(self) -> Array:
        return self.rotation_vector()


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


#: An orientation that does not move: a rotation vector, {rpy: ...} or {quaternion: ...}.
FixedOrientation = Annotated[FixedPart, BeforeValidator(_fixed)]
