"""What `Platform.fit` asks of a `Layout`, and how it words what it found."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

from nmm.errors import InputError
from nmm.platforms.layout import NEAR, Layout, Pivot, RollingJoint


def wheels_on(layout: Layout, carrier: str) -> tuple[RollingJoint, ...]:
    """The wheels that hang on one body, named by the joint that carries it."""
    return tuple(wheel for wheel in layout.wheels if wheel.carrier == carrier)


def rolls_forward(wheel: RollingJoint) -> bool:
    """Whether it rolls along its carrier's x axis, in either sense."""
    return abs(math.sin(wheel.heading)) <= NEAR


def same(values: Iterable[float]) -> bool:
    """Whether all are the same number."""
    values = list(values)
    return max(values) - min(values) <= NEAR


def symmetric_limit(pivot: Pivot) -> float | None:
    """The pivot's largest angle (rad) when its limits are finite and the same on both sides."""
    if math.isfinite(pivot.upper) and pivot.upper > 0.0 and abs(pivot.lower + pivot.upper) <= NEAR:
        return pivot.upper
    return None


def say_pivots(pivots: Sequence[Pivot]) -> str:
    """The pivots for an error message."""
    said = (f"{pivot.joint} at ({_m(pivot.x)}, {_m(pivot.y)}) m on {pivot.carrier}" for pivot in pivots)
    return "; ".join(said) or "none"


def say_wheels(wheels: Sequence[RollingJoint]) -> str:
    """The wheels for an error message."""
    return "; ".join(_say_wheel(wheel) for wheel in wheels) or "none"


def _say_wheel(wheel: RollingJoint) -> str:
    turned = "" if rolls_forward(wheel) else f" rolling at {math.degrees(wheel.heading):.4g} degrees"
    return f"{wheel.joint} at ({_m(wheel.x)}, {_m(wheel.y)}) m{turned}, radius {_m(wheel.radius)} m"


def _m(length: float) -> str:
    """Without the last digits, which rotations leave behind."""
    return f"{round(length, 6) + 0.0:.6g}"


def ahead(x: float) -> str:
    """Where a point at x (m) lies, in words."""
    return f"{_m(abs(x))} m {'ahead of' if x > 0.0 else 'behind'} the reference point"


def misfit(layout: Layout, platform: str, expected: str, wrong: str, found: str) -> InputError:
    """The error of a `fit`: what the platform expects, what is wrong with the file, and what it has."""
    robot = f"{layout.robot}: " if layout.robot else ""
    return InputError(f"{robot}platform {platform} expects {expected}; {wrong} (found: {found})")


def steered_too_little(layout: Layout, platform: str) -> tuple[str, ...]:
    """That wheels steer which cannot turn so far as a turn on the spot asks, a sentence each."""
    steering = [pivot for pivot in layout.pivots if pivot.steers and pivot.carrier == "theta"]
    if not any(wheels_on(layout, pivot.joint) for pivot in steering):
        return ()
    return tuple(
        f"platform {platform} turns on the spot, for which the file's wheels would have to steer to 90 "
        f"degrees; {pivot.joint} ends at {math.degrees(pivot.lower):.4g} and "
        f"{math.degrees(pivot.upper):.4g} degrees: platform car?"
        for pivot in steering
        if max(-pivot.lower, pivot.upper) < math.pi / 2
    )


def check_axle(layout: Layout, platform: str) -> None:
    """That the reference point is on an axle, where the root's body carries wheels that roll forward.

    Raises
    ------
    InputError : all of them are ahead of it or behind it
    """
    wheels = [wheel for wheel in wheels_on(layout, "theta") if rolls_forward(wheel)]
    if wheels and all(abs(wheel.x) > NEAR for wheel in wheels):
        expected = "its reference point on the axle of wheels that do not steer"
        nearest = min(wheels, key=lambda wheel: abs(wheel.x))
        wrong = f"the nearest wheel, {nearest.joint}, is {ahead(nearest.x)}: give axle (--axle X,Y)"
        raise misfit(layout, platform, expected, wrong, say_wheels(wheels))
