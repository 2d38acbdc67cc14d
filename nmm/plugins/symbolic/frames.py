"""What kernels read of a robot, as formulas: placements and Jacobians of frames, step by step from a frame
back to the world; auxiliary quantities."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from functools import partial
from itertools import takewhile
from typing import Any, NamedTuple

import numpy as np

from nmm.base.arrays import Array
from nmm.base.errors import InputError
from nmm.base.kernels import records
from nmm.model.robots.robot import CENTER_OF_MASS, Robot
from nmm.plugins.symbolic.expansion import Expansion
from nmm.plugins.symbolic.geometry import (
    Geometry,
    Turning,
    Vector,
    back,
    cross,
    merged,
    signed_axis,
    turned,
    unit_vectors,
)
from nmm.plugins.symbolic.quotient import Linear, Quotient, Untraceable
from nmm.plugins.symbolic.written import Auxiliary


def center(robot: Robot, geometry: Geometry) -> Vector:
    """The whole robot's centre of mass in world axes. Masses are in the symbols: `x_com_q1` (m) is, along x
    of joint q1's frame, the first moment of all that q1 carries, as if each joint behind it were where it is
    attached, over the robot's mass."""
    model = robot.model
    masses = np.array([inertia.mass for inertia in model.inertias])
    weights = masses.copy()  # of all that a joint carries
    for index in range(model.njoints - 1, 0, -1):
        weights[model.parents[index]] += weights[index]
    first = [mass * np.array(inertia.lever) for mass, inertia in zip(masses, model.inertias, strict=True)]
    for index in range(1, model.njoints):
        offset = np.array(model.jointPlacements[index].translation)
        first[model.parents[index]] = first[model.parents[index]] + weights[index] * offset
    names = ["com", *(f"com_{name}" for name in list(model.names)[1:])]
    moments = [geometry.vector(vector / weights[0], name) for vector, name in zip(first, names, strict=True)]
    for index in range(model.njoints - 1, 0, -1):
        placement, motion = joint_steps(robot, index)
        moment, share, parent = moments[index], weights[index] / weights[0], model.parents[index]
        moved = carried(motion, moment, geometry)
        if motion.kind == "prismatic" and share != 1.0:
            weight = geometry.length(share, f"share_{motion.label}")
            moved = [a + weight * (b - a) for a, b in zip(moment, moved, strict=True)]
        behind = carried(placement._replace(translation=np.zeros(3)), moved, geometry)
        moments[parent] = [a + b for a, b in zip(moments[parent], behind, strict=True)]
    return moments[0]


class Lazy:
    def __init__(self, entry: Callable[..., Any], shape: tuple[int, ...]) -> None:
        self._entry = entry
        self.shape = shape

    def __getitem__(self, index: int | tuple[int, ...]) -> Any:
        indices = index if isinstance(index, tuple) else (index,)
        if len(indices) == len(self.shape):
            return self._entry(*indices)
        return Lazy(partial(self._entry, *indices), self.shape[len(indices) :])


def lazy(entry: Callable[..., Any], *shape: int) -> Any:
    return Lazy(entry, shape)


def unread(what: str, dimensions: int) -> Any:
    def refuse(*index: int) -> None:
        raise Untraceable(f"it reads {what}")

    return Lazy(refuse, (0,) * dimensions)


@dataclass(eq=False)
class SymbolicFrames:
    """What kernels read of a robot, each quantity computed once."""

    robot: Robot
    geometry: Geometry
    auxiliaries: list[Auxiliary] = field(default_factory=list)
    #: Squared lengths of atan2's vectors: the traced function is undefined where one is 0.
    undefined: list[Expansion] = field(default_factory=list)
    _made: dict[Any, Any] = field(default_factory=dict)

    def coordinates(self) -> list[Linear]:
        return [Linear(self.geometry.ring, {index: Fraction(1)}) for index in self._indices()]

    def read(self, frames: tuple[str, ...]) -> records.Frames:
        """Placements and Jacobians of frames, without second derivatives."""
        k, n = len(frames), self.robot.n
        placements = lazy(lambda k, i, j: Quotient(self._column(frames[k], j)[i]), k, 3, 4)
        jacobians = lazy(lambda k, i, j: Quotient(self._motion(frames[k], i)[j]), k, 6, n)
        return records.Frames(np.arange(k), placements, jacobians, unread("second derivatives of frames", 4))

    def position(self, frame: str, seen_from: str | None = None) -> Vector:
        robot, geometry = self.robot, self.geometry
        if frame == CENTER_OF_MASS:
            return self._once(frame, lambda: center(robot, geometry))
        return self._once((frame, seen_from), lambda: position(steps_to(robot, frame, seen_from), geometry))

    def _column(self, frame: str, j: int) -> Vector:
        if j == 3:
            return self.position(frame)
        robot, geometry, unit = self.robot, self.geometry, unit_vectors(self.geometry.ring)[j]
        return self._once(
            (frame, j), lambda: turned(turns(steps_to(robot, frame), geometry), unit, geometry.ring)
        )

    def _motion(self, frame: str, i: int) -> Vector:
        if i < 3:
            return self._once((frame, i, "linear"), lambda: self.gradient(self.position(frame)[i]))
        return [turn[i - 3] for turn in self._once((frame, "angular"), lambda: self._angular(frame))]

    def _angular(self, frame: str) -> list[Vector]:
        """ω per coordinate, in world axes."""
        steps, ring = steps_to(self.robot, frame), self.geometry.ring
        forward = turns(steps, self.geometry)
        return [turned(forward, twist[3:], ring) for twist in self.twists(steps)]

    def twists(self, steps: list[ElementaryTransform]) -> list[Vector]:
        """The last frame's twist, v over ω, per coordinate, in its own axes."""
        by_joint, rest = twists(steps, self.geometry), [self.geometry.ring.number(0)] * 6
        return [by_joint.get(name, rest) for name in self.robot.q_names]

    def gradient(self, value: Expansion) -> list[Expansion]:
        return [value.derivative(index) for index in self._indices()]

    def _indices(self) -> list[int]:
        names = zip(self.robot.q_names, self.robot.q_units, strict=True)
        return [self.geometry.ring.variable(name, unit == "rad") for name, unit in names]

    def _once(self, key: Any, make: Callable[[], Any]) -> Any:
        if key not in self._made:
            self._made[key] = make()
        return self._made[key]

    def auxiliary(self, *wanted: tuple[str, str, Sequence[Expansion]]) -> list[str]:
        """Names of symbols for quantities (preferred name, kind, arguments); if a name is taken, all get the
        same number."""
        size, quantities = len(wanted), [(kind, tuple(arguments)) for _, kind, arguments in wanted]
        for i in range(len(self.auxiliaries) - size + 1):
            group = self.auxiliaries[i : i + size]
            if [auxiliary[1:] for auxiliary in group] == quantities:
                return [auxiliary.name for auxiliary in group]
        taken = {*self.robot.q_names, *self.geometry.ring.names}
        endings = itertools.chain([""], itertools.count(2))
        tried = ([f"{name}{ending}" for name, _, _ in wanted] for ending in endings)
        names = next(names for names in tried if taken.isdisjoint(names))
        for name, quantity in zip(names, quantities, strict=True):
            self.auxiliaries.append(Auxiliary(name, *quantity))
        return names

    def positive(self) -> set[int]:
        """Indices of auxiliary lengths, which are never negative."""
        ring = self.geometry.ring
        kinds = {auxiliary.name: auxiliary.kind for auxiliary in self.auxiliaries}
        return {i for i, name in enumerate(ring.names) if kinds.get(name) in ("length", "root", "ahead")}

    def angle(self, sine: Expansion, cosine: Expansion) -> Linear | None:
        """atan2 of both, where that is a combination of angles plus quarter turns."""
        ring, half = self.geometry.ring, Fraction(1, 2)
        size = cosine.split()[0] if cosine else ring.number(1)
        if size.variables() <= self.positive():
            above = size.inverse()
            above = above.scaled(Fraction(1 if above.at_sample() > 0.0 else -1))
            sine, cosine = sine * above, cosine * above
        turned_by = {(half, 0): 0, (0, half): 1, (-half, 0): 2, (0, -half): -1}
        if not len(cosine.terms) == len(sine.terms) == 2:
            return None
        for key, (re, im) in cosine.terms.items():
            whole = (re, im) in turned_by and all(ring.is_angle[i] for i, _ in key)
            if whole and sine.terms.get(key) == (im, -re):  # β = -i α
                constant = Fraction(turned_by[re, im] * math.pi / 2)
                return Linear(ring, {i: Fraction(n) for i, n in key}, constant)
        return None

    def matrix(self, product: tuple[Any, ...]) -> str:
        """A name for a rotation that is this product: R, R2, R3."""
        count = sum(isinstance(name, str) and name[0] == "R" for name in self._made.values()) + 1
        return str(self._once(("matrix", product), lambda: "R" if count == 1 else f"R{count}"))


class ElementaryTransform(NamedTuple):
    """A fixed placement, or the motion of a joint, "revolute" or "prismatic", about or along a unit axis;
    `backward` for its inverse."""

    label: str
    kind: str
    translation: Array = np.zeros(3)
    rotation: Array = np.eye(3)
    axis: Array = np.zeros(3)
    backward: bool = False


def joint_steps(robot: Robot, index: int) -> list[ElementaryTransform]:
    """A joint's placement in the frame of the joint before, and its motion; `index` is Pinocchio's.
    `InputError` for a joint that neither turns nor slides."""
    model = robot.model
    joint, placement = model.joints[index], model.jointPlacements[index]
    data = joint.createData()
    joint.calc(data, np.zeros(model.nq))
    motion = np.array(data.S, dtype=np.float64).reshape(-1)
    if motion.size != 6 or motion[:3].any() == motion[3:].any():
        what = f"{model.names[index]} is a {str(joint.shortname()).removeprefix('JointModel')}"
        raise InputError(what, where="symbolic", expected="joints that turn or slide")
    name, slides = str(model.names[index]), bool(motion[:3].any())
    return [
        ElementaryTransform(name, "fixed", np.array(placement.translation), np.array(placement.rotation)),
        ElementaryTransform(
            name, "prismatic" if slides else "revolute", axis=motion[:3] if slides else motion[3:]
        ),
    ]


def steps_to(robot: Robot, frame: str, seen_from: str | None = None) -> list[ElementaryTransform]:
    """The steps from the world, or from another frame, to a frame, without joints that carry both.
    `InputError` for an unknown frame, or a joint on the way that neither turns nor slides."""
    model = robot.model
    at = model.frames[robot.frame_id(frame)]
    steps = [
        ElementaryTransform(
            frame, "fixed", np.array(at.placement.translation), np.array(at.placement.rotation)
        )
    ]
    index = int(at.parentJoint)
    while index > 0:
        steps = joint_steps(robot, index) + steps
        index = int(model.parents[index])
    if seen_from is None:
        return steps
    other = steps_to(robot, seen_from)
    pairs = zip(steps[:-1], other[:-1], strict=False)
    shared = len(list(takewhile(lambda pair: pair[0].label == pair[1].label, pairs)))
    return [step._replace(backward=True) for step in reversed(other[shared:])] + steps[shared:]


def position(steps: list[ElementaryTransform], geometry: Geometry) -> Vector:
    """The last frame's origin as seen from the first."""
    _name_lengths(steps, geometry)
    p = [geometry.ring.number(0)] * 3
    for step in reversed(steps):
        p = carried(step, p, geometry)
    return p


def turns(steps: list[ElementaryTransform], geometry: Geometry) -> tuple[Turning, ...]:
    """The turns whose product is the last frame's rotation in the axes of the first."""
    return merged([turn for step in steps for turn in _turns_of(step, geometry)])


def twists(steps: list[ElementaryTransform], geometry: Geometry) -> dict[str, list[Expansion]]:
    """The last frame's twist, v over ω, in its own axes, by the name of each joint on the way: v = Rᵀ (a × p)
    and ω = Rᵀ a where it turns about a."""
    ring = geometry.ring
    _name_lengths(steps, geometry)
    behind: list[Turning] = []
    zero = [ring.number(0)] * 3
    p, by_joint = zero, {}
    for step in reversed(steps):
        if step.kind != "fixed":
            axis = [-entry if step.backward else entry for entry in _axis(step, geometry)]
            home = back(merged(behind))
            v, w = (cross(axis, p), axis) if step.kind == "revolute" else (axis, zero)
            by_joint[step.label] = turned(home, v, ring) + turned(home, w, ring)
        p = carried(step, p, geometry)
        behind = [*_turns_of(step, geometry), *behind]
    return by_joint


def _name_lengths(steps: list[ElementaryTransform], geometry: Geometry) -> None:
    """Name lengths from the root on: the order in formulas, not the one in which they are met here."""
    for step in steps:
        geometry.vector(step.translation, step.label)


def carried(step: ElementaryTransform, point: Vector, geometry: Geometry) -> Vector:
    """A point behind a step, as seen from before it."""
    offset = geometry.vector(step.translation, step.label)
    if step.kind == "prismatic":
        q = geometry.ring.scalar(step.label)
        offset = [entry * q for entry in _axis(step, geometry)]
    turning = _turns_of(step, geometry)
    if step.backward:
        point = [entry - part for entry, part in zip(point, offset, strict=True)]
        return turned(turning, point, geometry.ring)
    return [a + b for a, b in zip(turned(turning, point, geometry.ring), offset, strict=True)]


def _turns_of(step: ElementaryTransform, geometry: Geometry) -> list[Turning]:
    if step.kind == "prismatic":
        return []
    if step.kind == "fixed":
        turns = geometry.rotation(step.rotation, step.label)
    else:
        angle = geometry.ring.variable(step.label, True)
        straight = signed_axis(step.axis)
        if straight is not None:
            turns = [Turning(straight[0], ((angle, straight[1]),))]
        else:
            tilt = geometry.towards(step.axis, step.label)
            turns = [*tilt, Turning(2, ((angle, 1),)), *back(tilt)]
    return back(turns) if step.backward else turns


def _axis(step: ElementaryTransform, geometry: Geometry) -> Vector:
    straight, ring = signed_axis(step.axis), geometry.ring
    if straight is None:
        return turned(geometry.towards(step.axis, step.label), unit_vectors(ring)[2], ring)
    return [ring.number(straight[1] * int(i == straight[0])) for i in range(3)]
