"""Every function that a scenario can ask for: those of tasks, and the references that these follow."""

from collections.abc import Mapping
from typing import Annotated, Any, Literal, TypeVar, cast

from pydantic import (
    BeforeValidator,
    Field,
    ValidationInfo,
    ValidatorFunctionWrapHandler,
    WrapValidator,
    create_model,
)

from nmm.base.arrays import Array, vector
from nmm.base.errors import InputError, expect_known
from nmm.base.kinds import REFERENCES, TASKS
from nmm.control.functions.function import Function
from nmm.control.functions.references.orientation import rotation_vector
from nmm.control.functions.references.polynomial import Constant, Polynomial
from nmm.control.functions.tasks.camera_faults import CameraFaults
from nmm.scenario.constructors import FunctionPart, MadePart, Unit, keys_of, part_of
from nmm.scenario.keys import KeyedError, KeyedPart, OneOf, at, is_path, references_of
from nmm.scenario.numbers import NumberList, Numbers, Positive, numbers


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
        keys = {name for name in forms if getattr(self, name) is not None}
        if keys not in ({"coefficients", "duration"}, {"times", "points"}):
            raise InputError(expected="coefficients and duration, or times and points", got=sorted(keys))
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
        keys = [name for name in names if getattr(self, name) is not None]
        if len(keys) != 1:
            raise InputError(expected=f"one of {', '.join(names)}", got=keys)
        with self.own_keys():
            if self.vector is not None:
                return vector(self.vector, 3, "vector")
            return rotation_vector(rpy=self.rpy, quaternion=self.quaternion)


class FixedPart(RotationPart):
    """An orientation where only one that does not move will do."""

    def argument(self) -> Array:
        return self.rotation_vector()


def is_orientation(value: object) -> bool:
    return isinstance(value, Mapping) and "kind" not in value and ("rpy" in value or "quaternion" in value)


def checked_orientation(value: Any) -> Any:
    """The mapping with its kind and its numbers read; errors know their key."""
    sizes = {"rpy": 3, "quaternion": 4}
    for key, item in value.items():
        with at(str(key)):
            expect_known("key", key, sizes)
            values = numbers(item)
        if len(values) != sizes[key]:
            raise KeyedError((key,), expected=f"{sizes[key]} numbers", got=item)
    return {"kind": "rotation", **value}


def _fixed(value: object) -> object:
    """A rotation vector, or one of its other notations."""
    if is_orientation(value):
        return checked_orientation(value)
    if isinstance(value, KeyedPart) or (isinstance(value, Mapping) and value.get("kind") == "rotation"):
        return value
    if isinstance(value, Mapping):
        raise InputError(expected="a rotation vector, {rpy: ...} or {quaternion: ...}", got=value)
    return {"kind": "rotation", "vector": numbers(value)}


#: An orientation that does not move: a rotation vector, {rpy: ...} or {quaternion: ...}.
FixedOrientation = Annotated[FixedPart, BeforeValidator(_fixed)]


#: A target of one component may be a number.
SPELLED: dict[str, dict[str, Any]] = {
    "constant": {"value": Numbers},
    "line": {"start": Numbers, "end": Numbers},
}


class CameraFaultsPart(keys_of(CameraFaults, MadePart)):  # type: ignore[misc]  # made
    """What a simulation's camera does that a perfect one does not."""

    makes = CameraFaults


SPELLED["measured_points"] = {"faults": CameraFaultsPart, "depth": Numbers}
SPECIAL: dict[str, type[FunctionPart]] = {"polynomial": PolynomialPart, "rotation": RotationPart}


def _short(value: object) -> object:
    """A bare number or list stands for a constant, {rpy: ...} and {quaternion: ...} for an orientation."""
    if is_orientation(value):
        return checked_orientation(value)
    return value if isinstance(value, Mapping | KeyedPart) else {"kind": "constant", "value": value}


def _point(value: object) -> object:
    """A frame's name stands for its origin."""
    is_frame = isinstance(value, str) and not is_path(value)
    return {"kind": "position", "frame": value} if is_frame else value


def _reference(value: Any, read: ValidatorFunctionWrapHandler, info: ValidationInfo) -> FunctionPart:
    """A path to a task's reference stands for what is written there, as it is when the scenario is read."""
    if not is_path(value):
        part: FunctionPart = read(_short(value))
        return part
    path = value.strip()
    with references_of(info).followed(path) as written:
        return _reference(written, read, info).named(path)


#: The functions of tasks, by kind.
FUNCTION_PARTS = TASKS.made(lambda kind, made: part_of(kind, made, FunctionPart))
#: The references, by kind; after those of time what a task can follow of the robot itself.
REFERENCE_PARTS: dict[str, type[FunctionPart]] = REFERENCES.made(
    lambda kind, made: SPECIAL.get(kind) or part_of(kind, made, FunctionPart, **SPELLED.get(kind, {}))
)
for _kind, _part in (*SPECIAL.items(), *FUNCTION_PARTS.items()):
    REFERENCE_PARTS.setdefault(_kind, _part)

Reference = Annotated[FunctionPart, OneOf(REFERENCE_PARTS), WrapValidator(_reference)]
Point = Annotated[Reference, BeforeValidator(_point)]

P = TypeVar("P", bound=FunctionPart)


def with_functions(base: type[P]) -> dict[str, type[P]]:
    """By kind of a task's function: a part with its keys and those of `base`."""
    name = base.__name__.removesuffix("Part")
    return {
        kind: cast(
            "type[P]",
            create_model(
                f"{part.makes.__name__}{name}",
                __base__=(base, part),
                __module__=base.__module__,
                __doc__=part.__doc__,
            ),
        )
        for kind, part in FUNCTION_PARTS.items()
    }
