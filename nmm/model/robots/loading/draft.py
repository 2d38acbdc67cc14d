"""A robot in the making: what was read, what was asked for, and what the passes of `passes.py` made of it."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from nmm.base.findings import Finding
from nmm.model.platforms import FixedBase, Layout, Platform
from nmm.model.robots.loading.chain import CHAIN, rebuild
from nmm.model.robots.loading.locking import check_limits, reduced
from nmm.model.robots.loading.measured_joints import Asked, Measured, Undercarriage
from nmm.model.robots.loading.names_apart import rename_model, renamed_findings, with_names
from nmm.model.robots.loading.source import Source
from nmm.model.robots.loading.virtual_base import VirtualBase
from nmm.model.robots.mimic_joints import MimicJoint, settled
from nmm.model.robots.wheel import Wheel

#: Adds its pairs to the collision shapes on a model.
AddPairs = Callable[[pin.Model, pin.GeometryModel], None]


@dataclass(frozen=True)
class LoadOptions:
    """What `load` was asked for; see there. `add_pairs` chooses collision pairs."""

    platform: Platform | str | None = None
    wheels: Asked = None
    lock: Mapping[str, float] = field(default_factory=dict)
    axle: str | ArrayLike | None = None
    steer: Sequence[str] = ()
    name: str | None = None
    limits: Mapping[str, float] = field(default_factory=dict)
    add_pairs: AddPairs | None = None


@dataclass(eq=False)
class RobotDraft:
    """What each pass reads and changes.

    source : what was read; options : what was asked for, in the draft's names
    model, geometries : joints x, y, theta first, one number each; visual and collision shapes
    mimic_joints : those that move, each after its leader
    names : the new names of joints and links, by those of the file
    locked : joints that were to be locked, and their values, rad or m
    mimicked : what was fixed with the joint that it follows: this, and the value
    base : joints that stand for x, y, theta; gantry : slides that make the base a fixed one
    undercarriage : what the wheels hang on
    platform, origin : the platform, and who chose it (`Provenance.platform`)
    layout : the file's wheels and upright joints seen from the reference point; None for a fixed base
    notes : what was done to joints; remarks : on platform and wheels, told after these; wheel_notes : on
        wheels that are no coordinates, which a mounted arm's are told anew
    contradictions : of the remarks those on a platform that is not what the file's wheels are
    wheels : those that roll, and no coordinates"""

    source: Source
    options: LoadOptions
    model: pin.Model = field(init=False)
    geometries: tuple[pin.GeometryModel, ...] = field(init=False)
    mimic_joints: tuple[MimicJoint, ...] = field(init=False)
    platform: Platform = field(init=False)
    names: dict[str, str] = field(default_factory=dict)
    locked: dict[str, float] = field(default_factory=dict)
    mimicked: dict[str, tuple[str, float]] = field(default_factory=dict)
    base: VirtualBase | None = None
    gantry: tuple[str, ...] = ()
    undercarriage: Undercarriage = field(default_factory=Undercarriage)
    origin: str = "given"
    layout: Layout | None = None
    notes: list[Finding] = field(default_factory=list)
    remarks: list[Finding] = field(default_factory=list)
    wheel_notes: list[Finding] = field(default_factory=list)
    contradictions: tuple[Finding, ...] = ()
    wheels: tuple[Wheel, ...] = ()

    def __post_init__(self) -> None:
        self.model, self.mimic_joints = self.source.model, self.source.mimic_joints
        self.geometries = self.source.visual_model, self.source.collision_model

    @property
    def where(self) -> str:
        return self.source.where

    @property
    def asked_platform(self) -> Platform | str | None:
        """The platform, or its kind, that the caller or else the file wants."""
        return self.source.platform if self.options.platform is None else self.options.platform

    @property
    def is_fixed_base(self) -> bool:
        return isinstance(self.asked_platform, FixedBase) or self.asked_platform == FixedBase.name

    @property
    def stated_joints(self) -> tuple[str, ...]:
        """The own joints of a platform that was given with them."""
        platform = self.options.platform
        return platform.coordinates[len(CHAIN) :] if isinstance(platform, Platform) else ()

    def measured(self) -> Measured:
        """The joints and wheels as the model has them now."""
        shapes = self.geometries[::-1]  # those that collide are asked first
        return Measured(self.model, shapes, self.where, self.source.marks, self.undercarriage)

    def rebuild(self, **how: Any) -> None:
        """Make the model anew; `how` as of `rebuild`."""
        self.model, self.geometries = rebuild(self.model, self.geometries, self.where, **how)

    def hold(self, values: Mapping[str, float]) -> list[Finding]:
        """Fix joints at values, rad or m, and what follows them; a note on the latter, if there are any.
        `RobotError` for a follower beyond its limits."""
        following = [
            mimic for mimic in self.mimic_joints if mimic.joint not in values
        ]  # else it follows none
        # A leader that is no joint of the model is a fixed one, which stands at zero.
        movable = {*list(self.model.names)[1:]} - {*CHAIN}
        absent = {mimic.leader: 0.0 for mimic in following if mimic.leader not in movable}
        mimicked, self.mimic_joints = settled(following, {**absent, **values})
        for name, (leader, value) in mimicked.items():
            check_limits(self.model, name, value, self.where, f", which follows {leader}")
        still = {**values, **{name: value for name, (_, value) in mimicked.items()}}
        if still:
            q, joints = np.zeros(self.model.nq), [self.model.getJointId(name) for name in still]
            q[[self.model.joints[joint].idx_q for joint in joints]] = list(still.values())
            self.model, self.geometries = reduced(self.model, self.geometries, joints, q)
        self.mimicked |= mimicked
        at = {name: [leader, value] for name, (leader, value) in mimicked.items()}
        return [Finding("mimics_locked", {"values": at})] if at else []

    def rename(self, names: Mapping[str, str]) -> None:
        """Give joints and links other names, also in the notes on them; the draft has a model of its own."""
        if not names:
            return
        rename_model(self.model, names)
        self.notes = renamed_findings(self.notes, names)
        self.locked, self.mimicked = with_names(self.locked, names), with_names(self.mimicked, names)
        self.mimic_joints = tuple(mimic.with_names(names) for mimic in self.mimic_joints)

    def rename_options(self, names: Mapping[str, str]) -> None:
        """Speak of joints and links by other names in what was asked for."""
        keys = ("lock", "wheels", "axle", "steer")
        self.options = replace(
            self.options, **{key: with_names(getattr(self.options, key), names) for key in keys}
        )
