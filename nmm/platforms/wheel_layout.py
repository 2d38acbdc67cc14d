"""What a robot's file says about its wheels and upright joints, and what each `Platform.fit` asks of it."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

from nmm.errors import InputError
from nmm.findings import Finding

#: Two lengths (m) or angles (rad) of a robot's file that differ by less are meant to be the same.
NEAR = 1e-3
#: Parts of an upright joint's name, in lower case, that say what it is.
STEERING = ("steer",)
HITCHES = ("hitch", "trailer")
SWIVELS = ("caster", "swivel")


@dataclass(frozen=True)
class Pivot:
    """A joint that turns about an upright axis: a steering column, a hitch, a caster's swivel.

    Attributes
    ----------
    joint : its name
    carrier : name of the movable joint that carries it; "theta" for the root link's body
    x, y : its axis in the carrier's frame, at zero, m
    lower, upper : its limits, rad (infinite without)
    velocity : its largest rate, rad/s (infinite without)

    Examples
    --------
    >>> column = nmm.extending.Pivot("front_steer", "theta", x=0.5, y=0.0, lower=-0.6, upper=0.6)
    >>> column.steers, column.hitches
    (True, False)
    """

    joint: str
    carrier: str
    x: float
    y: float
    lower: float
    upper: float
    velocity: float = math.inf

    @property
    def steers(self) -> bool:
        """Whether its name says that it steers."""
        return any(word in self.joint.lower() for word in STEERING)

    @property
    def hitches(self) -> bool:
        """Whether its name says that it carries a trailer."""
        return any(word in self.joint.lower() for word in HITCHES)


@dataclass(frozen=True)
class RollingJoint:
    """A wheel's joint: it turns about a level axis, with nothing that moves below it.

    Attributes
    ----------
    joint : its name
    carrier : name of the movable joint that carries it; "theta" for the root link's body
    x, y : the wheel's centre in the carrier's frame, at zero, m
    heading : direction in which it rolls when it turns in the positive sense, from the carrier's x axis, rad
    radius : m

    Examples
    --------
    >>> wheel = nmm.extending.RollingJoint("left_wheel", "theta", x=0.0, y=0.3, heading=0.0, radius=0.1)
    >>> wheel.joint, wheel.y, wheel.radius
    ('left_wheel', 0.3, 0.1)
    """

    joint: str
    carrier: str
    x: float
    y: float
    heading: float
    radius: float


@dataclass(frozen=True)
class Layout:
    """The pivots and wheels of a robot. x and y count from the platform's reference point (see `load`'s
    `axle`) on the body that "theta" carries, and from the joint's own frame on any other.

    Examples
    --------
    >>> sides = (("left", 0.3), ("right", -0.3))
    >>> rolling = nmm.extending.RollingJoint
    >>> wheels = [rolling(name, "theta", 0.0, y, heading=0.0, radius=0.1) for name, y in sides]
    >>> platform = nmm.DifferentialDrive.fit(nmm.extending.Layout("cart", wheels=tuple(wheels)))
    >>> dict(platform.lengths)
    {'radius': 0.1, 'track': 0.6}
    """

    robot: str
    pivots: tuple[Pivot, ...] = ()
    wheels: tuple[RollingJoint, ...] = ()


@dataclass(frozen=True)
class AddedJoint:
    """An upright joint on the main body that a platform needs and a robot's file lacks, or its limits.

    Attributes
    ----------
    joint : its name
    x, y : its axis, from the platform's reference point, m
    lower, upper : its limits, rad
    velocity : its largest rate, rad/s

    Examples
    --------
    >>> joint = nmm.extending.AddedJoint("steering", x=0.5, y=0.0, lower=-0.6, upper=0.6, velocity=1.0)
    >>> joint.joint, joint.upper
    ('steering', 0.6)
    """

    joint: str
    x: float
    y: float
    lower: float
    upper: float
    velocity: float


def wheels_on(layout: Layout, carrier: str) -> tuple[RollingJoint, ...]:
    return tuple(wheel for wheel in layout.wheels if wheel.carrier == carrier)


def steering_pivots(layout: Layout) -> list[Pivot]:
    return [pivot for pivot in layout.pivots if pivot.steers and pivot.carrier == "theta"]


def rolls_forward(wheel: RollingJoint) -> bool:
    """Whether it rolls along its carrier's x axis, in either direction."""
    return abs(math.sin(wheel.heading)) <= NEAR


def stands_below(wheel: RollingJoint) -> bool:
    """Whether the wheel rolls forward with its axis through its pivot's."""
    return abs(wheel.x) <= NEAR and rolls_forward(wheel)


def same(values: Iterable[float]) -> bool:
    values = list(values)
    return max(values) - min(values) <= NEAR


def symmetric_limit(pivot: Pivot) -> float | None:
    """The pivot's largest angle (rad) when its limits are finite and the same on both sides."""
    even = math.isfinite(pivot.upper) and pivot.upper > 0.0 and abs(pivot.lower + pivot.upper) <= NEAR
    return pivot.upper if even else None


def described(parts: Iterable[Pivot | RollingJoint]) -> list[str]:
    """Name and place of each, and a pivot's carrier or a wheel's heading (unless forward) and radius."""
    found = []
    for part in parts:
        text = f"{part.joint} at ({_m(part.x)}, {_m(part.y)}) m"
        if isinstance(part, Pivot):
            found.append(f"{text} on {part.carrier}")
            continue
        turned = "" if rolls_forward(part) else f" rolling at {math.degrees(part.heading):.4g} degrees"
        found.append(f"{text}{turned}, radius {_m(part.radius)} m")
    return found


def _m(length: float) -> str:
    """Without the last digits, which rotations leave behind."""
    return f"{round(length, 6) + 0.0:.6g}"


def ahead(x: float) -> str:
    """Where a point at x (m) lies, in words."""
    return f"{_m(abs(x))} m {'ahead of' if x > 0.0 else 'behind'} the reference point"


def misfit(
    layout: Layout, platform: str, expected: str, wrong: str, found: Iterable[Pivot | RollingJoint]
) -> InputError:
    """The error of a `fit`: what the platform expects, what is wrong, and what the file has."""
    where = f"{layout.robot}: platform {platform}"
    return InputError(wrong, where=where, expected=expected, got=described(found))


def main_wheels(
    layout: Layout,
    platform: str,
    expected: str,
    why_not: Callable[[Sequence[RollingJoint]], str | None],
    least: int,
    most: float = math.inf,
) -> tuple[RollingJoint, ...]:
    """The root body's `least` to `most` wheels, forward, of one radius; `misfit` if not, or by `why_not`."""
    wheels = wheels_on(layout, "theta")
    turned = [wheel.joint for wheel in wheels if not rolls_forward(wheel)]
    if not least <= len(wheels) <= most:
        wrong: str | None = f"the root's body carries {len(wheels)}"
    elif turned:
        wrong = f"{turned[0]} does not roll forward"
    else:
        wrong = why_not(wheels) or (None if same(w.radius for w in wheels) else "their radii differ")
    if wrong is not None:
        raise misfit(layout, platform, expected, wrong, wheels)
    return wheels


def check_axle(layout: Layout, platform: str) -> None:
    """`InputError` if forward-rolling wheels on the root's body have their axle off the reference point."""
    wheels = [wheel for wheel in wheels_on(layout, "theta") if rolls_forward(wheel)]
    if wheels and all(abs(wheel.x) > NEAR for wheel in wheels):
        expected = "its reference point on the axle of wheels that do not steer"
        nearest = min(wheels, key=lambda wheel: abs(wheel.x))
        wrong = f"the nearest wheel, {nearest.joint}, is {ahead(nearest.x)}: give axle (--axle X,Y)"
        raise misfit(layout, platform, expected, wrong, wheels)


def steered_too_little(layout: Layout, platform: str) -> tuple[Finding, ...]:
    """The steered wheels that cannot turn far enough for a turn on the spot."""
    steering = steering_pivots(layout)
    if not any(wheels_on(layout, pivot.joint) for pivot in steering):
        return ()
    found = []
    for pivot in steering:
        if max(-pivot.lower, pivot.upper) < math.pi / 2:
            limits = {"lower": math.degrees(pivot.lower), "upper": math.degrees(pivot.upper)}
            values = {"platform": platform, "name": pivot.joint, **limits}
            found.append(Finding("steering_too_narrow", values))
    return tuple(found)
