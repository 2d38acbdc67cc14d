"""Rows of headings, orientations and poses."""

from __future__ import annotations

from nmm.analysis.formulas.frames import Frames
from nmm.analysis.formulas.kinematics import direction, steps_to, turns, twists
from nmm.analysis.formulas.numbers import exact
from nmm.analysis.formulas.row import Arc, SymbolicRow, Turn, Value
from nmm.functions.tasks import Heading, Orientation, Pose
from nmm.functions.tasks.heading import PLANES
from nmm.functions.tasks.position import AXES


def heading(function: Heading, frames: Frames) -> list[SymbolicRow]:
    """ψ = atan2(s, c): dψ = (c ds - s dc) / (c² + s²)."""
    function.rows(frames.robot)
    ring = frames.geometry.ring
    fixed = [ring.number(exact(float(value))) for value in function.direction]
    d = direction(steps_to(frames.robot, function.frame), frames.geometry, fixed)
    c, s = (d[AXES[axis]] for axis in PLANES[function.about])
    by_c, by_s = frames.gradient(c), frames.gradient(s)
    gradient = [c * ds - s * dc for ds, dc in zip(by_s, by_c, strict=True)]
    return [SymbolicRow(Arc(s, c), gradient, c * c + s * s)]


def orientation(function: Orientation, frames: Frames) -> list[SymbolicRow]:
    """The rotation vector; by the coordinates, the turning in the frame's own axes (of the error at 0)."""
    function.rows(frames.robot)
    return _motion(function.frame, function.relative_to, frames)[3:]


def pose(function: Pose, frames: Frames) -> list[SymbolicRow]:
    """Position over rotation vector; by the coordinates, the motion in the frame's own axes (as above)."""
    function.rows(frames.robot)
    return _motion(function.frame, function.relative_to, frames)


def _motion(frame: str, seen_from: str | None, frames: Frames) -> list[SymbolicRow]:
    geometry, ring = frames.geometry, frames.geometry.ring
    steps = steps_to(frames.robot, frame, seen_from)
    moving = twists(steps, geometry)
    product = tuple(
        (turn.axis, tuple((ring.names[i], k) for i, k in turn.angle), turn.quarters)
        for turn in turns(steps, geometry)
    )
    name = frames.new_matrix()
    values: list[Value] = [*frames.position(frame, seen_from), *(Turn(i, name, product) for i in range(3))]
    parts, zero = [moving.linear] * 3 + [moving.angular] * 3, [ring.number(0)] * 3
    return [
        SymbolicRow(value, [part.get(joint, zero)[i % 3] for joint in frames.robot.q_names], ring.number(1))
        for i, (value, part) in enumerate(zip(values, parts, strict=True))
    ]
