"""Rows of points: positions, distances, the centre of mass, and the bearing from one."""

from __future__ import annotations

from nmm.analysis.formulas.expansion import Expansion
from nmm.analysis.formulas.frames import Frames
from nmm.analysis.formulas.mass import center
from nmm.analysis.formulas.numbers import exact
from nmm.analysis.formulas.row import Arc, Auxiliary, SymbolicRow
from nmm.analysis.formulas.turning import Vector, dot
from nmm.errors import InputError
from nmm.functions.function import Function
from nmm.functions.references import Bearing, Constant
from nmm.functions.tasks import CenterOfMass, Distance, Position
from nmm.functions.tasks.position import AXES


def position(function: Position, frames: Frames) -> list[SymbolicRow]:
    """Along world axes, or those of another frame."""
    function.rows(frames.robot)
    at = frames.position(function.frame, function.relative_to)
    return [_plain(at[AXES[axis]], frames) for axis in function.axes]


def center_of_mass(function: CenterOfMass, frames: Frames) -> list[SymbolicRow]:
    """Along world axes."""
    function.rows(frames.robot)
    at = center(frames)
    return [_plain(at[AXES[axis]], frames) for axis in function.axes]


def distance(function: Distance, frames: Frames) -> list[SymbolicRow]:
    """d = to - p = rho (cos beta cos alpha, cos beta sin alpha, sin beta): drho = d/rho · (dto - dp)."""
    function.rows(frames.robot)
    ring, at = frames.geometry.ring, frames.position(function.frame)
    d = [to - p for to, p in zip(point(function.to, frames), at, strict=True)]
    level = not d[2]
    rho, azimuth, *rest = frames.free_names("rho", "alpha", *([] if level else ["beta"]))
    frames.auxiliaries.append(Auxiliary(rho, "length", tuple(d[:2] if level else d)))
    frames.auxiliaries.append(Auxiliary(azimuth, "bearing", (d[0], d[1])))
    alpha = {ring.variable(azimuth, True): 1}
    along = [ring.cos(alpha), ring.sin(alpha), ring.number(0)]
    if not level:
        frames.auxiliaries.append(Auxiliary(rest[0], "elevation", tuple(d)))
        beta = {ring.variable(rest[0], True): 1}
        along = [entry * ring.cos(beta) for entry in along[:2]] + [ring.sin(beta)]
    by_q = zip(*(frames.gradient(entry) for entry in d), strict=True)
    gradient = [dot(along, list(column)) for column in by_q]
    return [SymbolicRow(ring.scalar(rho), gradient, ring.number(1))]


def bearing(function: Bearing, frames: Frames) -> list[SymbolicRow]:
    """With T - p = rho (cos g, sin g): dg = (sin g dp_x - cos g dp_y) / rho."""
    function.rows(frames.robot)
    x, y = _seen_from(function.of, frames)
    ring = frames.geometry.ring
    dx, dy = (ring.number(exact(float(to))) - at for to, at in zip(function.towards[:2], (x, y), strict=True))
    rho, turn = frames.free_names("rho", "g")
    frames.auxiliaries += [Auxiliary(rho, "length", (dx, dy)), Auxiliary(turn, "bearing", (dx, dy))]
    g = {ring.variable(turn, True): 1}
    by_x, by_y = frames.gradient(x), frames.gradient(y)
    gradient = [ring.sin(g) * along - ring.cos(g) * across for along, across in zip(by_x, by_y, strict=True)]
    return [SymbolicRow(Arc(ring.sin(g), ring.cos(g)), gradient, ring.scalar(rho))]


def point(function: Function, frames: Frames) -> Vector:
    """A point at rest, or one of the robot, in world axes.

    Raises
    ------
    InputError : any other
    """
    if isinstance(function, Constant):
        return [frames.geometry.ring.number(exact(float(value))) for value in function.value]
    if isinstance(function, CenterOfMass) and len(function.axes) == 3:
        at = center(frames)
        return [at[AXES[axis]] for axis in function.axes]
    if isinstance(function, Position) and len(function.axes) == 3 and function.relative_to is None:
        at = frames.position(function.frame)
        return [at[AXES[axis]] for axis in function.axes]
    raise InputError(
        "symbolic: expected a point at rest, a frame's origin or the centre of mass, got "
        f"{type(function).__name__}"
    )


def _plain(value: Expansion, frames: Frames) -> SymbolicRow:
    return SymbolicRow(value, frames.gradient(value), frames.geometry.ring.number(1))


def _seen_from(function: Function, frames: Frames) -> Vector:
    """x and y of the point that a bearing is taken from."""
    if isinstance(function, Position):
        return [row.value for row in position(function, frames)[:2] if isinstance(row.value, Expansion)]
    if isinstance(function, CenterOfMass):
        return [row.value for row in center_of_mass(function, frames)[:2] if isinstance(row.value, Expansion)]
    raise InputError(
        f"symbolic: expected a bearing from a Position or the CenterOfMass, got {type(function).__name__}"
    )
