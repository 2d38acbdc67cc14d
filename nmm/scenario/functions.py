"""Every function that a scenario can ask for: those of tasks, and the references that these follow."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, Any

from pydantic import ValidationInfo, ValidatorFunctionWrapHandler, WrapValidator

from nmm.kinds import REFERENCES, TASKS
from nmm.scenario.function_part import FunctionPart
from nmm.scenario.keys import Part, one_of
from nmm.scenario.made_part import part_of
from nmm.scenario.named_reference import is_path, references_of
from nmm.scenario.numbers import Numbers
from nmm.scenario.special_references import (
    FixedOrientation,
    PolynomialPart,
    RotationPart,
    checked_orientation,
    is_orientation,
)

#: A target of one component may be a number.
SPELLED: dict[str, dict[str, Any]] = {
    "constant": {"value": Numbers},
    "line": {"start": Numbers, "end": Numbers},
}
SPECIAL: dict[str, type[FunctionPart]] = {"polynomial": PolynomialPart, "rotation": RotationPart}


def _short(value: object) -> object:
    """A bare number or list stands for a constant, {rpy: ...} and {quaternion: ...} for an orientation."""
    if is_orientation(value):
        return checked_orientation(value)
    return value if isinstance(value, Mapping | Part) else {"kind": "constant", "value": value}


def _point(value: object) -> object:
    """A frame's name stands for its origin."""
    return {"kind": "position", "frame": value} if isinstance(value, str) else _short(value)


def _reference(value: Any, read: ValidatorFunctionWrapHandler, info: ValidationInfo) -> FunctionPart:
    """A path to a task's reference stands for what is written there, as it is when the scenario is read."""
    if not is_path(value):
        part: FunctionPart = read(_short(value))
        return part
    path = value.strip()
    with references_of(info).followed(path) as written:
        return _reference(written, read, info).named(path)


def _point_or_reference(value: Any, read: ValidatorFunctionWrapHandler, info: ValidationInfo) -> FunctionPart:
    return _reference(value if is_path(value) else _point(value), read, info)


#: The functions of tasks, by kind.
FUNCTION_PARTS = {kind: part_of(kind, made, FunctionPart) for kind, made in TASKS.items()}
#: The references, by kind; after those of time what a task can follow of the robot itself.
REFERENCE_PARTS = {
    kind: SPECIAL.get(kind) or part_of(kind, REFERENCES[kind], FunctionPart, **SPELLED.get(kind, {}))
    for kind in dict.fromkeys([*REFERENCES, *SPECIAL])
}
REFERENCE_PARTS |= {kind: part for kind, part in FUNCTION_PARTS.items() if kind not in REFERENCE_PARTS}

#: What annotations of parts that hold functions stand for (`nmm.scenario.spelling`).
REFERENCES_BY_NAME: dict[str, Any]

if TYPE_CHECKING:
    Reference = FunctionPart
else:
    Reference = Annotated[one_of(REFERENCE_PARTS), WrapValidator(_reference)]
    REFERENCES_BY_NAME = {
        "Reference": Reference,
        "Point": Annotated[one_of(REFERENCE_PARTS), WrapValidator(_point_or_reference)],
        "FixedOrientation": FixedOrientation,
    }
    for _part in {*FUNCTION_PARTS.values(), *REFERENCE_PARTS.values()}:
        _part.model_rebuild(_types_namespace=REFERENCES_BY_NAME)
