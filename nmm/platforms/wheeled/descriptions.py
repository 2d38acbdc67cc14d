"""Descriptions of the wheels and hitches that a platform stands on (`WheeledPlatform`).

Positions are in the frame of the body that carries the wheel: x forward, y left, m. Headings are directions
in which a wheel rolls when it spins in the positive sense, from that body's x axis, rad.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from nmm.arrays import positive, scalar
from nmm.errors import InputError

#: Name of the main body: of the coordinate that turns it.
MAIN = "theta"


def _checked_name(value: object, what: str) -> str:
    if not isinstance(value, str) or not value:
        raise InputError(f"{what}: expected a name, got {value!r}")
    return value


def _check_joint(joint: object, lower: float, upper: float, where: str) -> None:
    """Refuse a joint without a name or without a range."""
    _checked_name(joint, f"{where}: joint")
    if np.isnan(lower) or np.isnan(upper) or not lower < upper:
        raise InputError(f"{where}: expected lower < upper, got {lower} and {upper}")


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
    >>> isinstance(wheel, nmm.WheelDescription), wheel.heading, wheel.body
    (True, 0.0, 'theta')
    """

    name: str
    x: float
    y: float
    radius: float
    heading: float = 0.0
    body: str = MAIN

    def __post_init__(self) -> None:
        _checked_name(self.name, "wheel")
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

    Examples
    --------
    >>> axle = [nmm.FixedWheel("left", 0, 0.3, 0.1), nmm.FixedWheel("right", 0, -0.3, 0.1)]
    >>> caster = nmm.CasterWheel("caster", 0.4, 0, radius=0.05, trail=0.04)
    >>> nmm.WheeledPlatform([*axle, caster]).coordinates
    ('x', 'y', 'theta')
    """

    trail: float = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        if scalar(self.trail, f"wheel {self.name}: trail") == 0.0:
            raise InputError(
                f"wheel {self.name}: expected a trail other than 0: without one nothing swivels a caster"
            )


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
        if abs(math.cos(scalar(self.roller, f"wheel {self.name}: roller"))) < 1e-6:
            raise InputError(
                f"wheel {self.name}: roller angle {math.degrees(self.roller):g} deg: its rollers would turn "
                "about the wheel's own axis and grip nothing when it spins; expected less than 90 deg"
            )
