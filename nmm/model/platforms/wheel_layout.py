"""What a robot's file says about its wheels and upright joints, and what each `Platform.fit` asks of it."""

from __future__ import annotations

import cmath
import math
import statistics
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Literal

from nmm.base.errors import InputError
from nmm.base.findings import Finding

#: Lengths of a robot's file that differ by less, m, are meant to be the same: files round, and drawings lie.
NEAR = 5e-3
#: The same of directions, rad: files say 3.14 for pi, and real wheels have some toe and camber.
PARALLEL = 0.02
#: A wheel whose centre is less than this share of its radius before or behind its pivot steers, and does not
#: trail.
TRAIL = 0.1
#: The coordinate that turns the main body, by which its joints name their carrier.
MAIN_BODY = "theta"
#: Parts of an upright joint's name, in lower case, that say what it is.
STEERING = ("steer",)
HITCHES = ("hitch", "trailer")
SWIVELS = ("caster", "castor", "swivel")
#: What an upright joint does on the ground.
Role = Literal["", "steering", "hitch", "swivel"]
#: What a wheel has on its rim: nothing, rollers about its rolling direction, or rollers at 45 degrees.
Rollers = Literal["", "omni", "mecanum"]


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
    role : "steering", "hitch", "swivel"; "" for what its name says

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
    role: Role = ""

    @property
    def steers(self) -> bool:
        """Whether it steers."""
        return self.role == "steering" if self.role else is_named(self.joint, STEERING)

    @property
    def hitches(self) -> bool:
        """Whether it carries a trailer."""
        return self.role == "hitch" if self.role else is_named(self.joint, HITCHES)


@dataclass(frozen=True)
class RollingJoint:
    """A wheel's joint: it turns about a level axis, with nothing that moves below it.

    Attributes
    ----------
    joint : its name
    carrier : name of the movable joint that carries it; "theta" for the root link's body
    x, y : the middle of its tyre in the carrier's frame, at zero, m
    heading : direction in which it rolls when it turns in the positive sense, from the carrier's x axis, rad
    radius : m; NaN where the file does not tell
    rollers : "omni" or "mecanum" where the file shows such rollers, else ""
    touches : whether it touches the ground of the lowest one

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
    rollers: Rollers = ""
    touches: bool = True


@dataclass(frozen=True)
class Layout:
    """The pivots and wheels of a robot. x and y count from the platform's reference point (see `load`'s
    `axle`) on the body that "theta" carries, and from the joint's own frame on any other. `drive` is what a
    simulator's plugin in the file drives the base as: "mecanum", "skid_steer", "" where none says.

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
    drive: str = ""

    def moved(self, x: float, y: float, yaw: float) -> Layout:
        """The same seen from (x, y) m and yaw (rad) on the main body."""

        def place(part: Pivot | RollingJoint) -> tuple[float, float]:
            if part.carrier == MAIN_BODY:
                at = complex(part.x - x, part.y - y) * back
            else:  # frames of other bodies lie along the main body's
                at = complex(part.x, part.y) * back
            return at.real, at.imag

        back = cmath.rect(1.0, -yaw)
        pivots = [replace(pivot, x=at[0], y=at[1]) for pivot in self.pivots for at in (place(pivot),)]
        wheels = [
            replace(wheel, x=at[0], y=at[1], heading=math.remainder(wheel.heading - yaw, 2.0 * math.pi))
            for wheel in self.wheels
            for at in (place(wheel),)
        ]
        return replace(self, pivots=tuple(pivots), wheels=tuple(wheels))


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


def is_named(joint: str, words: Iterable[str]) -> bool:
    """Whether a name holds one of the words."""
    return any(word in joint.lower() for word in words)


def wheels_on(layout: Layout, carrier: str) -> tuple[RollingJoint, ...]:
    return tuple(wheel for wheel in layout.wheels if wheel.carrier == carrier)


def standing_wheels(layout: Layout) -> tuple[RollingJoint, ...]:
    """The main body's wheels on the ground that neither steer nor swivel; those called casters, and those
    with rollers beside plain ones, only where there are no others: they constrain nothing."""
    wheels = tuple(wheel for wheel in wheels_on(layout, MAIN_BODY) if wheel.touches)
    wheels = tuple(wheel for wheel in wheels if not is_named(wheel.joint, SWIVELS)) or wheels
    return tuple(wheel for wheel in wheels if not wheel.rollers) or wheels


def steering_pivots(layout: Layout) -> list[Pivot]:
    return [pivot for pivot in layout.pivots if pivot.steers and pivot.carrier == MAIN_BODY]


def rolls_forward(wheel: RollingJoint) -> bool:
    """Whether it rolls along its carrier's x axis, in either direction."""
    return abs(math.sin(wheel.heading)) <= PARALLEL


def stands_below(wheel: RollingJoint) -> bool:
    """Whether the wheel rolls forward with its axis through its pivot's."""
    return abs(wheel.x) <= NEAR and rolls_forward(wheel)


def trail(wheel: RollingJoint) -> float:
    """How far a wheel's centre is before or behind its pivot, m."""
    return abs((complex(wheel.x, wheel.y) * cmath.rect(1.0, -wheel.heading)).real)


def trails(wheel: RollingJoint) -> bool:
    """Whether that is more than drawings are wrong by, so that the ground turns the pivot."""
    return trail(wheel) > (0.1 * TRAIL if math.isnan(wheel.radius) else wheel.radius * TRAIL)


def same(values: Iterable[float]) -> bool:
    """Whether lengths, m, are meant to be one; those that are unknown (NaN) aside."""
    known = [value for value in values if not math.isnan(value)]
    return not known or max(known) - min(known) <= NEAR


def symmetric_limit(pivot: Pivot) -> float | None:
    """The pivot's largest angle (rad) when its limits are finite and the same on both sides."""
    even = math.isfinite(pivot.upper) and pivot.upper > 0.0 and abs(pivot.lower + pivot.upper) <= PARALLEL
    return min(-pivot.lower, pivot.upper) if even else None


def described(parts: Iterable[Pivot | RollingJoint]) -> list[str]:
    """Name and place of each, and a pivot's carrier or a wheel's heading (unless forward) and radius."""
    lines = []
    for part in parts:
        text = f"{part.joint} at ({_m(part.x)}, {_m(part.y)}) m"
        if isinstance(part, Pivot):
            lines.append(f"{text} on {part.carrier}")
            continue
        turned = "" if rolls_forward(part) else f" rolling at {math.degrees(part.heading):.4g} degrees"
        radius = "unknown" if math.isnan(part.radius) else f"{_m(part.radius)} m"
        lines.append(f"{text}{turned}, radius {radius}")
    return lines


def _m(length: float) -> str:
    """Without the last digits, which rotations leave behind."""
    return f"{round(length, 6) + 0.0:.6g}"


def ahead(x: float) -> str:
    """Where a point at x (m) lies, in words."""
    return f"{_m(abs(x))} m {'ahead of' if x > 0.0 else 'behind'} the reference point"


def misfit(
    layout: Layout, platform: str, expected: str, wrong: str, parts: Iterable[Pivot | RollingJoint]
) -> InputError:
    """The error of a `fit`: what the platform expects, what is wrong, and what the file has."""
    where = f"{layout.robot}: platform {platform}"
    return InputError(wrong, where=where, expected=expected, got=described(parts))


def main_wheels(
    layout: Layout,
    platform: str,
    expected: str,
    why_not: Callable[[Sequence[RollingJoint]], str | None],
    least: int,
    most: float = math.inf,
) -> tuple[RollingJoint, ...]:
    """The root body's `least` to `most` wheels, forward, of one radius; `misfit` if not, or by `why_not`."""
    wheels = standing_wheels(layout)
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


def common_radius(platform: str, wheels: Sequence[RollingJoint]) -> float:
    """The mean of the wheels' radii, m; `InputError` where none is known."""
    known = [wheel.radius for wheel in wheels if not math.isnan(wheel.radius)]
    if not known:
        expected = (
            "the wheels' radius, for its inputs are their speeds: --wheels NAME=METRES,... (wheels={...})"
        )
        raise InputError(
            "no wheel has a shape that tells it", where=f"platform {platform}", expected=expected
        )
    return float(statistics.mean(known))


def check_axle(layout: Layout, platform: str) -> None:
    """`InputError` if forward-rolling wheels on the root's body have their axle off the reference point."""
    wheels = [wheel for wheel in standing_wheels(layout) if rolls_forward(wheel)]
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
    findings = []
    for pivot in steering:
        if max(-pivot.lower, pivot.upper) < math.pi / 2:
            limits = {"lower": math.degrees(pivot.lower), "upper": math.degrees(pivot.upper)}
            values = {"platform": platform, "name": pivot.joint, **limits}
            findings.append(Finding("steering_too_narrow", values))
    return tuple(findings)
