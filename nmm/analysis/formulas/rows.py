"""Rows of tasks, and of references that depend on q: value, and gradient over a denominator."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from nmm.analysis.formulas.frames import Frames
from nmm.analysis.formulas.numbers import exact
from nmm.analysis.formulas.point_rows import bearing, center_of_mass, distance, position
from nmm.analysis.formulas.pointing_rows import pointing
from nmm.analysis.formulas.row import Linear, SymbolicRow
from nmm.analysis.formulas.turn_rows import heading, orientation, pose
from nmm.analysis.singular.reached import Reached
from nmm.errors import InputError
from nmm.functions.function import Function
from nmm.functions.references import Bearing, Circle, Constant, Line, PiecewisePolynomial, Polynomial, Spline
from nmm.functions.tasks import (
    CenterOfMass,
    Coordinates,
    Distance,
    Heading,
    Orientation,
    Pointing,
    Pose,
    Position,
    Posture,
    Stack,
)
from nmm.functions.tasks.coordinates import coefficients

#: References whose derivative by q is 0.
_OF_TIME = (Circle, Constant, Line, PiecewisePolynomial, Polynomial, Reached, Spline)


def frames_of(functions: list[Function]) -> list[str]:
    """Names of the frames that functions speak of."""
    found: list[str] = []
    for function in functions:
        named = [getattr(function, attribute, None) for attribute in ("frame", "relative_to")]
        found += [name for name in named if isinstance(name, str)]
        inner = [getattr(function, attribute, None) for attribute in ("of", "to", "at")]
        found += frames_of([part for part in inner if isinstance(part, Function)])
    return list(dict.fromkeys(found))


def task_rows(stack: Stack, frames: Frames) -> tuple[list[SymbolicRow], list[SymbolicRow]]:
    """The rows of f, and those of f - g, which J of eq. 13 is made of (the value is f's in both).

    Raises
    ------
    InputError : a function or a reference whose formula is not here
    """
    plain, controlled = [], []
    for task in stack:
        task.rows(frames.robot)
        if task.function.comparison is not None and not isinstance(task.reference, Reached):
            kind = type(task.function).__name__
            raise InputError(
                f"symbolic: the error of {kind} is a logarithm, which has no formula here; give the "
                f"function without a target: J is then that of the error 0, in the frame's own axes"
            )
        rows = function_rows(task.function, frames)
        plain += rows
        if isinstance(task.reference, _OF_TIME) or (
            isinstance(task.reference, Bearing) and isinstance(task.reference.of, _OF_TIME)
        ):
            controlled += rows
            continue
        for row, target in zip(rows, function_rows(task.reference, frames), strict=True):
            gradient = [
                a * target.denominator - b * row.denominator
                for a, b in zip(row.gradient, target.gradient, strict=True)
            ]
            controlled.append(SymbolicRow(row.value, gradient, row.denominator * target.denominator))
    return plain, controlled


def function_rows(function: Function, frames: Frames) -> list[SymbolicRow]:
    """The rows of a function of the configuration.

    Raises
    ------
    InputError : a function whose formula is not here
    """
    for kind, build in _FORMULAS.items():
        if isinstance(function, kind):
            return build(function, frames)
    known = ", ".join(kind.__name__ for kind in _FORMULAS)
    raise InputError(f"symbolic: no formula for {type(function).__name__}; there are {known}")


def _coordinates(function: Coordinates, frames: Frames) -> list[SymbolicRow]:
    ring, names = frames.geometry.ring, frames.robot.q_names
    rows = []
    for values in coefficients(function.combinations, frames.robot):
        numbers = [exact(float(value)) for value in values]
        terms = tuple((name, number) for name, number in zip(names, numbers, strict=True) if number)
        rows.append(SymbolicRow(Linear(terms), [ring.number(number) for number in numbers], ring.number(1)))
    return rows


def _posture(function: Posture, frames: Frames) -> list[SymbolicRow]:
    function.rows(frames.robot)
    names = function.names or frames.robot.u_names[frames.robot.platform.p :]
    return _coordinates(Coordinates(*names), frames)


#: Each takes functions of its own kind.
_FORMULAS: dict[type[Function], Callable[[Any, Frames], list[SymbolicRow]]] = {
    Position: position,
    Heading: heading,
    Coordinates: _coordinates,
    Posture: _posture,
    Distance: distance,
    CenterOfMass: center_of_mass,
    Orientation: orientation,
    Pose: pose,
    Pointing: pointing,
    Bearing: bearing,
}
