"""How files spell what constructors take: a type for each annotation that the library's classes use."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, ForwardRef, Literal

from pydantic import BeforeValidator

from nmm.scenario.numbers import Number, NumberList, Whole, nested, number, numbers, numbers_by_name, shown

Unit = Literal["m", "rad", "1"]


def _combination(value: object) -> str | dict[str, float]:
    """A coordinate's name, or coefficients by name."""
    if isinstance(value, str):
        return value
    if isinstance(value, Mapping) and value:
        return numbers_by_name(value, "coefficient of ")
    raise ValueError(
        f"expected a coordinate's name, or coefficients by name ({{theta: 1, q1: 1}}), got {shown(value)}"
    )


def _weights(value: object) -> object:
    if isinstance(value, Mapping):
        return {str(name): number(weight) for name, weight in value.items()}
    return numbers(value)


def _by_name(value: object) -> dict[str, float]:
    if isinstance(value, Mapping):
        return numbers_by_name(value)
    raise ValueError(f"expected numbers by name ({{q1: 2, q2: 1}}), got {shown(value)}")


Combination = Annotated[str | dict[str, float], BeforeValidator(_combination)]
#: A direction by its name or as three numbers.
Direction = Annotated[str | list[float], BeforeValidator(lambda v: v if isinstance(v, str) else nested(v))]
Weights = Annotated[dict[str, float] | list[Any], BeforeValidator(_weights)]
#: A function of time or of the configuration, or what stands for one: see `nmm.scenario.functions`.
REFERENCE = ForwardRef("Reference")
#: Such a function too, or the name of a frame, for its origin.
POINT = ForwardRef("Point")
ORIENTATION = ForwardRef("FixedOrientation")

#: By the annotation of a constructor's parameter, as it is written there, without "| None".
SPELLINGS: dict[str, Any] = {
    "bool": bool,
    "int": Whole,
    "float": Number,
    "str": str,
    "Sequence[str]": list[str],
    "str | Sequence[str]": str | list[str],
    "str | ArrayLike": Direction,
    "ArrayLike": NumberList,
    "RotationVector": ORIENTATION,
    "Combination": Combination,
    "Function": REFERENCE,
    "Function | ArrayLike": REFERENCE,
    "Function | str | ArrayLike": POINT,
    "Function | RotationVector": REFERENCE,
    "Weights": Weights,
    "Mapping[str, Function | float]": dict[str, REFERENCE],  # type: ignore[valid-type]  # a value, not a type
    "Mapping[str, float]": Annotated[dict[str, float], BeforeValidator(_by_name)],
}
_OTHER_NOTATIONS = "; or {rpy: [...]}, or {quaternion: [x, y, z, w]}"
#: What files can say beside what the docstring says, by the same annotations.
NOTES = {
    "Function | RotationVector": _OTHER_NOTATIONS,
    "RotationVector": _OTHER_NOTATIONS,
}
