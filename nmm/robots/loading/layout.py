"""Measures a model's wheels and upright joints, from which platforms take their lengths."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pinocchio as pin

from nmm.arrays import Array, positive
from nmm.errors import InputError, RobotError, expect_known
from nmm.platforms.layout import HITCHES, STEERING, SWIVELS, Layout, Pivot, RollingJoint
from nmm.robots.loading.chain import CHAIN
from nmm.robots.loading.joint_kinds import axis, is_revolute, kind

# How far from level or upright an axis may be: files write pi/2 with a few digits.
_LEVEL = 1e-3
# A centre so near the root link's xy plane lies in it: the plane is then not the ground.
_ON_PLANE = 1e-6
_SHAPES = ("Cylinder", "Sphere", "Capsule")
#: The share of a radius by which files round it, and tyres give way.
ROUNDED = 0.01


@dataclass(frozen=True, eq=False)
class Measured:
    """A model whose joints are measured in the root link's frame, with every joint at zero.

    Attributes
    ----------
    model : with any root: fixed, planar, free, or the chain x, y, theta
    geometries : its collision and visual shapes, in the order in which to ask them for a radius
    where : what messages call the model
    """

    model: pin.Model
    geometries: Sequence[pin.GeometryModel]
    where: str

    @cached_property
    def root(self) -> int:
        """The joint that carries the root link; 0 (the universe) for a fixed base."""
        if tuple(self.model.names)[1 : len(CHAIN) + 1] == CHAIN:
            return len(CHAIN)
        free = self.model.njoints > 1 and kind(self.model.joints[1]) in ("FreeFlyer", "Planar")
        return 1 if free else 0

    @cached_property
    def neutral(self) -> Array:
        """The configuration at which everything is measured."""
        return np.array(pin.neutral(self.model))

    @cached_property
    def placements(self) -> list[pin.SE3]:
        """Pose of every joint in the root link's frame."""
        data = self.model.createData()
        pin.forwardKinematics(self.model, data, self.neutral)
        root = data.oMi[self.root].inverse()
        return [root * placement for placement in data.oMi]

    @cached_property
    def joints(self) -> dict[str, int]:
        """The joints after the root's, by name."""
        return {str(self.model.names[i]): i for i in range(self.root + 1, self.model.njoints)}

    @cached_property
    def links(self) -> dict[int, list[str]]:
        """Names of the link right below each joint; not of those fixed to it: a camera on a wheel is none."""
        below: dict[int, list[str]] = {}
        frames = self.model.frames
        for frame in frames:
            joint = int(frame.parentJoint)
            is_link = frame.type == pin.FrameType.BODY
            if is_link and frames[frame.parentFrame].name == self.model.names[joint]:
                below.setdefault(joint, []).append(frame.name)
        return below

    def axis(self, joint: int) -> Array:
        """The joint's axis, in the root link's frame."""
        return np.asarray(self.placements[joint].rotation @ axis(self.model.joints[joint], self.neutral))

    def is_upright(self, joint: int) -> bool:
        """Whether it turns about an upright axis, which may point up or down."""
        return is_revolute(self.model.joints[joint]) and abs(self.axis(joint)[2]) > 1.0 - _LEVEL

    def is_named_wheel(self, joint: int) -> bool:
        """Whether "wheel" is in the joint's name, or in that of its child link; "caster" will do for a joint
        that can be one's wheel."""
        names = [str(self.model.names[joint]), *self.links.get(joint, ())]
        rolls = self.why_not_rolling(joint) is None
        return any("wheel" in name.lower() or (rolls and "caster" in name.lower()) for name in names)

    def why_not_rolling(self, joint: int) -> str | None:
        """Why the joint itself cannot be a wheel's, wherever it hangs; None when it can."""
        if not is_revolute(self.model.joints[joint]):
            return "it does not turn"
        if joint in list(self.model.parents):
            return "another joint is below it"
        if abs(self.axis(joint)[2]) > _LEVEL:
            return "its axis is not level"
        return None

    def above(self, joint: int) -> list[int]:
        """The joints from the root's body down to the joint's parent."""
        path: list[int] = []
        while (joint := int(self.model.parents[joint])) > self.root:
            path.insert(0, joint)
        return path

    def asked(self, wheels: Sequence[str] | Mapping[str, float] | None) -> dict[str, float | None] | None:
        """The wheels asked for with their radii (m), where given; None when none are named.

        Raises
        ------
        RobotError : not a list of the model's joints
        """
        if wheels is None:
            return None
        if isinstance(wheels, str) or not isinstance(wheels, Iterable):
            raise RobotError(f"{self.where}: wheels: expected a list of joint names, got {wheels!r}")
        for name in wheels:
            expect_known("wheel joint", name, self.joints, self.where, RobotError)
        return {name: wheels[name] if isinstance(wheels, Mapping) else None for name in wheels}

    def wheels(
        self,
        asked: Sequence[str] | Mapping[str, float] | None,
        why_not: Callable[[str, Collection[str]], str | None],
        own: Collection[str] = (),
    ) -> tuple[dict[str, float | None], tuple[str, ...]]:
        """The joints that are wheels with their radii (m), where given, and notes on those only named so.

        Parameters
        ----------
        asked : joints that have to be, or the radius of each; None finds them by name
        why_not : of a joint and all that may be wheels, why it is none; None for one that is
        own : joints that are none, whatever their names

        Raises
        ------
        RobotError : one asked for that is no joint, or no wheel
        """
        radii = self.asked(asked)
        named = [name for name, i in self.joints.items() if self.is_named_wheel(i) and name not in own]
        candidates = dict.fromkeys(named) if radii is None else radii
        found: dict[str, float | None] = {}
        notes: list[str] = []
        for name, radius in candidates.items():
            reason = why_not(name, candidates)
            if reason is None:
                found[name] = radius
            elif radii is None:
                notes.append(f"{name} stays a coordinate in spite of its name: {reason}")
            else:
                raise RobotError(f"{self.where}: joint {name!r} is no wheel: {reason}")
        return found, tuple(notes)

    def radius(self, joint: int, given: float | None = None) -> float:
        """The wheel's radius, m: as given, or its centre's height over the root link's xy plane, or its
        largest round shape's where that is another: the plane is then not the ground.

        Raises
        ------
        RobotError : not a radius, or none found
        """
        name = str(self.model.names[joint])
        if given is not None:
            try:
                return positive(given, f"wheels: radius of {name}")
            except InputError as error:
                raise RobotError(f"{self.where}: {error}") from None
        # A root link may stand on the ground (REP-120's base_footprint), or be some part of the body.
        height, shape = float(self.placements[joint].translation[2]), self._shape_radius(joint)
        if height > _ON_PLANE and (shape is None or abs(shape - height) <= ROUNDED * shape):
            return height
        if shape is None:
            raise RobotError(
                f"{self.where}: radius of wheel {name!r} not found: its centre is not above the root link's "
                f"xy plane and it has no cylinder or sphere; give it, --wheels {name}=M,... "
                f"(wheels={{{name!r}: ...}}), or no wheels, --wheels none (wheels=())"
            )
        return shape

    def _shape_radius(self, joint: int) -> float | None:
        """The largest radius among the joint's round shapes, of the first geometry model that has any."""
        for geometry in self.geometries:
            shapes = [shape.geometry for shape in geometry.geometryObjects if shape.parentJoint == joint]
            radii = [float(shape.radius) for shape in shapes if type(shape).__name__ in _SHAPES]
            if radii and math.isfinite(max(radii)) and max(radii) > 0.0:
                return max(radii)
        return None


def measure_layout(
    model: pin.Model,
    geometries: Sequence[pin.GeometryModel],
    wheels: Sequence[str] | Mapping[str, float] | None,
    where: str,
) -> Layout:
    """The wheels and the upright joints that could steer, hitch or swivel, for `Platform.fit`.

    Lengths are along the root link's axes with every joint at zero. An upright joint counts when a wheel is
    below it, or when its name says what it is ("steer", "hitch", "trailer", "caster", "swivel"): an arm's
    shoulder does not. A joint whose axis points down does not either: its angle would count the wrong way.

    Parameters
    ----------
    model : of a fixed base, before it gets the coordinates x, y, theta (one that has them will do)
    geometries : its collision and visual shapes, in the order in which to ask them for a radius
    wheels : joints that only roll, or the radius (m) of each; None finds them by name
    where : what messages call the model

    Raises
    ------
    RobotError : a name that is no joint, or no wheel, or a wheel whose radius cannot be found
    """
    measured = Measured(model, geometries, where)
    given, _ = measured.wheels(wheels, lambda name, _: _why_no_wheel(measured, measured.joints[name]))
    radii = {joint: given[name] for name, joint in measured.joints.items() if name in given}
    carrying = {joint for wheel in radii for joint in measured.above(wheel)}
    pivots = [
        joint
        for name, joint in measured.joints.items()
        if measured.is_upright(joint)
        and measured.axis(joint)[2] > 0.0
        and (joint in carrying or any(word in name.lower() for word in (*STEERING, *HITCHES, *SWIVELS)))
    ]
    return Layout(
        str(model.name),
        tuple(_pivot(measured, joint) for joint in pivots),
        tuple(_rolling(measured, joint, radii[joint]) for joint in radii),
    )


def _why_no_wheel(measured: Measured, joint: int) -> str | None:
    reason = measured.why_not_rolling(joint)
    if reason is None and not all(measured.is_upright(above) for above in measured.above(joint)):
        return "another joint is between it and the root link"  # one that neither steers nor swivels
    return reason


def _pivot(measured: Measured, joint: int) -> Pivot:
    model = measured.model
    lower, upper = -math.inf, math.inf
    velocity = speed_limit(model, joint)
    if model.joints[joint].nq == 1:
        index = model.joints[joint].idx_q
        lower, upper = _finite(model.lowerPositionLimit[index]), _finite(model.upperPositionLimit[index])
    return Pivot(str(model.names[joint]), *_carried(measured, joint), lower, upper, velocity)


def _rolling(measured: Measured, joint: int, radius: float | None) -> RollingJoint:
    turning = measured.axis(joint)
    # It rolls along axis x z; adding zero makes -0.0 a plain one.
    heading = math.atan2(-turning[0], turning[1]) + 0.0
    return RollingJoint(
        str(measured.model.names[joint]),
        *_carried(measured, joint),
        heading,
        measured.radius(joint, radius),
    )


def _carried(measured: Measured, joint: int) -> tuple[str, float, float]:
    """The joint that carries this one ("theta" on the root's body), and where on it, m."""
    carrier = int(measured.model.parents[joint])
    offset = measured.placements[joint].translation - measured.placements[carrier].translation
    name = str(measured.model.names[carrier]) if carrier > measured.root else "theta"
    return name, float(offset[0]), float(offset[1])


def speed_limit(model: pin.Model, joint: int) -> float:
    """The largest rate of a joint, rad/s or m/s; infinite where its file says none, or 0."""
    own = float(model.velocityLimit[model.joints[joint].idx_v])
    return _finite(own) if own > 0.0 else math.inf


def _finite(limit: float) -> float:
    """A limit, infinite where Pinocchio has its largest number instead."""
    return float(limit) if abs(limit) < 1e300 else math.copysign(math.inf, limit)
