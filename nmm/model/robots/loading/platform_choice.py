"""Which platform a robot gets, as asked for or as its file or wheels say, and its reference point."""

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from nmm.base.arrays import array
from nmm.base.errors import InputError, RobotError, expect_known
from nmm.base.findings import Finding
from nmm.model.platforms import FixedBase, Layout, Platform, platform_by_name
from nmm.model.platforms.recognition import AT_ROOT, Pose, recognized, reference_of
from nmm.model.robots.loading.chain import CHAIN, yaw_of
from nmm.model.robots.loading.draft import RobotDraft
from nmm.model.robots.loading.measured_joints import Measured
from nmm.model.robots.loading.measured_layout import measure_layout
from nmm.model.robots.loading.passive_wheels import differing_radii, differing_tyres

# How far from upright a frame's z axis may be: files write pi/2 with a few digits.
_LEVEL = 1e-3


def choose_platform(draft: RobotDraft) -> Pose:
    """Choose and measure the draft's platform; returns where its reference point is in the root link.
    `RobotError` for one that does not fit, and wheels that leave open how they drive."""
    options, kind = draft.options, draft.asked_platform
    draft.origin = "base" if draft.gantry else "file" if options.platform is None else "given"
    if draft.is_fixed_base:
        draft.platform = FixedBase()
        return AT_ROOT  # there is nothing to measure
    measured = draft.measured()
    layout = measure_layout(measured, options.wheels, options.steer)
    reference = AT_ROOT
    try:
        if kind is None:
            kind = _recognized_kind(draft, measured, layout)
        if not isinstance(kind, Platform) and options.axle is None:
            reference = reference_of(layout, kind)
            layout = layout.moved(*reference) if reference != AT_ROOT else layout
        platform = kind if isinstance(kind, Platform) else platform_by_name(kind).fit(layout)
        draft.contradictions = *platform.compared(layout), *differing_radii(measured, options.wheels)
    except InputError as error:
        raise error.at(draft.where, RobotError) from None
    if layout.wheels and platform.lengths:
        draft.remarks += differing_tyres(measured, [wheel.joint for wheel in layout.wheels])
    draft.remarks += draft.contradictions
    draft.platform, draft.layout = platform, layout
    return reference


def _recognized_kind(draft: RobotDraft, measured: Measured, layout: Layout) -> str:
    """The kind of platform that the file's wheels or a base of joints tell, or the usual one."""
    by_wheels = recognized(layout)
    draft.remarks += by_wheels.notes
    if by_wheels.is_told:
        draft.origin = "wheels"
    elif draft.base is not None:
        draft.origin = "base"
        return draft.base.kind or by_wheels.kind
    else:
        draft.origin = "default"
        fixed, named = measured.fixed_wheels, measured.named_wheels
        none = Finding("no_wheels", {"names": named} if named else {})
        draft.remarks.append(Finding("wheels_fixed", {"names": fixed}) if fixed else none)
    return by_wheels.kind


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
