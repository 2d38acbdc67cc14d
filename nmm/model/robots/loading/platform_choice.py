"""Which platform a robot gets, as asked for or as its file or wheels say, and its reference point."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from nmm.base.arrays import array
from nmm.base.errors import InputError, RobotError, expect_known
from nmm.base.findings import Finding
from nmm.model.platforms import FixedBase, Layout, Platform, platform_by_name
from nmm.model.platforms.recognition import AT_ROOT, Pose, recognized, reference_of
from nmm.model.robots.loading.chain import CHAIN
from nmm.model.robots.loading.locking import Locked
from nmm.model.robots.loading.measured_joints import Asked, Measured
from nmm.model.robots.loading.measured_layout import measure_layout
from nmm.model.robots.loading.passive_wheels import differing_radii, differing_tyres
from nmm.model.robots.loading.source import Source
from nmm.model.robots.loading.virtual_base import VirtualBase

# How far from upright a frame's z axis may be: files write pi/2 with a few digits.
_LEVEL = 1e-3
#: Adds its pairs to the collision shapes on a model.
AddPairs = Callable[[pin.Model, pin.GeometryModel], None]


@dataclass(frozen=True)
class Options:
    platform: Platform | str | None = None
    wheels: Asked = None
    lock: Mapping[str, float] = field(default_factory=dict)
    axle: str | ArrayLike | None = None
    steer: Sequence[str] = ()
    name: str | None = None
    limits: Mapping[str, float] = field(default_factory=dict)
    add_pairs: AddPairs | None = None


def measured_of(made: Locked, source: Source) -> Measured:
    """The measures of a model that is in the making."""
    visual, collision = made.rebuilt.geometries
    return Measured(made.rebuilt.model, (collision, visual), source.where, source.marks, source.undercarriage)


@dataclass(frozen=True)
class ChosenPlatform:
    """A platform, who chose its kind, the file's wheels and joints seen from its reference point, where that
    is in the root link, what is to be told, and where the platform is not what the file's wheels are."""

    platform: Platform
    origin: str
    layout: Layout | None = None
    reference: Pose = AT_ROOT
    notes: tuple[Finding, ...] = ()
    contradictions: tuple[Finding, ...] = ()

    @property
    def remarks(self) -> tuple[Finding, ...]:
        return (*self.notes, *self.contradictions)


def choose_platform(
    made: Locked, source: Source, options: Options, base: VirtualBase | None
) -> ChosenPlatform:
    """`RobotError` for a platform that does not fit, and wheels that leave open how they drive."""
    kind: Platform | str | None = source.platform if options.platform is None else options.platform
    origin = "file" if options.platform is None else "given"
    if is_fixed_base(source, options):
        return ChosenPlatform(FixedBase(), origin)  # there is nothing to measure
    measured = measured_of(made, source)
    layout = measure_layout(measured, options.wheels, options.steer)
    notes: tuple[Finding, ...] = ()
    reference = AT_ROOT
    try:
        if kind is None:
            found = recognized(layout)
            kind, notes, origin = found.kind, found.notes, "wheels" if found.is_told else "default"
            if base is not None and origin == "default":
                kind, origin = base.kind or kind, "base"
            if origin == "default":
                fixed, named = measured.fixed_wheels, measured.named_wheels
                none = Finding("no_wheels", {"names": named} if named else {})
                notes = (Finding("wheels_fixed", {"names": fixed}) if fixed else none,)
        platform: Platform
        if isinstance(kind, Platform):
            platform = kind
        else:
            if options.axle is None:
                reference = reference_of(layout, kind)
                layout = layout.moved(*reference) if reference != AT_ROOT else layout
            platform = platform_by_name(kind).fit(layout)
        contradictions = [*platform.compared(layout), *differing_radii(measured, options.wheels)]
    except InputError as error:
        raise error.at(source.where, RobotError) from None
    if layout.wheels and platform.lengths:
        notes = (*notes, *differing_tyres(measured, [wheel.joint for wheel in layout.wheels]))
    return ChosenPlatform(platform, origin, layout, reference, notes, tuple(contradictions))


def is_fixed_base(source: Source, options: Options) -> bool:
    chosen = source.platform if options.platform is None else options.platform
    return isinstance(chosen, FixedBase) or chosen == FixedBase.name


def axle_placement(model: pin.Model, axle: str | ArrayLike, where: str) -> pin.SE3:
    """Pose of the platform's reference point in the root link (`load`'s `axle`): a position and a yaw."""
    if isinstance(axle, str):
        return _level_frame(model, axle, f"{where}: axle")
    try:
        numbers = array(axle, "axle")
    except InputError as error:
        raise error.at(where, RobotError) from None
    if numbers.shape not in ((2,), (3,), (4,)):
        expected = "a frame, or x and y, z (m) and yaw (rad) behind them where they are not 0"
        raise RobotError(where=f"{where}: axle", expected=expected, got=axle)
    x, y, z, yaw = np.append(numbers, np.zeros(4 - len(numbers)))
    return pin.SE3(pin.utils.rotate("z", float(yaw)), np.array([x, y, z]))


def _level_frame(model: pin.Model, name: str, where: str) -> pin.SE3:
    """Position and yaw of a level frame of the root link's body."""
    known = {frame.name: frame for frame in model.frames}
    fixed = {frame.name: frame for frame in model.frames if frame.parentJoint == len(CHAIN)}
    if name in known and name not in fixed:
        joint = model.names[known[name].parentJoint]
        what = f"frame {name!r} is not on the root link's body: joint {joint} moves it"
        raise RobotError(what, where=where, got=name)
    expect_known("frame", name, fixed, where, RobotError)
    placement = fixed[name].placement
    if placement.rotation[2, 2] < 1.0 - 0.5 * _LEVEL**2:
        raise RobotError(f"frame {name!r} is tilted, expected its z axis upwards", where=where, got=name)
    return pin.SE3(pin.utils.rotate("z", yaw_of(placement)), np.array(placement.translation))


def yaw_of(placement: pin.SE3) -> float:
    return float(np.arctan2(placement.rotation[1, 0], placement.rotation[0, 0]))
