"""A model's joints as a base has them: which may be wheels, columns, what is between; sizes of wheels."""

import math
import re
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import pinocchio as pin

from nmm.base.arrays import Array, positive
from nmm.base.errors import InputError, RobotError, expect_known
from nmm.base.findings import Finding
from nmm.base.findings.robot_file import refusal
from nmm.model.platforms.wheel_layout import PARALLEL, Rollers, is_named
from nmm.model.robots.loading.chain import replaced_joints
from nmm.model.robots.loading.drive_marks import DriveMarks, rollers_named
from nmm.model.robots.loading.joint_kinds import axis, is_revolute, joint_limits
from nmm.model.robots.loading.tyres import Tyre, tyres

# How far from upright a steering column may lean, and a wheel's axis from level (camber), rad.
_LEAN, _CAMBER = 0.2, 0.1
# A centre so near the root link's xy plane lies in it: the plane is then not the ground.
_ON_PLANE = 1e-6
_SHORT_NAMES = re.compile("caster|castor|(?<![a-z])[lr]w(?![a-z])")
#: Of joints that turn without end alone: a walking robot's legs are called so, too.
_CORNERS = re.compile("(?<![a-z])(?:[fbr][lr]|[lr][fbr])(?![a-z])")
#: Parts of the names of links that are wheels.
_WHEELS = ("wheel", "tire", "tyre")
#: Joints that have to be wheels, or the radius (m) of each; None finds them.
Asked = Sequence[str] | Mapping[str, float] | None
#: Why a joint is no wheel's: `why`, a code, and the names in its words; None for a wheel's.
NoWheel = Mapping[str, str] | None
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
        # Joint by joint: data of a model of 190 joints, with its Hessians, take a third of a second to make.
        model, found = self.model, [pin.SE3.Identity()]
        for i, joint in enumerate(model.joints[1:], start=1):
            data = joint.createData()
            joint.calc(data, self.neutral)
            found.append(found[model.parents[i]] * model.jointPlacements[i] * data.M)
        root = found[self.root].inverse()
        return [root * placement for placement in found]

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
        below = self.children(joint)
        return bool(below) and all(self.why_not_rolling(child) is None for child in below)

    def children(self, joint: int) -> list[int]:
        """The joints right below one."""
        return [*map(int, self.model.children[joint])]

    def is_endless(self, joint: int) -> bool:
        """Whether nothing limits it."""
        return not np.isfinite(ends_of(self.model, joint)).any()

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
        on_base = int(self.model.parents[joint]) == self.root
        if not (rolls and self.is_endless(joint) and _CORNERS.search(names)):
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

    @property
    def named_wheels(self) -> list[str]:
        """Joints that are called wheels, whatever they do."""
        return [name for name, joint in self.joints.items() if self.is_named_wheel(joint)]

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
        if self.children(joint):
            return {"why": "joint_below"}
        if abs(self.axis(joint)[2]) > _CAMBER:
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
        for below in self.children(swivel):
            other = str(model.names[below])
            if other not in candidates or self.why_not_rolling(below) is not None:
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
        radii: dict[str, float | None] = {}
        notes: list[Finding] = []
        for name, radius in candidates.items():
            reason = why_not(name) if why_not else self.why_no_wheel(name, candidates, own)
            if reason is None:
                radii[name] = radius
            elif asked is None:
                notes.append(Finding("not_a_wheel", {"name": name, **reason}))
            else:
                raise refusal(self.where, Finding("no_wheel", {"name": name, **reason}))
        return radii, notes

    def _is_wheel(self, name: str, joint: int) -> bool:
        made_out = self.undercarriage
        return name in made_out.unnamed or (name not in made_out.aloft and self.is_named_wheel(joint))

    def radius(self, joint: int, asked: float | None = None) -> float:
        """The radius, m: as given, or the centre's height over the root link's xy plane where a shape has
        that radius or none has one, or else the first shape's; NaN for none. `RobotError` for one given that
        is no length."""
        name = str(self.model.names[joint])
        if asked is not None:
            try:
                return positive(asked, f"wheels: radius of {name}")
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


def ends_of(model: pin.Model, joint: int) -> tuple[float, float]:
    lower, upper = (float(end[0]) for end in joint_limits(model, joint)[4:6])
    return lower, upper


def speed_limit(model: pin.Model, joint: int) -> float:
    """Rate limit of a joint, rad/s or m/s; infinite where its file gives none, or 0."""
    own = float(joint_limits(model, joint)[3][0])
    return own if own > 0.0 else math.inf
