"""Where a frame is and how it moves, carried joint by joint from the frame back to the world."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from nmm.analysis.formulas.chain import Chain, ChainJoint, chain_to
from nmm.analysis.formulas.geometry import Geometry, signed_axis
from nmm.analysis.formulas.turning import Turning, Vector, back, cross, merged, turned, unit_vectors
from nmm.arrays import Array
from nmm.robots.robot import Robot


class Step(NamedTuple):
    """A fixed placement or, with a joint, its motion; `backward` for its inverse."""

    label: str
    translation: Array
    rotation: Array
    joint: ChainJoint | None = None
    backward: bool = False


class Twists(NamedTuple):
    """Velocity of a frame by unit velocity of each joint on the way, in the frame's own axes: v and ω."""

    linear: dict[str, Vector]
    angular: dict[str, Vector]


def steps_to(robot: Robot, frame: str, seen_from: str | None = None) -> list[Step]:
    """The steps from the world, or from another frame, to a frame; joints that carry both are left out."""
    chain = chain_to(robot, frame)
    if seen_from is None:
        return _forward(chain, 0)
    other = chain_to(robot, seen_from)
    shared = 0
    for one, two in zip(chain.joints, other.joints, strict=False):
        if one.name != two.name:
            break
        shared += 1
    back = [step._replace(backward=True) for step in reversed(_forward(other, shared))]
    return back + _forward(chain, shared)


def position(steps: list[Step], geometry: Geometry) -> Vector:
    """The origin of the last frame as the first sees it."""
    _name_lengths(steps, geometry)
    p = [geometry.ring.number(0)] * 3
    for step in reversed(steps):
        p = carried(step, p, geometry)
    return p


def turns(steps: list[Step], geometry: Geometry) -> tuple[Turning, ...]:
    """The turns that the last frame's rotation in the axes of the first is the product of."""
    return merged([turn for step in steps for turn in _turns_of(step, geometry)])


def twists(steps: list[Step], geometry: Geometry) -> Twists:
    """How each joint on the way moves the last frame: v = Rᵀ (a × p), ω = Rᵀ a for one that turns about a."""
    ring = geometry.ring
    _name_lengths(steps, geometry)
    behind: list[Turning] = []
    p = [ring.number(0)] * 3
    found = Twists({}, {})
    for step in reversed(steps):
        if step.joint is not None:
            axis = [-entry if step.backward else entry for entry in _axis(step.joint, geometry)]
            home = back(merged(behind))
            if step.joint.kind == "revolute":
                found.linear[step.label] = turned(home, cross(axis, p), ring)
                found.angular[step.label] = turned(home, axis, ring)
            else:
                found.linear[step.label] = turned(home, axis, ring)
                found.angular[step.label] = [ring.number(0)] * 3
        p = carried(step, p, geometry)
        behind = [*_turns_of(step, geometry), *behind]
    return found


def _forward(chain: Chain, start: int) -> list[Step]:
    steps = []
    for joint in chain.joints[start:]:
        steps.append(Step(joint.name, joint.translation, joint.rotation))
        steps.append(Step(joint.name, np.zeros(3), np.eye(3), joint))
    return [*steps, Step(chain.frame, chain.translation, chain.rotation)]


def _name_lengths(steps: list[Step], geometry: Geometry) -> None:
    """From the root on: the order in which formulas have them, and not that in which they are met here."""
    for step in steps:
        geometry.vector(step.translation, step.label)


def carried(step: Step, point: Vector, geometry: Geometry) -> Vector:
    """A point behind a step, as it is seen from before it."""
    offset = geometry.vector(step.translation, step.label)
    if step.joint is not None and step.joint.kind == "prismatic":
        q = geometry.ring.scalar(step.joint.name)
        offset = [entry * q for entry in _axis(step.joint, geometry)]
    turning = _turns_of(step, geometry)
    if step.backward:
        point = [entry - part for entry, part in zip(point, offset, strict=True)]
        return turned(turning, point, geometry.ring)
    return [a + b for a, b in zip(turned(turning, point, geometry.ring), offset, strict=True)]


def _turns_of(step: Step, geometry: Geometry) -> list[Turning]:
    """The turns of one step."""
    joint = step.joint
    if joint is None:
        found = geometry.rotation(step.rotation, step.label)
    elif joint.kind == "prismatic":
        return []
    else:
        angle = geometry.ring.variable(joint.name, True)
        straight = signed_axis(joint.axis)
        if straight is not None:
            found = [Turning(straight[0], ((angle, straight[1]),))]
        else:
            tilt = geometry.towards(joint.axis, joint.name)
            found = [*tilt, Turning(2, ((angle, 1),)), *back(tilt)]
    return back(found) if step.backward else found


def _axis(joint: ChainJoint, geometry: Geometry) -> Vector:
    """A joint's axis in its own frame."""
    straight, ring = signed_axis(joint.axis), geometry.ring
    if straight is None:
        return turned(geometry.towards(joint.axis, joint.name), unit_vectors(ring)[2], ring)
    return [ring.number(straight[1] * int(i == straight[0])) for i in range(3)]
