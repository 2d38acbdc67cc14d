"""Wheels and hitches that a platform stands on (`WheeledPlatform`), also from a file.

Positions, m, are in the frame of the body that carries the wheel: x forward, y left. A heading is the
direction of rolling with positive spin, from that body's x axis, rad."""

from __future__ import annotations

import cmath
import math
from dataclasses import dataclass

from nmm.base.arrays import positive, scalar
from nmm.base.errors import InputError, expect
from nmm.model.platforms.wheel_layout import HITCHES, Layout, Pivot, RollingJoint, trails

#: Name of the main body: of the coordinate that turns it.
MAIN = "theta"
#: How far a wheel's centre may be from a pivot's axis and count as on it, m.
_ON_AXIS = 1e-6


def _check_name(value: object, where: str) -> None:
    expect(isinstance(value, str) and value, where, "a name", value)


def _check_joint(joint: object, lower: float, upper: float, where: str) -> None:
    _check_name(joint, f"{where}: joint")
    expect(lower < upper, where, "lower < upper", (lower, upper))


@dataclass(frozen=True)
class Hitch:
    """An upright joint with a further body behind it. Its angle is a coordinate, relative to the carrier.

    The further body's frame lies at the hitch (a joint's frame in a URDF), along the carrier's axes at zero.

    Attributes
    ----------
    joint : name of the joint, of its coordinate and of the body behind it
    x, y : the hitch in the carrier's frame, m
    carrier : "theta" for the main body, or the joint of another hitch
    lower, upper : its limits, rad

    Examples
    --------
    >>> axle = [nmm.FixedWheel("left", 0, 0.3, 0.1), nmm.FixedWheel("right", 0, -0.3, 0.1)]
    >>> behind = nmm.FixedWheel("behind", -0.6, 0, radius=0.1, body="hitch")
    >>> nmm.WheeledPlatform([*axle, behind], [nmm.Hitch("hitch", -0.2)]).coordinates
    ('x', 'y', 'theta', 'hitch')
    """

    joint: str
    x: float
    y: float = 0.0
    carrier: str = MAIN
    lower: float = -math.inf
    upper: float = math.inf

    def __post_init__(self) -> None:
        _check_joint(self.joint, self.lower, self.upper, f"hitch {self.joint}")
        for key in ("x", "y"):
            scalar(getattr(self, key), f"hitch {self.joint}: {key}")


@dataclass(frozen=True)
class WheelDescription:
    """What all wheels have: use one of the kinds below.

    Attributes
    ----------
    name : its name
    x, y : its centre, of a wheel on a pivot: its pivot, in the frame of `body`, m
    radius : m
    heading : the direction in which it rolls, at a pivot's zero, rad
    body : "theta" for the main body, or the joint of the hitch in front of the body that carries it

    Examples
    --------
    >>> wheel = nmm.FixedWheel("left", x=0.0, y=0.3, radius=0.1)
    >>> isinstance(wheel, nmm.extending.WheelDescription), wheel.heading, wheel.body
    (True, 0.0, 'theta')
    """

    name: str
    x: float
    y: float
    radius: float
    heading: float = 0.0
    body: str = MAIN

    def __post_init__(self) -> None:
        _check_name(self.name, "wheel")
        for key in ("x", "y", "heading"):
            scalar(getattr(self, key), f"wheel {self.name}: {key}")
        positive(self.radius, f"wheel {self.name}: radius")


@dataclass(frozen=True)
class FixedWheel(WheelDescription):
    """A wheel that rolls along its heading and does not slip.

    Examples
    --------
    >>> wheels = [nmm.FixedWheel("left", 0, 0.3, radius=0.1), nmm.FixedWheel("right", 0, -0.3, radius=0.1)]
    >>> nmm.WheeledPlatform(wheels).inputs
    ('v', 'omega')
    """


@dataclass(frozen=True)
class SteeredWheel(WheelDescription):
    """A wheel on an upright pivot at x, y whose angle is a coordinate.

    Two wheels with one joint (and one pivot) hang on the same pivot. With a trail it is a driven caster: its
    steering rate and the motion determine each other.

    Attributes
    ----------
    joint : name of the pivot's joint and of its coordinate, zero where the wheel points along `heading`
    trail : how far the wheel's centre lies behind the pivot, against the rolling direction, m
    offset : how far it lies to the left of the pivot, m
    lower, upper : limits of the steering angle, rad

    Examples
    --------
    >>> front = nmm.SteeredWheel("front", 0.8, 0, radius=0.1, joint="steer", upper=0.6, lower=-0.6)
    >>> rear = nmm.FixedWheel("rear", 0, 0, radius=0.1)
    >>> nmm.WheeledPlatform([rear, front]).coordinates
    ('x', 'y', 'theta', 'steer')
    """

    joint: str = "steering"
    trail: float = 0.0
    offset: float = 0.0
    lower: float = -math.inf
    upper: float = math.inf

    def __post_init__(self) -> None:
        super().__post_init__()
        _check_joint(self.joint, self.lower, self.upper, f"wheel {self.name}")
        for key in ("trail", "offset"):
            scalar(getattr(self, key), f"wheel {self.name}: {key}")

    @property
    def centered(self) -> bool:
        """Whether it has no trail: steering then moves nothing."""
        return abs(self.trail) < 1e-9


@dataclass(frozen=True)
class CasterWheel(WheelDescription):
    """A wheel that swivels freely on an upright pivot at x, y: it follows and constrains nothing.

    Its swivel's angle is no coordinate. `heading` is the direction in which it rolls at the swivel's zero.

    Attributes
    ----------
    trail : how far the wheel's centre lies behind the pivot, m, not 0
    offset : how far it lies to the left of the pivot, m

    Examples
    --------
    >>> axle = [nmm.FixedWheel("left", 0, 0.3, 0.1), nmm.FixedWheel("right", 0, -0.3, 0.1)]
    >>> caster = nmm.CasterWheel("caster", 0.4, 0, radius=0.05, trail=0.04)
    >>> nmm.WheeledPlatform([*axle, caster]).coordinates
    ('x', 'y', 'theta')
    """

    trail: float = 0.0
    offset: float = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        scalar(self.offset, f"wheel {self.name}: offset")
        where = f"wheel {self.name}: trail"
        expect(scalar(self.trail, where) != 0.0, where, "other than 0, or nothing swivels a caster", 0.0)


@dataclass(frozen=True)
class OmniWheel(WheelDescription):
    """A wheel with rollers on its rim: it grips along one direction and constrains nothing by itself.

    Attributes
    ----------
    roller : angle γ from the heading to the direction along which it grips, rad: 0 for rollers that turn
        about the rolling direction, ±pi/4 for mecanum wheels

    Examples
    --------
    >>> angles = 2 * np.pi * np.arange(3) / 3
    >>> wheels = [
    ...     nmm.OmniWheel(f"w{k}", 0.2 * np.cos(a), 0.2 * np.sin(a), radius=0.05, heading=a + np.pi / 2)
    ...     for k, a in enumerate(angles)
    ... ]
    >>> nmm.WheeledPlatform(wheels).mobility
    3
    """

    roller: float = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        where = f"wheel {self.name}: roller"
        grips = abs(math.cos(scalar(self.roller, where))) >= 1e-6
        expected = "an angle below 90 degrees: at 90 the wheel grips nothing when it spins"
        expect(grips, where, expected, self.roller)


def parts_from(layout: Layout) -> tuple[list[WheelDescription], list[Hitch]]:
    """A file's wheels and hitches. Wheels on the bodies of hitches and on the main one are fixed; on pivots
    that steer, steered, with a trail only where that is not small beside the wheel; behind or before other
    pivots, casters; right on swivels, none: these constrain nothing. A file does not show rollers.
    `InputError` for no wheels, other pivots, and wheels right on a pivot that nothing says more of."""
    expected = "wheels, which describe the platform"
    pivots = {pivot.joint: pivot for pivot in layout.pivots}
    carriers = {wheel.carrier for wheel in layout.wheels} | {pivot.carrier for pivot in layout.pivots}
    hitches = [
        Hitch(pivot.joint, pivot.x, pivot.y, pivot.carrier, pivot.lower, pivot.upper)
        for pivot in layout.pivots
        if pivot.hitches and pivot.joint in carriers
    ]
    bodies = {MAIN, *(hitch.joint for hitch in hitches)}
    made = [_wheel(wheel, pivots, bodies, layout.robot) for wheel in layout.wheels]
    wheels = [wheel for wheel in made if wheel is not None]
    if not wheels:
        what = "all wheels swivel freely" if layout.wheels else "no wheels found"
        raise InputError(what, where=layout.robot, expected=expected)
    return wheels, hitches


def _wheel(
    wheel: RollingJoint, pivots: dict[str, Pivot], bodies: set[str], robot: str
) -> WheelDescription | None:
    if wheel.carrier in bodies:
        return FixedWheel(wheel.joint, wheel.x, wheel.y, wheel.radius, wheel.heading, wheel.carrier)
    where = f"{robot}: wheel {wheel.joint}"
    if wheel.carrier not in pivots:
        raise InputError(f"hangs on {wheel.carrier}, which is no upright joint", where=where)
    pivot = pivots[wheel.carrier]
    if pivot.carrier not in bodies:
        what = f"its pivot {pivot.joint} hangs on {pivot.carrier}"
        expected = f"the main body or a joint with one of {', '.join(HITCHES)} in its name"
        raise InputError(what, where=where, expected=expected)
    place = complex(wheel.x, wheel.y)
    ahead = place * cmath.rect(1.0, -wheel.heading)  # in the wheel's own axes
    at = (wheel.joint, pivot.x, pivot.y, wheel.radius)
    trail = -ahead.real if trails(wheel) else 0.0
    if pivot.steers:
        return SteeredWheel(
            *at, wheel.heading, pivot.carrier, pivot.joint, trail, ahead.imag, pivot.lower, pivot.upper
        )
    if not trail and pivot.role:
        return None
    if abs(ahead.real) < _ON_AXIS:
        what = f"it is on the axis of {pivot.joint}, so it is no caster"
        cure = f"--steer {pivot.joint} (steer=[{pivot.joint!r}]) if it is steered, or lock it"
        raise InputError(f"{what}; {cure}", where=where)
    # A caster that looks backwards at zero has its trail ahead.
    heading = math.remainder(wheel.heading, 2 * math.pi)
    return CasterWheel(*at, heading, pivot.carrier, -ahead.real, ahead.imag)
