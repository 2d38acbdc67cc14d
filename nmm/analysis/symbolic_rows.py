"""Rows of tasks, and of references that depend on q: value, and gradient over a denominator."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any

from nmm.analysis.reached import Reached
from nmm.analysis.symbolic_chain import chain_to
from nmm.analysis.symbolic_expansion import Expansion
from nmm.analysis.symbolic_geometry import Geometry, exact
from nmm.analysis.symbolic_kinematics import Placement, direction, placement, relative
from nmm.errors import InputError
from nmm.function import Function
from nmm.references import Bearing, Circle, Constant, Line, PiecewisePolynomial, Polynomial, Spline
from nmm.robot import Robot
from nmm.tasks import Coordinates, Heading, Position, Posture, Stack
from nmm.tasks.coordinates import coefficients
from nmm.tasks.heading import PLANES
from nmm.tasks.position import AXES

#: References whose derivative by q is 0.
_OF_TIME = (Circle, Constant, Line, PiecewisePolynomial, Polynomial, Reached, Spline)


@dataclass(frozen=True, eq=False)
class Arc:
    """An angle atan2(sine, cosine)."""

    sine: Expansion
    cosine: Expansion


@dataclass(frozen=True, eq=False)
class Linear:
    """A combination of coordinates."""

    terms: tuple[tuple[str, Fraction], ...]


@dataclass(frozen=True, eq=False)
class SymbolicRow:
    """One row: its value, and its derivatives by the coordinates (n) times `denominator`."""

    value: Expansion | Arc | Linear
    gradient: list[Expansion]
    denominator: Expansion


@dataclass(eq=False)
class Frames:
    """Placements of a robot's frames, each made once, and what the auxiliary symbols mean."""

    robot: Robot
    geometry: Geometry
    bearings: list[tuple[Expansion, Expansion, Fraction, Fraction]] = field(default_factory=list)
    _made: dict[str, Placement] = field(default_factory=dict)

    def of(self, frame: str) -> Placement:
        """The frame's placement."""
        if frame not in self._made:
            self._made[frame] = placement(chain_to(self.robot, frame), self.geometry)
        return self._made[frame]

    def gradient(self, value: Expansion) -> list[Expansion]:
        """Derivatives by the robot's coordinates."""
        ring = self.geometry.ring
        units = zip(self.robot.q_names, self.robot.q_units, strict=True)
        return [value.derivative(ring.variable(name, unit == "rad")) for name, unit in units]


def frames_of(functions: list[Function]) -> list[str]:
    """Names of the frames that functions speak of."""
    found: list[str] = []
    for function in functions:
        if isinstance(function, Position | Heading):
            found.append(function.frame)
            if isinstance(function, Position) and function.relative_to is not None:
                found.append(function.relative_to)
        elif isinstance(function, Bearing):
            found += frames_of([function.of])
    return list(dict.fromkeys(found))


def task_rows(stack: Stack, frames: Frames) -> tuple[list[SymbolicRow], list[SymbolicRow]]:
    """The rows of f, and those of f - g, which J of eq. 13 is made of (the value is f's in both)."""
    plain, controlled = [], []
    for task in stack:
        task.rows(frames.robot)
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


def bearing_suffix(number: int) -> str:
    """What the symbols rho and g of the first bearing (1), the second, ... end in."""
    return "" if number == 1 else str(number)


def _position(function: Position, frames: Frames) -> list[SymbolicRow]:
    function.rows(frames.robot)
    at = frames.of(function.frame)
    values = at.position if function.relative_to is None else relative(at, frames.of(function.relative_to))
    one = frames.geometry.ring.number(1)
    return [
        SymbolicRow(values[AXES[axis]], frames.gradient(values[AXES[axis]]), one) for axis in function.axes
    ]


def _heading(function: Heading, frames: Frames) -> list[SymbolicRow]:
    """ψ = atan2(s, c): dψ = (c ds - s dc) / (c² + s²)."""
    function.rows(frames.robot)
    d = direction(frames.of(function.frame), tuple(float(value) for value in function.direction))
    c, s = (d[AXES[axis]] for axis in PLANES[function.about])
    by_c, by_s = frames.gradient(c), frames.gradient(s)
    gradient = [c * ds - s * dc for ds, dc in zip(by_s, by_c, strict=True)]
    return [SymbolicRow(Arc(s, c), gradient, c * c + s * s)]


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
    names = function.names or frames.robot.q_names[frames.robot.platform.n_p :]
    return _coordinates(Coordinates(*names), frames)


def _bearing(function: Bearing, frames: Frames) -> list[SymbolicRow]:
    """With T - p = rho (cos g, sin g): dg = (sin g dp_x - cos g dp_y) / rho."""
    function.rows(frames.robot)
    x, y = function_rows(function.of, frames)[:2]
    if not isinstance(x.value, Expansion) or not isinstance(y.value, Expansion):
        raise InputError("symbolic: expected a bearing from a Position")
    ring = frames.geometry.ring
    target = [exact(float(value)) for value in function.towards[:2]]
    frames.bearings.append((x.value, y.value, target[0], target[1]))
    suffix = bearing_suffix(len(frames.bearings))
    g = {ring.variable(f"g{suffix}", True): 1}
    gradient = [ring.sin(g) * dx - ring.cos(g) * dy for dx, dy in zip(x.gradient, y.gradient, strict=True)]
    return [SymbolicRow(Arc(ring.sin(g), ring.cos(g)), gradient, ring.scalar(f"rho{suffix}"))]


#: Each takes functions of its own kind.
_FORMULAS: dict[type[Function], Callable[[Any, Frames], list[SymbolicRow]]] = {
    Position: _position,
    Heading: _heading,
    Coordinates: _coordinates,
    Posture: _posture,
    Bearing: _bearing,
}
