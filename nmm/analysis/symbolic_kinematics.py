"""Placements of frames, composed joint by joint."""

from __future__ import annotations

from typing import NamedTuple

from nmm.analysis.symbolic_chain import Chain
from nmm.analysis.symbolic_expansion import Expansion
from nmm.analysis.symbolic_geometry import (
    Geometry,
    exact,
    identity,
    moving_turn,
    signed_axis,
    times,
    transposed,
)

Matrix = list[list[Expansion]]


class Placement(NamedTuple):
    """Rotation (3 x 3) and position (3) of a frame in world axes."""

    rotation: Matrix
    position: list[Expansion]


def placement(chain: Chain, geometry: Geometry) -> Placement:
    """Where a chain puts its frame."""
    ring = geometry.ring
    R, p = identity(ring), [ring.number(0)] * 3
    for joint in chain.joints:
        p = _moved(R, p, geometry.vector(joint.translation, joint.name))
        R = times(R, geometry.rotation(joint.rotation, joint.name))
        straight = signed_axis(joint.axis)
        if joint.kind == "prismatic":
            q = ring.scalar(joint.name)
            if straight is None:
                axis = [row[2] for row in geometry.towards(joint.axis, joint.name)]
            else:
                axis = [ring.number(straight[1] * int(i == straight[0])) for i in range(3)]
            p = _moved(R, p, [entry * q for entry in axis])
            continue
        angle = ring.variable(joint.name, True)
        if straight is None:
            tilt = geometry.towards(joint.axis, joint.name)
            R = times(times(times(R, tilt), moving_turn(ring, 2, angle, 1)), transposed(tilt))
        else:
            R = times(R, moving_turn(ring, straight[0], angle, straight[1]))
    p = _moved(R, p, geometry.vector(chain.translation, chain.frame))
    return Placement(times(R, geometry.rotation(chain.rotation, chain.frame)), p)


def relative(a: Placement, b: Placement) -> list[Expansion]:
    """The origin of a as b sees it."""
    between = [[one - other] for one, other in zip(a.position, b.position, strict=True)]
    return [row[0] for row in times(transposed(b.rotation), between)]


def direction(a: Placement, vector: tuple[float, ...]) -> list[Expansion]:
    """A direction of a frame in world axes."""
    fixed = [[a.position[0].ring.number(exact(value))] for value in vector]
    return [row[0] for row in times(a.rotation, fixed)]


def _moved(R: Matrix, p: list[Expansion], by: list[Expansion]) -> list[Expansion]:
    return [start + row[0] for start, row in zip(p, times(R, [[entry] for entry in by]), strict=True)]
