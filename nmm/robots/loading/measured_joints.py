"""Measures a model's wheels and upright joints: where wheels touch the ground, how long a platform is."""

import math
import re
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pinocchio as pin

from nmm.arrays import Array, positive
from nmm.errors import InputError, RobotError, expect_known
from nmm.findings import Finding
from nmm.findings.robot_file import refusal
from nmm.platforms import Platform
from nmm.platforms.wheel_layout import HITCHES, NEAR, STEERING, SWIVELS, Layout, Pivot, RollingJoint
from nmm.robots.loading.chain import replaced_joints
from nmm.robots.loading.extents import width
from nmm.robots.loading.joint_kinds import axis, is_revolute, joint_limits
from nmm.robots.meshes import read_meshes
from nmm.robots.wheel import Wheel

# How far from level or upright an axis may be: files write pi/2 with a few digits.
_LEVEL = 1e-3
# A centre so near the root link's xy plane lies in it: the plane is then not the ground.
_ON_PLANE = 1e-6
_SHAPES = ("Cylinder", "Sphere", "Capsule")
_SHORT_NAMES = re.compile("caster|(?<![a-z])[lr]w(?![a-z])")
#: Joints that have to be wheels, or the radius (m) of each; None finds them by their names.
Asked = Sequence[str] | Mapping[str, float] | None
#: Why a joint is no wheel's: `why`, a code, and the names in its words; None for a wheel's.
NoWheel = Mapping[str, str] | None
#: The share of a radius by which files round it, and tyres give way.
ROUNDED = 0.01


@dataclass(frozen=True, eq=False)
class Measured:
    """A model whose joints are measured in the root link's frame, with every joint at zero. `geometries` are
    its collision and visual shapes, in the order in which to ask them for a radius."""

    model: pin.Model
    geometries: Sequence[pin.GeometryModel]
    where: str

    @cached_property
    def root(self) -> int:
        """The joint that carries the root link; 0 (the universe) for a fixed base."""
        return replaced_joints(self.model)

    @cached_property
    def neutral(self) -> Array:
        return np.array(pin.neutral(self.model))

    @cached_property
    def placements(self) -> list[pin.SE3]:
        data = self.model.createData()
        pin.forwardKinematics(self.model, data, self.neutral)
        root = data.oMi[self.root].inverse()
        return [root * placement for placement in data.oMi]

    @cached_property
    def joints(self) -> dict[str, int]:
        return {str(self.model.names[i]): i for i in range(self.root + 1, self.model.njoints)}

    @cached_property
    def links(self) -> dict[int, list[str]]:
        """Names of the link right below each joint; not of those fixed to it: a camera on a wheel is none."""
        below: dict[int, list[str]] = {}
        frames = self.model.frames
        for frame in frames:
            joint, is_link = int(frame.parentJoint), frame.type == pin.FrameType.BODY
            if is_link and frames[frame.parentFrame].name == self.model.names[joint]:
                below.setdefault(joint, []).append(frame.name)
        return below

    def axis(self, joint: int) -> Array:
        """The joint's axis, in the root link's frame."""
        return np.asarray(self.placements[joint].rotation @ axis(self.model.joints[joint], self.neutral))

    def is_upright(self, joint: int) -> bool:
        """Whether it turns about an upright axis, which may point up or down."""
        return is_revolute(self.model.joints[joint]) and abs(self.axis(joint)[2]) > 1.0 - _LEVEL

    def points_down(self, joint: int) -> bool:
        """Whether it turns about an upright axis that points down: its angle counts to the right."""
        return self.is_upright(joint) and self.axis(joint)[2] < 0.0

    def is_named_wheel(self, joint: int) -> bool:
        """Whether its name or its child link's holds "wheel" or, where it can be a wheel's, "caster", or is
        that of a left or right wheel: lw, rw_joint."""
        names = " ".join([str(self.model.names[joint]), *self.links.get(joint, ())]).lower()
        rolls = self.why_not_rolling(joint) is None
        return "wheel" in names or (rolls and _SHORT_NAMES.search(names) is not None)

    def why_not_rolling(self, joint: int) -> NoWheel:
        """Why the joint cannot be a wheel's, wherever it hangs; None when it can."""
        if not is_revolute(self.model.joints[joint]):
            return {"why": "not_turning"}
        if joint in list(self.model.parents):
            return {"why": "joint_below"}
        if abs(self.axis(joint)[2]) > _LEVEL:
            return {"why": "axis_not_level"}
        return None

    def above(self, joint: int) -> list[int]:
        """The joints from the root's body down to the joint's parent."""
        path: list[int] = []
        while (joint := int(self.model.parents[joint])) > self.root:
            path.insert(0, joint)
        return path

    def swivel(self, name: str, own: Collection[str]) -> str:
        """The swivel on which a wheel's joint is; "" without."""
        carrier = int(self.model.parents[self.joints[name]])
        carrier_name = str(self.model.names[carrier])
        return carrier_name if carrier > self.root and carrier_name not in own else ""

    def why_no_wheel(self, name: str, candidates: Collection[str], own: Collection[str]) -> NoWheel:
        """Why a joint is no wheel's, where those on the root, on `own` joints and on swivels are."""
        if name in own:
            return {"why": "platforms_own"}
        model, joint = self.model, self.joints[name]
        reason = self.why_not_rolling(joint)
        between = [above for above in self.above(joint) if str(model.names[above]) not in own]
        if reason is not None or not between:
            return reason
        swivel = between[-1]
        if between != [int(model.parents[joint])] or not self.is_upright(swivel):
            names = ", ".join(str(model.names[above]) for above in between)
            return {"why": "joint_between", "between": names}
        for below, parent in enumerate(model.parents):
            other = str(model.names[below])
            if parent == swivel and (other not in candidates or self.why_not_rolling(below) is not None):
                return {"why": "swivel_carries_more", "swivel": str(model.names[swivel]), "other": other}
        return None

    def wheels(
        self, asked: Asked, own: Collection[str] = (), why_not: Callable[[str], NoWheel] | None = None
    ) -> tuple[dict[str, float | None], list[Finding]]:
        """Wheels' joints with given radii (m), and notes on joints only named so. `own` joints are none;
        `why_not` says why a joint is none. `RobotError` for one asked for that is no joint or no wheel."""
        candidates: Mapping[str, float | None]
        if asked is None:
            named = [name for name, i in self.joints.items() if self.is_named_wheel(i)]
            candidates = dict.fromkeys(name for name in named if name not in own)
        elif isinstance(asked, str) or not isinstance(asked, Iterable):
            raise RobotError(where=f"{self.where}: wheels", expected="a list of joint names", got=asked)
        else:
            for name in asked:
                expect_known("wheel joint", name, self.joints, self.where, RobotError)
            candidates = asked if isinstance(asked, Mapping) else dict.fromkeys(asked)
        found: dict[str, float | None] = {}
        notes: list[Finding] = []
        for name, radius in candidates.items():
            reason = why_not(name) if why_not else self.why_no_wheel(name, candidates, own)
            if reason is None:
                found[name] = radius
            elif asked is None:
                notes.append(Finding("not_a_wheel", {"name": name, **reason}))
            else:
                raise refusal(self.where, Finding("no_wheel", {"name": name, **reason}))
        return found, notes

    def radius(self, joint: int, given: float | None = None) -> float:
        """The radius, m: as given, or the centre's height over the root link's xy plane where a shape has
        that radius or none has one, or else the first shape's; `RobotError` for none."""
        name = str(self.model.names[joint])
        if given is not None:
            try:
                return positive(given, f"wheels: radius of {name}")
            except InputError as error:
                raise error.at(self.where, RobotError) from None
        # A root link may stand on the ground (REP-120's base_footprint), or be some part of the body.
        height, first = float(self.placements[joint].translation[2]), None
        for shape in self.shape_radii(joint):
            first = first or shape
            if height <= _ON_PLANE:
                break
            if abs(shape - height) <= ROUNDED * shape:
                return height
        if first is None and height <= _ON_PLANE:
            raise refusal(self.where, Finding("radius_unknown", {"name": name}))
        return first or height

    def shape_radii(self, joint: int) -> Iterator[float]:
        """The largest radius among the joint's round shapes, of each geometry model that has any; then that
        of its meshes, those shown first: they are finer. Meshes are only read where they are asked for."""
        for geometry in self.geometries:
            shapes = [shape.geometry for shape in geometry.geometryObjects if shape.parentJoint == joint]
            radii = [float(shape.radius) for shape in shapes if type(shape).__name__ in _SHAPES]
            if radii and math.isfinite(max(radii)) and max(radii) > 0.0:
                yield max(radii)
        along = axis(self.model.joints[joint], self.neutral)
        for geometry in reversed(self.geometries):
            shapes = [shape.copy() for shape in geometry.geometryObjects if shape.parentJoint == joint]
            radius = 0.0
            with suppress(RobotError):  # one that cannot be read says so where it is drawn
                read_meshes(shapes, self.where)
                radius = max((width(shape, along) for shape in shapes), default=0.0)
            if radius > 0.0:
                yield radius


def measure_layout(
    model: pin.Model, geometries: Sequence[pin.GeometryModel], asked: Asked, where: str
) -> Layout:
    """The wheels and the upright joints that could steer, hitch or swivel, for `Platform.fit`.

    Lengths are along the root link's axes with every joint at zero. An upright joint counts if it carries a
    wheel or its name says what it is ("steer", "hitch", "trailer", "caster", "swivel"); of one whose axis
    points down, the limits are those of the angle to the left. Errors as in `find_wheels`."""
    measured = Measured(model, geometries, where)

    def why_not(name: str) -> NoWheel:
        joint = measured.joints[name]
        upright = all(measured.is_upright(above) for above in measured.above(joint))
        return measured.why_not_rolling(joint) or (None if upright else {"why": "not_on_root"})

    given, _ = measured.wheels(asked, why_not=why_not)
    radii = {joint: given[name] for name, joint in measured.joints.items() if name in given}
    carrying = {joint for wheel in radii for joint in measured.above(wheel)}
    pivots = [
        joint
        for name, joint in measured.joints.items()
        if measured.is_upright(joint)
        and (joint in carrying or any(word in name.lower() for word in (*STEERING, *HITCHES, *SWIVELS)))
    ]
    return Layout(
        str(model.name),
        tuple(_pivot(measured, joint) for joint in pivots),
        tuple(_rolling(measured, joint, radii[joint]) for joint in radii),
    )


def _pivot(measured: Measured, joint: int) -> Pivot:
    model, place = measured.model, _carried(measured, joint)
    lower, upper = (float(end[0]) for end in joint_limits(model, joint)[4:6])
    if measured.points_down(joint):
        lower, upper = -upper, -lower
    return Pivot(str(model.names[joint]), *place, lower, upper, speed_limit(model, joint))


def _rolling(measured: Measured, joint: int, radius: float | None) -> RollingJoint:
    turning = measured.axis(joint)
    # It rolls along axis x z; adding zero makes -0.0 a plain one.
    heading = math.atan2(-turning[0], turning[1]) + 0.0
    place = _carried(measured, joint)
    return RollingJoint(str(measured.model.names[joint]), *place, heading, measured.radius(joint, radius))


def _carried(measured: Measured, joint: int) -> tuple[str, float, float]:
    """The joint that carries this one ("theta" on the root's body), and where on it, m."""
    carrier = int(measured.model.parents[joint])
    offset = measured.placements[joint].translation - measured.placements[carrier].translation
    name = str(measured.model.names[carrier]) if carrier > measured.root else "theta"
    return name, float(offset[0]), float(offset[1])


def speed_limit(model: pin.Model, joint: int) -> float:
    """Rate limit of a joint, rad/s or m/s; infinite where its file gives none, or 0."""
    own = float(joint_limits(model, joint)[3][0])
    return own if own > 0.0 else math.inf


def find_wheels(
    model: pin.Model,
    geometries: Sequence[pin.GeometryModel],
    asked: Asked,
    where: str,
    own: Sequence[str],
    platform: Platform,
) -> tuple[tuple[Wheel, ...], list[Finding]]:
    """The robot's passive wheels, and notes on joints that are only named wheels.

    A wheel is a revolute joint with a level axis and no joint below it, on the root link's body, one of the
    platform's own joints or a swivel: an upright joint, not the platform's own, that hangs on one of these
    and carries only wheels. Without `asked`, the joint's or child link's name must hold "wheel" (or
    "caster", lw, rw). `RobotError` for no joint, no wheel, or a wheel whose radius cannot be found."""
    measured = Measured(model, geometries, where)
    radii, notes = measured.wheels(asked, own)
    wheels = tuple(_wheel(measured, name, radii[name], own, platform) for name in radii)
    swivels = {wheel.swivel for wheel in wheels}  # named as wheels, and left out of q as these are
    return wheels, [note for note in notes if note.values["name"] not in swivels]


def differing_radii(
    model: pin.Model, geometries: Sequence[pin.GeometryModel], asked: Asked, where: str
) -> Iterator[Finding]:
    """Where a wheel's given radius, m, is not that of any of its shapes (1 mm or 1 % may differ)."""
    measured = Measured(model, geometries, where)
    for name, given in asked.items() if isinstance(asked, Mapping) else ():
        radii = [] if given is None else [*measured.shape_radii(measured.joints[name])]
        if radii and all(abs(given - one) > max(NEAR, ROUNDED * one) for one in radii):
            yield Finding("wheel_radius_differs", {"name": name, "given": float(given), "measured": radii[0]})


def held_joints(model: pin.Model, asked: Asked, where: str) -> tuple[tuple[str, ...], list[Finding]]:
    """A fixed base's wheels (as `find_wheels` takes them, radii aside), after their swivels, and notes."""
    measured = Measured(model, (), where)
    names, notes = measured.wheels(asked)
    held = [joint for name in names for joint in (measured.swivel(name, ()), name) if joint]
    return tuple(dict.fromkeys(held)), notes


def _wheel(
    measured: Measured, name: str, radius: float | None, own: Sequence[str], platform: Platform
) -> Wheel:
    model, joint = measured.model, measured.joints[name]
    carrier, swivel = int(model.parents[joint]), measured.swivel(name, own)
    if swivel:
        carrier = int(model.parents[carrier])
    carried = measured.placements[carrier].inverse()
    center = carried.act(measured.placements[joint].translation)
    pivot, roller, rolls_at = np.zeros(3), 0.0, center.copy()
    if swivel:
        pivot = carried.act(measured.placements[measured.joints[swivel]].translation)
    if carrier == measured.root and not swivel:
        x, y = (float(value) for value in center[:2])
        roller, rolls_at[:2] = platform.roller(x, y), platform.rolls_at(x, y)
    return Wheel(
        name,
        center,
        carried.rotation @ measured.axis(joint),
        measured.radius(joint, radius),
        rolls_at,
        carrier=str(model.names[carrier]),
        swivel=swivel,
        pivot=pivot,
        roller=roller,
        velocity=speed_limit(model, joint),
    )
