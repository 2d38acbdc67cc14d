"""Names for distances and directions that would make formulas long, put in before a kernel computes."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from nmm.analysis.formulas.expansion import Expansion, exact
from nmm.analysis.formulas.frames import Frames, lazy
from nmm.analysis.formulas.geometry import signed_axis
from nmm.analysis.formulas.kinematics import steps_to, turns, twists
from nmm.analysis.formulas.quotient import Quotient, Untraceable, quotient
from nmm.analysis.formulas.turning import Vector, back, cross, dot, turned
from nmm.functions.function import Stage
from nmm.functions.references.bearing import bearing
from nmm.functions.tasks.distance import distance
from nmm.functions.tasks.pointing import pointing
from nmm.kernels.records import Frames as Read
from nmm.kernels.records import Rows


def polar(stage: Stage, read: Read, rows: Rows, frames: Frames) -> Read:
    """A point that a kernel gets in its rows, as it is seen from another: by rho and angles.

    The kernel then finds the difference of both as rho (cos g, sin g), say, and what it computes is short.

    Returns
    -------
    read : placements and Jacobians for the kernel
    """
    change = _CHANGES.get(stage.kernel)
    return read if change is None else change(stage, read, rows, frames)


def _bearing(stage: Stage, read: Read, rows: Rows, frames: Frames) -> Read:
    """T - p = rho (cos g, sin g)."""
    ring, value = frames.geometry.ring, rows.value
    towards = [ring.number(exact(float(entry))) for entry in stage.numbers]
    seen = [to - at for to, at in zip(towards, _polynomials(value[:2], frames), strict=True)]
    if any(entry.variables() for entry in seen):
        rho, turn = frames.auxiliary(("rho", "length", seen), ("g", "bearing", seen))
        g = {ring.variable(turn, True): 1}
        for i, wave in enumerate((ring.cos(g), ring.sin(g))):
            value[i] = Quotient(towards[i] - ring.scalar(rho) * wave)
    return read


def _distance(stage: Stage, read: Read, rows: Rows, frames: Frames) -> Read:
    """d = to - p = rho (cos beta cos alpha, cos beta sin alpha, sin beta)."""
    ring, value, at = frames.geometry.ring, rows.value, frames.position(stage.frames[0])
    d = [to - p for to, p in zip(_polynomials(value, frames), at, strict=True)]
    level = not d[2]
    up = [] if level else [("beta", "elevation", d)]
    rho, azimuth, *rest = frames.auxiliary(
        ("rho", "length", d[:2] if level else d), ("alpha", "bearing", d[:2]), *up
    )
    alpha = {ring.variable(azimuth, True): 1}
    along = [ring.cos(alpha), ring.sin(alpha), ring.number(0)]
    if not level:
        beta = {ring.variable(rest[0], True): 1}
        along = [entry * ring.cos(beta) for entry in along[:2]] + [ring.sin(beta)]
    value[:] = [Quotient(p + ring.scalar(rho) * entry) for p, entry in zip(at, along, strict=True)]
    return read


def _pointing(stage: Stage, read: Read, rows: Rows, frames: Frames) -> Read:
    """l = rho (cos alpha, sin alpha (cos beta, sin beta)) along the task's axes; kappa is alpha / sin alpha.

    All is told in the frame's own axes, on which the result does not depend.
    """
    geometry, ring = frames.geometry, frames.geometry.ring
    if signed_axis(stage.numbers[:3]) is None:
        raise Untraceable("its axis is not x, y or z (or its negative)")
    axes = [[ring.number(exact(float(entry))) for entry in axis] for axis in stage.numbers.reshape(3, 3)]
    steps = steps_to(frames.robot, *stage.frames)
    seen, fixed = _seen(stage, rows, frames)
    along = [dot(axis, seen) for axis in axes]
    rho, off, around, kappa = frames.auxiliary(
        ("rho", "length", seen),
        ("alpha", "off axis", along),
        ("beta", "bearing", along[1:]),
        ("kappa", "over sine", along),
    )
    alpha, beta = ring.variable(off, True), ring.variable(around, True)
    ring.ratios[alpha] = kappa
    length, sine = ring.scalar(rho), ring.sin({alpha: 1})
    parts = [
        length * ring.cos({alpha: 1}),
        *(length * sine * wave({beta: 1}) for wave in (ring.cos, ring.sin)),
    ]
    point = [dot([axis[i] for axis in axes], parts) for i in range(3)]
    moving, zero = twists(steps, geometry), [ring.number(0)] * 3
    velocity = []
    for name in frames.robot.q_names:
        v, w = moving.linear.get(name, zero), moving.angular.get(name, zero)
        velocity.append([*v, *w])
    rows.value[:] = list(map(Quotient, point))
    if not fixed:
        gradients = [frames.gradient(entry) for entry in seen]
        for k, motion in enumerate(velocity):
            carried = [a + b for a, b in zip(motion[:3], cross(motion[3:], point), strict=True)]
            rows.value_q[:, k] = [Quotient(gradients[i][k] + carried[i]) for i in range(3)]
    return read._replace(
        placements=lazy(lambda k, i, j: float(i == j), 1, 3, 4),
        jacobians=lazy(lambda k, i, j: Quotient(velocity[j][i]), 1, 6, frames.robot.n),
    )


def _seen(stage: Stage, rows: Rows, frames: Frames) -> tuple[Vector, bool]:
    """The point in the frame's axes, and whether it rests in the world."""
    ring = frames.geometry.ring
    fixed = not any(quotient(entry, ring) for entry in rows.value_q.flat)
    at = frames.position(*stage.frames)
    d = [to - p for to, p in zip(_polynomials(rows.value, frames), at, strict=True)]
    steps = steps_to(frames.robot, *stage.frames)
    return turned(back(turns(steps, frames.geometry)), d, ring), fixed


def _polynomials(values: Any, frames: Frames) -> list[Expansion]:
    found = [quotient(value, frames.geometry.ring) for value in values]
    if any(value.under.variables() for value in found):
        raise Untraceable("it is taken of quotients")
    return [value.over for value in found]


#: By the kernel that they are for.
_CHANGES: dict[Any, Callable[..., Read]] = {bearing: _bearing, distance: _distance, pointing: _pointing}
