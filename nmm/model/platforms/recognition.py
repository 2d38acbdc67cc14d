"""Which platform a file's wheels allow: what moves without slip decides, not names."""

from __future__ import annotations

import cmath
import math
from collections.abc import Collection, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from nmm.base.errors import InputError
from nmm.base.findings import Finding
from nmm.base.kinds import PLATFORMS
from nmm.model.platforms.wheel_layout import (
    MAIN_BODY,
    NEAR,
    PARALLEL,
    SWIVELS,
    Layout,
    Pivot,
    Role,
    RollingJoint,
    is_named,
    standing_wheels,
    steering_pivots,
    trail,
    trails,
    wheels_on,
)

#: Where a platform's reference point lies in the root link, and its x axis: x, y (m), yaw (rad).
Pose = tuple[float, float, float]
AT_ROOT: Pose = (0.0, 0.0, 0.0)
#: A reference point so near to its place along the heading and across it, m, stays at the root link's origin.
_AHEAD, _BESIDE = 1e-3, NEAR
#: A pivot that turns farther than this, rad, points its wheel in every direction.
_ANY_WAY = math.pi - PARALLEL
#: One that turns as far turns without end.
_ENDLESS = 2.0 * math.pi - 0.1
#: Platforms whose reference point is the middle of an axle, and of several.
_ON_AXLE = ("unicycle", "differential", "car", "front_drive_car", "tractor")
_AMID_AXLES = ("skid_steer", "mecanum")


@dataclass(frozen=True)
class Recognized:
    """What a file's wheels say: a kind of platform, and why where that needs a word.
    is_told : False where the file has no wheels, so that the kind is a convention"""

    kind: str
    notes: tuple[Finding, ...] = ()
    is_told: bool = True


def with_roles(layout: Layout, steer: Collection[str] = ()) -> Layout:
    """The layout whose pivots have roles: those in `steer` steer, and others by what they carry."""
    return replace(
        layout, pivots=tuple(replace(pivot, role=_role(layout, pivot, steer)) for pivot in layout.pivots)
    )


def _role(layout: Layout, pivot: Pivot, steer: Collection[str]) -> Role:
    if pivot.role or pivot.joint in steer:
        return pivot.role or "steering"
    if pivot.steers:
        return "steering"
    if pivot.hitches:
        return "hitch"
    if pivot.carrier != MAIN_BODY or is_named(pivot.joint, SWIVELS):
        # Where nothing else could drive it, wheels on pivots do, whatever these are called.
        return "swivel" if wheels_on(layout, MAIN_BODY) or pivot.carrier != MAIN_BODY else "steering"
    centred = _is_centred(layout, pivot)
    if not wheels_on(layout, MAIN_BODY):  # casters beside what steers
        others = [
            other for other in layout.pivots if wheels_on(layout, other.joint) and _is_centred(layout, other)
        ]
        return "steering" if centred or len(others) < 2 else "swivel"
    return "steering" if centred and pivot.upper - pivot.lower < _ENDLESS else "swivel"


def _is_centred(layout: Layout, pivot: Pivot) -> bool:
    """Whether it is right above its wheels."""
    return not any(trails(wheel) for wheel in wheels_on(layout, pivot.joint))


def _looks_steered(layout: Layout, pivot: Pivot) -> bool:
    """Whether a swivel is right above its wheels, and not called one."""
    wheels = wheels_on(layout, pivot.joint)
    named = is_named(pivot.joint, SWIVELS) or any(is_named(wheel.joint, SWIVELS) for wheel in wheels)
    return bool(wheels) and not named and all(trail(wheel) <= NEAR for wheel in wheels)


def _size(wheel: RollingJoint) -> float:
    return 0.1 if math.isnan(wheel.radius) else wheel.radius


@dataclass(frozen=True)
class Axles:
    """Parallel wheels, seen along the direction in which they roll.
    heading : that direction, from the root link's x axis, within (-45, 135] degrees; nearer to the y axis
        than to the x axis the other way round if what is called left would be to the right
    places : (k, 2) the wheels' places ahead and to the left in axes turned by it, m"""

    heading: float
    places: np.ndarray

    @classmethod
    def of(cls, wheels: Sequence[RollingJoint]) -> Axles | None:
        """None without wheels, or where they are not parallel."""
        if not wheels:
            return None
        first = wheels[0].heading
        off = np.array([math.remainder(wheel.heading - first, math.pi) for wheel in wheels])
        if np.ptp(off) > 2.0 * PARALLEL:
            return None
        heading = math.remainder(first + float(off.mean()), math.pi)
        heading += math.pi if heading <= -0.25 * math.pi - PARALLEL else 0.0
        for exact in (0.0, 0.5 * math.pi):
            heading = exact if abs(heading - exact) <= 2.0 * PARALLEL else heading
        turned = np.array([complex(wheel.x, wheel.y) for wheel in wheels]) * cmath.rect(1.0, -heading)
        sides = [("left" in name) - ("right" in name) for name in (wheel.joint.lower() for wheel in wheels)]
        if heading > 0.25 * math.pi and float(turned.imag @ sides) < 0.0:
            heading, turned = heading - math.pi, -turned
        return cls(heading, np.column_stack([turned.real, turned.imag]))

    @property
    def are_one(self) -> bool:
        return bool(np.ptp(self.places[:, 0]) <= NEAR)

    @property
    def middle(self) -> Pose:
        """Midway between the outermost wheels; beside a single one, at the root link's own y."""
        ahead, beside = (0.5 * (way.min() + way.max()) for way in self.places.T)
        beside = beside if np.ptp(self.places[:, 1]) > NEAR else 0.0
        ahead = ahead if abs(ahead) > _AHEAD else 0.0
        beside = beside if abs(beside) > _BESIDE else 0.0
        at = complex(ahead, beside) * cmath.rect(1.0, self.heading)
        return round(at.real, 12) + 0.0, round(at.imag, 12) + 0.0, self.heading


def reference_of(layout: Layout, kind: str) -> Pose:
    """Where a platform of that kind has its reference point: on the axle of the wheels that do not steer, or
    in the middle of several axles; the root link where the wheels do not say."""
    if kind not in (*_ON_AXLE, *_AMID_AXLES):
        return AT_ROOT
    axles = Axles.of(standing_wheels(layout))
    if axles is None or (kind in _ON_AXLE and not axles.are_one):
        return AT_ROOT
    return axles.middle


def recognized(layout: Layout) -> Recognized:
    """The kind of platform that the file's wheels allow; `InputError` names how to load it where they allow
    several, or none."""
    standing, steering = standing_wheels(layout), steering_pivots(layout)
    if not standing and not steering:
        if layout.wheels:
            raise _unclear(layout, "on_swivels")
        return Recognized("unicycle", is_told=False)
    if not standing:
        return _all_steered(layout, steering)
    if all(wheel.rollers for wheel in standing):
        return _with_rollers(layout, standing)
    axles = Axles.of(standing)
    if axles is None:
        if len(standing) > 2 and _rolls_everywhere(standing):
            return _named("omnidirectional", "axes_meet", standing)
        raise _unclear(layout, "not_parallel")
    if any(pivot.hitches for pivot in layout.pivots) and _fits(layout, "tractor"):
        return _named("tractor", "hitched", [pivot for pivot in layout.pivots if pivot.hitches])
    if steering:
        for kind in ("car", "wheeled"):
            if _fits(layout, kind):
                return _named(kind, "steered", steering) if kind == "wheeled" else Recognized(kind)
        raise _unclear(layout, "steered_otherwise")
    if axles.are_one:
        casters = [pivot.joint for pivot in layout.pivots if _looks_steered(layout, pivot)]
        return Recognized("unicycle", (Finding("taken_for_casters", {"names": casters}),) if casters else ())
    if layout.drive in ("mecanum", "omnidirectional") and _fits(layout, "mecanum"):
        return _named("mecanum", "driven_so", standing)
    if _fits(layout, "skid_steer"):
        return _named("skid_steer", "several_axles", standing)
    sized = replace(layout, wheels=tuple(replace(wheel, radius=_size(wheel)) for wheel in layout.wheels))
    if _fits(sized, "skid_steer"):
        raise _unclear(layout, "size_unknown")
    raise _unclear(layout, "several_axles")


def _with_rollers(layout: Layout, standing: Sequence[RollingJoint]) -> Recognized:
    if _fits(layout, "mecanum"):
        return _named("mecanum", "rollers", standing)
    if len(standing) > 2 and not _rolls_everywhere(standing):
        raise _unclear(layout, "rollers_in_line")
    return _named("omnidirectional", "rollers", standing)


def _all_steered(layout: Layout, steering: Sequence[Pivot]) -> Recognized:
    if all(pivot.upper - pivot.lower >= _ANY_WAY for pivot in steering):
        wheels = [wheel for pivot in steering for wheel in wheels_on(layout, pivot.joint)]
        if len(steering) > 1 or len(wheels) > 1:
            return _named("omnidirectional", "all_steered", steering)
    elif _fits(layout, "wheeled"):
        return _named("wheeled", "steered", steering)
    raise _unclear(layout, "steered_otherwise")


def _rolls_everywhere(wheels: Sequence[RollingJoint]) -> bool:
    """Whether wheels with rollers about their rolling directions can move a body in every way."""
    length = max((abs(complex(wheel.x, wheel.y)) for wheel in wheels), default=0.0) or 1.0
    rows = []
    for wheel in wheels:
        along = cmath.rect(1.0, wheel.heading)
        lever = (along.conjugate() * 1j * complex(wheel.x, wheel.y)).real / length
        rows.append([along.real, along.imag, lever])
    return bool(np.linalg.matrix_rank(np.array(rows), tol=0.05) == 3)


def _named(kind: str, why: str, parts: Sequence[Pivot | RollingJoint]) -> Recognized:
    names = [part.joint for part in parts]
    return Recognized(
        kind, notes=(Finding("platform_recognized", {"platform": kind, "why": why, "names": names}),)
    )


def _fits(layout: Layout, kind: str) -> bool:
    with suppress(InputError):
        PLATFORMS.named(kind).fit(layout.moved(*reference_of(layout, kind)))
        return True
    return False


def _unclear(layout: Layout, why: str) -> InputError:
    """What the wheels leave open, and each command that loads the file."""
    wheels = [wheel.joint for wheel in layout.wheels] or [pivot.joint for pivot in layout.pivots]
    values = {"why": why, "names": wheels, "commands": [*_commands(layout)]}
    return InputError(Finding("platform_unclear", values), where=layout.robot)


def _commands(layout: Layout) -> Iterator[str]:
    """Options that load the file: platforms that fit, and those that ask nothing of its wheels."""
    kinds = ("skid_steer", "mecanum", "car", "wheeled")
    fitting = [kind for kind in kinds if _fits(layout, kind)]
    yield from (f"--platform {kind}" for kind in fitting)
    yield "--platform omnidirectional"
    yield "--platform unicycle"
