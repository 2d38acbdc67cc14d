"""Rows of an axis that points at something."""

from __future__ import annotations

from nmm.analysis.formulas.expansion import Expansion
from nmm.analysis.formulas.frames import Frames
from nmm.analysis.formulas.geometry import signed_axis
from nmm.analysis.formulas.kinematics import steps_to, turns, twists
from nmm.analysis.formulas.numbers import exact
from nmm.analysis.formulas.point_rows import point
from nmm.analysis.formulas.row import Auxiliary, Share, SymbolicRow
from nmm.analysis.formulas.turning import Vector, back, cross, dot, turned
from nmm.errors import InputError
from nmm.functions.references import Constant
from nmm.functions.tasks import Pointing, Position
from nmm.functions.tasks.position import AXES


def pointing(function: Pointing, frames: Frames) -> list[SymbolicRow]:
    """y = alpha (cos beta, sin beta), the point seen at l = rho (cos alpha, sin alpha (cos beta, sin beta)).

    Along (a, b1, b2), with kappa = alpha / sin alpha, dl_r = cos beta dl_1 + sin beta dl_2 and
    dl_t = cos beta dl_2 - sin beta dl_1: d alpha = (cos alpha dl_r - sin alpha dl_a) / rho and
    d beta = dl_t / (rho sin alpha), so that rho dy_1 = cos beta rho d alpha - kappa sin beta dl_t.
    """
    function.rows(frames.robot)
    ring = frames.geometry.ring
    if signed_axis(function.axis) is None:
        raise InputError(
            "symbolic: expected Pointing with an axis that is x, y or z (or its negative), got "
            f"{', '.join(f'{value:g}' for value in function.axis)}"
        )
    # a, b1 and b2 as the task has them.
    numbers = function.stages(frames.robot)[-1].numbers.reshape(3, 3)
    axes = [[ring.number(exact(float(value))) for value in axis] for axis in numbers]
    steps = steps_to(frames.robot, function.frame)
    seen = _seen(function, frames)
    along = [dot(axis, seen) for axis in axes]
    rho, off, around, ratio = frames.free_names("rho", "alpha", "beta", "kappa")
    frames.auxiliaries += [
        Auxiliary(rho, "length", tuple(seen)),
        Auxiliary(off, "off axis", tuple(along)),
        Auxiliary(around, "bearing", tuple(along[1:])),
        Auxiliary(ratio, "over sine", tuple(along)),
    ]
    alpha, beta = {ring.variable(off, True): 1}, {ring.variable(around, True): 1}
    (ca, sa), (cb, sb) = ((ring.cos(angle), ring.sin(angle)) for angle in (alpha, beta))
    length, kappa = ring.scalar(rho), ring.scalar(ratio)
    if isinstance(function.at, Constant):
        # The point rests, the frame moves: dl = -v - ω × l.
        moving = twists(steps, frames.geometry)
        parts = [length * ca, length * sa * cb, length * sa * sb]
        at = [dot([axis[i] for axis in axes], parts) for i in range(3)]
        zero = [ring.number(0)] * 3
        by_q = []
        for name in frames.robot.q_names:
            v, w = moving.linear.get(name, zero), cross(moving.angular.get(name, zero), at)
            seen = [-(a + b) for a, b in zip(v, w, strict=True)]
            by_q.append([dot(axis, seen) for axis in axes])
    else:
        columns = [frames.gradient(entry) for entry in along]
        by_q = [[column[k] for column in columns] for k in range(frames.robot.n)]
    rows: list[list[Expansion]] = [[], []]
    for by_a, by_1, by_2 in by_q:
        opening = ca * (cb * by_1 + sb * by_2) - sa * by_a
        across = kappa * (cb * by_2 - sb * by_1)
        rows[0].append(cb * opening - sb * across)
        rows[1].append(sb * opening + cb * across)
    values = Share(off, ring.cos(beta)), Share(off, ring.sin(beta))
    return [SymbolicRow(value, row, length) for value, row in zip(values, rows, strict=True)]


def _seen(function: Pointing, frames: Frames) -> Vector:
    """The point in the frame's axes."""
    if isinstance(function.at, Position):
        other = frames.position(function.at.frame, function.frame)
        return [other[AXES[axis]] for axis in function.at.axes]
    at = frames.position(function.frame)
    d = [to - p for to, p in zip(point(function.at, frames), at, strict=True)]
    steps = steps_to(frames.robot, function.frame)
    return turned(back(turns(steps, frames.geometry)), d, frames.geometry.ring)
