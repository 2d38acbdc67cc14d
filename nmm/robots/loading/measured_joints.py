"""Measures a model's wheels and upright joints: where tyres stand, how long a platform is."""

import math
import re
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
import pinocchio as pin

from nmm.arrays import Array, positive
from nmm.errors import InputError, RobotError, expect_known
from nmm.findings import Finding
from nmm.findings.robot_file import refusal
from nmm.platforms import Platform
from nmm.platforms.recognition import with_roles
from nmm.platforms.wheel_layout import (
    HITCHES,
    NEAR,
    PARALLEL,
    STEERING,
    SWIVELS,
    Layout,
    Pivot,
    Rollers,
    RollingJoint,
    is_named,
)
from nmm.robots.loading.chain import replaced_joints
from nmm.robots.loading.drive_marks import DriveMarks, rollers_named
from nmm.robots.loading.joint_kinds import axis, is_revolute, joint_limits
from nmm.robots.loading.tyres import Tyre, tyres
from nmm.robots.wheel import Wheel

# How far from upright a steering column may lean, rad.
_LEAN = 0.2
# A centre so near the root link's xy plane lies in it: the plane is then not the ground.
_ON_PLANE = 1e-6
_SHORT_NAMES = re.compile("caster|castor|(?<![a-z])[lr]w(?![a-z])")
#: Of joints on the base that turn without end alone: a walking robot's legs are called so, too.
_CORNERS = re.compile("(?<![a-z])(?:[fbr][lr]|[lr][fbr])(?![a-z])")
#: Parts of the names of links that are wheels.
_WHEELS = ("wheel", "tire", "tyre")
#: Joints that have to be wheels, or the radius (m) of each; None finds them.
Asked = Sequence[str] | Mapping[str, float] | None
#: Why a joint is no wheel's: `why`, a code, and the names in its words; None for a wheel's.
NoWheel = Mapping[str, str] | None
#: A wheel that ends so much above the ground, as a share of its radius, guides a track, or nothing.
_ALOFT = 0.5
#: The share of a radius by which files round it, and tyres give way.
ROUNDED = 0.01


@dataclass(frozen=True)
class Undercarriage:
    """What a base's wheels hang on.

    held : joints that stand still, at these values, rad or m: springs, rockers, rollers
    unnamed : wheels by their shapes
    rollers : by wheel's joint, what its rollers' axes say
    aloft : joints that are called wheels and hang in the air
    """

    held: Mapping[str, float] = field(default_factory=dict)
    unnamed: tuple[str, ...] = ()
    rollers: Mapping[str, Rollers] = field(default_factory=dict)
    aloft: tuple[str, ...] = ()

    def notes(self) -> Iterator[Finding]:
        if self.held:
            yield Finding("undercarriage_held", {"values": dict(self.held)})
        if self.unnamed:
            yield Finding("wheels_by_shape", {"names": [*self.unnamed]})


@dataclass(frozen=True, eq=False)
class Measured:
    """A model whose joints are measured in the root link's frame, with every joint at zero. `geometries` are
    its collision and visual shapes, in the order in which to ask them for a radius; `undercarriage` is what
    was made out before."""

    model: pin.Model
    geometries: Sequence[pin.GeometryModel]
    where: str
    marks: DriveMarks = field(default_factory=DriveMarks)
    undercarriage: Undercarriage = field(default_factory=Undercarriage)

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
        """Whether it turns about an upright axis, which may point up or down; that of a column which carries
        a wheel only may lean, as a kingpin does."""
        if not is_revolute(self.model.joints[joint]):
            return False
        lean = math.hypot(*self.axis(joint)[:2])
        return lean <= PARALLEL or (lean <= _LEAN and self._is_column(joint))

    def _is_column(self, joint: int) -> bool:
        below = [i for i, parent in enumerate(self.model.parents) if parent == joint]
        return bool(below) and all(self.why_not_rolling(one) is None for one in below)

    def points_down(self, joint: int) -> bool:
        """Whether it turns about an upright axis that points down: its angle counts to the right."""
        return self.is_upright(joint) and self.axis(joint)[2] < 0.0

    def is_named_wheel(self, joint: int) -> bool:
        """Whether its name or its child link's holds "wheel" or, where it can be a wheel's, "caster", or is
        that of a wheel at the left or right, or at a corner: lw, rw_joint, fl, rear_lr."""
        names = " ".join([str(self.model.names[joint]), *self.links.get(joint, ())]).lower()
        rolls = self.why_not_rolling(joint) is None
        if is_named(names, _WHEELS) or (rolls and _SHORT_NAMES.search(names)):
            return True
        endless = not np.isfinite(_ends(self.model, joint)).any()
        on_base = int(self.model.parents[joint]) == self.root
        if not (rolls and endless and _CORNERS.search(names)):
            return False
        return on_base or any(tyre.is_round for tyre in self.tyres(joint))

    def carries_wheel_link(self, joint: int) -> bool:
        """Whether a link that is called a wheel is fixed to the joint's body."""
        links = [
            frame.name
            for frame in self.model.frames
            if frame.parentJoint == joint and frame.type == pin.FrameType.BODY
        ]
        return any(is_named(name, _WHEELS) for name in (str(self.model.names[joint]), *links))

    @cached_property
    def fixed_wheels(self) -> list[str]:
        """Links on the root's body that are called wheels: they do not turn."""
        return [
            frame.name
            for frame in self.model.frames
            if frame.parentJoint == self.root
            and frame.type == pin.FrameType.BODY
            and is_named(frame.name, ("wheel", "caster"))
        ]

    def rollers(self, joint: int) -> Rollers:
        """What the names of a wheel's joint, links and meshes, or its link's friction, say of its rim."""
        name, links = str(self.model.names[joint]), self.links.get(joint, [])
        if name in self.undercarriage.rollers:
            return self.undercarriage.rollers[name]
        marked: Rollers = next((self.marks.rollers[link] for link in links if link in self.marks.rollers), "")
        return marked or rollers_named(" ".join([name, *links]))

    def why_not_rolling(self, joint: int) -> NoWheel:
        """Why the joint cannot be a wheel's, wherever it hangs; None when it can."""
        if not is_revolute(self.model.joints[joint]):
            return {"why": "not_turning"}
        if joint in list(self.model.parents):
            return {"why": "joint_below"}
        if abs(self.axis(joint)[2]) > PARALLEL:
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
            named = [name for name, i in self.joints.items() if self._is_wheel(name, i)]
            candidates = dict.fromkeys(name for name in named if name not in own)
        else:
            expect_names(asked, self.where)
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

    def _is_wheel(self, name: str, joint: int) -> bool:
        made_out = self.undercarriage
        return name in made_out.unnamed or (name not in made_out.aloft and self.is_named_wheel(joint))

    def radius(self, joint: int, given: float | None = None) -> float:
        """The radius, m: as given, or the centre's height over the root link's xy plane where a shape has
        that radius or none has one, or else the first shape's; NaN for none. `RobotError` for one given that
        is no length."""
        name = str(self.model.names[joint])
        if given is not None:
            try:
                return positive(given, f"wheels: radius of {name}")
            except InputError as error:
                raise error.at(self.where, RobotError) from None
        # A root link may stand on the ground (REP-120's base_footprint), or be some part of the body.
        height, first = float(self.placements[joint].translation[2]), None
        for tyre in self.tyres(joint):
            first = first or tyre.radius
            if height <= _ON_PLANE:
                break
            if abs(tyre.radius - height) <= ROUNDED * tyre.radius:
                return height
        return first or (height if height > _ON_PLANE else math.nan)

    def tyres(self, joint: int) -> Iterator[Tyre]:
        yield from tyres(self.geometries, joint, axis(self.model.joints[joint], self.neutral))

    def contact(self, joint: int) -> Array:
        """The middle of a wheel's tyre (3,) in the root link's frame, m: a joint may lie beside it."""
        tyre = next(self.tyres(joint), None)
        aside = self.axis(joint) * (0.0 if tyre is None else tyre.middle)
        return np.asarray(self.placements[joint].translation + aside)


def expect_names(asked: Asked, where: str) -> None:
    """`RobotError` unless `load`'s `wheels` are names, or a radius for each."""
    if asked is not None and (isinstance(asked, str) or not isinstance(asked, Iterable)):
        raise RobotError(where=f"{where}: wheels", expected="a list of joint names", got=asked)


def measure_layout(measured: Measured, asked: Asked, steer: Collection[str] = ()) -> Layout:
    """The wheels and the upright joints that steer, hitch or swivel, for `Platform.fit`.

    Lengths are along the root link's axes with every joint at zero. An upright joint counts if it carries a
    wheel, is in `steer`, or its name says what it is ("steer", "hitch", "trailer", "caster", "swivel"); one
    that ends on both sides counts if it carries a link called a wheel, too. Of one whose axis points down,
    the limits are those of the angle to the left. `RobotError` as in `find_wheels`, for an unknown name in
    `steer`, and for one that is no upright joint."""
    model = measured.model

    def why_not(name: str) -> NoWheel:
        joint = measured.joints[name]
        upright = all(measured.is_upright(above) for above in measured.above(joint))
        return measured.why_not_rolling(joint) or (None if upright else {"why": "not_on_root"})

    for name in steer:
        expect_known("joint that steers", name, measured.joints, measured.where, RobotError)
        if not measured.is_upright(measured.joints[name]):
            expected = "a joint that turns about an upright axis"
            raise RobotError(where=f"{measured.where}: steer", expected=expected, got=name)
    given, _ = measured.wheels(asked, why_not=why_not)
    radii = {joint: given[name] for name, joint in measured.joints.items() if name in given}
    carrying = {joint for wheel in radii for joint in measured.above(wheel)}

    def counts(name: str, joint: int) -> bool:
        if joint in carrying or name in steer or is_named(name, (*STEERING, *HITCHES, *SWIVELS)):
            return True
        return bool(np.isfinite(_ends(model, joint)).all()) and measured.carries_wheel_link(joint)

    pivots = [
        joint for name, joint in measured.joints.items() if measured.is_upright(joint) and counts(name, joint)
    ]
    ground = _ground(measured, radii)
    layout = Layout(
        str(model.name),
        tuple(_pivot(measured, joint) for joint in pivots),
        tuple(_rolling(measured, joint, radii[joint], ground) for joint in radii),
        measured.marks.drive,
    )
    return with_roles(layout, steer)


def _ends(model: pin.Model, joint: int) -> tuple[float, float]:
    lower, upper = (float(end[0]) for end in joint_limits(model, joint)[4:6])
    return lower, upper


def _pivot(measured: Measured, joint: int) -> Pivot:
    model, place = measured.model, _carried(measured, joint, measured.placements[joint].translation)
    lower, upper = _ends(model, joint)
    if measured.points_down(joint):
        lower, upper = -upper, -lower
    return Pivot(str(model.names[joint]), *place, lower, upper, speed_limit(model, joint))


def _ground(measured: Measured, radii: Mapping[int, float | None]) -> float:
    """Where the lowest wheel that is no caster ends, m; infinite where no size is known."""
    bottoms = [
        float(measured.placements[joint].translation[2]) - measured.radius(joint, radius)
        for joint, radius in radii.items()
        if not is_named(str(measured.model.names[joint]), SWIVELS)
    ]
    return min((bottom for bottom in bottoms if not math.isnan(bottom)), default=math.inf)


def _rolling(measured: Measured, joint: int, radius: float | None, ground: float) -> RollingJoint:
    turning = measured.axis(joint)
    # It rolls along axis x z; adding zero makes -0.0 a plain one.
    heading = math.atan2(-turning[0], turning[1]) + 0.0
    place = _carried(measured, joint, measured.contact(joint))
    size = measured.radius(joint, radius)
    bottom = float(measured.placements[joint].translation[2]) - size
    touches = not bottom - ground > _ALOFT * size
    name = str(measured.model.names[joint])
    return RollingJoint(name, *place, heading, size, measured.rollers(joint), touches)


def _carried(measured: Measured, joint: int, place: Array) -> tuple[str, float, float]:
    """The joint that carries this one ("theta" on the root's body), and where `place` is on it, m."""
    carrier = int(measured.model.parents[joint])
    offset = place - measured.placements[carrier].translation
    name = str(measured.model.names[carrier]) if carrier > measured.root else "theta"
    return name, float(offset[0]), float(offset[1])


def speed_limit(model: pin.Model, joint: int) -> float:
    """Rate limit of a joint, rad/s or m/s; infinite where its file gives none, or 0."""
    own = float(joint_limits(model, joint)[3][0])
    return own if own > 0.0 else math.inf


def find_wheels(
    measured: Measured, asked: Asked, own: Sequence[str], platform: Platform, sliding: Collection[str] = ()
) -> tuple[tuple[Wheel, ...], list[Finding]]:
    """The robot's passive wheels, those in `sliding` as such, and notes on joints that are only named wheels.

    A wheel is a revolute joint with a level axis and no joint below it, on the root link's body, one of the
    platform's own joints or a swivel: an upright joint, not the platform's own, that hangs on one of these
    and carries only wheels. Without `asked`, the joint's or child link's name must hold "wheel" (or "tire",
    "caster", lw, rw), or its shape be one. `RobotError` for no joint, or no wheel."""
    radii, notes = measured.wheels(asked, own)
    wheels = tuple(
        replace(_wheel(measured, name, radii[name], own, platform), slides=name in sliding) for name in radii
    )
    swivels = {wheel.swivel for wheel in wheels}  # named as wheels, and left out of q as these are
    return wheels, [note for note in notes if note.values.get("name") not in swivels]


def differing_radii(measured: Measured, asked: Asked) -> Iterator[Finding]:
    """Where a wheel's given radius, m, is not that of any of its shapes (1 mm or 1 % may differ)."""
    for name, given in asked.items() if isinstance(asked, Mapping) else ():
        radii = [] if given is None else [tyre.radius for tyre in measured.tyres(measured.joints[name])]
        if radii and all(abs(given - one) > max(1e-3, ROUNDED * one) for one in radii):
            yield Finding("wheel_radius_differs", {"name": name, "given": float(given), "measured": radii[0]})


def differing_tyres(measured: Measured, names: Iterable[str]) -> Iterator[Finding]:
    """Where a wheel's shapes do not agree on where the middle of its tyre is, m along its axis."""
    for name in names:
        middles = [tyre.middle for tyre in measured.tyres(measured.joints[name])]
        if middles and max(middles) - min(middles) > NEAR:
            yield Finding("tyre_unclear", {"name": name, "middles": middles})


def without_radius(measured: Measured, layout: Layout) -> tuple[str, ...]:
    """Wheels of which nothing tells the radius, and the swivels that carry these alone."""
    names = {wheel.joint for wheel in layout.wheels if math.isnan(wheel.radius)}
    swivels = {swivel for name in names if (swivel := measured.swivel(name, ()))}
    others = {wheel.carrier for wheel in layout.wheels if wheel.joint not in names}
    return (*sorted(swivels - others), *sorted(names))


def held_joints(measured: Measured, asked: Asked) -> tuple[tuple[str, ...], list[Finding]]:
    """A fixed base's wheels (as `find_wheels` takes them, radii aside), after their swivels, and notes."""
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
    center = carried.act(measured.contact(joint))
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
