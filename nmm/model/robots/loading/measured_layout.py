"""The wheels and pivots of a file, measured for `Platform.fit`."""

import math
from collections.abc import Collection, Mapping

import numpy as np

from nmm.base.arrays import Array
from nmm.base.errors import RobotError, expect_known
from nmm.model.platforms.recognition import with_roles
from nmm.model.platforms.wheel_layout import HITCHES, STEERING, SWIVELS, Layout, Pivot, RollingJoint, is_named
from nmm.model.robots.loading.measured_joints import Asked, Measured, NoWheel, ends_of, speed_limit

#: A wheel that ends so much above the ground, as a share of its radius, guides a track, or nothing.
_ALOFT = 0.5


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
    named, _ = measured.wheels(asked, why_not=why_not)
    radii = {joint: named[name] for name, joint in measured.joints.items() if name in named}
    carrying = {joint for wheel in radii for joint in measured.above(wheel)}

    def counts(name: str, joint: int) -> bool:
        if joint in carrying or name in steer or is_named(name, (*STEERING, *HITCHES, *SWIVELS)):
            return True
        return bool(np.isfinite(ends_of(model, joint)).all()) and measured.carries_wheel_link(joint)

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


def _pivot(measured: Measured, joint: int) -> Pivot:
    model, place = measured.model, _carried(measured, joint, measured.placements[joint].translation)
    lower, upper = ends_of(model, joint)
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
